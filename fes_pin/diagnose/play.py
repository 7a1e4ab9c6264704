"""Play in a sensor: a reading that depends on the side from which it was reached."""

from __future__ import annotations

import numpy as np

from fes_pin.diagnose.innovations import Stretch, stretches
from fes_pin.diagnose.library import Projection
from fes_pin.identify.distributions import f_tail
from fes_pin.identify.fit import Fit
from fes_pin.models.simulate import Simulator

WIDTHS = (0.003, 0.01, 0.03, 0.1)
"""Half widths of the play that are tried, as shares of the largest range of a trial's reading. Below the least of them
only the direction of the last motion counts."""
UNITS = 32
"""Pieces of trials that the spread of the evidence is judged on, at least."""
FELT = 1e-3
"""Share of a deviation's norm that must be left beside what the fit takes up."""


def play_p_value(fitted: Fit, projection: Projection) -> float:
    """p-value of readings not lagging behind where the motion turns; corrected for widths and channels.

    The deviation that a play of half width w makes in the simulated reading y, p_t - y_t with
    p_t = min(max(p_(t-1), y_t - w), y_t + w), is whitened as the residual and freed of what the fit takes up. With c_i
    and r_i its part and the residual's in one piece of a trial, x_i = c_i' r_i, n_i = c_i' c_i and a = sum x / sum n,
    the gain (sum x)^2 / sum n is compared with the spread between U pieces, sum (x_i - a n_i)^2 / n_i / (U - 1), by
    Fisher's F of 1 and U - 1 degrees: noise that is not quite whitened, or another deviation, is in both.

    Source of the operator: Krasnosel'skii and Pokrovskii, Systems with Hysteresis, Springer 1989, section 2.
    """
    simulated = Simulator(fitted.model, fitted.trials).run(fitted.values, fitted.unknowns)
    groups: dict[str, list[Stretch]] = {}
    for one in stretches(fitted):
        groups.setdefault(one.channel, []).append(one)
    found: list[float] = []
    for group in groups.values():
        readings = [simulated[s.number].readings[:, s.output] for s in group]
        columns = np.zeros((len(projection.residual), len(WIDTHS)))
        for one, deviation in zip(group, _deviations(readings), strict=True):
            columns[one.rows] = one.noise.whiten(deviation, one.trial.dt)
        left = projection(columns)
        felt = np.linalg.norm(left, axis=0) > FELT * np.linalg.norm(columns, axis=0)
        found += [_one(c, projection.residual, group) for c in left.T[felt]]
    return min([1.0, *(len(found) * p for p in found)])


def _deviations(readings: list[np.ndarray]) -> list[np.ndarray]:
    """What a play of each width does to each trial's reading, in half widths, shapes (n, widths)."""
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


def _one(column: np.ndarray, residual: np.ndarray, group: list[Stretch]) -> float:
    """p-value of one width in one channel."""
    count = -(-UNITS // len(group))
    pieces = [
        (float(c @ r), float(c @ c))
        for one in group
        for c, r in zip(np.array_split(column[one.rows], count), np.array_split(residual[one.rows], count), strict=True)
    ]
    x, n = np.array(pieces).T
    felt = n > 1e-4 * n.max()
    x, n = x[felt], n[felt]
    if len(x) < 2:
        return 1.0
    amplitude = x.sum() / n.sum()
    spread = float(np.sum((x - amplitude * n) ** 2 / n)) / (len(x) - 1)
    return f_tail(float(amplitude * x.sum()) / max(spread, 1e-12), 1, len(x) - 1)
