"""Scatter of repeats: the nominal parameters of each trial scatter about those of its group (random effects).

A muscle is a percent stronger in one trial than in the next, even in repeats. In a simulation that is an error far
above the measurement noise, in every sample of the trial, and every cause of the library explains some of it. With a
trial's whitened residual r, the sensitivities V of its readings to the nominal parameters, and their standard
deviations D = diag(s),

    r ~ N(0, I + V D^2 V'),

where s is estimated by maximum likelihood with the parameters of the model profiled out. The gain of a change beyond
that scatter is kept. Source: Laird and Ware, Biometrics 38 (1982).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fes_pin.data.trial import Trial
from fes_pin.identify.likelihood import LikelihoodProblem
from fes_pin.infer.levels import PARAMETER_PENALTY
from fes_pin.infer.problem import Linearized, Unknowns
from fes_pin.infer.projection import without_locals
from fes_pin.models.least_squares import least_squares
from fes_pin.models.model import Model
from fes_pin.models.predictions import PredictedTrial
from fes_pin.models.predictor import StateSpaceNoise

SMALLEST, LARGEST = -1.0, 12.0
"""Range of the logarithm of s, in units of the standard error of a parameter from these trials: at the lower end its
variance is an eighth of that, at the upper end a trial determines only its own value."""
COARSE, STEP, FINE = 27, 0.5, 21
"""Grid of a deviation's logarithm, half a unit apart, and its refinement about the best point."""


class RepeatedProblem(LikelihoodProblem):
    """A `LikelihoodProblem` whose nominal parameters scatter between trials.

    Parameters
    ----------
    model, trials, noise
        As in `LikelihoodProblem`.
    deviations
        Standard deviation of a nominal parameter between trials, in its unit, by name.
    """

    def __init__(
        self, model: Model, trials: Sequence[Trial], noise: StateSpaceNoise, deviations: Mapping[str, float]
    ) -> None:
        super().__init__(model, trials, noise)
        self.deviations = deviations

    def linearize(self, values: Mapping[str, float], unknowns: Unknowns) -> list[Linearized]:
        """Return residuals and sensitivities as `LikelihoodProblem` does, times (I + V D^2 V')^(-1/2)."""
        return self.scattered(super().linearize(values, unknowns))

    def scattered(self, plain: Sequence[Linearized]) -> list[Linearized]:
        """Return trials whitened by the scatter of parameters, from trials without."""
        shrinks = self.shrinks(plain) if self.deviations else []
        return [s.whitened(p) for p, s in zip(plain, shrinks, strict=True)] if shrinks else list(plain)

    def plain(self, values: Mapping[str, float], unknowns: Unknowns) -> list[Linearized]:
        """Return the trials without scatter."""
        return super().linearize(values, unknowns)

    def shrinks(self, plain: Sequence[Linearized]) -> list[Shrink]:
        """Return (I + V D^2 V')^(-1/2) of each trial."""
        return [Shrink.of(self.columns(p, list(self.deviations)) * self._sizes) for p in plain]

    def columns(self, plain: Linearized, names: Sequence[str]) -> np.ndarray:
        """Return sensitivities of a trial to some parameters, its own unknowns projected off, shape (m, names)."""
        return without_locals(plain, plain.jacobian[:, [self.free.index(n) for n in names]])

    @property
    def _sizes(self) -> np.ndarray:
        return np.array(list(self.deviations.values()))

    def residual_run(self, values: Mapping[str, float], unknowns: Unknowns) -> list[PredictedTrial]:
        """Return trials minus their likeliest deviation from their group."""
        if not self.deviations:
            return super().residual_run(values, unknowns)
        at = [self.free.index(n) for n in self.deviations]
        return [self._less(one, at) for one in self.innovations(values, unknowns)]

    def _less(self, one: PredictedTrial, at: Sequence[int]) -> PredictedTrial:
        part = self.whitened(one)
        v = self.columns(part, list(self.deviations)) * self._sizes
        own = np.linalg.solve(np.eye(len(at)) + v.T @ v, v.T @ part.residual) * self._sizes
        own_step = least_squares(part.local, part.jacobian[:, at] @ own, rcond=1e-10)
        moved = one.sensitivities[..., at] @ own - one.sensitivities[..., len(self.free) :] @ own_step
        return replace(one, values=np.where(one.seen, one.values - moved, 0.0))


@dataclass(frozen=True)
class Shrink:
    """(I + V D^2 V')^(-1/2) of one trial: orthonormal directions, and the powers of V D along them."""

    basis: np.ndarray
    powers: np.ndarray

    @classmethod
    def of(cls, along: np.ndarray) -> Shrink:
        with np.errstate(all="ignore"):
            gram = along.T @ along
        if not np.isfinite(gram).all():  # a trial that diverges has an infinite cost anyway
            return cls(np.zeros((len(along), 0)), np.zeros(0))
        powers, vectors = np.linalg.eigh(gram)
        felt = powers > 1e-12 * max(powers.max(initial=0.0), 1e-300)
        return cls(along @ vectors[:, felt] / np.sqrt(powers[felt]), powers[felt])

    def shrunk(self, x: np.ndarray) -> np.ndarray:
        """Return rows of the trial, shape (m, ...), whitened."""
        return np.asarray(x + (self.basis * (1.0 / np.sqrt(1.0 + self.powers) - 1.0)) @ (self.basis.T @ x))

    def whitened(self, part: Linearized) -> Linearized:
        """Return the trial, whitened."""
        residual, jacobian, local = (self.shrunk(x) for x in (part.residual, part.jacobian, part.local))
        return Linearized(residual, jacobian, local, part.log_determinant + float(np.log1p(self.powers).sum()))

    def leaning(self, moved: np.ndarray) -> float:
        """Return the slope of the whitened squares of a trial's change in the logarithm of s^2, with opposite sign.

        The squares are as uncertain by the estimate of s as this part of them.
        """
        return float(np.sum((self.basis.T @ moved) ** 2 * self.powers / (1.0 + self.powers)))


