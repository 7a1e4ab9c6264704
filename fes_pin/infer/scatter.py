"""Corrections for errors of form: scatter of scores between pieces of the data, against that of a right model.

Where a model is right, twice the gain in log-likelihood of k more parameters is a chi-square of k degrees of freedom.
Where it is wrong, it is a sum of k chi-squares of one degree, times the eigenvalues of V C^-1, with C the inverse
information and V the sandwich covariance of the parameters (`covariance.widened`). Gains are divided by the mean of
these eigenvalues, if that is above 1.

Source: Kent, Robust properties of likelihood ratio tests, Biometrika 69 (1982); Satorra and Bentler, A scaled
difference chi-square test statistic for moment structure analysis, Psychometrika 66 (2001).
"""

import math
from collections.abc import Collection, Sequence
from dataclasses import replace
from typing import Protocol, TypeVar

import numpy as np
import scipy.linalg

from fes_pin.infer.covariance import covariance_of, scattered, widened
from fes_pin.infer.distributions import chi2_quantile, normal_quantile
from fes_pin.infer.levels import CLAIM_LEVEL, SEPARABLE, SURE, UNFELT, UNUSUAL_LEVEL
from fes_pin.infer.optimum import Optimum
from fes_pin.infer.problem import Linearized, normal_equations
from fes_pin.infer.projection import without_locals

F = TypeVar("F", bound=Optimum)


class Residuals(Protocol):
    """A fit with its whitened residuals."""

    @property
    def sse(self) -> float:
        """Twice the negative log-likelihood, up to a constant."""

    @property
    def parts(self) -> Sequence[Linearized]:
        """Whitened residuals by trial."""


PIECES = 40
"""Pieces of the data whose scores show a model's errors of form: enough to estimate a standard deviation within a
tenth, and no more, so that each is long."""


def with_honest_intervals(fitted: F) -> F:
    """Return the fit with intervals of the sandwich estimator, from the scores of its trials in `PIECES` pieces."""
    return replace(fitted, covariance=widened(*_information_and_scores(fitted)))


def as_wide_as(fitted: F, other: Optimum) -> F:
    """Return the fit with intervals at least as wide as those of another estimate of the same parameters."""
    known = dict(zip(other.free, np.diag(other.covariance), strict=True))
    own = np.diag(fitted.covariance)
    theirs = np.array([known.get(n, np.nan) for n in fitted.free])
    with np.errstate(all="ignore"):
        ratio = np.where(theirs > own, theirs / own, 1.0)
    wider = np.sqrt(np.where(np.isfinite(ratio), ratio, 1.0))
    return replace(fitted, covariance=fitted.covariance * np.outer(wider, wider))


def as_wide_as_trials_differ(fitted: F, again: Sequence[Optimum]) -> F:
    """Return the fit with jackknife intervals of the parameters that differ more between trials than is expected.

    From fits without one of k parts of the trials each, the jackknife's variance is

        (k - 1) / k sum (p_i - mean p)^2

    Its ratio to that of the fit is a chi-square over its k - 1 degrees of freedom if the latter is right. The jackknife
    is used where that ratio is unusually large.

    Source: Miller, The jackknife - a review, Biometrika 61 (1974); of intervals that are widened as measurements
    differ, Birge, The calculation of errors by the method of least squares, Physical Review 40 (1932).

    Parameters
    ----------
    again
        Fits of the same model without one part of the trials each; fewer than two change nothing.
    """
    if len(again) < 2:
        return fitted
    known, degrees = np.diag(fitted.covariance), len(again) - 1
    values = np.array([[one.values[n] for n in fitted.free] for one in again])
    differ = degrees * np.var(values, axis=0)
    with np.errstate(all="ignore"):
        ratio = np.where(np.isfinite(known) & (known > 0.0), differ / known, 0.0)
    unusual = degrees * ratio > chi2_quantile(1.0 - UNUSUAL_LEVEL, degrees)
    wider = np.sqrt(np.where(unusual, ratio, 1.0))
    return replace(fitted, covariance=fitted.covariance * np.outer(wider, wider))


