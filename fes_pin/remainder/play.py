"""Test for play in a sensor: a reading that depends on the side from which it was reached."""

import numpy as np

from fes_pin.identify.fit import Fit
from fes_pin.infer.distributions import f_tail
from fes_pin.infer.levels import IDENTIFIABLE_SHARE, UNFELT
from fes_pin.infer.projection import Projection
from fes_pin.models.simulate import Simulator
from fes_pin.remainder.innovations import Innovations, channels

WIDTHS = (0.003, 0.01, 0.03, 0.1)
"""Half widths of the play that are tried, as shares of the largest range of a trial's reading. Below the smallest, only
the direction of the last motion counts."""
UNITS = 32
"""Least number of pieces of trials from which the spread of the evidence is estimated."""


def play_p_value(fitted: Fit, projection: Projection) -> float:
    """Return the p-value of readings without a lag where the motion reverses; corrected for widths and channels.

    The deviation that a play of half width w makes in the simulated reading y, p_t - y_t with
    p_t = min(max(p_(t-1), y_t - w), y_t + w), is whitened as the residual is, and the fitted parameters are projected
    off. With c_i and r_i its part and the residual's in one piece of a trial, x_i = c_i' r_i, n_i = c_i' c_i and
    a = sum x / sum n, the gain (sum x)^2 / sum n is compared with the spread between pieces,
    sum (x_i - a n_i)^2 / n_i / k, by Fisher's F of 1 and k degrees: noise that is not quite whitened, or another
    deviation, enters both. With b_i the orthonormal vectors of the projection, cut to the piece,
    k = sum (1 - |b_i' c_i|^2 / n_i) - 1 is the expectation of the spread for white noise. It is less than the number of
    pieces less one, since the projection removes a part of each piece.

    Source of the operator: Krasnosel'skii and Pokrovskii, Systems with Hysteresis, Springer 1989.
    """
    simulated = Simulator(fitted.model, fitted.trials).run(fitted.values, fitted.unknowns)
    found: list[float] = []
    for group in channels(fitted):
        readings = [simulated[s.number].readings[:, s.output] for s in group]
        columns = np.zeros((len(projection.residual), len(WIDTHS)))
        for one, deviation in zip(group, _deviations(readings), strict=True):
            columns[one.rows] = one.whitened(deviation)
        left = projection(columns)
        felt = np.linalg.norm(left, axis=0) > IDENTIFIABLE_SHARE * np.linalg.norm(columns, axis=0)
        found += [_one(c, projection, group) for c in left.T[felt]]
    return min([1.0, *(len(found) * p for p in found)])


def _deviations(readings: list[np.ndarray]) -> list[np.ndarray]:
    """Return the deviation of each trial's reading by a play of each width, in half widths, shapes (n, widths)."""
    half = max(float(np.ptp(y)) for y in readings) * np.array(WIDTHS)
    if not half[0] > 0:
        return [np.zeros((len(y), len(WIDTHS))) for y in readings]
    longest = max(map(len, readings))
    y = np.stack([np.pad(one, (0, longest - len(one)), mode="edge") for one in readings], axis=1)[:, :, None]
    low, high, out = y - half, y + half, np.empty((longest, len(readings), len(WIDTHS)))
    follower = np.repeat(y[0], len(WIDTHS), axis=1)
    for t in range(longest):
        follower = np.minimum(np.maximum(follower, low[t]), high[t])
        out[t] = follower
    out = (out - y) / half
    return [out[: len(one), k] for k, one in enumerate(readings)]


def _one(column: np.ndarray, projection: Projection, group: list[Innovations]) -> float:
    """Return the p-value of one width in one channel."""
    units, count = [], -(-UNITS // len(group))
    for rows in (piece for s in group for piece in np.array_split(s.rows, count)):
        c = column[rows]
        taken = sum(float(np.sum((b.T @ c) ** 2)) for b in projection.taken(rows))
        units.append((float(c @ projection.residual[rows]), float(c @ c), taken))
    x, n, taken = np.array(units).T
    felt = n > UNFELT * n.max()
    x, n, taken = x[felt], n[felt], taken[felt]
    degrees = float(np.sum(1.0 - taken / n)) - 1.0
    if degrees < 1.0:
        return 1.0
    amplitude = x.sum() / n.sum()
    spread = float(np.sum((x - amplitude * n) ** 2 / n)) / degrees
    return f_tail(float(amplitude * x.sum()) / max(spread, 1e-12), 1, degrees)
