"""How what a filter leaves of readings foretells itself, found in its innovations: see `models.autoregression`.

All trials together give the coefficients of every order by Burg's method, and the order whose innovations are likeliest
by what a parameter must earn. Such an autoregression is stationary, whatever the trials. It is nothing but the
likeliest: coefficients that took 0.3 % of the noise for white left 2 to 9 % more of noise that lasts than need be, and
a random effort that nothing exerted made up for it.

Source: Burg, Maximum entropy spectral analysis, PhD thesis, Stanford 1975; Brockwell and Davis, Time Series: Theory and
Methods, 2nd ed., section 8.2.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from fes_pin.infer.levels import PARAMETER_PRICE
from fes_pin.infer.noise import SAMPLES_EACH
from fes_pin.models.foretold import ForetoldTrial

MOST = 8
"""Highest order. A sensor's noise is white beside a few coefficients; the tens that a random torque's would need
(`infer.noise.ORDERS`) stand for a random effort, which is known by itself here. They would learn a hum, too, whose
phase is each trial's own, before it is looked for; beside these few it is found (`tests/driven/test_stimulated.py`)."""


def autoregressions(run: Sequence[ForetoldTrial], orders: Mapping[str, Sequence[int]]) -> dict[str, tuple[float, ...]]:
    """That of each output that is measured in some trial, of one of its orders."""
    out = {}
    for name, own in orders.items():
        left = [_left(one, name) for one in run if name in one.outputs]
        if left:
            out[name] = _likeliest(left, [p for p in own if p <= min(MOST, min(map(len, left)) // SAMPLES_EACH)] or [0])
    return out


def residual_powers(run: Sequence[ForetoldTrial]) -> dict[str, float]:
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
    count, least = sum(map(len, left)), math.inf
    best: tuple[float, ...] = ()
    for p, (ar, power) in enumerate(_burg(left, max(orders))):
        cost = count * math.log(power) + PARAMETER_PRICE * p
        if p in orders and cost < least:
            best, least = ar, cost
    return best


def _burg(left: Sequence[np.ndarray], most: int) -> Iterator[tuple[tuple[float, ...], float]]:
    """Autoregressions of every order up to the highest, and the power of what each leaves.

    With f what an order leaves forwards and b backwards, the next has the last coefficient
    2 sum f_t b_(t-1) / sum (f_t^2 + b_(t-1)^2), over all trials.
    """
    ar, power = np.zeros(0), float(np.sum([x @ x for x in left])) / max(sum(map(len, left)), 1)
    ahead, back = list(left), list(left)
    while math.isfinite(power) and power > 0.0:
        yield tuple(float(a) for a in ar), power
        if len(ar) == most:
            return
        ahead, back = [f[1:] for f in ahead], [b[:-1] for b in back]
        both = sum(float(f @ f + b @ b) for f, b in zip(ahead, back, strict=True))
        last = 2.0 * sum(float(f @ b) for f, b in zip(ahead, back, strict=True)) / max(both, 1e-300)
        ahead, back = (
            [f - last * b for f, b in zip(ahead, back, strict=True)],
            [b - last * f for f, b in zip(ahead, back, strict=True)],
        )
        ar, power = np.append(ar - last * ar[::-1], last), power * (1.0 - last**2)
