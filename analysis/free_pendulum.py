"""What does a pendulum lose its swing to?

One release of a real pendulum, 55 s at 1 kHz in six parts (public data); its authors' model knows viscous friction
only. Four parts are diagnosed. The last two, smaller swings, are then predicted from their first sample alone: by the
model as it was believed, fitted to the same four parts, and by what the diagnosis made of it.
Run the cells, or `python analysis/free_pendulum.py`; the picture goes to out/free_pendulum.png.
"""

# %% The diagnosis
import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import fes_pin as fp
from fes_pin.data.datasets import fetch
from fes_pin.data.errors import InputError
from fes_pin.data.trial import Trial
from fes_pin.models.predict import predict

OUT = Path("out")
try:
    STUDY = fp.read_study(fetch("free_pendulum"))
except InputError as error:
    print(f"free_pendulum: {error}", file=sys.stderr)
    raise SystemExit(2) from None
found = fp.diagnose(STUDY)
print(found)


# %% The last swings, from their first sample on
def predicted(model, trial):
    first = {f"{n}0": float(trial[n][0]) for n in ("position", "velocity")}
    return predict(model, Trial(trial.name, "motion", {}, trial.time, first))["position"]


HELD = [t for t in STUDY.trials if t.role == "held_out"]
MODELS = {"viscous friction only": found.nominal.model, "with what was found": found.model}
missed = {
    name: [1e3 * float(np.sqrt(np.mean((t["position"] - predicted(model, t)) ** 2))) for t in HELD]
    for name, model in MODELS.items()
}
for name, errors in missed.items():
    print(f"{name:24s} {errors[0]:5.1f} and {errors[1]:5.1f} mrad rms over {HELD[0].duration:.0f} s")

# %% The smallest swings, and by how much each model misses them
trial, colours = HELD[-1], {"viscous friction only": "C0", "with what was found": "C3"}
figure, axes = plt.subplots(1, 3, figsize=(14, 4.2), width_ratios=(2, 2, 1.4))
axes[0].plot(trial.time, trial["position"] - np.pi, color="k", lw=0.7, zorder=3, label="measured, held out")
for k, (name, model) in enumerate(MODELS.items()):
    shown = predicted(model, trial)
    axes[0].plot(trial.time, shown - np.pi, color=colours[name], lw=1.8, label=name)
    axes[1].plot(trial.time, 1e3 * (trial["position"] - shown), color=colours[name], lw=0.8)
    axes[2].bar(np.arange(2) + 0.4 * k - 0.2, missed[name], 0.4, color=colours[name], label=name)
axes[0].set(title=f"{trial.name}, predicted from its first sample", xlabel="time, s", ylabel="angle from hanging, rad")
axes[0].set_ylim(-0.45, 0.8)
axes[0].legend(loc="upper right", fontsize=8)
axes[2].legend(loc="upper left", fontsize=8)
axes[1].set(title="residual: measured - predicted", xlabel="time, s", ylabel="angle, mrad")
axes[2].set(ylabel="rms error of the angle, mrad", title="both trials held out")
axes[2].set_xticks(range(2), [t.name for t in HELD])
figure.tight_layout()
OUT.mkdir(exist_ok=True)
figure.savefig(OUT / "free_pendulum.png", dpi=110)