def scatter(parts: Sequence[Linearized], columns: Sequence[np.ndarray], names: Sequence[str]) -> dict[str, float]:
    """Return standard deviations of nominal parameters between trials, for those whose scatter is significant.

    Parameters
    ----------
    parts
        Trials linearized at a fit, whitened by their noise alone.
    columns
        V of each trial, shape (m, names), its own unknowns projected off.
    names
        Names of the parameters that may scatter.

    Returns
    -------
    dict
        Empty also where a trial's readings or sensitivities are not finite.
    """
    with np.errstate(all="ignore"):  # an overflow has an infinite cost
        return _Scatter(parts, columns, names).found()


class _Scatter:
    """The likelihood of deviations, from products of X (free parameters), V and r of each trial."""

    def __init__(self, parts: Sequence[Linearized], columns: Sequence[np.ndarray], names: Sequence[str]) -> None:
        self.names = names
        unit = 1.0 / np.maximum(np.linalg.norm(np.concatenate([p.jacobian for p in parts]), axis=0), 1e-300)
        x = [without_locals(p, p.jacobian * unit) for p in parts]
        r = [without_locals(p, p.residual[:, None])[:, 0] for p in parts]
        self.xx = np.array([a.T @ a for a in x])
        self.xv = np.array([a.T @ v for a, v in zip(x, columns, strict=True)])
        self.xr = np.array([a.T @ b for a, b in zip(x, r, strict=True)])
        self.vv = np.array([v.T @ v for v in columns])
        self.vr = np.array([v.T @ b for v, b in zip(columns, r, strict=True)])
        self.size = np.sqrt(np.mean(np.diagonal(self.vv, axis1=1, axis2=2), axis=0))

    def found(self) -> dict[str, float]:
        """Return the deviations, found by adding one while it is significant."""
        best = np.zeros(len(self.names))
        cost = float(self.costs(best[None])[0])
        while True:
            more = [self._with(best, k) for k in np.flatnonzero((best == 0.0) & (self.size > 0.0)).tolist()]
            least, wanted = min(more, key=lambda m: m[0], default=(np.inf, best))
            if not cost - least > PARAMETER_PENALTY:
                return {n: float(s) for n, s in zip(self.names, best, strict=True) if s > 0.0}
            best, cost = wanted, least

    def _with(self, deviations: np.ndarray, k: int) -> tuple[float, np.ndarray]:
        """Return the cost with one more deviation, and all deviations, each refined with the others held."""
        now, cost = deviations.copy(), np.inf
        others: list[int] = np.flatnonzero(now).tolist()
        for one in [k, *others, k] if others else [k]:
            cost, now[one] = self._best(now, one)
        return cost, now

    def _best(self, deviations: np.ndarray, k: int) -> tuple[float, float]:
        """Return the least cost along one of the deviations, and its place."""
        least, best = np.inf, 0.0
        for grid in (np.linspace(SMALLEST, LARGEST, COARSE), np.linspace(-STEP, STEP, FINE)):
            tried = np.tile(deviations, (len(grid), 1))
            tried[:, k] = np.exp(grid) * (best or 1.0 / self.size[k])
            costs = self.costs(tried)
            at = int(np.argmin(costs))
            least, best = float(costs[at]), float(tried[at, k])
        return least, best

    def costs(self, deviations: np.ndarray) -> np.ndarray:
        """Return twice the negative log-likelihood up to a constant, the free parameters profiled out.

        Parameters
        ----------
        deviations
            Shape (points, names).

        Returns
        -------
        ndarray, shape (points,)
            Infinite where a product overflows.
        """
        felt = np.flatnonzero(deviations.any(axis=0))
        d = deviations[:, None, felt]
        inner = np.eye(len(felt)) + d[..., None] * self.vv[:, felt[:, None], felt] * d[:, :, None, :]
        xv, vr = self.xv[:, :, felt] * d[:, :, None, :], self.vr[:, felt] * d
        solved = np.linalg.solve(inner, np.concatenate([xv.swapaxes(2, 3), vr[..., None]], axis=3))
        hessian = (self.xx - xv @ solved[..., :-1]).sum(axis=1)
        gradient = (self.xr - (xv @ solved[..., -1:])[..., 0]).sum(axis=1)
        own = np.linalg.slogdet(inner)[1].sum(axis=1) - (vr * solved[..., -1]).sum(axis=(1, 2))
        usable = np.isfinite(hessian).all(axis=(1, 2)) & np.isfinite(gradient).all(axis=1) & np.isfinite(own)
        inverse = np.linalg.pinv(np.where(usable[:, None, None], hessian, 0.0), rcond=1e-12, hermitian=True)
        return np.where(usable, own - np.einsum("gp,gpq,gq->g", gradient, inverse, gradient), np.inf)
