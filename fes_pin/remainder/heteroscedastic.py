"""Test for heteroscedastic residuals: those of a sensor are not larger while the muscle is active."""

from collections.abc import Sequence

import numpy as np

from fes_pin.infer.distributions import f_tail
from fes_pin.remainder.innovations import autocorrelation, convolved, normal_scores

SCALES_S = (0.0, 0.08, 0.3, 1.0)
"""Lengths over which the innovations are averaged, s; 0 averages nothing."""
FEWEST = 4
"""Least number of such lengths in a trial."""


def heteroscedastic_p_value(innovations: Sequence[np.ndarray], driver: Sequence[np.ndarray], dt: float) -> float:
    """Return the p-value of the null that the innovations are no larger where a driver is large than where it is small.

    With z the innovations and d the driver averaged over a length, d from 0 to 1, the ratio of the means of z^2 with
    the weights w = d^2 and w = (1 - d)^2 is compared with Fisher's F, each mean with
    (sum_t w_t)^2 / sum_st w_s w_t rho_(s-t)^2 degrees (Satterthwaite), rho the autocorrelation of z. The innovations
    are taken by rank, as for bursts. The smallest p-value is corrected for the number of lengths.

    Parameters
    ----------
    innovations
        One array for each trial.
    driver
        Arrays of the same shapes, on which the size of the innovations may depend.
    dt
        Time step, s.
    """
    scores = normal_scores(innovations)
    found = [p for s in SCALES_S if (p := _one(scores, driver, max(1, round(s / dt)))) is not None]
    return min([1.0, *(len(found) * p for p in found)])


def _one(scores: Sequence[np.ndarray], driver: Sequence[np.ndarray], count: int) -> float | None:
    window = np.ones(count) / count
    pairs = [(e, d) for e, d in zip(scores, driver, strict=True) if len(e) >= FEWEST * count]
    if not pairs:
        return None
    z, x = ([np.convolve(one[k], window, "valid") for one in pairs] for k in (0, 1))
    low, high = min(d.min() for d in x), max(d.max() for d in x)
    if not high > low:
        return None
    share, alike = [(d - low) / (high - low) for d in x], autocorrelation(z) ** 2
    large, many = _mean_square(z, [d**2 for d in share], alike)
    small, few = _mean_square(z, [(1.0 - d) ** 2 for d in share], alike)
    return f_tail(large / small, many, few)


def _mean_square(z: Sequence[np.ndarray], weights: Sequence[np.ndarray], alike: np.ndarray) -> tuple[float, float]:
    """Return the weighted mean square and its degrees of freedom."""
    whole = sum(float(w.sum()) for w in weights)
    total = sum(float(w @ v**2) for v, w in zip(z, weights, strict=True))
    pairs = sum(float(w @ convolved(w, alike)) for w in weights)
    return total / whole, whole**2 / pairs
