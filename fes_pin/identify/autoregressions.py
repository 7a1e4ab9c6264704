"""How what a filter leaves of readings foretells itself, found in its innovations: see `models.autoregression`.

Autocovariances of all trials together give the coefficients of every order (Yule and Walker), and the order whose
innovations are likeliest by what a parameter must earn. Such an autoregression is stationary, whatever the trials, and
`WHITE_SHARE` of white noise keeps it from becoming a resonator.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.linalg import solve_toeplitz

from fes_pin.identify.levels import PARAMETER_PRICE
from fes_pin.identify.noise import WHITE_SHARE
from fes_pin.models.foretold import ForetoldTrial

MOST = 8
"""Highest order. A sensor's noise is white beside a few coefficients; the tens that a random torque's would need
(`identify.noise.ORDERS`) stand for a random effort, which is known by itself here. They would learn a hum, too, whose
phase is each trial's own, before it is looked for; beside these few it is found (`tests/driven/test_stimulated.py`)."""


def autoregressions(run: Sequence[ForetoldTrial], orders: Mapping[str, Sequence[int]]) -> dict[str, tuple[float, ...]]:
    """That of each output that is measured in some trial, of one of its orders."""
    out = {}
    for name, own in orders.items():
        left = [_left(one, name) for one in run if name in one.outputs]
        if left:
            out[name] = _likeliest(left, [p for p in own if p <= min(MOST, min(map(len, left)) // 10)] or [0])
    return out


def with_autoregressions(one: ForetoldTrial, found: Mapping[str, tuple[float, ...]]) -> ForetoldTrial:
    """The trial with other autoregressions of its outputs."""
    return replace(one, ar=tuple(found.get(o, ()) for o in one.outputs))


def _left(one: ForetoldTrial, name: str) -> np.ndarray:
    """Innovations of an output over their deviations, shape (n,); 0 where none was seen."""
    k = one.outputs.index(name)
    with np.errstate(all="ignore"):
        return np.where(one.seen[:, k], one.values[:, k] / np.sqrt(one.variances[:, k]), 0.0)


def _likeliest(left: Sequence[np.ndarray], orders: Sequence[int]) -> tuple[float, ...]:
    """The autoregression of the order that costs least."""
    most, count = max(orders), sum(map(len, left))
    power = np.sum([[x[j:] @ x[: len(x) - j] for j in range(most + 1)] for x in left], axis=0)
    if not (np.isfinite(power).all() and power[0] > 0.0):
        return ()
    power[0] *= 1.0 + WHITE_SHARE
    best: tuple[float, ...] = ()
    least = math.inf
    for p in orders:
        ar = solve_toeplitz(power[:p], power[1 : p + 1]) if p else np.zeros(0)
        cost = count * math.log(1.0 - float(ar @ power[1 : p + 1]) / power[0]) + PARAMETER_PRICE * p
        if cost < least:
            best, least = tuple(float(a) for a in ar), cost
    return best
