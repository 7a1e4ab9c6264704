"""Measurement noise in what a filter leaves of readings: its autoregression and its variance; `models.autoregression`.

All trials together give the coefficients of every order (`infer.noise.likeliest_autoregression`), without any share
that is taken for white: coefficients that took 0.3 % of the noise for white left 2 to 9 % more of noise that lasts than
need be, and a random effort that nothing exerted made up for it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from fes_pin.infer.noise import SAMPLES_EACH, likeliest_autoregression
from fes_pin.models.predictions import PredictedTrial

MOST = 8
"""Highest order. A sensor's noise is white beside a few coefficients; the tens that a random torque's would need
(`infer.noise.ORDERS`) stand for a random effort, which is known by itself here. They would learn a hum, too, whose
phase is each trial's own, before it is looked for; beside these few it is found (`tests/driven/test_stimulated.py`)."""


def autoregressions(run: Sequence[PredictedTrial], orders: Mapping[str, Sequence[int]]) -> dict[str, tuple[float, ...]]:
    """That of each output that is measured in some trial, of one of its orders."""
    out = {}
    for name, own in orders.items():
        left = [_left(one, name) for one in run if name in one.outputs]
        if left:
            most = min(MOST, min(map(len, left)) // SAMPLES_EACH)
            out[name] = likeliest_autoregression(left, [p for p in own if p <= most] or [0])
    return out


def residual_powers(run: Sequence[PredictedTrial]) -> dict[str, float]:
    """By output, the factor on the variance of its noise that makes what is left of it likeliest.

    A count that was read n times in a row is one reading: its errors count as one.
    """
    out = {}
    for name in dict.fromkeys(n for one in run for n in one.outputs):
        squares = count = 0.0
        for one in run:
            if name in one.outputs:
                own = one.of_seen(np.broadcast_to(np.array(one.outputs) == name, one.seen.shape))
                squares += float(np.sum(one.whitened[0][own] ** 2))
                count += float(np.sum(1.0 - one.readings.again[own]))
        if 0.0 < squares < math.inf:
            out[name] = squares / count
    return out


def _left(one: PredictedTrial, name: str) -> np.ndarray:
    """Innovations of an output over their deviations, shape (n,); 0 where none was seen."""
    k = one.outputs.index(name)
    with np.errstate(all="ignore"):
        return np.where(one.seen[:, k], one.values[:, k] / np.sqrt(one.variances[:, k]), 0.0)
