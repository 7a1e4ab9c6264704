"""Test of lack of fit: whether a fit by the likelihood leaves more than noise, and on what the residual depends.

The innovations of the predictor are white where the model is right. Score tests ask whether they depend on some forty
features: functions of state, input and time that act as an effort at the joint (or a force), or on the reading. The
fitted parameters are free in these tests. Estimated process noise is part of the model: a lack of fit must exceed it.
"""

import math

import numpy as np

from fes_pin.identify.afar import is_rounding
from fes_pin.identify.fit import rough_fit, under_own_noise
from fes_pin.identify.likelihood import LikelihoodProblem
from fes_pin.identify.likelihood_fit import LikelihoodFit
from fes_pin.identify.problem import limits_of
from fes_pin.infer.distributions import chi2_tail
from fes_pin.infer.levels import UNFELT
from fes_pin.infer.optimum import MAX_ITERATIONS
from fes_pin.infer.projection import Projection
from fes_pin.infer.result import Remainder
from fes_pin.models.features import EffortFeatures, ForceFeatures, ReadingFeatures, scaled_to
from fes_pin.remainder.open_set import residual_tests

TRIED = (1.0, 0.5, 0.25, 0.1)
"""Shares of the Gauss-Newton step at which the cost is evaluated."""
KEPT = 1e-3
"""Share of its norm that a feature must keep once the sensitivities to fitted parameters are projected off."""
FEWEST_SIGNS = 4
"""Least number of trials whose signs say how much a statistic is inflated."""


def lack_of_fit(fitted: LikelihoodFit) -> Remainder:
    """Test whether a fit leaves anything but noise.

    Where measurement noise may be autoregressive, the residuals of a free simulation are tested too, see
    `remainder.open_set`: process noise would take bursts and detents for its own. The p-value is that of the
    most significant test, times the number of tests. Errors of free simulations that are those of rounding are not
    tested.
    """
    if is_rounding(fitted):
        return Remainder(False, 1.0, None, fitted.level)
    free = rough_fit(fitted.model, fitted.trials) if fitted.noise.ar else None
    if free is not None and math.isfinite(free.sse):
        free = under_own_noise(free, max_iterations=MAX_ITERATIONS)
    others = residual_tests(free) if free is not None and math.isfinite(free.sse) else []
    found = [_features_left(fitted), *others]
    p_value, where = min(found, key=lambda f: f[0])
    p_value = min(1.0, len(found) * p_value)
    unexplained = p_value < fitted.level
    return Remainder(unexplained, p_value, where if unexplained else None, fitted.level)


def _features_left(fitted: LikelihoodFit) -> tuple[float, str | None]:
    """Return the p-value of residuals that depend on no feature, and the variable of the largest single one.

    The level is that of a cause: half of it for the largest single feature, half for all features together. The
    chi-square is divided by its mean under random signs of the trials, where there are enough, over its rank. Slopes of
    a filter are approximate, worst for features with kinks. A score counts therefore only as far as the likelihood
    improves by it. This does not hold where effort is read: there fits follow such slopes to their end.
    """
    featured = _Featured(fitted)
    projection = Projection(fitted.parts)
    left = projection(featured.columns)
    before, after = np.linalg.norm(featured.columns, axis=0), np.linalg.norm(left, axis=0)
    good = np.flatnonzero((after > KEPT * np.where(before > 0, before, 1.0)) & featured.varies)
    if not len(good):
        return 1.0, None
    left = left[:, good] / after[good]
    by_trial = np.array([left[rows].T @ projection.residual[rows] for rows in projection.trials])
    values, vectors = np.linalg.eigh(left.T @ left)
    kept = values > UNFELT * values.max()
    shares = by_trial @ vectors[:, kept] / np.sqrt(values[kept])
    rank, statistic = int(kept.sum()), float(np.sum(shares.sum(axis=0) ** 2))
    inflation = max(1.0, float(np.sum(shares**2)) / rank) if len(shares) >= FEWEST_SIGNS else 1.0
    single = by_trial.sum(axis=0)
    best = int(np.argmax(np.abs(single)))

    def p_value(all_of_them: float, one: float) -> float:
        p_values = (float(chi2_tail(all_of_them / inflation, rank)), rank * float(chi2_tail(one / inflation, 1)))
        return min(1.0, 2.0 * min(p_values))

    p = p_value(statistic, float(single[best] ** 2))
    if p < fitted.level and featured.can_keep:
        alone, together = np.zeros((2, len(featured.names)))
        alone[good[best]] = single[best] / after[good[best]]
        together[good] = vectors[:, kept] @ (shares.sum(axis=0) / np.sqrt(values[kept])) / after[good]
        p = max(p, p_value(featured.gained(together), featured.gained(alone)))
    return p, featured.names[good[best]].split(":")[0]


class _Featured:
    """A fit extended by the features.

    Attributes
    ----------
    names
        Of the features.
    columns
        Whitened sensitivities of the innovations to them, all trials end to end, shape (m, features).
    can_keep
        False where the fit took filter gains as constant to its end.
    varies
        False of functions of the motion where nothing moves: these are constants.
    """

    def __init__(self, fitted: LikelihoodFit) -> None:
        signals = {s for t in fitted.trials for s in fitted.model.rig.signals(t.kind)}
        kinds = [EffortFeatures if "torque" in signals else ForceFeatures]
        kinds += [ReadingFeatures] if "reading" in signals else []
        self.fitted, self._model = fitted, fitted.model
        for kind in kinds:
            self._model = self._model + scaled_to(kind(), fitted.model.rig, fitted.trials)
        self.names = [n for kind in kinds for n in kind.functions]
        rig = fitted.model.rig
        moves = any("q" in rig.states(t.kind) or rig.schema.motion(t.kind) for t in fitted.trials)
        self.varies = np.array([moves or n.split(":")[0] not in ("angle", "rate") for n in self.names])
        free = tuple(f"{kind.name}.a{k:02d}" for kind in kinds for k in range(len(kind.functions)))
        self._problem = LikelihoodProblem(self._model, fitted.trials, fitted.noise, free)
        self.can_keep = not self._problem.is_final
        run = self._problem.innovations(self._model.parameters(), fitted.unknowns)
        columns = [i.over_deviations(i.sensitivities[..., : len(free)]) for i in run]
        self.columns = np.nan_to_num(np.concatenate(columns))

    def gained(self, amplitudes: np.ndarray) -> float:
        """Return by how much the cost falls along a step of features and fitted parameters; 0 where it rises.

        Parameters
        ----------
        amplitudes
            Shape (features,).
        """
        fitted, values = self.fitted, self._model.parameters()
        rows, residual = (np.concatenate([getattr(p, n) for p in fitted.parts]) for n in ("jacobian", "residual"))
        others = np.linalg.lstsq(rows, residual - self.columns @ amplitudes, rcond=1e-10)[0]
        moves = dict(zip((*fitted.free, *self._problem.free), (*others, *amplitudes), strict=True))
        limits = limits_of(self._model, fitted.trials)
        tried = [{n: float(np.clip(values[n] + t * m, *limits[n])) for n, m in moves.items()} for t in (0.0, *TRIED)]
        points = [({**values, **one}, fitted.unknowns) for one in tried]
        now, *costs = self._problem.costs(points)
        return max(0.0, now - min(costs))
