"""Innovations of a fit by channel, under the noise of its residuals, for the tests of lack of fit."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.fft
import scipy.special

from fes_pin.data.trial import Trial
from fes_pin.identify.fit import Fit
from fes_pin.infer.noise import Noise, first_order_low_pass, thin, thinning
from fes_pin.models.autoregression import innovations_of
from fes_pin.models.free_run import MeasuredOutputs

CLIP = 4.0
"""Innovations are limited to this, in standard deviations."""
ACTIVATION_S = 0.05
"""Time constant from stimulus to force, s: Dombre, Fournier and Coiffet's ankle, section II of their paper."""


@dataclass(frozen=True)
class Innovations:
    """Innovations of one channel of one trial, under the noise of a fit.

    Attributes
    ----------
    number, output
        Of the trial, and of the channel among the trial's outputs.
    rows
        Places among the whitened residuals of all trials, end to end.
    values
        Shape (n,), of unit variance.
    dt
        Their time step, s.
    inputs
        The trial's columns that drive the rig.
    """

    trial: Trial
    number: int
    output: int
    rows: np.ndarray
    values: np.ndarray
    noise: Noise
    dt: float
    inputs: tuple[str, ...]

    def whitened(self, values: np.ndarray) -> np.ndarray:
        """Return the innovations of values of all samples, shape (n, ...): of residuals, or of their sensitivities."""
        short = thin(values, thinning(self.trial.dt, self.noise.step_s))
        return innovations_of(short, self.noise.ar) / self.noise.innovation_std


def channels(fitted: Fit) -> list[list[Innovations]]:
    """Return the innovations of each trial by channel and time step."""
    found: dict[tuple[str, float], list[Innovations]] = {}
    at = 0
    for number, (trial, part) in enumerate(zip(fitted.trials, fitted.parts, strict=True)):
        read, inputs = MeasuredOutputs(fitted.model, trial, fitted.noise), fitted.model.rig.input_columns(trial)
        channel = read.readings.of_seen(np.broadcast_to(read.places, read.readings.seen.shape))
        for output, name in zip(read.places, read.readings.outputs, strict=True):
            own, dt = np.flatnonzero(channel == output), round(trial.dt * read.count, 9)
            one = Innovations(trial, number, output, at + own, part.residual[own], fitted.noise[name], dt, inputs)
            found.setdefault((name, dt), []).append(one)
        at += len(channel)
    return list(found.values())


def driven(one: Innovations) -> np.ndarray:
    """Roughly how active the muscle (or the motor, with its sign) is, shape (n,); zero without a stimulus."""
    trial, count = one.trial, max(1, round(one.dt / one.trial.dt))
    drive = trial[one.inputs[0]] if one.inputs else np.zeros(len(trial))
    pole = float(np.exp(-trial.dt / ACTIVATION_S))
    act = thin(first_order_low_pass(drive / max(float(np.abs(drive).max()), 1e-300), pole), count)
    return act[len(act) - len(one.values) :]


def normal_scores(values: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Quantiles of the normal distribution by the rank of each value among all."""
    together = np.concatenate(values)
    _, which, counts = np.unique(together, return_inverse=True, return_counts=True)
    ranks = (np.cumsum(counts) - 0.5 * (counts - 1))[which]  # equal values share the mean of theirs
    scores = scipy.special.ndtri((ranks - 0.5) / len(together))
    return np.split(scores, np.cumsum([len(v) for v in values])[:-1])


def autocorrelation(z: Sequence[np.ndarray]) -> np.ndarray:
    """Return the autocorrelation of a channel of mean 0, shape (2 k + 1,), up to a quarter of its shortest trial."""
    most = min(map(len, z)) // 4
    size = scipy.fft.next_fast_len(max(map(len, z)) + most, real=True)
    power = np.sum([np.abs(np.fft.rfft(one, size)) ** 2 for one in z], axis=0)
    half = np.fft.irfft(power, size)[: most + 1]
    half = half / half[0] if half[0] > 0.0 else np.eye(1, most + 1)[0]  # a channel of zeros is taken for white
    return np.r_[half[:0:-1], half]


def convolved(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the middle of a convolution by Fourier transforms, as long as `a`; shapes (n,) and (2 k + 1,)."""
    count = len(a) + len(b) - 1
    size = scipy.fft.next_fast_len(count, real=True)
    whole = np.fft.irfft(np.fft.rfft(a, size) * np.fft.rfft(b, size), size)
    return whole[len(b) // 2 :][: len(a)]
