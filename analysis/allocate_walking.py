"""Which part of walking can stimulated nerves make, which pulse widths do it, and what is short, and why?

Measured walking (two strides, one adult) gives the joint torques; what ligaments and resting muscle give by themselves
(Riener and Edrich 1999, healthy legs) is taken off; four sets of nerves are asked for the others, with the strength of
paralysed, of weaker and of stronger muscle, and with forces that fall off over length and speed. Levers of
the trunk's muscles are round figures of the size that imaging gives (Jorgensen et al. 2001, McGill et al. 1993),
constant over posture: read "legs and trunk" as a sign and a size, no more (fes_pin/muscles/tables/SOURCE.md).
Run the cells, or `python analysis/allocate_walking.py`; the picture goes to out/allocate_walking.png.
"""

# %% The torques of a measured walk
import sys
from collections import Counter
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from yardsticks.rules_of_thumb import clipped, direction_error, rescaled

import fes_pin as fp
from fes_pin.body.joints import JOINT_NAMES
from fes_pin.body.measured_walk import read_walk
from fes_pin.body.passive import PassiveLegs
from fes_pin.muscles.nerves import HEALTHY, PARALYSED, PARALYSED_BAND

try:
    measured = read_walk()
except fp.InputError as error:
    print(f"allocate_walking: {error}", file=sys.stderr)
    raise SystemExit(2) from None
walk = measured.active(PassiveLegs())
weights = walk.known.astype(float)
LEG = [n.removeprefix("left_") for n in fp.Nerves().names if n.startswith("left_")]
TRUNK = ("erector_spinae", "abdominals")
SETS = {
    "peroneal (drop foot)": ["deep_peroneal"],
    "four a leg": ["femoral", "hamstrings", "tibial", "deep_peroneal"],
    "every leg nerve": [n for n in LEG if n not in TRUNK],
    "legs and trunk": LEG,
}
SAGITTAL = [
    f"{side}_{joint}" for side in ("left", "right") for joint in ("hip_flexion", "knee_flexion", "ankle_dorsiflexion")
]
KNOWN = [name for name, known in zip(JOINT_NAMES, walk.known, strict=True) if known]
sagittal_only = np.isin(JOINT_NAMES, SAGITTAL).astype(float)
STRENGTHS = (PARALYSED_BAND[0], PARALYSED, PARALYSED_BAND[1], HEALTHY)


def both_sides(names):
    return [f"{side}_{name}" for side in ("left", "right") for name in names]


# %% Attained: every joint that counts within 10 % of its peak torque; forces over length and speed
def attained(result, joints):
    index = [JOINT_NAMES.index(j) for j in joints]
    met = np.abs(result.shortfall[:, index]) <= np.maximum(0.1 * np.abs(result.wanted[:, index]).max(0), 1.0)
    return met.all(1).mean(), met.mean()


given = measured.torque - walk.torque
for joint in SAGITTAL[3:]:
    j = JOINT_NAMES.index(joint)
    print(f"{joint:28s} by itself {given[:, j].min():+6.1f} to {given[:, j].max():+6.1f} N m")
print(f"{len(walk.time)} samples, {walk.time[-1] - walk.time[0]:.2f} s; joints within 10 % of their peak torque")
columns = "strength " + " - ".join(f"{x:g}" for x in STRENGTHS) + " of a healthy adult's"
print(f"{'nerves':22s} {'all sagittal':>28s} {'all in 3-D':>28s}   ({columns})")
results = {}
for name, nerves in SETS.items():
    row = []
    for strength in STRENGTHS:
        channels = fp.Nerves(both_sides(nerves), strength=strength)
        sagittal = fp.allocate_walk(walk.torque, channels, walk.q, walk.rates, weights=sagittal_only)
        full = fp.allocate_walk(walk.torque, channels, walk.q, walk.rates, weights=weights)
        assert max(sagittal.residual.max(), full.residual.max()) < 1e-9
        row.append((attained(sagittal, SAGITTAL)[0], attained(full, KNOWN)[0]))
        if strength == PARALYSED:
            results[name] = (sagittal, full)
    cells = [" - ".join(f"{100 * r[k]:3.0f}" for r in row) + " %" for k in range(2)]
    print(f"{name:22s} {cells[0]:>28s} {cells[1]:>28s}")

