"""Test for spectral lines: ripple at the rate of the pulses, hum, a fan; steady, or in proportion to activation."""

from collections.abc import Sequence

import numpy as np
import scipy.fft
import scipy.ndimage

from fes_pin.infer.distributions import chi2_quantile, f_tail
from fes_pin.remainder.innovations import CLIP, Innovations, driven

LOWEST_HZ = 2.0
"""Lowest frequency: slower oscillations are found by the smooth features and by the causes of the library."""
HIGHEST = 0.96
"""Highest frequency, as a share of half the sampling rate."""
NEIGHBOURS = 201
"""Frequencies, half a resolution apart, whose median is the level with which a line is compared; half as many at the
ends of the spectrum, where they are mirrored."""
LONGEST_NOISE = 4
"""Order of the noise model: enough for a level spectrum between neighbouring frequencies, and too low to take a line
for noise."""
MEDIAN_EFFICIENCY = 0.64
"""Efficiency of a median against a mean: 2 / pi."""


def line_p_value(pieces: Sequence[Innovations]) -> tuple[float, str]:
    """Return the p-value of the strongest line in one channel, and what its phase follows: "time" or "stimulus".

    A line of frequency f and amplitude g_t (1, or the activation) has in the innovations e of trial i the Fourier
    coefficient F_i(f) = sum_t g_t e_t exp(-2 pi i f t). Under the null 2 |sum F_i|^2 / sum g^2, for lines of the same
    phase in every trial, is chi-square of 2 degrees and sum_i 2 |F_i|^2 / sum_t g_t^2, for lines of any phase, of twice
    the number of trials; both are compared with the median of the latter around f, by Fisher's F. The smallest of all
    p-values is corrected for the number of frequencies and for these four tests.
    """
    long = [e for e in pieces if len(e.values) > NEIGHBOURS]
    steady = [(e, np.ones(len(e.values))) for e in long]
    active = [(e, act) for e in long if np.ptp(act := driven(e)) > 0]
    found = [(p, "time") for p in _lines(steady)] + [(p, "stimulus") for p in _lines(active)]
    p, where = min(found, default=(1.0, "time"))
    return min(1.0, max(1, len(found)) * p), where


def _lines(used: Sequence[tuple[Innovations, np.ndarray]]) -> tuple[float, ...]:
    """Return p-values of the strongest line of one phase, and of the strongest of any phase in each trial.

    Parameters
    ----------
    used
        Innovations, each with the amplitude of a line.
    """
    if not used:
        return ()
    dt, size = used[0][0].dt, scipy.fft.next_fast_len(2 * max(len(e.values) for e, _ in used), real=True)
    frequency = np.fft.rfftfreq(size, dt)
    together, apart, power = np.zeros(len(frequency), dtype=complex), np.zeros(len(frequency)), 0.0
    for one, g in used:
        own = float(g @ g)
        begun = len(one.trial) * one.trial.dt - len(one.values) * dt
        f = np.fft.rfft(np.clip(one.values, -CLIP, CLIP) * g, size) * np.exp(-2j * np.pi * frequency * begun)
        together, apart, power = together + f, apart + 2.0 * np.abs(f) ** 2 / own, power + own
    inside = (frequency > LOWEST_HZ) & (frequency < HIGHEST / (2.0 * dt))
    if inside.sum() < NEIGHBOURS:
        return ()
    degrees = 2 * len(used)
    median = chi2_quantile(0.5, degrees)
    level = np.maximum(scipy.ndimage.median_filter(apart, NEIGHBOURS, mode="reflect") / median, 1e-12)[inside]
    one_phase = float(np.max(np.abs(together[inside]) ** 2 / power / level))
    any_phase = float(np.max(apart[inside] / level)) / degrees
    known = MEDIAN_EFFICIENCY * degrees * 0.25 * NEIGHBOURS * _fullness([g for _, g in used])
    count = int(inside.sum())
    return tuple(min(1.0, count * f_tail(x, k, known)) for x, k in ((one_phase, 2), (any_phase, degrees)))


def _fullness(amplitudes: Sequence[np.ndarray]) -> float:
    """Return the share of the samples that carry the power, by which independent frequencies are fewer."""
    g = np.concatenate(amplitudes) ** 2
    return float(g.sum() ** 2 / (len(g) * (g @ g)))
