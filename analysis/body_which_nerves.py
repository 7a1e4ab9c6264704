"""Which nerves, and which orthoses, does a paralysed body need to be controllable, standing on one foot or on both?

The paper ends on the question whether a nerve acts on one joint or on several, and leaves open what to stimulate.
Here every nerve of the legs may be used; braces are added one by one; for each the fewest nerves are found, exactly:
that hold a degree of lean stimulated constantly, and that catch it, stimulated over time. The centre of pressure must
lie on the soles, so the postures are ones to stand in. The command line asks the same:
`fes-pin body nerves --posture one_leg --brace corset ... --strength 1 --fewest [--constant]`.
Run the cells, or `python analysis/body_which_nerves.py` (minutes); the picture goes to out/body_which_nerves.png.
"""

# %% One adult of healthy strength, standing on one leg with the weight over the foot, and on both
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import fes_pin as fp
from fes_pin.body.joints import JOINT_NAMES
from fes_pin.body.minimal_sets import ORTHOSES, STIMULATIONS
from fes_pin.muscles.nerves import HEALTHY, PARALYSED

body = fp.Body.from_subject(mass_kg=72.6, height_m=1.80, sex="male", stance="right")
LEGS = tuple(n for n in fp.Nerves().names if not n.endswith(("erector_spinae", "abdominals")))
legs = fp.subject_nerves(body, LEGS, strength=HEALTHY)
POSTURES = ("one_leg", "standing")
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
    torque = fp.Inputs.of(legs, linear).on(linear)
    need = -linear.C
    have = np.where(need > 0.0, np.maximum(torque, 0.0).sum(axis=1), np.minimum(torque, 0.0).sum(axis=1))
    worst = int(np.argmax(np.abs(need) - np.abs(have)))
    return linear.joint_names[worst], need[worst], have[worst]


def brace(linear, joints):
    """With the joints locked that still move; None where nothing would be left to move."""
    left = [joint for joint in joints if joint in linear.joint_names]
    return linear.brace(left) if left else linear


table = {}
for posture in POSTURES:
    linear = fp.linearize(body, posture)
    print(f"\n{posture}: the fewest of 22 leg nerves that keep the posture and 1 degree of lean each way")
    for step, joints in STEPS.items():
        linear = brace(linear, joints)
        everything = fp.attainable(linear, legs)
        line = f"  {step:30s} {len(linear.braced):2d} joints locked, {len(everything.falling)} falls"
        if not everything.holds:
            joint, need, have = shortest(linear)
            short = f"; {joint} needs {need:+.0f} N m, its nerves give {have:+.0f}" if abs(need) > abs(have) else ""
            line += f"; all nerves together hold nothing{short}"
        print(line, flush=True)
        for stimulation in STIMULATIONS:
            found = fp.minimal_sets(linear, legs, stimulation=stimulation)
            table[posture, step, stimulation] = len(found[0].inputs) if found else None
            print(f"    {stimulation:10s} {found[0] if found else 'no set'}", flush=True)

# %% What strength, settling and passive legs do to the answer: on one leg, both ankles in orthoses
LOCKED = [joint for step in list(STEPS)[:4] for joint in STEPS[step]]
QUESTIONS = [
    *((f"modes within {deg:g} deg", {"settle_deg": deg}, 1.0, None) for deg in (5.0, 20.0)),
    *((f"strength {s:g}", {}, s, None) for s in (0.7, PARALYSED)),
    ("passive legs", {}, 1.0, fp.PassiveLegs(1.0)),
    (f"passive legs, strength {PARALYSED:g}", {}, PARALYSED, fp.PassiveLegs(1.0)),
]
print("\nOn one leg, both ankles in orthoses: fewest nerves, over time / constantly")
for question, options, strength, passive in [("as above", {}, 1.0, None), *QUESTIONS]:
    linear = fp.linearize(body, "one_leg", passive=passive).brace(LOCKED)
    nerves = fp.subject_nerves(body, LEGS, strength=strength)
    found = [fp.minimal_sets(linear, nerves, stimulation=s, **options) for s in STIMULATIONS]
    print(f"  {question:32s} {' / '.join(str(len(f[0].inputs)) if f else 'none' for f in found)}", flush=True)

# %% Do the fewest catch a fall on the full equations? A degree off in every fall, both ways, for two seconds
linear = fp.linearize(body, "one_leg").brace(LOCKED)
for stimulation in STIMULATIONS:
    for best in fp.minimal_sets(linear, legs, stimulation=stimulation, alternatives=3):
        names = fp.subject_nerves(body, best.inputs, strength=HEALTHY)
        starts = [sign * mode.one_degree for mode in linear.modes().falling for sign in (1.0, -1.0)]
        for moving in (False, True):
            runs = [fp.close_the_loop(linear, names, start, moving_arms=moving) for start in starts]
            held = sum(not run.lost for run in runs)
            arms = "moment arms that follow the joints" if moving else "moment arms of the posture"
            print(f"  {len(best.inputs)} nerves, {stimulation}, {arms}: held {held} of {len(starts)}", flush=True)

# %% The answer, and a picture
for posture in POSTURES:
    for stimulation in STIMULATIONS:
        first = next((s for s in STEPS if table[posture, s, stimulation]), None)
        answer = "never" if first is None else f"from '{first}' on, with {table[posture, first, stimulation]} of them"
        print(f"\n{posture}, {stimulation}: the nerves of the legs suffice {answer}")
figure, rows = plt.subplots(2, 1, figsize=(8, 6), sharex=True)
for axes, posture in zip(rows, POSTURES, strict=True):
    for k, stimulation in enumerate(STIMULATIONS):
        counts = [table[posture, s, stimulation] for s in STEPS]
        places = np.arange(len(STEPS)) + 0.2 * (2 * k - 1)
        bars = axes.bar(places, [c or 0 for c in counts], 0.38, label=f"stimulated {stimulation.replace('_', ' ')}")
        axes.bar_label(bars, ["no set" if c is None else str(c) for c in counts], fontsize=8)
    axes.set(ylabel="fewest nerves", title=posture.replace("_", " "))
    axes.margins(y=0.2)  # room for the numbers over the bars
rows[0].legend()
rows[1].set_xticks(range(len(STEPS)), [s.replace(", ", "\n") for s in STEPS], fontsize=8)
figure.tight_layout()
Path("out").mkdir(exist_ok=True)
figure.savefig("out/body_which_nerves.png", dpi=110)
