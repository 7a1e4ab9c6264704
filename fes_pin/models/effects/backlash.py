"""Play between the joint and what is read."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from fes_pin.models.maths import play
from fes_pin.models.parameters import parameter
from fes_pin.models.stage import Bounds, ByName, Effect, Grids, Measured, Scalar, Signals, Stage, least_step, span

WIDTHS = (0.003, 0.03)
"""Half widths at which a fit starts, in addition to those that slopes lead to, as shares of the range of the motion."""


@dataclass(frozen=True)
class Backlash(Effect):
    """Play: the driven side, or the reading, follows only when the slack is taken up.

        b+ = clip(b, q - half_width, q + half_width)      play, once per sample
        y  = b+

    The inertia is on the side that is driven, what is read on the other; what is driven through the slack is light or
    held by friction. A trial begins in the middle of the slack.

    Tell-tale: where the motion turns the reading stands still until the slack is crossed, whatever the speed.
    Source: Nordin and Gutman, Controlling mechanical systems with backlash - a survey, Automatica 38 (2002). Play:
    Krasnosel'skii and Pokrovskii, Systems with Hysteresis, Springer 1989.
    """

    half_width: float = parameter(0.01, unit="{q}", null=0.0, lower=0.0, scale=0.005)

    name, stage, signal, rigs = "backlash", Stage.JOINT, "play", ("joint",)
    memories = ("followed",)

    @classmethod
    def far_sizes(cls, measured: Measured) -> Grids:
        """Half widths as shares of the motion: a fit that starts from no slack ends at a slack of a few counts."""
        size = span(measured, "position")
        return {"half_width": tuple(share * size for share in WIDTHS)} if size > 0.0 else {}

    def limits(self, measured: Measured) -> Bounds:
        """A slack that the motion never crosses would hide all of it."""
        size = span(measured, "position")
        return {"half_width": (0.0, 0.5 * size)} if size > 0.0 else {}

    def smallest(self, measured: Measured) -> dict[str, float]:
        """Half a count: a reading that stands still for less has not come to the next."""
        step = least_step(measured.get("position", np.zeros(1)))
        return {"half_width": 0.5 * step} if np.isfinite(step) else {}

    def apply(self, value: Scalar, s: Signals) -> Scalar:
        return play(s.own.followed, value, self.half_width)

    def update(self, s: Signals) -> ByName:
        return {"followed": play(s.own.followed, s.q, self.half_width)}

    def slack(self, s: Signals) -> Mapping[str, tuple[Scalar, Scalar]]:
        return {"followed": (s.q, self.half_width)}

    def rest(self, s: Signals) -> ByName:
        return {"followed": s.q}

    def start_variances(self, reach: Scalar, speed: Scalar) -> ByName:
        """Return the variance of the unknown initial position in the slack: uniform over 2 half_width."""
        return {"followed": self.half_width**2 / 3.0}
