"""How much more the scores of pieces of the data scatter than a right model's would: errors of form are no white noise.

Where a model is right, twice the gain in log-likelihood of k more parameters is a chi-square of k degrees of freedom.
Where it is not, it is a sum of k of one degree each, times the eigenvalues of V C^-1, with C what the information says
of the parameters' covariance and V how they scatter (`covariance.widened`). Gains are divided by their mean, if that is
above 1.

Source: Kent, Robust properties of likelihood ratio tests, Biometrika 69 (1982); Satorra and Bentler, A scaled
difference chi-square test statistic for moment structure analysis, Psychometrika 66 (2001).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np

from fes_pin.infer.covariance import covariance_of, scattered, widened
from fes_pin.infer.distributions import chi2_quantile, normal_quantile
from fes_pin.infer.levels import CLAIM_LEVEL, SEPARABLE, SURE, UNUSUAL_LEVEL
from fes_pin.infer.optimum import Optimum
from fes_pin.infer.problem import Linearized, normal_equations
from fes_pin.infer.projection import without_locals

F = TypeVar("F", bound=Optimum)

PIECES = 40
"""Pieces of the data by whose scores a model's errors of form show: as many as tell a deviation within a tenth, and so
as long as they can be."""


def with_honest_intervals(fitted: F) -> F:
    """The fit with intervals as wide as the scores of its trials, cut into `PIECES` pieces, scatter."""
    return replace(fitted, covariance=widened(*_information_and_scores(fitted)))


def as_wide_as_trials_differ(fitted: F, again: Sequence[Optimum]) -> F:
    """The fit with intervals of parameters that trials differ in by more than each is sure of as wide as they differ.

    Of fits without one of k parts of the trials each, the jackknife's variance is

        (k - 1) / k sum (p_i - mean p)^2

    which over that of the fit is a chi-square over its k - 1 degrees of freedom where it is sure as it says; it counts
    where that is unusual.

    Source: Miller, The jackknife - a review, Biometrika 61 (1974); of intervals that are widened as measurements
    differ, Birge, The calculation of errors by the method of least squares, Physical Review 40 (1932).

    Parameters
    ----------
    again
        Fits of the same model without one part of the trials each; of fewer than two nothing follows.
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


def as_wide_as_estimates_differ(fitted: F, other: Optimum) -> F:
    """The fit with intervals that hold another estimate of the same parameters where chance does not set both apart.

    Both estimate the same where the model is right, and the other no better: their difference varies by less than that
    does. Where it is unusually large, the model is not right, by about as much as both are apart; either may be off
    by that.

    Source: Hausman, Specification tests in econometrics, Econometrica 46 (1978).

    Parameters
    ----------
    other
        A fit of the same causes to the same trials by what is not the likeliest.
    """
    known = dict(zip(other.free, np.diag(with_honest_intervals(other).covariance), strict=True))
    varies = np.array([known.get(n, np.inf) for n in fitted.free])
    apart = np.array([other.values[n] - fitted.values[n] for n in fitted.free])
    with np.errstate(all="ignore"):
        ratio = np.where(np.isfinite(varies) & (varies > 0.0), apart**2 / varies, 0.0)
    apart = np.where(ratio > chi2_quantile(1.0 - UNUSUAL_LEVEL, 1), apart, 0.0)
    return replace(fitted, covariance=fitted.covariance + np.outer(apart, apart))


def excess_scatter(larger: Optimum, smaller: Optimum) -> float:
    """How many times wider than of a right model that is scattered what a larger fit has besides; at least 1."""
    more = [k for k, n in enumerate(larger.free) if n not in smaller.free]
    if not more:
        return 1.0
    covariance, scores = _information_and_scores(larger)
    more = [k for k in more if np.isfinite(covariance[k, k]) and covariance[k, k] > 0.0]
    if not more or len(scores) < 2:
        return 1.0
    own, wide = (c[np.ix_(more, more)] for c in (covariance, scattered(covariance, scores)))
    return max(1.0, float(np.trace(np.linalg.pinv(own, hermitian=True) @ wide)) / len(more))


def least_apart(likelier: Optimum, other: Optimum) -> float:
    """Twice the log-likelihood by which a fit must be likelier than another of the same trials to be distinguished.

    With Delta the difference of their whitened residuals, what the right one of two is likelier by, in twice the
    log-likelihood, has the mean |Delta|^2 and scatters by 2 |Delta|, or as pieces of the data show where that is more.
    The wrong one is likelier by `SEPARABLE` in no more than 5 % of cases, however far apart they are. Where one is
    likelier by less than it must be if it were right, at `CLAIM_LEVEL`, neither is right, and the nearer one is
    distinguished where the pieces agree on it.

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
    """The inverse information of a fit that has ended, and the slopes of the log-likelihood of its pieces."""
    parts, free = at_rest(fitted.parts), np.array([n not in fitted.at_bound for n in fitted.free])
    return covariance_of(normal_equations(parts).hessian, free), scores_of(parts)


def scores_of(parts: Sequence[Linearized]) -> np.ndarray:
    """The slopes of the log-likelihood of `PIECES` pieces of some trials, shape (pieces, parameters).

    What is each trial's own goes with the parameters.
    """
    lengths = [len(p.residual) for p in parts]
    shares = [min(n, max(1, round(PIECES * n / sum(lengths)))) for n in lengths]
    pieces = [
        piece
        for part, count in zip(parts, shares, strict=True)
        for piece in np.add.reduceat(
            without_locals(part, part.jacobian) * part.residual[:, None], _beginnings(part, count)
        )
    ]
    return np.array(pieces)


def _beginnings(part: Linearized, count: int) -> np.ndarray:
    """Where pieces of a trial begin, shape (count,)."""
    return np.linspace(0, len(part.residual), count, endpoint=False, dtype=int)


def in_pieces(values: np.ndarray, trials: int) -> np.ndarray:
    """Sums of the values of one trial of so many over its pieces."""
    return np.array([piece.sum() for piece in np.array_split(values, max(1, PIECES // trials)) if len(piece)])


def at_rest(parts: Sequence[Linearized]) -> list[Linearized]:
    """The trials of a fit that has ended, without what its sensitivities have along the residual as a whole.

    A slope at an end from which no step gains is roughness of the cost, as of friction that jumps: it says nothing of a
    parameter.
    """
    power = sum(float(p.residual @ p.residual) for p in parts)
    along = sum(p.residual @ p.jacobian for p in parts) / max(power, 1e-300)
    return [replace(p, jacobian=p.jacobian - np.outer(p.residual, along)) for p in parts]
