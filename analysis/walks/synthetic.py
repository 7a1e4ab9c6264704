"""Walking made without the engine: kinematics and Newton-Euler in numpy, from the measured walk's waves.

Every segment's pose is written out from the joints' axes; forces come from differences of momenta over time. Nothing of
`fes_pin.walk` and nothing of Pinocchio is used.
"""

from dataclasses import dataclass, field, replace

import numpy as np
import tomli_w
from scipy.interpolate import CubicSpline

from fes_pin.body.anthropometry import Subject, skeleton_of_subject
from fes_pin.body.joints import JOINTS, axis_of

G = 9.80665
TO_WORLD = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
ANKLE = {"right": np.array([-0.10501355, -0.97912632, -0.17402245]), "left": np.array([0.10501355, -0.97912632, 0.17402245])}  # fmt: skip  # noqa: E501
SUBTALAR = {"right": np.array([0.78717961, 0.12094949, 0.60474746]), "left": np.array([-0.78717961, 0.12094949, -0.60474746])}  # fmt: skip  # noqa: E501
HIP_OF_HEIGHT = np.array([-0.0724376, -0.0677245, 0.0855522]) / 1.80
WAVES = 8
LANDMARK_M, LANDMARK_RAD = 0.005, np.radians(1.5)
"""What is off for a whole session: landmarks are found to 6-21 mm, and a frame is the mean of several of them
(U. Della Croce et al., Gait Posture 21:226, 2005)."""
PLATE_N, PLATE_M, PLATE_NM = 1.5, 0.004, 1.2
"""Plates' forces are 2.5 to 5 N off, centres of pressure 0.6 to 2.3 mm after and 2 to 14 mm before calibration
(A. Cappello et al., Gait Posture 33:724, 2011)."""
LEVEL_RAD = 0.004
"""Plates are level in the cameras' frame to about a quarter of a degree."""


def turn(axis, angle):
    """Rotation matrices (n, 3, 3) by Rodrigues's formula."""
    x, y, z = axis / np.linalg.norm(axis)
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle)[:, None, None] * K + (1 - np.cos(angle))[:, None, None] * (K @ K)


@dataclass
class Gait:
    """One stride of the measured walk as waves: coordinate -> coefficients, and the right foot's share of the load."""

    names: list
    coefficients: np.ndarray
    period: float
    share: np.ndarray
    grid: np.ndarray


def gait_of(walk):
    """The measured walk's mean stride between the right foot's contacts."""
    c = np.genfromtxt(walk / "coords_mtpfree.csv", delimiter=",", names=True)
    g = np.genfromtxt(walk / "grf_raw_600hz.csv", delimiter=",", names=True)
    right, left = np.clip(g["r_Fy"], 0, None), np.clip(g["l_Fy"], 0, None)
    up = g["time"][1:][(right[1:] > 20) & (right[:-1] <= 20)]
    up = up[np.r_[True, np.diff(up) > 0.3]]
    start, period = up[0], up[1] - up[0]
    names = [n for n in c.dtype.names if n.startswith("q_")]
    inside = (c["time"] >= start) & (c["time"] < start + period)
    phase = (c["time"][inside] - start) / period
    basis = waves(phase)
    coefficients = np.stack([np.linalg.lstsq(basis, c[n][inside], rcond=None)[0] for n in names], axis=1)
    grid = np.linspace(0, 1, 200, endpoint=False)
    share = np.interp(start + period * grid, g["time"], right / np.maximum(right + left, 1.0))
    return Gait(names, coefficients, period, share, grid)


def waves(phase):
    columns = [np.ones_like(phase)]
    for h in range(1, WAVES + 1):
        columns += [np.cos(2 * np.pi * h * phase), np.sin(2 * np.pi * h * phase)]
    return np.stack(columns, axis=1)


@dataclass
class Person:
    """Ten segments in the neutral posture: mass, centre (world), central inertia; joint centres."""

    mass: dict
    com: dict
    inertia: dict
    centres: dict
    height: float

    @classmethod
    def like(cls, skeleton, height):
        s = skeleton.segments
        return cls({n: v.mass for n, v in s.items()}, {n: v.com.copy() for n, v in s.items()},
                   {n: v.inertia.copy() for n, v in s.items()}, dict(skeleton.centres), height)  # fmt: skip


