"""Do three claims of the paper hold on measured walking?

They are: 19 degrees of freedom suffice, the foot's division matters, and the linear equations hold "although the total
displacements may be large". Two strides of one adult.
Run the cells, or `python analysis/walk_claims.py`; the picture goes to out/walk_claims.png.
"""

# %% Two strides: motion, and plates
import json
import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
import pinocchio as pin
from yardsticks.walking import joint_torques, rooted_motion

from fes_pin.body.build import Body, pelvis_to_hip
from fes_pin.body.linearize import linearize
from fes_pin.body.measured_walk import data_folder
from fes_pin.body.passive import PassiveLegs
from fes_pin.data.errors import InputError
from fes_pin.data.motion import read_coordinates, read_ground_reaction
from fes_pin.walk.motion import Session, about, motion_of
from fes_pin.walk.walk_trial import plates_of

OUT = Path("out")
try:
    WALK = data_folder()
except InputError as error:
    print(f"walk_claims: {error}", file=sys.stderr)
    raise SystemExit(2) from None
SEGMENTS = WALK / "reference/subject01_model.json"
BODIES = {side: Body.from_segments(SEGMENTS, side) for side in ("left", "right")}
HIP = pelvis_to_hip(BODIES["right"], json.loads(SEGMENTS.read_text()))
CHANNELS = ("Fx", "Fy", "Fz", "Mx", "My", "Mz")


def rms(values):
    return np.sqrt(np.mean(np.square(values), axis=0))


def walk(columns_of, side="right"):
    """Motion while the plates were recorded, its coordinates, and the plates; `columns_of` changes coordinates."""
    grf_time, grf = read_ground_reaction(WALK / "grf_raw_600hz.csv")
    time, columns = columns_of()
    motion = motion_of(BODIES[side], time, columns, HIP, Session())
    inside = (time >= grf_time[0]) & (time <= grf_time[-1])
    own = {n: c[inside] for n, c in columns.items()}
    return motion.part(inside), own, plates_of(grf_time, grf, time[inside], Session())


def residual(motion, plates):
    centre = motion.centre
    return about(plates.total, centre) - about(motion.required, centre)


def free():
    return read_coordinates(WALK / "coords_mtpfree.csv")


def locked():
    return read_coordinates(WALK / "coords_locked.csv")


def without_motion(*joints):
    """The free feet's coordinates with some joints of the feet held where they are on average."""
    time, columns = free()
    for name in list(columns):
        if name.split("_", 1)[1].startswith(joints):
            columns[name] = np.full_like(columns[name], columns[name].mean() if name.startswith("q_") else 0.0)
    return time, columns


# %% Required against measured, and the tree that stands on its forefoot
motion, own, plates = walk(free)
left = residual(motion, plates)
singles = plates.loaded["left"] ^ plates.loaded["right"]
print("measured - required, rms: forces N, moments about the centre of mass N m")
print(f"{'':34s}" + "".join(f"{c:>7s}" for c in CHANNELS))


def row(name, values):
    print(f"{name:34s}" + "".join(f"{v:7.1f}" for v in rms(values)))


row("body let go, all samples", left)
row("body let go, single support", left[singles])
row("body let go, double support", left[~singles])
standing = []
for side in ("left", "right"):
    moved, coordinates, pressed = walk(free, side)
    for foot, rows in pressed.single_supports():
        if foot == side:
            rooted = rooted_motion(moved, coordinates, rows)
            centre = moved.centre[rows]
            standing.append(about(pressed.total[rows], centre) - about(rooted.required, centre))
row("19 joints on a resting forefoot", np.concatenate(standing))

# %% The foot in two parts
cases = {
    "rigid feet (IK with both held)": locked,
    "free feet": free,
    "free IK, MTP joint then held": lambda: without_motion("mtp_angle"),
    "free IK, subtalar then held": lambda: without_motion("subtalar_angle"),
    "free IK, both then held": lambda: without_motion("mtp_angle", "subtalar_angle"),
}
print("\nthe division of the foot: single support, per step")
feet = {}
for name, columns_of in cases.items():
    moved, _, pressed = walk(columns_of)
    feet[name] = residual(moved, pressed)
    row(name, feet[name][singles])
