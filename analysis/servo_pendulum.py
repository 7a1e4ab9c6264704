"""Does a hobby servo exert the torque that its log computes?

A servo carries a known mass on an arm, under four trajectories at four gains of its position controller (public data).
The torque is computed from the log: duty cycle, supply voltage and speed, by constants that its authors identified.
Gravity's torque on the mass is known, 0.481 N m at a right angle. Each trial alone is asked how much of it the computed
torque has to hold, and what inertia it has to move: were only a scale of the torque wrong, all would say the same.
Run the cells, or `python analysis/servo_pendulum.py`; the picture goes to out/servo_pendulum.png.
"""

# %% The study, and what is known
import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from scipy.signal import savgol_filter

import fes_pin as fp
from fes_pin.data.datasets import fetch
from fes_pin.data.errors import InputError

OUT = Path("out")
try:
    STUDY = fp.read_study(fetch("servo_pendulum"))
except InputError as error:
    print(f"servo_pendulum: {error}", file=sys.stderr)
    raise SystemExit(2) from None
KNOWN = 0.49 * 0.1 * 9.81  # N m: the mass and the length of the logs' own entries
WINDOW = 31  # samples of a cubic through the reading, 155 ms


# %% Each trial alone: effort = inertia a + damping v + gravity sin q + friction sign v
def regression(trial):
    q, v, a = (savgol_filter(trial["position"], WINDOW, 3, k, trial.dt) for k in (0, 1, 2))
    effort = savgol_filter(trial["effort"], WINDOW, 3)
    inner = slice(40, -40)
    columns = np.column_stack([a, v, np.sin(q), np.tanh(v / 0.1)])[inner]
    return np.linalg.lstsq(columns, effort[inner], rcond=None)[0]


told = {t.name: regression(t) for t in STUDY.trials}
for name, (inertia, _, gravity, _) in told.items():
    print(f"{name:24s} inertia {inertia:.4f} kg m2, gravity {gravity:.3f} N m, {gravity / KNOWN:.2f} of what hangs")
seen = np.array([gravity for _, _, gravity, _ in told.values()])
print(f"{KNOWN:.3f} N m hang, {seen.min():.2f} to {seen.max():.2f} N m are seen: it is no one scale of the effort")

# %% What the diagnosis says of all together
found = fp.diagnose(STUDY)
print(found)

# %% By the controller's gain
figure, axes = plt.subplots(1, 2, figsize=(11, 4.2))
gains = (100, 200, 400, 800)
for path in ("sin_sin", "lift_and_drop", "up_and_down", "sin_time_square"):
    of_path = np.array([told[f"{path}_kp{k}"] for k in gains])
    axes[0].semilogx(gains, of_path[:, 2], "o-", label=path)
    axes[1].semilogx(gains, 1e3 * of_path[:, 0], "o-", label=path)
axes[0].axhline(KNOWN, color="0.3", lw=1.0, ls="--")
axes[0].text(100, KNOWN + 0.005, "what hangs there", fontsize=8, color="0.3")
axes[1].axhline(1e3 * KNOWN * 0.1 / 9.81, color="0.3", lw=1.0, ls="--")
axes[1].text(100, 5.1, "of the mass alone", fontsize=8, color="0.3")
axes[0].set(ylabel="gravity's torque at a right angle, N m", title="held by the computed torque")
axes[1].set(ylabel="inertia, g m2", title="moved by the computed torque")
for axis in axes:
    axis.set(xlabel="gain of the position controller")
    axis.set_xticks(gains, [str(k) for k in gains])
    axis.minorticks_off()
axes[0].legend(fontsize=8)
figure.tight_layout()
OUT.mkdir(exist_ok=True)
figure.savefig(OUT / "servo_pendulum.png", dpi=110)
