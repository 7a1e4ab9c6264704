"""Autoregressive measurement noise: a model of standardised innovations x_t.

    x_t = a_1 x_(t-1) + ... + a_p x_(t-p) + e_t,    e_t of unit variance

Without process noise the filter is a free simulation, and x is the measurement noise itself. With process noise, x is
white if the measurement noise is.

The first samples, which have fewer before them, are predicted by the best predictors of lower orders k, with errors of
variances v_k (Levinson's recursion backwards, c the last coefficient of each):

    a_i <- (a_i + c a_(k-i)) / (1 - c^2),    v <- v / (1 - c^2)

Source: Ljung, System Identification, 2nd ed., sections 3.2 and 10.1.
"""

import math
from functools import cache

import numpy as np

REACH = 400
"""Samples ahead beyond which past noise predicts nothing: the noise of a sensor is correlated over tens of samples."""


def innovations_of(x: np.ndarray, ar: tuple[float, ...]) -> np.ndarray:
    """Return innovations of autoregressive noise, or their sensitivities from those of the noise: (n,) or (n, k)."""
    if x.ndim == 1:
        out = np.convolve(x, [1.0, *(-a for a in ar)])[: len(x)]
    else:
        out = x.copy()
        for i, a in enumerate(ar, 1):
            out[i:] -= a * x[:-i]
    first = _first(ar)[: len(x), : len(x)]
    out[: len(first)] = first @ x[: len(first)]
    return out


@cache
def _first(ar: tuple[float, ...]) -> np.ndarray:
    """Return the map from the first samples to their innovations, shape (p, p): row t is a predictor of order t."""
    predictors, variances = beginning(ar)
    out = np.eye(len(ar))
    for t, own in enumerate(predictors):
        out[t, :t] = -own[::-1]
    return out / np.sqrt(variances)[:, None]


@cache
def beginning(ar: tuple[float, ...]) -> tuple[tuple[np.ndarray, ...], np.ndarray]:
    """Return the best predictors of each of the first samples from those before, and the variances of their errors.

    Returns
    -------
    predictors
        Predictors of orders 0, 1, ... below that of the autoregression.
    variances
        Shape (p,).
    """
    now, variance = np.array(ar), 1.0
    predictors, variances = [], np.ones(len(ar))
    for k in reversed(range(len(ar))):
        left = 1.0 - now[k] ** 2
        if not left > 0.0:  # noise that is not stationary: nothing predicts its first samples
            variance, now = math.inf, np.zeros(k)
        else:
            variance, now = variance / left, (now[:k] + now[k] * now[:k][::-1]) / left
        predictors.append(now)
        variances[k] = variance
    return tuple(reversed(predictors)), variances


def stationary_variance(ar: tuple[float, ...]) -> float:
    """Return the stationary variance of noise whose innovations have unit variance."""
    return float(beginning(ar)[1][0]) if ar else 1.0


def weights_ahead(ar: tuple[float, ...], count: int) -> np.ndarray:
    """Return weights of past samples, the newest first, in predictions of the next `count` samples, shape (count, p).

    Row k is the first row of the companion matrix to the power of k + 1.
    """
    rows = np.zeros((count, len(ar)))
    row = np.array(ar)
    for k in range(count if ar else 0):
        rows[k] = row
        row = row[0] * np.array(ar) + np.append(row[1:], 0.0)
    return rows


@cache
def _ahead(ar: tuple[float, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Return `weights_ahead`, and the variance of the errors, shape (`REACH`,)."""
    rows = weights_ahead(ar, REACH)
    return rows, np.cumsum(np.append(1.0, rows[:-1, 0] if ar else np.zeros(REACH - 1)) ** 2)


def noise_ahead(x: np.ndarray, seen: np.ndarray, ar: tuple[float, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Return the prediction of noise from its measured past, and the variance of its error, shape (n,) each.

    Parameters
    ----------
    x
        The noise, shape (n,); arbitrary where it was not measured.
    seen
        Whether it was measured, shape (n,).
    """
    order, (rows, growth) = len(ar), _ahead(ar)
    known = np.append(np.zeros(order), np.where(seen, x, 0.0))  # samples before the trial are unknown
    ends = np.flatnonzero(np.diff(np.concatenate([[True], seen, [True]]).astype(int)))
    for begin, end in ends.reshape(-1, 2):
        count = min(end - begin, REACH)
        known[order + begin : order + begin + count] = rows[:count] @ known[begin : begin + order][::-1]
    predicted = np.convolve(known, [0.0, *ar])[order : order + len(x)]
    at = np.arange(len(x))
    newest = np.maximum.accumulate(np.append(-1, np.where(seen, at, -1)))[:-1]
    variances = growth[np.minimum(at - newest - 1, REACH - 1)]
    predictors, first = beginning(ar)
    for t in range(min(order, len(x))):
        predicted[t] = predictors[t] @ known[order : order + t][::-1]
        variances[t] = max(variances[t], first[t])
    return predicted, variances