print("gain of free over rigid feet, N rms of the vertical force, step by step: ", end="")
steps = [rows for _, rows in plates.single_supports()]
print(
    ", ".join(f"{rms(feet['rigid feet (IK with both held)'][s])[2] - rms(feet['free feet'][s])[2]:+.1f}" for s in steps)
)
share = rms(feet["free IK, both then held"][singles])[2]
whole, none = (rms(feet[n][singles])[2] for n in ("free feet", "rigid feet (IK with both held)"))
print(
    f"of {none - whole:.1f} N, the feet's own motion makes {share - whole:+.1f} N; {none - share:.1f} N are the "
    "other joints', which no longer bend to meet the foot's markers"
)
print("whether those markers were right is not told by this: that needs inverse kinematics without them")

# %% Linear equations along the stance
TERMS = ("change of inertia", "Coriolis", "curvature of gravity")


def along(rooted, postures, moving=False):
    """Torques along a stance by the full equations and by the linear ones of the posture nearest in time, N m.

    The full torque is A(q) a + c(q, v) + g(q), that of A G'' - B G - C = D at rest in q0 is A(q0) a + g(q0)
    + dg/dq (q - q0). They differ by the sum of three terms: (A(q) - A(q0)) a, c(q, v), and the curvature of gravity.

    Parameters
    ----------
    postures
        How many postures, evenly spread over the stance; or where, as shares of it.
    moving
        Linearize about the motion at these samples, with its rates and accelerations, not at rest in its postures.

    Returns
    -------
    full, linear
        (n, 19).
    neglected
        (3, n, 19) by `TERMS`; zeros about the motion itself.
    """
    body, count = rooted.body, len(rooted.time)
    q, v, a = rooted.q[:, 7:], rooted.v[:, 6:], rooted.a[:, 6:]
    model, data = body.model, body.model.createData()
    shares = (np.arange(postures) + 0.5) / postures if isinstance(postures, int) else np.asarray(postures)
    at = np.clip(np.round(shares * count - 0.5), 0, count - 1).astype(int)
    nearest = at[np.argmin(np.abs(np.arange(count)[:, None] - at), axis=1)]
    known = {k: linearize(body, q[k], check=False, **({"rates": v[k], "accelerations": a[k]} if moving else {}))
             for k in at}  # fmt: skip
    full, linear, neglected = np.empty_like(q), np.empty_like(q), np.zeros((3, *q.shape))
    for t, k in enumerate(nearest):
        lin, away = known[k], q[t] - q[k]
        full[t] = pin.rnea(model, data, q[t], v[t], a[t])
        if moving:
            linear[t] = lin.A @ (a[t] - a[k]) + lin.E @ (v[t] - v[k]) - lin.B @ away - lin.C
            continue
        linear[t] = lin.A @ a[t] - lin.B @ away - lin.C
        inertia, gravity = pin.crba(model, data, q[t]), pin.computeGeneralizedGravity(model, data, q[t])
        neglected[:, t] = (inertia - lin.A) @ a[t], full[t] - inertia @ a[t] - gravity, gravity + lin.B @ away + lin.C
    return full, linear, neglected


def missed(full, linear, rows=slice(None)):
    return 100.0 * np.linalg.norm((full - linear)[rows]) / np.linalg.norm(full[rows])


side, rows = next((s, r) for s, r in plates.single_supports() if s == "right")
rooted = rooted_motion(motion, own, rows)
full, one, neglected = along(rooted, 1)
assert np.abs(full - one - neglected.sum(axis=0)).max() < 1e-8  # the three terms are the whole difference
joints = rooted.body.joint_names
print("\nlinear against full equations, right single support; error in percent of the torque, worst joints")
shown = np.argsort(-rms(full - one))[:6]
print(f"{'':24s}" + "".join(f"{joints[i][:20]:>22s}" for i in shown))
variants = {
    "one posture": one,
    "two postures": along(rooted, 2)[1],
    "four postures": along(rooted, 4)[1],
    "one, with E and a0": along(rooted, 1, moving=True)[1],
    "four, with E and a0": along(rooted, 4, moving=True)[1],
}
for name, each in variants.items():
    print(f"{name:24s}" + "".join(f"{100.0 * (rms(full - each) / rms(full))[i]:22.1f}" for i in shown))
print("neglected by one posture, N m rms")
for k, name in enumerate(TERMS):
    print(f"{name:24s}" + "".join(f"{rms(neglected[k])[i]:22.2f}" for i in shown))
