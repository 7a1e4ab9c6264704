"""What acts on a rig at random: an effort that no cause explains, and slow wandering of a reading.

Both are processes of stationary deviation std and correlation time; of first order,

    e' = -e / time + white noise,

or of second, where what acts is smooth, as friction's ripple is behind a gear:

    e' = (d - e) / smooth,   d' = -d / time + white noise,   var d = std^2 (time + smooth) / time

The second goes over into the first as smooth goes to zero. They are effects like any other, but of no library: nobody
is told that noise is a cause. Their deviations and times are no parameters of a model; they are constants of a
predictor (`models.predictor.Doubt`), as reading noise is.

Source of the variances: Gardiner, Handbook of Stochastic Methods, 3rd ed., section 4.4.6, the stationary covariance of
a linear process.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from fes_pin.models.model import Model
from fes_pin.models.stage import Effect, Stage


@dataclass(frozen=True)
class RandomProcess(Effect):
    """A process of first order that is added to a signal."""

    def apply(self, value: Any, s: Any) -> Any:
        return value + getattr(s.own, self.states[0])

    def rate(self, s: Any) -> Mapping[str, Any]:
        (e,) = self.states
        return {e: -getattr(s.own, e) / getattr(s.c, f"time.{e}")}

    def intensities(self, c: Any) -> Mapping[str, Any]:
        (e,) = self.states
        return {e: 2.0 * c[f"std.{e}"] ** 2 / c[f"time.{e}"]}

    def start_covariances(self, c: Any) -> Mapping[tuple[str, str], Any]:
        (e,) = self.states
        return {(e, e): c[f"std.{e}"] ** 2}


@dataclass(frozen=True)
class SmoothProcess(RandomProcess):
    """A process of second order that is added to a signal."""

    def rate(self, s: Any) -> Mapping[str, Any]:
        e, d = self.states
        acting, driving = getattr(s.own, e), getattr(s.own, d)
        time, smooth = (getattr(s.c, f"{what}.{e}") for what in ("time", "smooth"))
        return {e: (driving - acting) / smooth, d: -driving / time}

    def _driving(self, c: Any) -> Any:
        """Stationary variance of what drives the effort."""
        e = self.states[0]
        return c[f"std.{e}"] ** 2 * (c[f"time.{e}"] + c[f"smooth.{e}"]) / c[f"time.{e}"]

    def intensities(self, c: Any) -> Mapping[str, Any]:
        e, d = self.states
        return {d: 2.0 * self._driving(c) / c[f"time.{e}"]}

    def start_covariances(self, c: Any) -> Mapping[tuple[str, str], Any]:
        e, d = self.states
        own = c[f"std.{e}"] ** 2
        return {(e, e): own, (e, d): own, (d, d): self._driving(c)}


_EFFORT = ("std.effort", "time.effort")
_FORCE = ("std.force", "time.force")


@dataclass(frozen=True)
class RandomEffort(RandomProcess):
    """A random effort at the joint."""

    name, stage, signal, rigs = "random_effort", Stage.JOINT, "torque", ("ankle", "joint")
    states, random = ("effort",), _EFFORT


@dataclass(frozen=True)
class SmoothEffort(SmoothProcess):
    """The same, smooth."""

    name, stage, signal, rigs = "smooth_effort", Stage.JOINT, "torque", ("ankle", "joint")
    states, random = ("effort", "drive"), (*_EFFORT, "smooth.effort")


@dataclass(frozen=True)
class RandomForce(RandomProcess):
    """A random force of a muscle that is held."""

    name, stage, signal, rigs = "random_force", Stage.MUSCLE, "pull", ("ankle", "muscle")
    states, random = ("force",), _FORCE


@dataclass(frozen=True)
class SmoothForce(SmoothProcess):
    """The same, smooth."""

    name, stage, signal, rigs = "smooth_force", Stage.MUSCLE, "pull", ("ankle", "muscle")
    states, random = ("force", "drive"), (*_FORCE, "smooth.force")


@dataclass(frozen=True)
class WanderingReading(RandomProcess):
    """A slow random part of the first reading."""

    name, stage, signal, rigs = "wandering_reading", Stage.SENSOR, "reading", ("ankle", "joint", "muscle")
    states, random = ("reading",), ("std.reading", "time.reading")


DISTURBANCES = (RandomEffort, SmoothEffort, RandomForce, SmoothForce, WanderingReading)
"""Every random process, in the order of the signal path."""


def disturbed(model: Model, kind: str, random: Sequence[str]) -> Model:
    """The model with the processes that a kind of trial can feel; a random force only where no joint moves.

    Parameters
    ----------
    random
        Names of the values of a `Doubt`: a process acts if its values, and no further ones of it, are among them.
    """
    signals = model.rig.signals(kind)
    for one in DISTURBANCES:
        own = {n for n in random if n.partition(".")[2] == one.states[0] and not n.startswith("white.")}
        moves = one.signal == "pull" and "torque" in signals and model.rig.name in RandomEffort.rigs
        if set(one.random) == own and one.signal in signals and not moves and model.rig.name in one.rigs:
            model = model + one()
    return model
