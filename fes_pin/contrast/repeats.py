"""Repeats that differ: the nominal parameters of each trial scatter about those of its group.

A muscle is a percent stronger in one trial than in the next, however alike they are meant to be. To a simulation that
is an error far above the noise of its reading, in every sample of the trial, and every cause of the library takes up
some of it. With a trial's residual r (whitened), the sensitivities V of its readings to the nominal parameters, and
their deviations D = diag(s),

    r ~ N(0, I + V D^2 V'),

of which s is estimated by maximum likelihood, the parameters of the model profiled out. What a change of the rig
explains beyond that is not taken from it. Source: Laird and Ware, Biometrics 38 (1982).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.optimize

from fes_pin.data.trial import Trial
from fes_pin.identify.fit import PARAMETER_PRICE
from fes_pin.identify.noise import NoiseModel
from fes_pin.identify.noise_floor import span
from fes_pin.identify.problem import Linearized, Problem, Unknowns
from fes_pin.models.model import Model

SMALLEST, LARGEST = -1.0, 12.0
"""Logarithms between which s is sought, in units of what the trials tell of a parameter: at the smallest its variance
is an eighth of that, at the largest a trial tells nothing but its own."""
GRID = 27
"""Values of a deviation that are tried before the best of them is refined: half a unit of the logarithm apart."""
SWEEPS = 2
"""Turns in which deviations are refined beside each other."""


@dataclass(frozen=True, eq=False)
class Repeats:
    """Noise of a group's trials, and how much their nominal parameters scatter.

    Attributes
    ----------
    noise
        By output column.
    deviations
        Standard deviation of a nominal parameter between trials, in its unit, by name.
    along
        V D of each trial, shape (m, parameters that scatter).
    """

    noise: NoiseModel
    deviations: Mapping[str, float]
    along: tuple[np.ndarray, ...]

    def of(self, rows: slice) -> Repeats:
        """The same for some of the trials."""
        return Repeats(self.noise, self.deviations, self.along[rows])


class RepeatedProblem(Problem):
    """A `Problem` whose residuals are weighed by the scatter of repeats as well."""

    def __init__(
        self, model: Model, trials: Sequence[Trial], weight: Repeats, free: tuple[str, ...] | None = None
    ) -> None:
        super().__init__(model, trials, weight.noise, free)
        self._shrinks = [_shrink(v) for v in weight.along]

    def linearize(self, values: Mapping[str, float], unknowns: Unknowns) -> list[Linearized]:
        """As a `Problem` does, times (I + V D^2 V')^(-1/2)."""
        plain = super().linearize(values, unknowns)
        return [_shrunk(part, *shrink) for part, shrink in zip(plain, self._shrinks, strict=True)]


def _shrink(along: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Orthonormal directions, what is taken off along each, and the log-determinant of I + `along` `along`'."""
    powers, vectors = np.linalg.eigh(along.T @ along)
    felt = powers > 1e-12 * max(powers.max(initial=0.0), 1e-300)
    basis = along @ vectors[:, felt] / np.sqrt(powers[felt])
    return basis, 1.0 - 1.0 / np.sqrt(1.0 + powers[felt]), float(np.log1p(powers[felt]).sum())


def _shrunk(part: Linearized, basis: np.ndarray, less: np.ndarray, log_determinant: float) -> Linearized:
    residual, jacobian, local = (x - basis @ (less * (basis.T @ x).T).T for x in (part.residual, part.jacobian, part.local))
    return Linearized(residual, jacobian, local, part.log_determinant + log_determinant)


@dataclass(frozen=True)
class _Evidence:
    """What a trial says: products of X (free parameters), V and r, its own unknowns taken out."""

    xx: np.ndarray
    xv: np.ndarray
    xr: np.ndarray
    vv: np.ndarray
    vr: np.ndarray


def scatter(parts: Sequence[Linearized], columns: Sequence[np.ndarray], names: Sequence[str]) -> dict[str, float]:
    """Deviations of nominal parameters between trials, of those whose scatter the trials demand.

    Parameters
    ----------
    parts
        Trials linearized at a fit, whitened with their noise alone.
    columns
        V of each trial, shape (m, names).
    names
        Of the parameters that may scatter.
    """
    told = [_evidence(p, v) for p, v in zip(parts, columns, strict=True)]
    size = np.sqrt(np.mean([np.diag(e.vv) for e in told], axis=0))
    found: dict[int, float] = {}
    cost = _cost(told, np.zeros(len(names)))
    for _ in names:
        tried = {k: _with(told, found, k, size) for k in range(len(names)) if k not in found and size[k] > 0.0}
        best = min(tried, key=lambda k: tried[k][0], default=None)
        if best is None or not cost - tried[best][0] > PARAMETER_PRICE:
            break
        cost, found = tried[best]
    return {names[k]: s for k, s in found.items()}


def _with(
    told: Sequence[_Evidence], found: Mapping[int, float], k: int, size: np.ndarray
) -> tuple[float, dict[int, float]]:
    """The cost with one deviation more, and all of them."""
    now, cost = dict(found), np.inf
    for turn in range(SWEEPS if found else 1):
        for one in (k, *found) if turn == 0 else (*found, k):
            cost, now[one] = _best_of_one(told, now, one, size)
    return cost, now


def _best_of_one(
    told: Sequence[_Evidence], found: Mapping[int, float], k: int, size: np.ndarray
) -> tuple[float, float]:
    def cost(log_s: float) -> float:
        deviations = np.zeros(len(size))
        for one, s in found.items():
            deviations[one] = s
        deviations[k] = np.exp(log_s) / size[k]
        return _cost(told, deviations)

    grid = np.linspace(SMALLEST, LARGEST, GRID)
    start = grid[int(np.argmin([cost(x) for x in grid]))]
    near = scipy.optimize.minimize_scalar(cost, bounds=(start - 0.5, start + 0.5), method="bounded")
    return float(near.fun), float(np.exp(near.x) / size[k])


def _evidence(part: Linearized, columns: np.ndarray) -> _Evidence:
    x, v, r = without_locals(part, part.jacobian), without_locals(part, columns), part.residual
    r = without_locals(part, r[:, None])[:, 0]
    return _Evidence(x.T @ x, x.T @ v, x.T @ r, v.T @ v, v.T @ r)


def without_locals(part: Linearized, columns: np.ndarray) -> np.ndarray:
    """Columns less what a step of the trial's own unknowns makes of them, shape as `columns`."""
    own = span(part.local)
    return columns - own @ (own.T @ columns)


def _cost(told: Sequence[_Evidence], deviations: np.ndarray) -> float:
    """Twice the negative log-likelihood but for a constant, the free parameters profiled out."""
    felt = deviations > 0.0
    hessian, gradient, total = 0.0, 0.0, 0.0
    for one in told:
        xx, xr = one.xx, one.xr
        if felt.any():
            d = deviations[felt]
            inner = np.eye(len(d)) + d[:, None] * one.vv[np.ix_(felt, felt)] * d
            xv, vr = one.xv[:, felt] * d, one.vr[felt] * d
            solved = np.linalg.solve(inner, np.column_stack([xv.T, vr]))
            xx, xr = xx - xv @ solved[:, :-1], xr - xv @ solved[:, -1]
            total += float(np.linalg.slogdet(inner)[1] - vr @ solved[:, -1])
        hessian, gradient = hessian + xx, gradient + xr
    return total - float(gradient @ np.linalg.lstsq(hessian, gradient, rcond=1e-12)[0])
