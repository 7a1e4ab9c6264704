"""What a functional form of a cause can change; each hook is the identity here."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np


class Form:
    """One functional form of one cause, for all lanes.

    Attributes
    ----------
    cause
        Canonical name; of a cause outside the library a name of its own.
    name
        Of the form: "same" is the engine's.
    rigs
        Where it applies.
    unit, cap
        A size that shows in a study, and the largest that is still sensible.
    states
        Names of its own states.
    ranges
        Shape parameters that are drawn evenly, with their limits.
    true
        The engine's parameters, where this is its form: each is the size, or a shape parameter.
    size, p
        Its size and shape parameters, shape (L,).
    """

    cause: ClassVar[str]
    name: ClassVar[str] = "same"
    rigs: ClassVar[tuple[str, ...]] = ("ankle",)
    unit: ClassVar[float] = 1.0
    cap: ClassVar[float] = np.inf
    states: ClassVar[tuple[str, ...]] = ()
    ranges: ClassVar[Mapping[str, tuple[float, float]]] = {}
    true: ClassVar[Mapping[str, str]] = {}
    fine: ClassVar[int] = 5
    """Integration steps per sample that it needs; at 5 (1 kHz) every rig is within d = 0.01 of the engine."""

    def __init__(self, size: np.ndarray, p: dict[str, np.ndarray]) -> None:
        self.size, self.p = size, p

    @classmethod
    def draw(cls, rng: np.random.Generator, angles: np.ndarray) -> dict[str, float]:
        """Shape parameters of one study; `angles` are those of its nominal motion."""
        return {name: float(rng.uniform(*between)) for name, between in cls.ranges.items()}

    @classmethod
    def truth(cls, size: float, p: dict[str, float]) -> dict[str, float]:
        """Parameters of the engine's effect, by name, where this is the engine's form."""
        own = {**p, "size": size * p.get("sign", 1.0)}
        if "phase" in p:  # of size sin(w x + phase)
            own |= {"in_phase": size * math.cos(p["phase"]), "quadrature": size * math.sin(p["phase"])}
        return {name: own[which] for name, which in cls.true.items()}

    def begin(self, s: Any, lanes: Any) -> None:
        """Change constants: `s.load`, `s.tilt`, `s.offset`, `s.effort`; `lanes.k["number"]` numbers the trials."""

    def width(self, w: np.ndarray, time: np.ndarray, lanes: Any) -> np.ndarray:
        return w

    def recruit(self, r: np.ndarray) -> np.ndarray:
        return r

    def delays(self) -> list[tuple[float, np.ndarray]]:
        """Weights and delays from pulse to activation."""
        return []

    def rest(self, name: str, q: np.ndarray) -> np.ndarray | float:
        return 0.0

    def rates(self, s: Any) -> dict[str, np.ndarray]:
        return {}

    def own(self, s: Any, name: str) -> np.ndarray:
        """One of its own states."""
        return s.x[self.cause, name]

    def passed(self, v: np.ndarray, step: int) -> None:
        """See the joint's rate at the beginning of an integration step."""

    def time_constant(self, tau: np.ndarray, s: Any) -> np.ndarray:
        return tau

    def activation(self, act: np.ndarray, s: Any) -> np.ndarray:
        return act

    def force(self, force: np.ndarray, s: Any) -> np.ndarray:
        return force

    def net_force(self, force: np.ndarray, s: Any) -> np.ndarray:
        return force

    def torque(self, torque: np.ndarray, s: Any) -> np.ndarray:
        return torque

    def accelerate(self, acceleration: np.ndarray, s: Any) -> np.ndarray:
        return acceleration

    def sensed(self, y: np.ndarray, s: Any) -> np.ndarray:
        """What the sensor follows at a sample."""
        return y

    def reading(self, y: np.ndarray, v: np.ndarray, time: np.ndarray, rest: np.ndarray) -> np.ndarray:
        return y


class Signed(Form):
    """A form that acts either way, with an equal chance, or with those of `ways`, down and up."""

    ways: ClassVar[tuple[float, float] | None] = None

    @classmethod
    def draw(cls, rng: np.random.Generator, angles: np.ndarray) -> dict[str, float]:
        return {"sign": float(rng.choice((-1.0, 1.0), p=cls.ways))}


def play(y: np.ndarray, half: np.ndarray, follower: np.ndarray) -> np.ndarray:
    """A slack of +- half between a signal and its follower, which starts where it is said to; shape (n, L)."""
    out = np.empty_like(y)
    for i, now in enumerate(y):
        follower = np.clip(follower, now - half, now + half)
        out[i] = follower
    return out