def as_wide_as_estimates_differ(fitted: F, other: Optimum, unlike: Collection[str] = ()) -> F:
    """Return the fit with intervals that include the difference to another estimate, where that is significant.

    Parameters that the other fit does not have keep their intervals.

    Where the model is right both estimate the same, and the variance of their difference is at most that of the less
    efficient one. Where the difference is unusually large, the model is wrong by about that difference, and either
    estimate may be off by it.

    Source: Hausman, Specification tests in econometrics, Econometrica 46 (1978).

    Parameters
    ----------
    other
        A fit to the same data by a less efficient estimator, with honest intervals.
    unlike
        Parameters of both that do not mean the same in both.
    """
    known = {n: v for n, v in zip(other.free, np.diag(other.covariance), strict=True) if n not in unlike}
    varies = np.array([known.get(n, np.inf) for n in fitted.free])
    apart = np.array([other.values.get(n, fitted.values[n]) - fitted.values[n] for n in fitted.free])
    with np.errstate(all="ignore"):
        ratio = np.where(np.isfinite(varies) & (varies > 0.0), apart**2 / varies, 0.0)
    apart = np.where(ratio > chi2_quantile(1.0 - UNUSUAL_LEVEL, 1), apart, 0.0)
    return replace(fitted, covariance=fitted.covariance + np.outer(apart, apart))


def excess_scatter(larger: Optimum, smaller: Optimum, *, is_slow: bool = False) -> float:
    """Return the variance ratio of a larger fit's further parameters to that of a right model; at least 1.

    Parameters
    ----------
    is_slow
        Whether the ratio is at least that of a first-order autoregression with the correlation of neighbouring
        residuals: `PIECES` show too little of a noise that is slower than they are long.
    """
    more = [k for k, n in enumerate(larger.free) if n not in smaller.free]
    if not more:
        return 1.0
    covariance, scores = _information_and_scores(larger)
    more = [k for k in more if np.isfinite(covariance[k, k]) and covariance[k, k] > 0.0]
    if not more or len(scores) < 2:
        return 1.0
    known = np.isfinite(np.diag(covariance))
    own = np.linalg.pinv(covariance[np.ix_(more, more)], hermitian=True)
    wide = [scattered(covariance, scores)]
    if is_slow:
        inverse = np.where(np.outer(known, known), covariance, 0.0)
        wide.append(inverse @ _autoregressive(at_rest(larger.parts)) @ inverse)
    return max(1.0, *(float(np.trace(own @ one[np.ix_(more, more)])) / len(more) for one in wide))


def _autoregressive(parts: Sequence[Linearized]) -> np.ndarray:
    """Return the covariance of the slopes of the log-likelihood, by the correlation of neighbouring residuals.

    Source: Newey and West, as `covariance.widened`, with the lags of a first-order autoregression: Andrews,
    Heteroskedasticity and autocorrelation consistent covariance matrix estimation, Econometrica 59 (1991).
    """
    pairs = [(p.residual[:-1], p.residual[1:]) for p in parts]
    near, power = (sum(float(x @ y) for x, y in many) for many in (pairs, [(a, a) for a, _ in pairs]))
    rho = min(max(near / max(power, 1e-300), 0.0), 1.0 - 1e-6)
    return np.asarray(sum(p.jacobian.T @ _correlated(without_locals(p, p.jacobian), rho) for p in parts))


def _correlated(columns: np.ndarray, rho: float) -> np.ndarray:
    """Return the correlations rho^|i - j| of rows times columns, shape (m, n); their inverse is a band of three."""
    bands = np.full((3, len(columns)), -rho)
    bands[1] = 1.0 + rho**2
    bands[1, [0, -1]] = 1.0 if len(columns) > 1 else 1.0 - rho**2
    return np.asarray(scipy.linalg.solve_banded((1, 1), bands / (1.0 - rho**2), columns))


