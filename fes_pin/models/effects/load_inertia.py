"""The load's own inertia, felt through its cable."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from fes_pin.models.maths import sin
from fes_pin.models.parameters import parameter
from fes_pin.models.stage import Effect, Stage


@dataclass(frozen=True)
class LoadInertia(Effect):
    """The load's own inertia, felt through its cable.

        J + share M l^2 sin(theta)^2

    Tell-tale: heavier loads make the joint slower, not only displaced.
    Source: d'Alembert's principle for a load on a cable at lever l sin(theta), without its slack; share 1 is a
    rigid cable.
    """

    share: float = parameter(0.5, null=0.0, lower=0.0, upper=3.0, scale=0.1)

    name, stage, signal, rigs = "load_inertia", Stage.JOINT, "inertia", ("ankle",)

    def apply(self, value: Any, s: Any) -> Any:
        lever = s.lever * sin(s.q)
        return value + self.share * s.load * lever * lever
