"""How much dry friction does a band make at each tension?

A test stand imposes the stroke of a banded rotary damper and measures the force (public data, three tensions and a
fourth of another year). The model believes in a mass and viscous damping; `fes-pin diagnose` on the study names dry
friction that builds up over a way, and an offset. Here its level is fitted at each tension, and compared with half
the height of the loops in the middle of the stroke.
Run the cells, or `python analysis/friction_damper.py`; the picture goes to out/friction_damper.png.
"""

# %% The study, and its tensions
import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import fes_pin as fp
from fes_pin.data.datasets import fetch
from fes_pin.data.errors import InputError
from fes_pin.models.effects import CoulombFriction, EffortOffset

OUT = Path("out")
try:
    STUDY = fp.read_study(fetch("friction_damper"))
except InputError as error:
    print(f"friction_damper: {error}", file=sys.stderr)
    raise SystemExit(2) from None
GROUPS = tuple(dict.fromkeys(t.group for t in STUDY.trials))


def of_group(group):
    return tuple(t for t in STUDY.trials if t.group == group)


# %% The friction of each tension: fitted, and half the height of the loops in the middle of the stroke
def on_the_loops(trial):
    q, v, force = trial["position"], trial["velocity"], trial["effort"]
    middle, half = 0.5 * (q.max() + q.min()), 0.5 * np.ptp(q)
    sliding = (np.abs(q - middle) < 0.3 * half) & (np.abs(v) > 0.5 * np.abs(v).max())
    return 0.5 * (np.median(force[sliding & (v > 0)]) - np.median(force[sliding & (v < 0)]))


def error_percent(model, trial):
    return 100.0 * np.mean(trial.residual(fp.simulate(model, trial), "effort") ** 2) / np.var(trial["effort"])


FRICTION = fp.nominal_model(STUDY) + CoulombFriction(torque_nm=5e3, presliding=5e-3) + EffortOffset(offset=0.0)
fits, fitted, read, before, after = {}, {}, {}, {}, {}
for group in GROUPS:
    train, held = ([t for t in of_group(group) if t.role == role] for role in ("fit", "held_out"))
    fits[group] = fp.fit(FRICTION, train)
    nominal = fp.fit(fp.nominal_model(STUDY), train)
    fitted[group] = fits[group].values["coulomb_friction.torque_nm"]
    read[group] = float(np.mean([on_the_loops(t) for t in train]))
    before[group] = float(np.mean([error_percent(nominal.model, t) for t in held]))
    after[group] = float(np.mean([error_percent(fits[group].model, t) for t in held]))
    low, high = fits[group].interval("coulomb_friction.torque_nm")
    level = f"{fitted[group]:6.0f} [{low:.0f}, {high:.0f}] N fitted"
    errors = f"held out E {before[group]:.0f} -> {after[group]:.1f} %"
    print(f"{group:12s} {level}, {read[group]:6.0f} N on the loops; {errors}")

# %% The ratio of the three levels
first = GROUPS[0]
off = 0.0
for group in GROUPS[1:3]:
    by_fit, by_eye = fitted[group] / fitted[first], read[group] / read[first]
    off = max(off, abs(by_fit / by_eye - 1.0))
    print(f"{group} over {first}: {by_fit:.2f} fitted, {by_eye:.2f} on the loops")
print(f"the levels' ratios differ from those on the loops by {100.0 * off:.1f} % at most")
masses = [20e-3 * f.values["inertia_scale"] for f in fits.values()]
print(f"unexplained: the stand rings, which makes the fitted mass {min(masses):.1f} to {max(masses):.1f} t, too much")

# %% Loops of trials that no fit has seen
figure, axes = plt.subplots(1, len(GROUPS), figsize=(15, 4.2), sharey=True)
for axis, group in zip(axes, GROUPS, strict=True):
    trial = next(t for t in of_group(group) if t.role == "held_out")
    shown = fp.simulate(fits[group].model, trial)
    axis.plot(1e3 * trial["position"], 1e-3 * trial["effort"], color="k", lw=0.6, zorder=3, label="measured, held out")
    axis.plot(1e3 * trial["position"], 1e-3 * shown["effort"], color="C3", lw=2.0, label="with the band's friction")
    axis.set(title=f"{group}: {1e-3 * fitted[group]:.1f} kN", xlabel="stroke, mm")
axes[0].set_ylabel("force, kN")
axes[0].legend(loc="lower right", fontsize=8)
figure.tight_layout()
OUT.mkdir(exist_ok=True)
figure.savefig(OUT / "friction_damper.png", dpi=110)
