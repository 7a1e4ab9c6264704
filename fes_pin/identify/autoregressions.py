"""Autoregression and variance of measurement noise from the innovations of a filter; see `models.autoregression`.

All trials together give the coefficients of every order (`infer.noise.likeliest_autoregression`). No white share is
assumed: with a white share of 0.3 % the innovations of coloured noise were 2 to 9 % larger, and the fit made up for
that by process noise that did not exist.
"""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from fes_pin.infer.noise import SAMPLES_EACH, likeliest_autoregression
from fes_pin.models.predictions import PredictedTrial

MOST = 8
"""Highest order. A few coefficients whiten the noise of a sensor. Tens of coefficients (`infer.noise.ORDERS`) would
also model process noise, which is a part of the model here, and a hum with a phase of each trial's own, which is a
cause of the library and is found with these few (`tests/driven/test_stimulated.py`)."""


def autoregressions(run: Sequence[PredictedTrial], orders: Mapping[str, Sequence[int]]) -> dict[str, tuple[float, ...]]:
    """Return the likeliest autoregression of each measured output, of one of its orders."""
    out = {}
    for name, own in orders.items():
        with np.errstate(all="ignore"):
            left = [one.standardised(one.values)[:, one.outputs.index(name)] for one in run if name in one.outputs]
        if left:
            most = min(MOST, min(map(len, left)) // SAMPLES_EACH)
            out[name], _ = likeliest_autoregression(left, [p for p in own if p <= most] or [0])
    return out


def residual_powers(run: Sequence[PredictedTrial]) -> dict[str, float]:
    """Return, by output, the factor on the variance of its noise that maximises the likelihood of its innovations.

    A count that was read n times in a row is one reading, with one error.
    """
    out = {}
    for name in dict.fromkeys(n for one in run for n in one.outputs):
        squares = count = 0.0
        for one in run:
            if name in one.outputs:
                own = one.of_seen(np.broadcast_to(np.array(one.outputs) == name, one.seen.shape))
                squares += float(np.sum(one.whitened[own] ** 2))
                count += float(np.sum(1.0 - one.readings.again[own]))
        if 0.0 < squares < math.inf:
            out[name] = squares / count
    return out
