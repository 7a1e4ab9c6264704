"""Do the muscles of the table make the joint torques that people make, at every angle?

Each joint's greatest isometric torque, all muscles that help fully active, is held against what healthy young men have
been measured to make (Anderson, Madigan and Nussbaum 2007) and, at the knee, against a pool of 411 studies (Sarabon,
Kozinc and Perman 2021), at the hip's abductors against sportsmen (Sugimoto et al. 2014): these took no part in fitting
the strengths. The source model's own strengths are shown too, and
what paralysed muscle is taken to have. Run the cells, or `python analysis/joint_torques.py`; the picture goes to
out/joint_torques.png.
"""

# %% The table of muscles, and the same with the source model's strengths
from dataclasses import replace
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from yardsticks.strength import ANDERSON_2007, SARABON_2021, SUGIMOTO_2014, greatest_torque_nm

from fes_pin.body.joints import JOINT_NAMES
from fes_pin.muscles.muscles import KNOWN_DEG, standard_muscles
from fes_pin.muscles.nerves import HEALTHY, PARALYSED, PARALYSED_BAND, SUBJECT_HEIGHT, SUBJECT_MASS, Nerves
from fes_pin.muscles.paths import read_table

table = standard_muscles()
source = replace(table, strength=np.tile([float(row["strength_N"]) for row in read_table("muscles.csv")], 2))

# %% Greatest joint torques, N m
print(f"greatest isometric torque of one leg, N m, man of {SUBJECT_MASS} kg and {SUBJECT_HEIGHT:.2f} m")
print(f"{'action':16s}{'angle':>7s}{'measured':>10s}{'2 sd':>8s}{'here':>7s}{'source':>8s}{'paralysed':>11s}")
misses = {}
for action, curve in ANDERSON_2007.items():
    angles = curve.angles_deg()
    measured = curve.torque_nm(angles, SUBJECT_MASS, SUBJECT_HEIGHT)
    ours, before = (greatest_torque_nm(each, curve, angles) for each in (table, source))
    misses[action] = np.sqrt(np.mean((ours - measured) ** 2)) / measured.max()
    spread = 2 * curve.spread / curve.peak * measured.max()
    for k in range(0, len(angles), 2):
        low, high = (factor * ours[k] for factor in PARALYSED_BAND)
        print(
            f"{action:16s}{angles[k]:7.0f}{measured[k]:10.0f}{spread:8.0f}{ours[k]:7.0f}{before[k]:8.0f}"
            f"{PARALYSED * ours[k]:8.0f} ({low:.0f} to {high:.0f})"
        )
for (action, angle), interval in SARABON_2021.items():
    low, high = (SUBJECT_MASS * value for value in interval)
    ours, before = (greatest_torque_nm(each, ANDERSON_2007[action], [angle])[0] for each in (table, source))
    print(f"{action:16s}{angle:7.0f}  pool of studies {low:.0f} to {high:.0f}; here {ours:.0f}, source {before:.0f}")
per_kg, spread, speed = SUGIMOTO_2014
muscles = Nerves.muscles(*(n for n in Nerves().names if n.startswith("left_")), strength=HEALTHY)
moving = muscles.torque_matrix(None, {"left_hip_adduction": -np.radians(speed)})[
    JOINT_NAMES.index("left_hip_adduction")
]
print(
    f"hip abduction at {speed:.0f} degrees per second: sportsmen {SUBJECT_MASS * per_kg:.0f} (2 sd "
    f"{2 * SUBJECT_MASS * spread:.0f}); here {-np.minimum(moving, 0.0).sum():.0f}"
)
foot = muscles.torque_matrix()[JOINT_NAMES.index("left_ankle_inversion")]
inversion, eversion = np.maximum(foot, 0.0).sum(), -np.minimum(foot, 0.0).sum()
print(f"held against nothing: inversion {inversion:.0f}, eversion {eversion:.0f} of the neutral foot")

# %% The picture
figure, axes = plt.subplots(2, 3, figsize=(13, 7.2), constrained_layout=True)
for axis, (action, curve) in zip(axes.T.flat, ANDERSON_2007.items(), strict=True):
    wide = np.linspace(*KNOWN_DEG[curve.joint], 61)
    angles = curve.angles_deg()
    measured = curve.torque_nm(angles, SUBJECT_MASS, SUBJECT_HEIGHT)
    spread = 2 * curve.spread / curve.peak * measured.max()
    axis.fill_between(
        angles, measured - spread, measured + spread, color="0.88", lw=0, label="measured, 2 sd of people"
    )
    axis.plot(angles, measured, color="k", lw=1.2, zorder=3, label="measured, mean of young men")
    ours = greatest_torque_nm(table, curve, wide)
    axis.plot(wide, ours, color="tab:orange", lw=1.8, label="here, healthy")
    axis.plot(wide, PARALYSED * ours, color="tab:orange", lw=1.2, ls="--", label="here, paralysed")
    axis.fill_between(wide, *(factor * ours for factor in PARALYSED_BAND), color="tab:orange", alpha=0.2, lw=0)
    axis.plot(wide, greatest_torque_nm(source, curve, wide), color="tab:blue", lw=1.0, label="source model's strengths")
    for (pooled, angle), interval in SARABON_2021.items():
        if pooled == action:
            ends = [SUBJECT_MASS * value for value in interval]
            label = "411 studies, mean" if angle == 20.0 else None
            axis.plot([angle, angle], ends, color="tab:green", lw=3, solid_capstyle="butt", label=label)
    axis.set(title=action, xlabel=f"{curve.joint.replace('_', ' ')} (degrees)", ylabel="torque (N m)")
    axis.set_ylim(0, None)
    axis.margins(x=0)
figure.legend(*axes[0, 1].get_legend_handles_labels(), loc="outside lower center", ncols=5, fontsize=9)
out = Path("out")
out.mkdir(exist_ok=True)
figure.savefig(out / "joint_torques.png", dpi=110)

# %% The number
worst = max(misses, key=lambda action: misses[action])
mean = 100 * np.mean(list(misses.values()))
print(
    f"Over six actions the torque differs from the mean of young men by {mean:.0f} % of its peak "
    f"(rms; {worst} most, {100 * misses[worst]:.0f} %)."
)
