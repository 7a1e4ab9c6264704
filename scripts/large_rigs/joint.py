"""Joints that swing, or turn round without gravity, freely or by an effort that answers no reading."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from confusion_matrix.rigs import urdf_text

from large_rigs.recorded import HOLD, Drawn, Take, changes, held, log_uniform, simulated

SWINGING = (
    ("effort_offset",),
    ("coulomb_friction",),
    ("parallel_stiffness",),
    ("quadratic_damping",),
    ("base_tilt",),
    ("joint_stop",),
    ("effort_offset", "coulomb_friction"),
    ("passive_relaxation",),
    ("base_tilt", "coulomb_friction"),
)
CAUSES = {
    "free": SWINGING,
    "driven": SWINGING,
    "coasting": (("coulomb_friction",), ("quadratic_damping",), ("cogging",)),
    "turning": (
        ("coulomb_friction",),
        ("effort_offset",),
        ("quadratic_damping",),
        ("cogging",),
        ("effort_offset", "coulomb_friction"),
    ),
}
"""What is hidden in turn: in joints that swing freely or by an effort, and in those that turn round."""
SHARE = (0.15, 0.6)
"""Torque of what is hidden, as a share of gravity's largest, or of what turns the joint."""
WRONG = (0.5, 2.0)
"""Inertia, or mass, as a multiple of what is believed."""
TURNS = (3.0, 60.0)
OVER = 2.8
"""Farthest that a swinging joint may go from where it hangs, rad: short of its turning over."""
LEAST = 0.3
"""Least range of each swing, rad."""
TRIES = 60


@dataclass(frozen=True)
class Joint:
    """A joint as it is.

    Attributes
    ----------
    weight
        Gravity's largest torque, N m; 0 where it has none.
    turned
        Position at which it hangs, less the sign, rad.
    hidden
        Numbers of what is hidden, by their names in an answer.
    form
        Of friction: `sharp` and `fall`, speeds, rad/s, and `more`, the share by which it is larger at rest.
    """

    inertia: float
    damping: float
    weight: float
    turned: float = 0.0
    hidden: Mapping[str, float] = field(default_factory=dict)
    form: Mapping[str, float] = field(default_factory=dict)

    def run(self, start: tuple[float, float], time: np.ndarray, effort: np.ndarray) -> np.ndarray:
        """Positions at the samples, rad, shape (n,)."""
        relaxes = "passive_relaxation.relaxation_s" in self.hidden
        state = (*start, start[0]) if relaxes else start
        return simulated(self.rates, state, time, *changes(effort, time))[:, 0]

    def rates(self, t: float, x: np.ndarray, effort: float) -> list[float]:
        """Rates of position, speed, and of where a Maxwell element rests if there is one."""
        q, v, *rest = x
        torque = effort - self.weight * np.sin(q + self.turned + self.hidden.get("base_tilt.tilt_rad", 0.0))
        torque += self.besides(q, v, *rest) - self.damping * v
        return [v, torque / self.inertia, *((q - r) / self.hidden["passive_relaxation.relaxation_s"] for r in rest)]

    def besides(self, q: float, v: float, rest: float = 0.0) -> float:
        """Torque of what is hidden, but for a tilt."""
        h, torque = self.hidden, self.hidden.get("effort_offset.offset", 0.0)
        if size := h.get("coulomb_friction.torque_nm"):
            more = 1.0 + self.form["more"] * np.exp(-((v / self.form["fall"]) ** 2))
            torque -= size * more * np.tanh(v / self.form["sharp"])
        if size := h.get("quadratic_damping.coefficient"):
            torque -= size * v * abs(v)
        if size := h.get("parallel_stiffness.stiffness_nm_per_rad"):
            torque -= size * (q - h["parallel_stiffness.rest_angle_rad"])
        if size := h.get("joint_stop.stiffness"):
            torque -= h["joint_stop.side"] * size * max(h["joint_stop.side"] * (q - h["joint_stop.angle_rad"]), 0.0)
        if size := h.get("passive_relaxation.stiffness_nm_per_rad"):
            torque -= size * (q - rest)
        if waves := h.get("cogging.waves"):
            torque += h["cogging.in_phase"] * np.sin(waves * q) + h["cogging.quadrature"] * np.cos(waves * q)
        return float(torque)


