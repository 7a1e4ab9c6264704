"""How does the body fall through a step, and does one linear model serve the whole of it, as the paper says?

Run the cells, or `python analysis/body_modes_of_the_gait.py`; the picture goes to out/body_modes_of_the_gait.png.
"""

# %% A body and the postures of a measured step, right foot on the ground
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import fes_pin as fp

STEP = ("initial_contact", "loading", "mid_stance", "mid_swing", "terminal_stance", "pre_swing")
body = fp.Body.from_subject(mass_kg=72.6, height_m=1.80, sex="male", stance="right")
corners = np.array([[fp.posture_angles(name, "right")[joint] for joint in body.joint_names] for name in STEP])
along = np.linspace(0.0, len(STEP) - 1.0, 101)
postures = np.stack([np.interp(along, range(len(STEP)), column) for column in corners.T], axis=1)

# %% Modes at every posture
modes = [fp.linearize(body, q).modes() for q in postures]
falls = np.array([len(m.falling) for m in modes])
doubling = [[mode.doubling_time for mode in m.falling if np.isfinite(mode.doubling_time)] for m in modes]
fastest = np.array([min(d) for d in doubling])
whole = np.array([max(x for x in d if x < 0.5) for d in doubling])
print(f"{'posture':16s} falls  fastest doubles in  slowest real fall")
for name, k in zip(STEP, np.searchsorted(along, range(len(STEP))), strict=True):
    slow = [mode for mode in modes[k].falling if mode.doubling_time < 0.5][-1]
    print(f"{name:16s} {falls[k]:5d} {1e3 * fastest[k]:12.0f} ms        {slow.name}")

# %% One linear model for all of single support? Its holding torques against the true ones.
centre = fp.linearize(body, "mid_stance")
error, change = [], []
for q in postures:
    here = fp.linearize(body, q)
    error.append(np.linalg.norm(centre.C + centre.B @ (q - centre.q) - here.C))
    change.append(np.linalg.norm(here.C - centre.C))
error, change = np.array(error), np.array(change)
single = (along >= 2.0) & (along <= 4.0)  # from the passing of the feet to terminal stance
worst = (error[single] / np.linalg.norm(centre.C)).max()
growth = np.array([m.values[: falls.min()] for m in modes])[single]
drift = (np.ptp(np.sqrt(growth), axis=0) / np.sqrt(growth).mean(axis=0)).max()
everywhere = (error / np.linalg.norm(centre.C)).max()
print(f"\nFrom mid-stance to terminal stance the model of mid-stance misses the holding torques by {100 * worst:.0f} %")
print(f"of their size at most; rates of falling change by up to {100 * drift:.0f} %.")
print(f"Over the whole step, double support too, it misses by up to {100 * everywhere:.0f} %.")
print(f"The paper's claim of one linear model {'holds' if worst < 0.1 else 'does not hold'} for single support.")

# %% Does the foot's division matter, as the paper says? Lock the toe joints.
TOES = ("left_mtp_extension", "right_mtp_extension")
for name in ("mid_stance", "pre_swing"):
    whole_foot = fp.linearize(body, name).brace(TOES).modes()
    split = fp.linearize(body, name).modes()
    torque = fp.linearize(body, name).holding_torque[TOES[1]]
    print(f"{name}: {len(split.falling)} falls with toe joints, {len(whole_foot.falling)} without them;", end=" ")
    print(f"the stance toe joint carries {torque:+.0f} N m if that foot carries all")

# %% Picture
figure, (top, bottom) = plt.subplots(2, 1, figsize=(9.5, 7), sharex=True)
for rank in range(falls.max()):
    times = [1e3 * m.falling[rank].doubling_time if rank < len(m.falling) else np.nan for m in modes]
    middle = next((m.falling[rank] for m in modes[50::-1] if rank < len(m.falling)), None)
    joint = next(iter(middle.joints)).replace("_", " ") if middle is not None else ""
    top.plot(along, times, lw=1.3, color=plt.cm.tab20(rank), label=f"{rank + 1}. fall; most at {joint}")
top.set(yscale="log", ylim=(10, 3000), ylabel="time to double, ms", title="Falls of the unmoved body by rank of speed")
top.legend(
    fontsize=7, loc="center left", bbox_to_anchor=(1.0, 0.5), title="joint: first half of the step", title_fontsize=7
)
bottom.plot(along, change, label="change of the holding torque since mid-stance")
bottom.plot(along, error, label="what the linear model of mid-stance misses of it")
bottom.set(ylabel="N m (norm over 19 joints)", ylim=(0, None))
bottom.set_xticks(range(len(STEP)), [name.replace("_", "\n") for name in STEP])
bottom.legend()
figure.tight_layout()
Path("out").mkdir(exist_ok=True)
figure.savefig("out/body_modes_of_the_gait.png", dpi=110)
