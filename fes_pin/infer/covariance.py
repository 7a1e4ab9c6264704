"""Covariance of fitted parameters, and the gain of a further step, from the second derivatives of a fit."""

from collections.abc import Sequence

import numpy as np

from fes_pin.infer.problem import NormalEquations

LOST = 1e-3
"""Component of a parameter in a direction that is not identified above which the parameter is not identified either."""
UNIDENTIFIED = 1e-10
"""Eigenvalue of the scaled information matrix, relative to the largest, below which a direction is not identified."""


def covariance_of(hessian: np.ndarray, free: np.ndarray) -> np.ndarray:
    """Return the inverse information of the free parameters; infinite where not identified, 0 at a bound."""
    if not np.isfinite(hessian).all():
        return np.full_like(hessian, np.inf)
    out = np.zeros_like(hessian)
    free = np.asarray(free, dtype=bool)  # an empty mask has no kind of its own
    inner = hessian[np.ix_(free, free)]
    diagonal = np.diag(inner).copy()
    seen = diagonal > np.finfo(float).tiny  # below it a variance is not finite
    scale = np.sqrt(np.where(seen, diagonal, 1.0))
    values, vectors = np.linalg.eigh(inner / np.outer(scale, scale) + np.diag(np.where(seen, 0.0, 1.0)))
    weak = values <= UNIDENTIFIED * max(values.max(initial=0.0), 1e-300)
    inverse = np.where(weak, 0.0, 1.0 / np.where(weak, 1.0, values))
    covariance = (vectors * inverse) @ vectors.T / np.outer(scale, scale)
    lost = ~seen | (np.abs(vectors[:, weak]) > LOST).any(axis=1)
    covariance[np.diag_indices_from(covariance)] = np.where(lost, np.inf, np.diag(covariance))
    out[np.ix_(free, free)] = covariance
    return out


def single_gain(hessian: np.ndarray, gradient: np.ndarray, free: np.ndarray) -> float:
    """Return the largest predicted gain in twice the log-likelihood of a step of one free parameter alone."""
    diagonal = np.diag(hessian)
    good = free & (diagonal > 0) & np.isfinite(gradient)
    return float(np.max(gradient[good] ** 2 / diagonal[good], initial=0.0))


def step_gain(system: NormalEquations, free: Sequence[bool]) -> float:
    """Return the predicted gain in twice the log-likelihood of a Gauss-Newton step of all free parameters."""
    moving = np.flatnonzero(free)
    slope, curvature = system.gradient[moving], system.hessian[np.ix_(moving, moving)]
    if not (np.isfinite(slope).all() and np.isfinite(curvature).all()):
        return 0.0
    return float(slope @ least_squares_step(curvature, slope, rcond=1e-12))


def least_squares_step(hessian: np.ndarray, gradient: np.ndarray, rcond: float = 1e-10) -> np.ndarray:
    """Return the shortest x, in parameters scaled by their information, that maximises 2 gradient' x - x' hessian x.

    Parameters
    ----------
    hessian, gradient
        Shape (n, n) and (n,).
    rcond
        Eigenvalues below this share of the largest count as zero.
    """
    scale = 1.0 / np.sqrt(np.maximum(np.diag(hessian), 1e-300))
    return np.asarray(scale * np.linalg.lstsq(hessian * np.outer(scale, scale), gradient * scale, rcond=rcond)[0])


def moved_with(covariance: np.ndarray, at: list[int], change: np.ndarray) -> np.ndarray:
    """Return the change of all parameters where some are moved: the conditional mean of a Gaussian.

    Parameters
    ----------
    covariance
        Shape (n, n).
    at
        Places of the moved parameters.
    change
        Their changes, shape (len(at),).

    Returns
    -------
    numpy.ndarray
        Shape (n,); `change` alone where the covariance is not finite.
    """
    out, moved = np.zeros(len(covariance)), covariance[:, at]
    known = np.isfinite(np.diag(covariance))
    if known[at].all():
        out[known] = moved[known] @ np.linalg.pinv(moved[at]) @ change
    out[at] = change
    return out


def widened(covariance: np.ndarray, scores: np.ndarray) -> np.ndarray:
    """Return the covariance of a fit, widened to that of the sandwich estimator where this is larger.

    With C the inverse information and g_k the slopes of the log-likelihood of m pieces of the data, C has the variances
    of a right model. Those of a wrong model are in the sandwich

        C (m / (m - 1) sum g_k g_k') C

    The larger variances are returned with the correlations of C.

    Source: White, Maximum likelihood estimation of misspecified models, Econometrica 50 (1982); by pieces of a record,
    Newey and West, A simple, positive semi-definite, heteroskedasticity and autocorrelation consistent covariance
    matrix, Econometrica 55 (1987).

    Parameters
    ----------
    covariance
        Shape (n, n).
    scores
        Shape (m, n), m at least 2; a single piece does not scatter.
    """
    if len(scores) < 2:
        return covariance
    known = np.isfinite(np.diag(covariance)) & (np.diag(covariance) > 0.0)
    wider = np.ones(len(covariance))
    wider[known] = np.sqrt(np.maximum(1.0, np.diag(scattered(covariance, scores))[known] / np.diag(covariance)[known]))
    return covariance * np.outer(wider, wider)


def scattered(covariance: np.ndarray, scores: np.ndarray) -> np.ndarray:
    """Return the sandwich of `widened`, shape (n, n); 0 for parameters that are not identified or do not move.

    Parameters
    ----------
    covariance
        Inverse information, shape (n, n).
    scores
        Scores of at least two pieces, shape (m, n).
    """
    known, pieces = np.isfinite(np.diag(covariance)) & (np.diag(covariance) > 0.0), len(scores)
    spread = scores[:, known] @ covariance[np.ix_(known, known)]
    out = np.zeros_like(covariance)
    out[np.ix_(known, known)] = pieces / (pieces - 1.0) * spread.T @ spread
    return out