def least_apart(likelier: Residuals, other: Residuals) -> float:
    """Return the lead in twice the log-likelihood above which a fit is distinguished from another of the same trials.

    With Delta the difference of their whitened residuals, the lead of the right one of two has the mean |Delta|^2 and
    the standard deviation 2 |Delta|, or that between pieces of the data if it is larger. The wrong one leads by
    `SEPARABLE` in at most 5 % of cases, however different they are. Where the lead is smaller than that of a right
    model, at `CLAIM_LEVEL`, neither is right, and the nearer one is distinguished if the pieces agree.

    Source: Cox, Tests of separate families of hypotheses, 4th Berkeley Symposium 1, 1961; Vuong, Likelihood ratio tests
    for model selection and non-nested hypotheses, Econometrica 57 (1989).
    """
    pairs = [(a.residual, b.residual) for a, b in zip(likelier.parts, other.parts, strict=True)]
    if any(a.shape != b.shape for a, b in pairs):
        return SEPARABLE
    squares = float(sum((a - b) @ (a - b) for a, b in pairs))
    gains = np.concatenate([in_pieces(b**2 - a**2, len(pairs)) for a, b in pairs])
    scatter = math.sqrt(len(gains)) * float(np.std(gains, ddof=1))
    least = squares - normal_quantile(1.0 - CLAIM_LEVEL) * max(scatter, 2.0 * math.sqrt(squares))
    return SEPARABLE if other.sse - likelier.sse >= least else max(SEPARABLE, SURE * scatter)


def _information_and_scores(fitted: Optimum) -> tuple[np.ndarray, np.ndarray]:
    """Return the inverse information of a fit, and the slopes of the log-likelihood of its pieces."""
    parts, free = at_rest(fitted.parts), np.isin(fitted.free, fitted.at_bound, invert=True)
    return covariance_of(normal_equations(parts).hessian, free), scores_of(parts)


def scores_of(parts: Sequence[Linearized]) -> np.ndarray:
    """Return the slopes of the log-likelihood of `PIECES` pieces of some trials, shape (pieces, parameters).

    Each trial's own unknowns are eliminated.
    """
    lengths = [len(p.residual) for p in parts]
    shares = [min(n, max(1, round(PIECES * n / sum(lengths)))) for n in lengths]
    pieces = list[np.ndarray]()
    for part, count in zip(parts, shares, strict=True):
        rows = without_locals(part, part.jacobian) * part.residual[:, None]
        pieces += [*np.add.reduceat(rows, np.linspace(0, len(rows), count, endpoint=False, dtype=int))]
    return np.array(pieces)


def in_pieces(values: np.ndarray, trials: int) -> np.ndarray:
    """Return sums of the values of one trial over its pieces, where there are `trials` trials."""
    return np.array([piece.sum() for piece in np.array_split(values, max(1, PIECES // trials)) if len(piece)])


def at_rest(parts: Sequence[Linearized]) -> list[Linearized]:
    """Return the trials of a fit with sensitivities made orthogonal to the residual as a whole.

    A slope at an optimum from which no step gains is roughness of the cost, as by friction that jumps. It carries no
    information on a parameter. Trials in which a parameter is not felt have no part in its slope.
    """
    power = np.array([float(p.residual @ p.residual) for p in parts])
    squares = np.array([np.sum(np.square(p.jacobian), axis=0) for p in parts])
    felt = squares >= UNFELT * squares.max(axis=0)
    along = sum(p.residual @ p.jacobian for p in parts) / np.maximum(power @ felt, 1e-300)
    each = zip(parts, felt, strict=True)
    return [replace(p, jacobian=p.jacobian - np.outer(p.residual, along * own)) for p, own in each]