class Plan(NamedTuple):
    """What is drawn of a study's trials: sample step, samples, and a multiple of the rate at which it is recorded."""

    dt: float
    count: int
    faster: int

    @property
    def time(self) -> np.ndarray:
        """Times of the samples, s, shape (n,)."""
        return np.arange(self.count * self.faster) * (self.dt / self.faster)


def draw(family: str, hidden: tuple[str, ...], trials: int, faster: int, rng: np.random.Generator) -> Drawn:
    """A joint of a family with these causes hidden.

    Parameters
    ----------
    faster
        Multiple of its sample rate; all else is the same.
    """
    dt = float(rng.choice([0.002, 0.004, 0.005, 0.01]))
    plan = Plan(dt, HOLD * round(rng.uniform(5.0, 11.0) / (HOLD * dt)), faster)
    swings = family in ("free", "driven")
    return (_swinging if swings else _turning)(family, hidden, trials, plan, rng)


def _swinging(family: str, hidden: tuple[str, ...], trials: int, plan: Plan, rng: np.random.Generator) -> Drawn:
    mass, length = log_uniform(rng, 0.2, 5.0), rng.uniform(0.08, 0.4)
    known = {"mass": mass, "length": length, "own": rng.uniform(0.05, 0.4) * mass * length**2}
    known["turned"] = float(rng.choice([0.0, rng.uniform(-1.6, 1.6)]))
    believed, weight = known["own"] + mass * length**2, 9.81 * mass * length
    heavier = log_uniform(rng, *WRONG)
    scales = (heavier, heavier * rng.uniform(0.8, 1.25)) if rng.random() < 0.3 else (1.0, log_uniform(rng, *WRONG))
    weight, inertia = scales[0] * weight, scales[1] * believed
    rate = np.sqrt(weight / inertia)
    damping = 2.0 * log_uniform(rng, 0.005, 0.1) * inertia * rate
    share = rng.uniform(*SHARE) / (1.0 if len(hidden) < 2 else np.sqrt(2.0))
    sizes = _sizes(hidden, share * weight, rate, share, -known["turned"], rng)
    joint = Joint(inertia, damping, weight, known["turned"], sizes, _form(rate, rng))
    friction = share if "coulomb_friction" in hidden else 0.0
    takes = [_swing(joint, family == "driven", friction, plan, rng) for _ in range(trials + 1)]
    start = {"inertia_scale": 1.0, "damping": _four(damping * log_uniform(rng, 0.1, 10.0))}
    truth = {"inertia_scale": scales[1], "damping": damping, **sizes}
    if scales[0] != 1.0:
        start["gravity_scale"], truth["gravity_scale"] = 1.0, scales[0]
        if family == "free":  # which shows ratios alone
            torques = {n: v / scales[1] for n, v in truth.items() if n not in NO_TORQUES}
            truth = {**truth, **torques}
            del truth["inertia_scale"]
    size = max(float(np.ptp(t.values[:: plan.faster])) for t in takes)
    return Drawn("joint", {}, start, truth, _unstated(takes), takes[-1], size, urdf_text(known))


NO_TORQUES = (
    "base_tilt.tilt_rad",
    "parallel_stiffness.rest_angle_rad",
    "joint_stop.angle_rad",
    "joint_stop.side",
    "passive_relaxation.relaxation_s",
)


def _four(value: float) -> float:
    return float(f"{value:.4g}")


def _form(speed: float, rng: np.random.Generator) -> dict[str, float]:
    """The form of friction: how sharply its sign changes, and how it falls with speed."""
    more = float(rng.choice([0.0, rng.uniform(0.1, 0.4)]))
    return {"sharp": speed * log_uniform(rng, 1e-4, 1e-2), "more": more, "fall": speed * rng.uniform(0.01, 0.05)}


