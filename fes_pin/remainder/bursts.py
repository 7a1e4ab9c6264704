"""Test for bursts in the innovations: deviations at irregular times, as spasms or a slipping sensor."""

from collections.abc import Sequence

import numpy as np

from fes_pin.infer.distributions import pearson3_tail
from fes_pin.infer.noise import Noise
from fes_pin.remainder.innovations import autocorrelation, convolved, normal_scores

HUMPS_S = (0.06, 0.12, 0.25, 0.5, 1.0)
"""Lengths of a transient deviation, s: from a twitch to a slow pull."""
TORQUES_S = (0.05, 0.15, 0.4)
"""Lengths of a transient effort, s: the noise model has learned how the joint responds to it."""
STEPS_S = (0.25, 1.0)
"""Lengths over which the reading after a step is compared with the reading before it, s."""


def burst_p_value(innovations: Sequence[np.ndarray], noise: Noise, dt: float) -> float:
    """Return the p-value of the null that the innovations of one channel are as even in time as Gaussian noise.

    A hump or step of a given length in the reading has the whitened shape g in the innovations e. An effort to which
    the reading responds as it does to the noise has the shape g itself. With z_t = sum_s g_s e_(t+s) / |g|, Gaussian
    noise has excess kurtosis 0 in z, whatever its spectrum; deviations at irregular times raise it. The statistic
    sum_t H4(z_t), H4 the fourth Hermite polynomial, has under the null the variance 24 n sum_s rho_s^4 and the third
    cumulant 1728 n sum_st (rho_s rho_t rho_(s-t))^2, with rho the sample autocorrelation of z. The innovations need
    therefore not be white, and a low order of the noise model cannot learn the bursts. The tail is that of a gamma
    distribution of these moments. The smallest p-value of all shapes is corrected for their number.

    The innovations are replaced by van der Waerden's normal scores of their ranks. Independent innovations of any
    distribution, however heavy its tails, are then Gaussian, so that a few outliers are no burst.

    Parameters
    ----------
    innovations
        One array for each trial.
    noise
        The noise model that whitened them.
    dt
        Their time step, s.
    """
    scores = normal_scores(innovations)
    found = [p for g in _templates(noise, dt) if (p := _one(scores, g)) is not None]
    return min([1.0, *(len(found) * p for p in found)])


def _templates(noise: Noise, dt: float) -> list[np.ndarray]:
    """Return the shapes of deviations in the innovations, each of norm 1."""
    ar = np.r_[1.0, -np.array(noise.ar)]
    out = [np.convolve(_hump(length, dt), ar) for length in HUMPS_S]
    out += [_hump(length, dt) for length in TORQUES_S]
    for length in STEPS_S:
        step = np.repeat([-1.0, 1.0], max(2, round(length / dt)))
        out.append(np.convolve(step, ar)[len(noise.ar) : len(step)])  # its ends are no part of it
    return [g / max(float(np.linalg.norm(g)), 1e-300) for g in out if len(g)]


def _hump(length: float, dt: float) -> np.ndarray:
    count = max(2, round(length / dt))
    return np.sin(np.pi * (np.arange(count) + 0.5) / count) ** 2


def _one(scores: Sequence[np.ndarray], g: np.ndarray) -> float | None:
    """Return the p-value of one shape; None where no trial is long enough for it, or innovations are constant."""
    z = [np.convolve(e, g[::-1], "valid") for e in scores if len(e) >= 2 * len(g)]
    level = float(np.mean(np.concatenate(z) ** 2)) if z else 0.0
    if level == 0.0:
        return None
    count = sum(map(len, z))
    statistic = sum(float(np.sum((one**2 / level) ** 2 - 3.0)) for one in z)
    power = autocorrelation(z) ** 2
    variance = 24.0 * count * float(power @ power)
    third = 1728.0 * count * float(power @ convolved(power, power))
    return pearson3_tail(statistic / np.sqrt(variance), third / variance**1.5)
