"""What is claimed of a change: against the noise, against the spread between trials, over the whole library."""

from __future__ import annotations

import numpy as np

from fes_pin.contrast.fits import Fits
from fes_pin.contrast.grouped import Grouped
from fes_pin.diagnose.decide.significance import Family, coherence_p_value
from fes_pin.identify.distributions import f_tail

LEVEL = 0.01
"""Family-wise error of each round of claims."""
FEWEST_TRIALS = 6
"""Trials that alone show how much repeats differ; of fewer each is cut into pieces, as a diagnosis does."""
UNFELT = 1e-4
"""Share of the largest part that a trial must have in a change to say something of its spread."""


def p_value(fits: Fits, family: Family, larger: Grouped, smaller: Grouped) -> float:
    """Family-wise p-value of what a set has more than another: the larger of that against the noise and of that against
    the spread between trials. A repeat that differs by more than its noise is no change.
    """
    degrees = max(len(larger.fit.free) - len(smaller.fit.free), 1)
    noise = family.p_value(smaller.fit.sse - larger.fit.sse, degrees)
    if not noise < LEVEL:
        return noise
    return max(noise, family.adjusted(between_trials(larger, fits.weighed_as(smaller, larger), degrees)))


def noise_p_value(family: Family, larger: Grouped, smaller: Grouped) -> float:
    """Family-wise p-value against the noise alone: of a cause of all groups, which claims no change."""
    return family.p_value(smaller.fit.sse - larger.fit.sse, max(len(larger.fit.free) - len(smaller.fit.free), 1))


def between_trials(larger: Grouped, smaller: Grouped, degrees: int) -> float:
    """p-value of a gain against its spread between trials.

    x_i is what the larger set adds to trial i, r_i what it leaves there; x_i' r_i / |x_i| has a variance phi, 1 where
    repeats differ by their noise alone. gain / (degrees phi) is compared with Fisher's F(degrees, n - 2): the mean
    over all trials and that of one group are fitted.
    """
    if len(larger.fit.parts) < FEWEST_TRIALS:
        return coherence_p_value(smaller.fit, larger.fit, degrees)
    phi, free = inflation(larger, smaller)
    gain = smaller.fit.sse - larger.fit.sse
    if free < 1 or gain <= 0.0:
        return 1.0
    return float(f_tail(gain / (degrees * max(phi, 1e-12)), degrees, free))


def inflation(larger: Grouped, smaller: Grouped) -> tuple[float, int]:
    """phi of `between_trials` and its degrees of freedom."""
    pairs = [
        (few.residual - many.residual, many.residual)
        for few, many in zip(smaller.fit.parts, larger.fit.parts, strict=True)
    ]
    sizes = np.array([float(x @ x) for x, _ in pairs])
    along = np.array([float(x @ r) for x, r in pairs])
    felt = sizes > UNFELT * max(float(sizes.max()), 1e-300)
    free = int(felt.sum()) - 1 - max(1, len(larger.changes))
    if free < 1:
        return 1.0, free
    return float(np.sum(along[felt] ** 2 / sizes[felt])) / free, free