@dataclass
class Wrong:
    """What is hidden, and how much the cameras and plates err anyway."""

    cause: str = "none"
    site: str = ""
    size: float = 0.0
    tissue: float = 0.6
    markers_m: float = 0.0005
    placed: float = 1.0
    strides: int = 5
    extra: dict = field(default_factory=dict)


def poses(person, q):
    """Rotation and centre of mass of every segment: q by coordinate (n,)."""
    L, F, U = np.array([0, 1.0, 0]), np.array([1.0, 0, 0]), np.array([0, 0, 1.0])
    pelvis = turn(-L, q["pelvis_tilt"]) @ turn(F, q["pelvis_list"]) @ turn(U, q["pelvis_rotation"])
    origin = np.stack([q["pelvis_tx"], -q["pelvis_tz"], q["pelvis_ty"]], axis=1)
    place = {"pelvis": (pelvis, None)}
    pelvis_origin = person.centres["right_hip"] - TO_WORLD @ (HIP_OF_HEIGHT * person.height)
    anchor = {"pelvis": (origin, pelvis_origin)}
    for joint in JOINTS:
        R, _ = place[joint.inner]
        here, neutral = anchor[joint.inner]
        centre = here + R @ (person.centres[joint.name] - neutral)
        side = joint.name.split("_")[0]
        if joint.name.endswith("ankle"):
            own = turn(ANKLE[side], q[f"ankle_angle_{side[0]}"]) @ turn(SUBTALAR[side], q[f"subtalar_angle_{side[0]}"])
        else:
            own = np.eye(3)
            for revolute in joint.revolutes:
                own = own @ turn(axis_of(revolute), _angle(q, revolute))
        place[joint.outer] = (R @ own, None)
        anchor[joint.outer] = (centre, person.centres[joint.name])
    out = {}
    for name in person.mass:
        R = place[name][0]
        here, neutral = anchor[name]
        out[name] = R, here + R @ (person.com[name] - neutral)
    return out, anchor, place


def _angle(q, revolute):
    side, _, joint = revolute.partition("_")
    if side == "lumbar":
        return q[revolute]
    sign, name = {"knee_flexion": (-1, "knee_angle"), "mtp_extension": (1, "mtp_angle")}.get(joint, (1, joint))
    return sign * q[f"{name}_{side[0]}"]


def required(person, q, dt, gravity=(0, 0, -G)):
    """Force and moment about the origin from momenta differenced over time: (n, 6)."""
    segments, anchor, place = poses(person, q)
    force, moment = 0.0, 0.0
    for name, (R, c) in segments.items():
        m, J = person.mass[name], person.inertia[name]
        a = _diff(_diff(c, dt), dt)
        dR = _diff(R.reshape(len(R), 9), dt).reshape(-1, 3, 3)
        S = dR @ R.transpose(0, 2, 1)
        omega = np.stack([S[:, 2, 1] - S[:, 1, 2], S[:, 0, 2] - S[:, 2, 0], S[:, 1, 0] - S[:, 0, 1]], axis=1) / 2
        spin = np.einsum("nij,jk,nlk,nl->ni", R, J, R, omega)
        push = m * (a - np.array(gravity))
        force = force + push
        moment = moment + np.cross(c, push) + _diff(spin, dt)
    return np.hstack([force, moment]), anchor, place


def _diff(values, dt):
    """Fourth-order central differences."""
    out = np.gradient(values, dt, axis=0)
    out[2:-2] = (values[:-4] - 8 * values[1:-3] + 8 * values[3:-1] - values[4:]) / (12 * dt)
    return out


def smooth_noise(random, time, period, n=1):
    """A slow random course with unit size that no two strides share: (n, time)."""
    knots = np.arange(time[0] - 2 * period, time[-1] + 3 * period, 0.5 * period)
    values = random.normal(size=(n, len(knots)))
    return np.array([CubicSpline(knots, v)(time) for v in values])