total = {n: missed(full, e) for n, e in variants.items()}
print(
    "by the posture that one linearizes at, percent of the torque: whole stance, and the tenth of it about the posture"
)
for share in (0.1, 0.3, 0.5, 0.7, 0.9):
    here, still = along(rooted, [share])[1], along(rooted, [share], moving=True)[1]
    near = np.abs(np.arange(len(rooted.time)) / len(rooted.time) - share) < 0.05
    parts = [missed(full, e, rows) for e in (here, still) for rows in (slice(None), near)]
    print(
        f"  at {100 * share:3.0f} % of the stance: at rest {parts[0]:4.0f}, {parts[1]:4.0f}; "
        f"with E and a0 {parts[2]:4.0f}, {parts[3]:4.0f}"
    )
print("all joints together, percent: " + ", ".join(f"{n} {v:.1f}" for n, v in total.items()))

# %% Passive torques
# Muscles were not recorded: where they pull, nothing tells their torque from the passive one. What can be said is how
# much of the measured torque the published passive legs would be.
torque, _ = joint_torques(motion, plates.feet)
names = list(motion.body.joint_names)
passive = np.array([PassiveLegs().torque(q, names) for q in motion.q[:, 7:]])
print("\npassive torque of healthy legs (Riener and Edrich) in the measured one; swing: the foot carries no load")
print(f"{'joint':30s}{'torque':>9s}{'passive':>9s}{'explained, %':>14s}{'correlation':>13s}")
for joint in ("hip_flexion", "knee_flexion", "ankle_dorsiflexion"):
    for foot in ("left", "right"):
        i = names.index(f"{foot}_{joint}")
        for phase, when in (("stance", plates.loaded[foot]), ("swing", ~plates.loaded[foot])):
            t, p = torque[when, i], passive[when, i]
            gained = 100 * (1 - np.sum((t - p) ** 2) / np.sum(t**2))
            print(f"{foot + ' ' + joint + ', ' + phase:30s}{rms(t):9.1f}{rms(p):9.1f}{gained:14.0f}"
                  f"{np.corrcoef(t, p)[0, 1]:13.2f}")  # fmt: skip
print(
    "no joint is known to be passive here: stiffness and damping of single joints are not identifiable from this walk"
)

# %% The picture
OUT.mkdir(exist_ok=True)
figure, axes = plt.subplots(2, 2, figsize=(11, 6.4), layout="constrained")
centre = motion.centre
needed, read = about(motion.required, centre), about(plates.total, centre)
for panel, channel, word in ((axes[0, 0], 2, "vertical force (N)"), (axes[0, 1], 0, "forward force (N)")):
    panel.plot(motion.time, read[:, channel], color="#17191c", lw=1.0, zorder=3, label="measured")
    panel.plot(motion.time, needed[:, channel], color="#d55e00", lw=2.0, label="required by the motion")
    panel.fill_between(motion.time, 0, 1, where=singles, transform=panel.get_xaxis_transform(), color="#eceef1", lw=0)
    panel.set_ylabel(word)
axes[0, 0].legend(frameon=False, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2)
vertical = {n: rms(f[singles])[[0, 1, 2]] for n, f in feet.items()}
place = np.arange(3)
for k, (name, values) in enumerate(vertical.items()):
    axes[1, 0].bar(place + 0.16 * k, values, 0.15, label=name)
axes[1, 0].set_xticks(place + 0.32, ["forward", "left", "up"])
axes[1, 0].set_ylabel("measured - required, N rms")
axes[1, 0].set_ylim(0.0, 36.0)  # room for the legend
axes[1, 0].legend(frameon=False, fontsize=7.5)
i = int(shown[0])
axes[1, 1].plot(rooted.time, full[:, i], color="#17191c", label="full equations")
for name, colour in (("one posture", "#8b8f96"), ("four postures", "#56b4e9"), ("four, with E and a0", "#d55e00")):
    axes[1, 1].plot(rooted.time, variants[name][:, i], color=colour, label=name)
axes[1, 1].set_ylabel(f"{joints[i].replace('_', ' ')} (N m)")
axes[1, 1].legend(frameon=False, fontsize=8)
for panel in (*axes[0], axes[1, 1]):
    panel.set_xlabel("time (s)")
for panel in axes.ravel():
    panel.spines[["top", "right"]].set_visible(False)
figure.savefig(OUT / "walk_claims.png", dpi=130)
cost = rms(np.concatenate(standing))[2] / rms(left[singles])[2]
print(f"\nA resting forefoot costs {cost:.1f} times the vertical residual;")
print(f"free feet gain {none - whole:.1f} N of {none:.1f} N;")
print(f"one posture leaves {total['one posture']:.0f} % of the torques,")
print(f"four with rates {total['four, with E and a0']:.1f} %")