# %% What the strength assumed and the forces' fall over length and speed do to it
chosen = "four a leg"
FORCES = {
    "as at the best length, at rest": (False, False),
    "over length": (True, False),
    "over speed": (False, True),
    "over length and speed": (True, True),
}
share = {}
print(f"{chosen}, all sagittal; columns: {columns}")
for forces, (over_length, over_speed) in FORCES.items():
    for strength in STRENGTHS:
        channels = fp.Nerves(both_sides(SETS[chosen]), strength=strength, force_length=over_length)
        rates = walk.rates if over_speed else None
        found = fp.allocate_walk(walk.torque, channels, walk.q, rates, weights=sagittal_only)
        share[forces, strength] = attained(found, SAGITTAL)[0]
    print(f"{forces:32s}" + "".join(f"{100 * share[forces, strength]:6.0f} %" for strength in STRENGTHS))

# %% What it changes that joints give torque by themselves; paralysed legs may give less, or with contractures more
alone = {}
for name, nerves in SETS.items():
    cells = []
    for factor in (0.0, 0.5, 1.0, 2.0):
        wanted = measured.active(PassiveLegs(factor)).torque
        found = fp.allocate_walk(wanted, fp.Nerves(both_sides(nerves)), walk.q, walk.rates, weights=sagittal_only)
        cells.append(f"{factor:g}: {100 * attained(found, SAGITTAL)[0]:3.0f} %")
        if factor == 0.0:
            alone[name] = attained(found, SAGITTAL)[0]
    print(f"{name:22s} all sagittal, passive torque of healthy legs times {', '.join(cells)}")

# %% What is short, and why: the worst joint of every sample, counted
for name, (sagittal, _) in results.items():
    words = Counter()
    for k in range(len(walk.time)):
        reasons = sagittal.at(k).reasons
        if reasons:
            joint, _, why = reasons[0].partition(": ")
            words[f"{' '.join(joint.split()[1:-4])}: {why.replace('left ', '').replace('right ', '')}"] += 1
    print(name)
    for reason, count in words.most_common(3):
        print(f"   {100 * count / len(walk.time):3.0f} % of samples: {reason}")

# %% Against the rules of thumb: least squares without limits, then clip or rescale
index = [JOINT_NAMES.index(j) for j in SAGITTAL]
errors = {}
for name, (sagittal, _) in results.items():
    rules = {"this": sagittal.achieved[:, index]}
    for rule, choose in (("clip", clipped), ("rescale", rescaled)):
        rules[rule] = np.array(
            [m[index] @ choose(m[index], t[index]) for m, t in zip(sagittal.matrices, walk.torque, strict=True)]
        )
    wanted = walk.torque[:, index]
    errors[name] = {
        rule: (np.degrees(np.median(direction_error(wanted, got))), np.sqrt(((got - wanted) ** 2).sum(1).mean()))
        for rule, got in rules.items()
    }
    text = "   ".join(f"{rule} {angle:5.1f} deg, {size:5.1f} N m" for rule, (angle, size) in errors[name].items())
    print(f"{name:22s} median torque-direction error and rms torque error: {text}")

# %% The ankle rig: the paper's threshold and saturation, one joint, one nerve
rig = fp.Allocator([[0.034 * 60.0]], recruitment=fp.LinearRecruitment(180.0, 1000.0), effort=1e-9)
for torque in (0.0, 0.5, 1.5, 2.5):
    print(f"ankle rig, {torque} N m wanted:", str(rig([torque])).replace("\n", "; "))

