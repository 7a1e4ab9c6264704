"""One-joint rigs under feedback in plain numpy: what hides in them, the controller, the encoder, and a random torque.

Nothing here is the engine's: another integrator (Heun's, four steps a sample), other functional forms (for friction a
hyperbolic tangent, one that jumps and sticks, or bristles; a one-sided spring with damping for a stop, a discrete
Maxwell element), noise by a recursion.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

DT = 0.002
"""Sample step, s."""
STEPS = 4
"""Integration steps per sample."""


@dataclass(frozen=True)
class Plant:
    """A rig and what hides in it.

    Attributes
    ----------
    inertia, damping
        kg m2 and N m s, or kg and N s/m.
    weight
        Gravity's torque A sin(q), N m; negative where the rig stands on its head; 0 for a slide.
    hidden
        Sizes of what is hidden, by name: see `_hidden`.
    noise, count
        White reading noise and an encoder's count, rad or m; 0 for none.
    torque, torque_s
        Stationary deviation and time constant of a random torque that acts all the time.
    """

    inertia: float
    damping: float
    weight: float
    stiffness: float
    rate_gain: float
    hidden: dict[str, float] = field(default_factory=dict)
    noise: float = 0.0
    count: float = 0.0
    torque: float = 0.0
    torque_s: float = 0.1


def run(plant: Plant, references: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Efforts that the controller commands and positions that are read.

    Parameters
    ----------
    references
        Shape (n, trials): where the joint is wanted, rad or m.

    Returns
    -------
    effort, position
        Shape (n, trials).
    """
    n, lanes = references.shape
    state = _State(plant, references[0].copy(), rng)
    effort, position = np.empty((n, lanes)), np.empty((n, lanes))
    before = None
    for k in range(n):
        position[k] = state.read()
        rate = np.zeros(lanes) if before is None else (position[k] - before) / DT
        before = position[k]
        state.rate = 0.9 * state.rate + 0.1 * rate  # the controller's own low pass
        wanted = (references[min(k + 1, n - 1)] - references[k]) / DT
        effort[k] = plant.stiffness * (references[k] - position[k]) + plant.rate_gain * (wanted - state.rate)
        state.advance(effort[k], k * DT)
    return effort, position


