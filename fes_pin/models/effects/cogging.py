"""Torque that is periodic in the angle."""

from dataclasses import dataclass

import numpy as np

from fes_pin.models.maths import TURN, cos, sin
from fes_pin.models.stage import Bounds, Effect, Grids, Measured, Scalar, Signals, Stage, parameter, refinement

FEWEST, MOST = 1.5, 30.0
"""Waves within the measured range: one is a spring that hardens, or gravity; of one and a half, half comes again. More
would be about a degree on half a radian."""
STEP = 0.75
"""Between two that are tried, waves within the range: what it resolves is one, so a fit starts within its own hill."""
TEETH = 36
"""Waves a turn that are tried of a joint that turns round: three phases, slots and poles of small motors."""


@dataclass(frozen=True)
class Cogging(Effect):
    """Torque that is periodic in the angle: magnets, gear teeth, detents.

        torque + in_phase sin(k q) + quadrature cos(k q) + second sin(2 k q + phase),   k = waves

    The data choose k, and whether there is a second harmonic.

    Tell-tale: the joint comes to rest at equal distances, and slow motion is uneven at the same angles both ways.
    Source: Hanselman, Brushless Permanent Magnet Motor Design, 2nd ed., 2006: cogging torque is a Fourier series in
    the angle, of few terms.
    """

    in_phase: float = parameter(0.01, unit="{effort}", null=0.0, lower=-1e6, upper=1e6, scale=0.01)
    quadrature: float = parameter(0.0, unit="{effort}", null=0.0, lower=-1e6, upper=1e6, scale=0.01)
    waves: float = parameter(12.0, unit="1/{q}", lower=0.0, upper=1e5, scale=1.0)
    second: float = refinement(
        0.0, unit="{effort}", lower=0.0, upper=1e6, scale=0.01, grid=(0.005,), words="with a second harmonic"
    )
    phase_rad: float = parameter(
        0.0, unit="rad", lower=-TURN, upper=TURN, scale=0.5, optional=True, grid=(0.0, TURN / 4, TURN / 2, -TURN / 4)
    )

    name, stage, signal, rigs = "cogging", Stage.JOINT, "torque", ("joint",)

    @classmethod
    def grids(cls, measured: Measured) -> Grids:
        """Waves that come again within the measured range; of a joint that turns round also whole ones a turn."""
        grids, size = super().grids(measured), _range(measured)
        if not size > 0.0:
            return grids
        waves = [TURN / size * n for n in np.arange(FEWEST, MOST, STEP)]
        waves += [float(n) for n in range(1, TEETH + 1) if size > FEWEST * TURN]
        return {**grids, "waves": tuple(waves)}

    def limits(self, measured: Measured) -> Bounds:
        """Return a lower bound of the waves in a turn: they must repeat within the measured range."""
        size = _range(measured)
        return {"waves": (FEWEST * TURN / size, np.inf)} if size > 0.0 else {}

    def apply(self, value: Scalar, s: Signals) -> Scalar:
        angle = self.waves * s.q
        value = value + self.in_phase * sin(angle) + self.quadrature * cos(angle)
        return value + self.second * sin(2.0 * angle + self.phase_rad)


def _range(measured: Measured) -> float:
    """All but the outermost hundredths of the positions that were measured, rad or m; 0 where there are none."""
    position = measured.get("position", np.zeros(1))
    return float(np.quantile(position, 0.99) - np.quantile(position, 0.01))
