"""Which nerves, and which orthoses, does a paralysed body need to be controllable, standing and stepping?

The paper ends on the question whether a nerve acts on one joint or on several, and leaves open what to stimulate.
Here every nerve of the legs may be used; braces are added one by one; for each the fewest nerves are found, exactly.
Strength is a healthy adult's, so that no set is dropped that somebody's muscles could do; another is an argument.
Run the cells, or `python analysis/body_which_nerves.py [0.5]` (some minutes); the picture goes to
out/body_which_nerves.png.
"""

# %% One adult on the right foot: standing on one leg with the weight over the foot, and at mid-stance of a step
import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from fes_pin.body.attainable import attainable, lean_text
from fes_pin.body.build import Body
from fes_pin.body.inputs import Inputs
from fes_pin.body.joints import JOINT_NAMES
from fes_pin.body.linearize import linearize
from fes_pin.body.minimal_sets import ORTHOSES, minimal_sets, pareto
from fes_pin.muscles.nerves import HEALTHY, Nerves

body = Body.from_subject(mass_kg=72.6, height_m=1.80, sex="male", stance="right")
strength = float(sys.argv[1]) if len(sys.argv) > 1 else HEALTHY
leg_nerves = tuple(n for n in Nerves().names if not n.endswith(("erector_spinae", "abdominals")))
legs = Nerves(leg_nerves, strength=strength)
LEAN = np.arctan(0.5 * 0.095 * 1.80 / 0.9)  # brings the hips' width over the stance foot, 0.9 m above its ankle
POSTURES = {"standing on one leg": {"right_ankle_inversion": -LEAN}, "mid-stance": "mid_stance"}
both = lambda name: (*ORTHOSES[f"left_{name}"], *ORTHOSES[f"right_{name}"])  # noqa: E731
STEPS = {
    "heel on the ground": both("foot_plate"),
    "+ trunk held": ORTHOSES["corset"],
    "+ ankle orthosis, swing leg": ORTHOSES["left_ankle_foot_orthosis"],
    "+ ankle orthosis, stance leg": ORTHOSES["right_ankle_foot_orthosis"],
    "+ knee lock, stance leg": ORTHOSES["right_knee_lock"],
    "+ hip guides": both("hip_guide"),
}

# %% The closing question: on how many joints does a nerve act?
neutral = legs.torque_matrix()
print("nerve (right leg)          joints it turns by at least 10 % of its greatest torque")
for name, column in zip(legs.names, neutral.T, strict=True):
    if name.startswith("right_"):
        order = [i for i in np.argsort(-np.abs(column)) if abs(column[i]) >= 0.1 * np.abs(column).max()]
        joints = ", ".join(f"{JOINT_NAMES[i].removeprefix('right_')} {column[i]:+.0f}" for i in order)
        count = len({JOINT_NAMES[i].split("_")[1] for i in order})
        print(f"  {name.removeprefix('right_'):24s} {count} joint(s): {joints} N m")


# %% Braces one after the other; strengths are known to a factor of 1.8
def shortest(linear):
    """The joint that nerves fall shortest of holding by themselves: name, torque needed, torque there is, N m."""
    torque = Inputs.of(legs, linear).on(linear)
    need = -linear.C
    have = np.where(need > 0.0, np.maximum(torque, 0.0).sum(axis=1), np.minimum(torque, 0.0).sum(axis=1))
    worst = int(np.argmax(np.abs(need) - np.abs(have)))
    return linear.joint_names[worst], need[worst], have[worst]


table = {}
for posture, angles in POSTURES.items():
    locked: list[str] = []
    print(f"\n{posture}: the fewest of 22 leg nerves that hold the posture and 1 degree of lean each way")
    for step, joints in STEPS.items():
        locked += joints
        linear = linearize(body, angles).brace(locked)
        everything = attainable(linear, legs)
        found = minimal_sets(linear, legs, lean_deg=1.0)
        table[posture, step] = found[0] if found else None
        line = f"  {step:30s} {len(locked):2d} joints locked, {len(everything.falling)} falls; "
        if not everything.holds:
            joint, need, have = shortest(linear)
            print(line + "cannot be held by all nerves of the legs together")
            if abs(need) > abs(have):
                print(f"  {'':30s} ({joint} needs {need:+.0f} N m, its nerves give {have:+.0f})")
        elif not found:
            print(line + f"held, but not a degree off (least lean {lean_text(everything.least_lean_deg)} deg)")
        else:
            best = found[0]
            low, high = (lean_text(x) for x in best.lean_band_deg)
            lean = f"lean {lean_text(best.lean_deg)} deg [{low}, {high}]"
            print(line + f"{len(best.inputs)} nerves, {lean}, energy {best.energy:.1e} s")
            print(f"  {'':30s} {', '.join(best.inputs)}")

# %% Which brace saves most nerves? Every pair of orthoses, heel on the ground and trunk held, standing on one leg
base = linearize(body, POSTURES["standing on one leg"]).brace([*STEPS["heel on the ground"], *STEPS["+ trunk held"]])
free = [name for name, joints in ORTHOSES.items() if set(joints) <= set(base.joint_names)]
pairs = minimal_sets(base, legs, braces=free, max_braces=2)
print("\nFewest nerves for every number of further braces (of all single ones and pairs):")
for best in pareto(pairs):
    print(f"  {best}")
print("\nBy single brace:")
for best in (s for s in pairs if len(s.braces) == 1):
    print(f"  {best.braces[0]:28s} {len(best.inputs):2d} nerves, energy {best.energy:.1e} s")

# %% The answer, and a picture
first = {p: next((s for s in STEPS if table[p, s]), None) for p in POSTURES}
for posture, step in first.items():
    answer = "never" if step is None else f"from '{step}' on, with {len(table[posture, step].inputs)} of them"
    print(f"\n{posture}: the nerves of the legs suffice {answer}")
figure, axes = plt.subplots(figsize=(8, 4))
for k, posture in enumerate(POSTURES):
    counts = [len(table[posture, s].inputs) if table[posture, s] else np.nan for s in STEPS]
    places = np.arange(len(STEPS)) + 0.2 * (2 * k - 1)
    bars = axes.bar(places, np.nan_to_num(counts), 0.38, label=posture)
    axes.bar_label(bars, ["no set" if np.isnan(c) else f"{c:.0f}" for c in counts], fontsize=8)
axes.set_xticks(range(len(STEPS)), [s.replace(", ", "\n") for s in STEPS], fontsize=8)
axes.set(ylabel="fewest nerves", title="Fewest leg nerves that hold the body on one foot, and 1° of lean in every fall")
axes.legend()
figure.tight_layout()
Path("out").mkdir(exist_ok=True)
figure.savefig("out/body_which_nerves.png", dpi=110)