class _State:
    """What moves, side by side for all trials."""

    def __init__(self, plant: Plant, q: np.ndarray, rng: np.random.Generator) -> None:
        self.plant, self.rng = plant, rng
        self.q, self.v, self.rate = q, np.zeros_like(q), np.zeros_like(q)
        self.relaxed, self.lagged, self.followed = q.copy(), q.copy(), q.copy()
        self.random = plant.torque * rng.standard_normal(len(q))
        self.bent = np.zeros_like(q)

    def read(self) -> np.ndarray:
        """The encoder's reading now."""
        p, hidden = self.plant, self.plant.hidden
        y = self.lagged if "sensor_lag" in hidden else self._through_play()
        y = y * (1.0 + hidden.get("sensor_gain", 0.0)) + hidden.get("sensor_offset", 0.0)
        y = y + p.noise * self.rng.standard_normal(len(y))
        return np.round(y / p.count) * p.count if p.count else y

    def _through_play(self) -> np.ndarray:
        """What a play leaves of the position: a sensor may lag behind that."""
        if (half := self.plant.hidden.get("backlash")) is None:
            return self.q
        self.followed = np.minimum(np.maximum(self.followed, self.q - half), self.q + half)
        return self.followed

    def advance(self, effort: np.ndarray, time: float) -> None:
        """To the next sample by Heun's method; the random torque is held over an integration step."""
        p, h = self.plant, DT / STEPS
        keep = np.exp(-h / p.torque_s)
        for j in range(STEPS):
            t, bristles = time + j * h, self._bristles(h)
            a0 = self._acceleration(effort, t, self.q, self.v, self.relaxed) - bristles
            q1, v1 = self.q + h * self.v, self.v + h * a0
            a1 = self._acceleration(effort, t + h, q1, v1, self.relaxed) - bristles
            lag, relax = p.hidden.get("sensor_lag", 0.0), p.hidden.get("relaxation_s", 0.0)
            if lag:
                sensed = self._through_play()
                self.lagged = sensed + (self.lagged - sensed) * np.exp(-h / lag)
            if relax:
                self.relaxed = self.q + (self.relaxed - self.q) * np.exp(-h / relax)
            v = self.v + 0.5 * h * (a0 + a1)
            if p.hidden.get("sticks", 0.0):
                v = np.where(v * self.v < 0.0, 0.0, v)
            self.q, self.v = self.q + 0.5 * h * (self.v + v1), v
            shock = p.torque * np.sqrt(1.0 - keep**2) * self.rng.standard_normal(len(self.q))
            self.random = keep * self.random + shock

    def _bristles(self, h: float) -> np.ndarray | float:
        """Deceleration by bristles that bend by `bristles` before they slip; z' = v - |v| z / g by an implicit step.

        Source: Canudas de Wit, Olsson, Astrom and Lischinsky, A new model for control of systems with friction, IEEE
        Transactions on Automatic Control 40 (1995).
        """
        p = self.plant
        if not (way := p.hidden.get("bristles", 0.0)):
            return 0.0
        size, slope = p.hidden["coulomb_friction"], p.hidden["stiction"]
        g = way * (1.0 + slope * np.exp(-((0.2 * self.v / p.hidden["friction_speed"]) ** 2)))
        self.bent = (self.bent + h * self.v) / (1.0 + h * np.abs(self.v) / g)
        stiffness = size / way
        creeping = self.v - np.abs(self.v) * self.bent / g
        return (stiffness * self.bent + np.sqrt(stiffness * p.inertia) * creeping) / p.inertia

    def _acceleration(
        self, effort: np.ndarray, t: float, q: np.ndarray, v: np.ndarray, relaxed: np.ndarray
    ) -> np.ndarray:
        p = self.plant
        torque = effort * (1.0 + p.hidden.get("effort_gain", 0.0)) - p.weight * np.sin(q) - p.damping * v
        torque = torque + self.random + _hidden(p.hidden, t, q, v, relaxed)
        return (torque - _friction(p.hidden, torque, v)) / p.inertia


def _friction(hidden: dict[str, float], torque: np.ndarray, v: np.ndarray) -> np.ndarray | float:
    """A hyperbolic tangent of the velocity, or what jumps where its sign does and holds a joint that stands.

    Source of the second: Karnopp, Computer simulation of stick-slip friction in mechanical dynamic systems, J. Dyn.
    Syst. Meas. Control 107 (1985).
    """
    if not (size := hidden.get("coulomb_friction", 0.0)) or hidden.get("bristles", 0.0):
        return 0.0
    ratio = v / hidden["friction_speed"]
    most = size * (1.0 + hidden.get("stiction", 0.0) * np.exp(-((0.2 * ratio) ** 2)))
    if hidden.get("sticks", 0.0):
        return np.where(v == 0.0, np.clip(torque, -most, most), most * np.sign(v))
    return most * np.tanh(ratio)


def _hidden(hidden: dict[str, float], t: float, q: np.ndarray, v: np.ndarray, relaxed: np.ndarray) -> np.ndarray:
    """The torque of what is hidden but for friction."""
    out = np.zeros_like(q)
    if size := hidden.get("quadratic_damping", 0.0):
        out -= size * v * np.abs(v)
    if size := hidden.get("effort_offset", 0.0):
        out += size
    if size := hidden.get("parallel_stiffness", 0.0):
        out -= size * (q - hidden["rest"])
    if size := hidden.get("joint_stop", 0.0):
        beyond = np.maximum(q - hidden["at"], 0.0)
        out -= size * beyond * (1.0 + 0.02 * v)
    if size := hidden.get("passive_relaxation", 0.0):
        out -= size * (q - relaxed)
    if size := hidden.get("periodic_torque", 0.0):
        out += size * np.sin(2.0 * np.pi * hidden["frequency"] * t + hidden["phase"])
    if size := hidden.get("cogging", 0.0):
        out += size * np.sin(hidden["waves"] * q + 0.3)
    if size := hidden.get("damping_drift", 0.0):
        out -= size * t * v
    return out