def _sizes(
    hidden: tuple[str, ...], torque: float, speed: float, share: float, middle: float, rng: np.random.Generator
) -> dict[str, float]:
    """Numbers of what is hidden, so that each acts with about this torque, at this speed or a radian from `middle`."""
    sign, out = float(rng.choice([-1.0, 1.0])), dict[str, float]()
    if "effort_offset" in hidden:
        out["effort_offset.offset"] = sign * torque
    if "coulomb_friction" in hidden:
        out["coulomb_friction.torque_nm"] = torque
    if "quadratic_damping" in hidden:
        out["quadratic_damping.coefficient"] = torque / speed**2
    if "parallel_stiffness" in hidden:
        out["parallel_stiffness.stiffness_nm_per_rad"] = torque
        out["parallel_stiffness.rest_angle_rad"] = middle + rng.uniform(-0.6, 0.6)
    if "base_tilt" in hidden:
        out["base_tilt.tilt_rad"] = sign * float(np.arcsin(share))
    if "joint_stop" in hidden:
        out |= {"joint_stop.stiffness": 20.0 * torque, "joint_stop.side": sign}
        out["joint_stop.angle_rad"] = middle + sign * rng.uniform(0.15, 0.4)
    if "passive_relaxation" in hidden:
        out["passive_relaxation.stiffness_nm_per_rad"] = 1.5 * torque
        out["passive_relaxation.relaxation_s"] = rng.uniform(0.15, 0.5)
    if "cogging" in hidden:
        phase = rng.uniform(0.0, 2.0 * np.pi)
        out |= {"cogging.in_phase": torque * np.cos(phase), "cogging.quadrature": torque * np.sin(phase)}
        out["cogging.waves"] = float(rng.integers(2, 9))
    return {name: float(value) for name, value in out.items()}


def _swing(joint: Joint, driven: bool, friction: float, plan: Plan, rng: np.random.Generator) -> Take:
    """A trial in which the joint moves, does not turn over, and touches a stop."""
    time, hangs = plan.time, -joint.turned
    for attempt in range(TRIES):
        least = np.arcsin(min(1.3 * friction + 0.2, 0.95))
        away = max(rng.uniform(least, 2.0) * 0.97**attempt, 0.5 * LEAST)
        start = (hangs + float(rng.choice([-1.0, 1.0])) * away, 0.0)
        effort = np.zeros(len(time))
        if driven:
            start = (hangs + rng.uniform(-0.2, 0.2), 0.0)
            effort = _effort(joint.weight * (friction + rng.uniform(0.2, 0.8) * 0.97**attempt), plan, rng)
        q = joint.run(start, time, effort)
        q_seen = q[:: plan.faster]
        side, stop = joint.hidden.get("joint_stop.side", 1.0), joint.hidden.get("joint_stop.angle_rad", -np.inf)
        is_touched = (side * (q_seen - stop)).max() > 0.05
        if np.abs(q_seen - hangs).max() < OVER and np.ptp(q_seen) > LEAST and is_touched:
            return _take(q, start, effort if driven else None, time)
    raise RuntimeError("no trial of this joint moves without turning over")