# %% The picture
sagittal, _ = results[chosen]
figure, axes = plt.subplots(2, 3, figsize=(13, 7.2), constrained_layout=True)
titles = ("right hip, flexion +", "right knee, flexion +", "right ankle, dorsiflexion +")
for axis, joint, title in zip(axes[0], SAGITTAL[3:], titles, strict=True):
    j = JOINT_NAMES.index(joint)
    axis.plot(walk.time, walk.torque[:, j], color="k", lw=0.9, zorder=3, label="measured walking, less passive torque")
    axis.plot(
        walk.time,
        sagittal.achieved[:, j],
        color="tab:orange",
        lw=1.5,
        label="stimulated, paralysed: femoral,\nhamstrings, tibial, deep peroneal",
    )
    axis.fill_between(
        walk.time, walk.torque[:, j], sagittal.achieved[:, j], color="tab:red", alpha=0.25, lw=0, label="short"
    )
    axis.set(title=title, xlabel="time (s)", ylabel="torque (N m)")
    axis.margins(x=0)
axes[0, 0].set_ylim(-135, 45)
axes[0, 0].legend(fontsize=8, loc="lower left")
names = sagittal.problem.names
right = [i for i, n in enumerate(names) if n.startswith("right_")]
width = np.where(sagittal.pulse_width_us[:, right].T > 0, sagittal.pulse_width_us[:, right].T, np.nan)
image = axes[1, 0].pcolormesh(walk.time, np.arange(len(right) + 1), width[:, :-1], cmap="viridis", vmin=180, vmax=1000)
axes[1, 0].set(title="pulse widths (white: off)", xlabel="time (s)", yticks=np.arange(len(right)) + 0.5)
axes[1, 0].set_yticklabels([names[i].removeprefix("right_").replace("_", "\n") for i in right], fontsize=8)
figure.colorbar(image, ax=axes[1, 0], label="us")
outline = fp.AttainableTorques(fp.Nerves(both_sides(SETS[chosen])), walk.q[60]).outline(
    "right_knee_flexion", "right_ankle_dorsiflexion"
)
wide = fp.AttainableTorques(fp.Nerves(both_sides(SETS["every leg nerve"])), walk.q[60]).outline(
    "right_knee_flexion", "right_ankle_dorsiflexion"
)
axes[1, 1].fill(*wide.T, color="tab:blue", alpha=0.15, label="every leg nerve")
axes[1, 1].fill(*outline.T, color="tab:orange", alpha=0.35, label="four a leg")
knee, ankle = (walk.torque[:, JOINT_NAMES.index(j)] for j in ("right_knee_flexion", "right_ankle_dorsiflexion"))
axes[1, 1].plot(knee, ankle, color="k", lw=0.9, zorder=3, label="measured walking")
axes[1, 1].set(
    title="attainable torque, knee and ankle", xlabel="knee flexion (N m)", ylabel="ankle dorsiflexion (N m)"
)
axes[1, 1].set_ylim(-130, 60)
axes[1, 1].legend(fontsize=8, loc="lower left")
place = np.arange(len(errors))
for k, (rule, colour) in enumerate({"this": "tab:orange", "clip": "tab:blue", "rescale": "tab:green"}.items()):
    axes[1, 2].bar(place + 0.27 * (k - 1), [e[rule][0] for e in errors.values()], 0.25, color=colour, label=rule)
axes[1, 2].set(title="torque-direction error, sagittal", ylabel="median (degrees)", xticks=place)
axes[1, 2].set_xticklabels(
    [n.replace(" (", "\n(").replace("every leg", "every\nleg").replace("legs and", "legs\nand") for n in errors],
    fontsize=8,
)
axes[1, 2].legend(fontsize=8)
out = Path("out")
out.mkdir(exist_ok=True)
figure.savefig(out / "allocate_walking.png", dpi=110)

# %% The number
weak, usual, strong, healthy = (100 * share["over length and speed", strength] for strength in STRENGTHS)
print(
    f"Four nerves a leg make {usual:.0f} % of the samples of walking (sagittal hip, knee and ankle) with half a "
    f"healthy adult's strength, {weak:.0f} to {strong:.0f} % with what paralysed muscle has, "
    f"{healthy:.0f} % with a healthy adult's; {100 * alone[chosen]:.0f} % if joints give nothing by themselves."
)
nerves = fp.Nerves(both_sides(SETS[chosen]))
wanted = dict(zip(JOINT_NAMES, walk.torque[60], strict=True))
print(fp.allocate(wanted, nerves, walk.q[60], v=walk.rates[60], weights=weights))
