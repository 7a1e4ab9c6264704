"""A fit without some of its units of evidence, by one Gauss-Newton step from the fit to all.

With g and H the slope and the curvature of half the cost of the other units, each unit's own unknowns eliminated, the
step is H^-1 g along the descent, and the cost after the step is |r|^2 - g' H^-1 g.

Source: Giordano, Stephenson, Liu, Jordan and Broderick, A Swiss army infinitesimal jackknife, AISTATS 2019.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from fes_pin.infer.covariance import least_squares_step
from fes_pin.infer.optimum import Optimum
from fes_pin.infer.problem import Linearized, normal_equations
from fes_pin.infer.scatter import at_rest
from fes_pin.infer.scoring import LITTLE


@dataclass(frozen=True)
class _Unit:
    """Number of readings of a unit, and its part of a fit's cost, of half its slope and of half its curvature."""

    readings: int
    cost: float
    slope: np.ndarray
    curvature: np.ndarray


class LeftOut:
    """The units of a fit, with slopes along the parameters that are not at a bound.

    The slopes of a fit that has ended are roughness of its cost (`infer.scatter.at_rest`).
    """

    def __init__(self, fitted: Optimum) -> None:
        self._fitted = fitted
        self._moving = [k for k, n in enumerate(fitted.free) if n not in fitted.at_bound]
        has_ended = fitted.together and fitted.gradient_norm < LITTLE
        self.each = list(map(self._unit, at_rest(fitted.parts) if has_ended else fitted.parts))

    def _unit(self, part: Linearized) -> _Unit:
        own, k = normal_equations([part]), self._moving
        cost = own.sse - own.local_gain + part.log_determinant
        return _Unit(len(part.residual), cost, own.gradient[k], own.hessian[np.ix_(k, k)])

    def step(self, held: Collection[int] = ()) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return slope and curvature of half the cost of the units that are not held out, and the step from them."""
        others = [one for k, one in enumerate(self.each) if k not in held]
        slope, curvature = (np.sum([getattr(one, n) for one in others], axis=0) for n in ("slope", "curvature"))
        return slope, curvature, least_squares_step(curvature, slope, rcond=1e-12)

    def values(self, held: Collection[int]) -> dict[str, float]:
        """Return the values of the parameters that are not at a bound, without some units."""
        names = [self._fitted.free[k] for k in self._moving]
        return {n: self._fitted.values[n] + d for n, d in zip(names, self.step(held)[2], strict=True)}

    def cost(self, held: Collection[int]) -> float:
        """Return the cost of the units that are not held out after one step, scaled to the readings of all.

        A fit by the likelihood takes filter gains as constant in its slopes. The gain that these predict even for all
        units together is therefore subtracted: no step of the fit reached it.
        """
        others = [one for k, one in enumerate(self.each) if k not in held]
        many = sum(one.readings for one in self.each) / sum(one.readings for one in others)
        (slope, curvature, step), (_, _, kept) = self.step(held), self.step()
        gained = float(slope @ step - 2.0 * slope @ kept + kept @ curvature @ kept)
        return many * (sum(one.cost for one in others) - gained)