def _effort(size: float, plan: Plan, rng: np.random.Generator) -> np.ndarray:
    """Sines, or random steps, as a controller commands them: held for some samples."""
    every = HOLD * max(1, round(0.036 / (HOLD * plan.dt)))
    levels = -(-plan.count // every)
    if rng.random() < 0.5:
        t, slow = np.arange(levels) * every * plan.dt, rng.uniform(0.15, 1.2, 3)
        wave = sum(np.sin(2.0 * np.pi * f * t + p) for f, p in zip(slow, rng.uniform(0.0, 6.28, 3), strict=True))
        out = size * wave / np.abs(wave).max()
    else:
        out = size * _steps(levels, every * plan.dt, rng)
    return held(np.array([float(f"{x:.5g}") for x in out]), every * plan.faster, plan.count * plan.faster)


def _steps(count: int, dt: float, rng: np.random.Generator) -> np.ndarray:
    """Levels of either sign that last 0.3 to 1.5 s, the largest 1, shape (n,)."""
    ends = np.append(0.0, np.cumsum(rng.uniform(0.3, 1.5, 1 + int(count * dt / 0.3))))
    out = np.zeros(count)
    for a, b in pairwise(ends):
        out[(np.arange(count) * dt >= a) & (np.arange(count) * dt < b)] = rng.uniform(-1.0, 1.0)
    return out / np.abs(out).max()


def _take(q: np.ndarray, start: tuple[float, float], effort: np.ndarray | None, time: np.ndarray) -> Take:
    inputs = {} if effort is None else {"effort": effort}
    return Take(float(time[1]), "position", q, inputs, conditions={"position0": start[0], "velocity0": start[1]})


def _unstated(takes: list[Take]) -> list[Take]:
    """All but the last, whose start nobody states."""
    return [replace(take, conditions={}) for take in takes[:-1]]


def _turning(family: str, hidden: tuple[str, ...], trials: int, plan: Plan, rng: np.random.Generator) -> Drawn:
    inertia, seconds, turns = log_uniform(rng, 1e-4, 1e-1), plan.count * plan.dt, log_uniform(rng, 5.0, 45.0)
    driven = family == "turning"
    run_out = seconds * (rng.uniform(0.05, 0.3) if driven else rng.uniform(0.2, 0.8))
    speed = 2.0 * np.pi * turns / (seconds if driven else run_out * (1.0 - np.exp(-seconds / run_out)))
    scale = log_uniform(rng, *WRONG) if driven else 1.0  # which a coasting joint does not show
    damping = scale * inertia / run_out
    share = rng.uniform(*SHARE) / (1.0 if len(hidden) < 2 else np.sqrt(2.0))
    sizes = _sizes(hidden, share * damping * speed, speed, share, 0.0, rng)
    if "cogging" in hidden:
        sizes["cogging.waves"] = max(2.0, min(sizes["cogging.waves"], float(int(0.8 / (speed * plan.dt)))))
    joint = Joint(scale * inertia, damping, 0.0, 0.0, sizes, _form(speed, rng))
    takes = [_turn(joint, speed, driven, plan, rng) for _ in range(trials + 1)]
    known = {"mass": 50.0 * inertia, "length": 0.0, "turned": 0.0, "own": inertia}
    start = {"inertia_scale": 1.0, "damping": _four(damping * log_uniform(rng, 0.1, 10.0))}
    truth = {"damping": damping, **sizes, **({"inertia_scale": scale} if driven else {})}
    return Drawn("joint", {}, start, truth, _unstated(takes), takes[-1], 2.0 * np.pi, urdf_text(known))


def _turn(joint: Joint, speed: float, driven: bool, plan: Plan, rng: np.random.Generator) -> Take:
    """A trial of 3 to 60 turns: sometimes both ways, sometimes one."""
    time, both = plan.time, rng.random() < 0.5
    sign = float(rng.choice([-1.0, 1.0]))
    for _ in range(TRIES):
        effort, start = np.zeros(len(time)), (0.0, sign * speed * rng.uniform(0.6, 1.1))
        if driven:
            start = (0.0, 0.0)
            effort = 1.3 * joint.damping * speed * _effort(1.0, plan, rng)
            effort = effort if both else sign * np.abs(effort)
        q = joint.run(start, time, effort)
        turned = float(np.ptp(q[:: plan.faster])) / (2.0 * np.pi)
        if TURNS[0] < turned < TURNS[1]:
            return _take(q, start, effort if driven else None, time)
        speed *= 1.3 if turned < TURNS[0] else 0.8
    raise RuntimeError("no trial of this joint turns as often as it should")
