"""Measurement noise: autoregressive, one model for each measured channel."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg

from fes_pin.infer.levels import PARAMETER_PENALTY, WHITE_SHARE

ORDERS = (0, 1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48)
"""Orders tried. Sensor noise is whitened by a few; random torque under white sensor noise is slow and needs 24 to 48:
on the ankle, order 12 leaves 2.2 times too much power below 0.5 Hz, order 24 none; a test would take it for a cause."""

SAMPLES_EACH = 10
"""Least number of samples of the shortest trial for each coefficient (Box and Jenkins)."""


@dataclass(frozen=True)
class Noise:
    """Autoregressive noise e_t = ar_1 e_(t-1) + ... + ar_p e_(t-p) + innovation, Gaussian.

    Attributes
    ----------
    innovation_std
        Standard deviation of the innovation, unit of the channel.
    ar
        Coefficients, shape (p,).
    std
        Standard deviation of the noise of a single sample.
    step_s
        Time step of the coefficients, s: trials sampled faster are averaged to it. With 0 samples are not averaged.
    """

    innovation_std: float
    ar: tuple[float, ...] = ()
    std: float = 0.0
    step_s: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "ar", tuple(self.ar))


def estimate_noise(
    residuals: Sequence[np.ndarray],
    used: int = 0,
    std: float | None = None,
    step_s: float = 0.0,
    longest: int = ORDERS[-1],
    least: int = 0,
) -> Noise:
    """Fit autoregressive noise to the residuals of one channel; see `likeliest_autoregression`.

    Parameters
    ----------
    residuals
        One array of shape (n,) for each trial.
    used
        Degrees of freedom of the fit whose residuals these are.
    std
        Standard deviation of single samples, where the residuals are averages.
    step_s
        Time step of the residuals, if they are averages.
    longest, least
        Highest and lowest order that is tried; the highest is limited by the length of the trials.

    Raises
    ------
    FloatingPointError
        For residuals whose squares are not finite.
    """
    shortest, total = min(map(len, residuals)), sum(map(len, residuals))
    own = math.sqrt(sum(float(r @ r) for r in residuals) / max(total - used, 1))
    if not math.isfinite(own):
        raise FloatingPointError("residuals whose squares are not finite")
    possible = [p for p in ORDERS if p <= min(longest, shortest // SAMPLES_EACH)]
    ar, power = likeliest_autoregression(residuals, [p for p in possible if p >= least] or possible[-1:], WHITE_SHARE)
    innovation = math.sqrt(power * total / max(total - len(ar) - used, 1))
    return Noise(max(innovation, 1e-12), ar, own if std is None else std, step_s)


FASTEST_S = 4e-3
"""Shortest time step at which noise is modelled, s: 250 Hz resolves the mains, and 48 coefficients span 0.2 s."""


def thinning(dt: float, step_s: float) -> int:
    """Return the number of samples that are averaged into one."""
    return max(1, round(step_s / dt)) if step_s > 0 else 1


def noise_step(steps: Sequence[float]) -> float:
    """Return the time step at which the noise of trials with these sample steps is modelled, s."""
    slowest = max(steps)
    return max(1, math.floor(FASTEST_S / slowest + 1e-6)) * slowest


def first_order_low_pass(values: np.ndarray, pole: float) -> np.ndarray:
    """Return the first-order low pass y_t = pole y_(t-1) + (1 - pole) x_t from rest, along an axis of shape (n,)."""
    bands = np.ones((2, len(values)))
    bands[1] = -pole
    return np.asarray(scipy.linalg.solve_banded((1, 0), bands, (1.0 - pole) * values))


def thin(values: np.ndarray, count: int) -> np.ndarray:
    """Return means of `count` successive samples along the first axis; an incomplete mean at the end is dropped."""
    if count == 1:
        return values
    end = len(values) // count * count
    total = values[0:end:count].copy()
    for k in range(1, count):
        total += values[k:end:count]
    return np.asarray(total / count)


def likeliest_autoregression(
    pieces: Sequence[np.ndarray], orders: Sequence[int], white: float = 0.0
) -> tuple[tuple[float, ...], float]:
    """Return the autoregression of several pieces by Burg's method, of lowest criterion, and its innovations' variance.

    Such an autoregression is always stationary.

    Source: Burg, Maximum entropy spectral analysis, PhD thesis, Stanford 1975; Brockwell and Davis, Time Series: Theory
    and Methods, 2nd ed., section 8.2.

    Parameters
    ----------
    pieces
        Each of shape (n,).
    orders
        Orders that are tried; the criterion has `PARAMETER_PENALTY` for each coefficient.
    white
        Share of the variance of the pieces by which white noise is assumed to add to it.
    """
    count, tried = sum(map(len, pieces)), enumerate(_burg(pieces, max(orders), white))
    costs = ((count * math.log(power) + PARAMETER_PENALTY * p, ar, power) for p, (ar, power) in tried if p in orders)
    _, ar, power = min(costs, key=lambda one: one[0], default=(0.0, (), 0.0))
    return ar, power


def _burg(pieces: Sequence[np.ndarray], most: int, white: float) -> Iterator[tuple[tuple[float, ...], float]]:
    """Yield autoregressions of every order up to the highest, and the power of the residual of each.

    With f the residual of an order forwards and b backwards, the next has the last coefficient
    2 sum f_t b_(t-1) / sum (f_t^2 + b_(t-1)^2), over all trials, and both sums with their expectations for the white
    noise that is assumed.
    """
    ar, power = np.zeros(0), float(np.sum([x @ x for x in pieces])) / max(sum(map(len, pieces)), 1)
    added, power = white * power, (1.0 + white) * power
    ahead, back = list(pieces), list(pieces)
    while math.isfinite(power) and power > 0.0:
        yield tuple(float(a) for a in ar), power
        if len(ar) == most:
            return
        ahead, back = [f[1:] for f in ahead], [b[:-1] for b in back]
        noise, pairs = added * sum(map(len, ahead)), list(zip(ahead, back, strict=True))
        both = sum(float(f @ f + b @ b) for f, b in pairs) + 2.0 * noise * (1.0 + float(ar @ ar))
        last = 2.0 * (sum(float(f @ b) for f, b in pairs) + noise * float(ar @ ar[::-1])) / max(both, 1e-300)
        ahead, back = [f - last * b for f, b in pairs], [b - last * f for f, b in pairs]
        ar, power = np.append(ar - last * ar[::-1], last), power * (1.0 - last**2)


NoiseModel = Mapping[str, Noise]
"""Noise by output column."""
