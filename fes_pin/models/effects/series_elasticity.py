"""Tendon and aponeurosis stretch: the fibres are shorter than the muscle, and move later."""

from dataclasses import dataclass

import numpy as np

from fes_pin.models.maths import exp
from fes_pin.models.parameters import parameter, refinement
from fes_pin.models.stage import Bounds, ByName, Effect, Grids, Measured, Scalar, Signals, Stage, span

RIGID = 1e-16
"""Compliance that counts as none, m/N."""


@dataclass(frozen=True)
class SeriesElasticity(Effect):
    """Tendon and aponeurosis stretch: the fibres are shorter than the muscle, and move later.

        fibre length = muscle length - xi(F),   xi = compliance F + toe (1 - exp(-F / toe_force))

    The fibres shorten at the speed at which their force is the tendon's, which `force_velocity` tells; without it they
    follow at once, and the tendon only shows through `force_length`. The tendon has a damping time of half an
    integration step, which keeps the equations regular also where the fibres carry nothing.

    Tell-tale: after a quick release the force drops by the same amount per millimetre at all speeds, then recovers.
    Source: Zajac, Crit. Rev. Biomed. Eng. 17 (1989): tendon in series, its toe region below a quarter of the largest
    force.
    """

    compliance: float = parameter(1e-4, unit="m/N", null=0.0, lower=0.0, upper=1.0, scale=1e-4)
    toe: float = refinement(
        0.0, unit="m", lower=0.0, upper=0.1, scale=1e-4, words="most at small forces (the toe region)"
    )
    toe_force: float = parameter(1.0, unit="N", lower=1e-3, upper=1e4, scale=1.0, optional=True)

    name, stage, signal, rigs = "series_elasticity", Stage.MUSCLE, "fibre", ("muscle",)
    states = ("tension",)
    screened_with = ("force_velocity",)

    @classmethod
    def grids(cls, measured: Measured) -> Grids:
        """A toe of some hundredths of the way that was imposed, over a quarter of the force."""
        way, force = span(measured, "length_m"), span(measured, "reading")
        return {**super().grids(measured), "toe": (0.05 * way,), "toe_force": (max(0.25 * force, 1e-3),)}

    def limits(self, measured: Measured) -> Bounds:
        """Return bounds by a tenth of the length of muscle and tendon: a tendon tears before it stretches so far."""
        if "length_m" not in measured:
            return {}
        longest = 0.1 * float(np.max(measured["length_m"]))
        force = max(float(np.nanmax(measured.get("reading", np.ones(1)))), 1e-9)
        return {"compliance": (0.0, longest / force), "toe": (0.0, longest), "toe_force": (0.05 * force, force)}

    def elongation(self, s: Signals) -> Scalar:
        """Return the stretch of the tendon, m."""
        tension = s.own.tension
        return self.compliance * tension + self.toe * (1.0 - exp(-tension / self.toe_force))

    def softness(self, s: Signals) -> Scalar:
        """d(elongation) / d(tension), m/N."""
        return RIGID + self.compliance + self.toe / self.toe_force * exp(-s.own.tension / self.toe_force)

    def apply(self, value: Scalar, s: Signals) -> Scalar:
        return value

    def rate(self, s: Signals) -> ByName:
        return {"tension": (s.tendon - s.own.tension) / (0.5 * s.step)}
