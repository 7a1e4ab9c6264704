"""Process noise of a rig: a random effort, and a slowly wandering reading.

Both are first-order processes, e' = -e / time + white noise, of stationary standard deviation std. They are effects
that belong to no library, as noise is never named as a cause. Their deviations and times are no parameters of a model
but constants of a predictor (`models.predictor.StateSpaceNoise`), as measurement noise is.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from fes_pin.models.model import Model
from fes_pin.models.stage import Effect, Stage


@dataclass(frozen=True)
class RandomProcess(Effect):
    """A first-order process that is added to a signal."""

    def apply(self, value: Any, s: Any) -> Any:
        return value + getattr(s.own, self.states[0])

    def rate(self, s: Any) -> Mapping[str, Any]:
        return {e: -getattr(s.own, e) / getattr(s.c, f"time.{e}") for e in self.states}

    def intensities(self, c: Any) -> Mapping[str, Any]:
        return {e: 2.0 * c[f"std.{e}"] ** 2 / c[f"time.{e}"] for e in self.states}

    def stationary_variances(self, c: Any) -> Mapping[str, Any]:
        return {e: c[f"std.{e}"] ** 2 for e in self.states}


@dataclass(frozen=True)
class RandomEffort(RandomProcess):
    """A random effort at the joint."""

    name, stage, signal, rigs = "random_effort", Stage.JOINT, "torque", ("ankle", "joint")
    states, random = ("effort",), ("std.effort", "time.effort")


@dataclass(frozen=True)
class RandomForce(RandomProcess):
    """A random force of an isometric muscle."""

    name, stage, signal, rigs = "random_force", Stage.MUSCLE, "pull", ("ankle", "muscle")
    states, random = ("force",), ("std.force", "time.force")


@dataclass(frozen=True)
class WanderingReading(RandomProcess):
    """A slow random part of the first reading."""

    name, stage, signal, rigs = "wandering_reading", Stage.SENSOR, "reading", ("ankle", "joint", "muscle")
    states, random = ("reading",), ("std.reading", "time.reading")


DISTURBANCES = (RandomEffort, RandomForce, WanderingReading)
"""Every random process, in the order of the signal path."""


def disturbed(model: Model, kind: str, processes: Sequence[str]) -> Model:
    """Return the model with the processes that act in a kind of trial; a random force only where no joint moves."""
    signals = model.rig.signals(kind)
    for one in DISTURBANCES:
        moves = one is RandomForce and RandomEffort.signal in signals and model.rig.takes(RandomEffort)
        if set(one.states) <= set(processes) and one.signal in signals and not moves and model.rig.takes(one):
            model = model + one()
    return model