def make(gait, folder, wrong, seed, subject=None):
    """Write a study that hides a cause; gives the noise-free change of the reaction that the cause makes."""
    random = np.random.default_rng(seed)
    if subject is None:
        height = random.uniform(1.55, 1.92)
        subject = Subject(round(random.uniform(18.5, 28.0) * height**2, 1), round(height, 2))
    skeleton = skeleton_of_subject(subject)
    person = Person.like(skeleton, subject.height_m)
    scale = subject.height_m / 1.80
    period = gait.period * np.sqrt(scale) * random.uniform(0.95, 1.1)
    dt = 0.005
    time = np.arange(-0.4, wrong.strides * period + 0.6, dt)
    phase = time / period + 0.004 * np.cumsum(smooth_noise(random, time, period)[0]) * dt / period * 5
    base = waves(phase) @ gait.coefficients
    mean = gait.coefficients[0]
    wiggle = 1 + 0.03 * smooth_noise(random, time, period, base.shape[1]).T
    scatter = random.normal(size=base.shape[1]) * 0.08 + 1.0
    base = mean + (base - mean) * wiggle * scatter
    truth = {n[2:]: base[:, k] for k, n in enumerate(gait.names)}
    for n in ("pelvis_tx", "pelvis_ty", "pelvis_tz"):
        truth[n] = truth[n] * scale
    real, gravity = hidden_body(person, wrong)
    wrench, anchor, place = required(real, truth, dt, gravity)
    wrench = wrench - external(wrong, place, anchor, len(time))
    feet = split(gait, wrench, phase, anchor, place)
    recorded = dict(truth)
    tissue_errors(random, recorded, time, phase, period, wrong)
    read = misread(feet, wrong, time, random)
    misplaced(np.random.default_rng([seed, 1]), recorded, read, feet, wrong)
    write(folder, subject, recorded, read, time, wrong, period)
    return subject


def hidden_body(person, wrong):
    """The real person of a believed one."""
    real, gravity = (
        replace(person, mass=dict(person.mass), com=dict(person.com), inertia=dict(person.inertia)),
        (0, 0, -G),
    )
    where = wrong.site.split(",")
    if wrong.cause == "segment_mass":
        for s in where:
            factor = 1 + wrong.size
            real.mass[s], real.inertia[s] = factor * person.mass[s], factor * person.inertia[s]
    if wrong.cause == "segment_com":
        axis = np.array(wrong.extra["axis"])
        for s in where:
            real.com[s] = person.com[s] + wrong.size * axis
    if wrong.cause == "segment_inertia":
        for s in where:
            real.inertia[s] = (1 + wrong.size) * person.inertia[s]
    if wrong.cause == "base_tilt":
        gravity = tuple(G * np.array([*(wrong.size * np.array(wrong.extra["axis"][:2])), -np.sqrt(1 - wrong.size**2)]))
    return real, gravity


def external(wrong, place, anchor, n):
    if wrong.cause != "external_force":
        return 0.0
    R = place[wrong.site][0]
    point = anchor[wrong.site][0] + R @ np.array(wrong.extra["at"])
    force = np.broadcast_to(wrong.size * np.array(wrong.extra["axis"]), (n, 3))
    return np.hstack([force, np.cross(point, force)])


def split(gait, wrench, phase, anchor, place):
    """Each foot's reaction: force and centre of pressure, free moment about the vertical."""
    share = np.interp(phase % 1.0, np.r_[gait.grid, 1.0], np.r_[gait.share, gait.share[0]])
    share = np.where(share < 0.02, 0.0, np.where(share > 0.98, 1.0, share))
    parts = {"right": share, "left": 1 - share}
    points = {s: anchor[f"{s}_forefoot"][0] * [1, 1, 0] for s in parts}
    couple = wrench[:, 3:] - sum(parts[s][:, None] * np.cross(points[s], wrench[:, :3]) for s in parts)
    out = {}
    for s, part in parts.items():
        force = part[:, None] * wrench[:, :3]
        moment = np.cross(points[s], force) + part[:, None] * couple
        up = np.where(part > 0, force[:, 2], 1.0)
        cop = np.stack([-moment[:, 1] / up, moment[:, 0] / up, 0 * up], axis=1)
        free = moment[:, 2] - (cop[:, 0] * force[:, 1] - cop[:, 1] * force[:, 0])
        out[s] = [force, cop * (part > 0)[:, None], np.stack([0 * free, 0 * free, free * (part > 0)], axis=1), part > 0]
    return out


def tissue_errors(random, recorded, time, phase, period, wrong):
    """Soft tissue: errors that come again in each stride, and some that do not; then the cameras' white noise."""
    for name in recorded:
        size = 0.002 if name.startswith("pelvis_t") and len(name) == 9 else np.radians(0.5)
        if name.startswith(("subtalar", "mtp")):
            size *= 2
        amplitudes = random.normal(size=(3, 2)) / np.array([1, 2, 3])[:, None]
        again = sum(a * np.cos(2 * np.pi * h * phase) + b * np.sin(2 * np.pi * h * phase)
                    for h, (a, b) in enumerate(amplitudes, 1))  # fmt: skip
        other = smooth_noise(random, time, period)[0]
        recorded[name] = recorded[name] + wrong.tissue * size * (again + 0.15 * other)


def misplaced(random, recorded, read, feet, wrong):
    """What is off by a constant in every session: where markers and plates are, and what a loaded plate reads."""
    for name in recorded:
        size = LANDMARK_M if name.startswith("pelvis_t") and len(name) == 9 else LANDMARK_RAD
        recorded[name] = recorded[name] + wrong.placed * size * random.normal()
    tilt = wrong.placed * LEVEL_RAD * random.normal(size=2)
    for s, (level, cop, free) in read.items():
        force = level + np.stack([-tilt[0] * level[:, 2], -tilt[1] * level[:, 2], level[:, :2] @ tilt], axis=1)
        on = wrong.placed * feet[s][3][:, None]
        off = PLATE_N * random.normal(size=3) * on, PLATE_M * random.normal(size=3) * [1, 1, 0] * on
        read[s] = force + off[0], cop + off[1], free + PLATE_NM * random.normal() * on * [0, 0, 1]


def misread(feet, wrong, time, random):
    """What the plates make of it."""
    out = {}
    for s, (force, cop, free, on) in feet.items():
        f, c, t = force.copy(), cop.copy(), free.copy()
        mine = wrong.site in (s, "both")
        if wrong.cause == "plate_gain" and mine:
            f, t = f * (1 + wrong.size), t * (1 + wrong.size)
        if wrong.cause == "plate_offset" and mine:
            f = f + wrong.size * np.array(wrong.extra["axis"]) * on[:, None]
        if wrong.cause == "clock_offset":
            for array in (f, c, t):
                array[:] = np.stack([np.interp(time - wrong.size, time, column) for column in array.T], axis=1)
        f = f + random.normal(size=f.shape) * 1.0 * on[:, None]
        out[s] = f, c, t
    return out


def write(folder, subject, recorded, read, time, wrong, period):
    folder.mkdir(parents=True, exist_ok=True)
    inside = (time >= -0.15) & (time <= wrong.strides * period + 0.35)
    random = np.random.default_rng(int(1e6 * period) + wrong.strides)
    noise = wrong.size if wrong.cause == "marker_noise" else wrong.markers_m
    slow = np.flatnonzero(inside)[::2]
    columns = [time[slow]]
    for name, values in recorded.items():
        size = noise if name.startswith("pelvis_t") and len(name) == 9 else noise / 0.15
        columns.append(values[slow] + size * random.normal(size=len(slow)))
    header = ",".join(["time_s", *(f"q_{n}" for n in recorded)])
    np.savetxt(folder / "coords.csv", np.stack(columns, axis=1), delimiter=",", header=header, comments="", fmt="%.8g")
    rows, names = [time[inside]], ["time_s"]
    for s in ("right", "left"):
        for kind, values in zip(("F", "cop", "T"), read[s], strict=True):
            for axis, column in zip("xyz", (values @ TO_WORLD).T, strict=True):
                names.append(f"{s[0]}_{kind}{axis}")
                rows.append(column[inside])
    np.savetxt(
        folder / "grf.csv", np.stack(rows, axis=1), delimiter=",", header=",".join(names), comments="", fmt="%.7g"
    )
    rig = {"mass_kg": float(subject.mass_kg), "height_m": float(subject.height_m)}
    trial = {"coordinates": "coords.csv", "ground_reaction": "grf.csv"}
    study = {"study": {"name": folder.name, "rig": "body"}, "rig": rig, "trial": [trial]}
    (folder / "study.toml").write_text(tomli_w.dumps(study))
