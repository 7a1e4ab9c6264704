"""One likelihood for everything a set of causes is judged by: what is left of the ground reaction, as coloured noise.

Residuals are waves of the stride, in the mean over strides: soft tissue moves alike in each, so more strides are no
more evidence. They are Gaussian, independent from wave to wave and, after a rotation of the six channels, from channel
to channel, with a variance whose logarithm is a + b h, h the number of waves in a stride: Whittle's likelihood at the
walk's own frequencies. Means over a stride are known better: momentum comes back to what it was, so a mean force is
wrong by no more than 0.2 % of the weight, a mean moment by what a centre of mass 5 mm off makes.

Sizes of effects are integrated over a normal prior of their plausible sizes (Laplace's evidence, exact as effects are
linear): that is the price of a parameter, log(1 + d^2) for one seen with d standard deviations of the prior.

Motion is measured with errors, so that the required reaction is larger than the true one where motion is small: every
set has nuisance parameters that take that up (`nuisance`), and no cause is made of it.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

ROUNDS = 8
"""Of alternating weights and effects; the last changes a deviance by less than 0.1."""
SLOPE_SD = 0.5
"""Standard deviation of what is believed of the slopes b beforehand: a factor e^(1/2) a wave."""
FLOOR_N = 0.3
"""N, or N m: a plate's own noise in a stride's wave; no residual is smaller."""
MEAN_FORCE, MEAN_ARM_M = 0.002, 0.005
"""Errors of mean force, in weights, and of mean moment, in weights times m; see above."""


@dataclass(frozen=True)
class Noise:
    """What is common to all fits of a diagnosis.

    Attributes
    ----------
    harmonics
        (k,).
    turn
        (6, 6): scale and rotation of the channels for waves; means keep theirs.
    mean_variance
        (6,): of the means over a stride.
    nuisance
        (n, 6, k, m): columns that every fit has, rotated, each in units of its prior's standard deviation.
    jitter
        (n, 6, k) variance that white noise of one unit on the coordinates leaves, in rotated channels; None: none.
    """

    harmonics: np.ndarray
    turn: np.ndarray
    mean_variance: np.ndarray
    nuisance: np.ndarray
    jitter: np.ndarray | None = field(default=None, repr=False)

    def rotated(self, values: np.ndarray) -> np.ndarray:
        """Signals (n, 6, k, ...) in rotated channels."""
        out = np.einsum("ij,njk...->nik...", self.turn, values)
        means = self.harmonics == 0
        out[:, :, means] = values[:, :, means]
        return out


@dataclass(frozen=True)
class Fitted:
    """Effects at their most likely values under noise of their own.

    Attributes
    ----------
    values, covariance
        (p,), (p, p) of the effects.
    taken
        (m,) what the nuisance parameters take, in units of their priors.
    deviance
        -2 log evidence.
    left, variance
        (n, 6, k): what is left and the noise's variance, in rotated channels.
    """

    values: np.ndarray
    covariance: np.ndarray
    taken: np.ndarray
    deviance: float
    left: np.ndarray = field(repr=False)
    variance: np.ndarray = field(repr=False)


def rotation(left: np.ndarray, harmonics: np.ndarray) -> np.ndarray:
    """Scale and rotation under which the waves of what is left (n, 6, k) are uncorrelated between channels: (6, 6)."""
    left = left[:, :, harmonics > 0]
    scale = 1.0 / np.maximum(np.sqrt(np.mean(left**2, axis=(0, 2))), FLOOR_N)
    scaled = (scale[:, None] * left).transpose(1, 0, 2).reshape(6, -1)
    shared = scaled @ scaled.T / scaled.shape[1]
    shared = 0.8 * shared + 0.2 * np.diag(np.diag(shared))  # few strides tell a correlation badly
    _, vectors = np.linalg.eigh(shared)
    return vectors.T * scale


def fit(y: np.ndarray, x: np.ndarray, prior: np.ndarray, noise: Noise) -> Fitted:
    """Effects and noise, most likely together.

    Parameters
    ----------
    y, x
        (n, 6, k) and (n, 6, k, p), contrasts of strides in rotated channels.
    prior
        (p,) standard deviation of each effect's size beforehand.
    noise
        What is common.
    """
    values, covariance, deviance, left, variance, taken = fit_many(y[None], x, prior, noise)
    return Fitted(values[0], covariance[0], taken[0], float(deviance[0]), left[0], variance[0])


def fit_many(
    y: np.ndarray, x: np.ndarray, prior: np.ndarray, noise: Noise, rounds: int = ROUNDS
) -> tuple[np.ndarray, ...]:
    """`fit` of many residuals (b, n, 6, k) at once: values, covariances, deviances, left, variances, taken."""
    count, p = len(y), x.shape[-1]
    m = noise.nuisance.shape[-1]
    flat = np.concatenate([x * prior, noise.nuisance[: y.shape[1]]], axis=-1).reshape(y[0].size, p + m)
    spectra = _Spectra(y, noise)
    values = np.zeros((count, p + m))
    gram = np.zeros((count, p + m, p + m))
    left, variance = y, spectra.update(y)
    for _ in range(rounds if p + m else 1):
        weight = (1.0 / variance).reshape(count, -1)
        gram = flat.T @ (weight[:, :, None] * flat) + np.eye(p + m)
        right = (weight * y.reshape(count, -1)) @ flat
        values = np.linalg.solve(gram, right[:, :, None])[:, :, 0]
        left = y - (values @ flat.T).reshape(y.shape)
        variance = spectra.update(left)
    deviance = np.sum(np.log(variance) + left**2 / variance, axis=(1, 2, 3)) + spectra.penalty()
    deviance += np.sum(values**2, axis=1) + np.linalg.slogdet(gram)[1]
    covariance = np.linalg.inv(gram)[:, :p, :p] * np.outer(prior, prior)
    sizes = values[:, :p] * prior
    return sizes, covariance, deviance, left, variance, values[:, p:]


def white_level(y: np.ndarray, noise: Noise, jitter: np.ndarray) -> tuple[float, float, float]:
    """White noise on the coordinates in what differs from stride to stride.

    What else differs dies out with frequency; noise of differentiated coordinates grows.

    Parameters
    ----------
    y
        (n, 6, k) differences of strides, in rotated channels.
    noise
        Whose `nuisance` is not read.
    jitter
        (6, k) variance that noise of one unit leaves.

    Returns
    -------
    level, std, gain
        Of the noise, in units, with its standard deviation; the deviance that it saves.
    """
    alone, with_it = _Spectra(y[None], replace(noise, jitter=None), True), None
    with_it = _Spectra(y[None], replace(noise, jitter=np.broadcast_to(jitter, y.shape)), True)
    deviance = []
    for spectra in (alone, with_it):
        for _ in range(4 * ROUNDS):
            variance = spectra.update(y[None])
        waves = noise.harmonics > 0
        terms = np.log(variance) + y[None] ** 2 / variance
        deviance.append(float(np.sum(terms[..., waves]) + spectra.penalty()[0]))
    _, curve = with_it._white_score(y[None], variance)
    level = float(np.sqrt(with_it.white[0]))
    return level, float(0.5 / np.sqrt(curve[0]) / max(level, 1e-9)), deviance[0] - deviance[1]


class _Spectra:
    """Log-linear variances, updated by Fisher scoring of gamma regression; `falling`: none may grow with frequency."""

    def __init__(self, y: np.ndarray, noise: Noise, falling: bool = False) -> None:
        count = len(y)
        self.waves = noise.harmonics > 0
        self.span = float(max(1.0, noise.harmonics.max()))
        self.h = noise.harmonics[self.waves] / self.span
        self.floor = np.maximum((FLOOR_N * noise.turn) ** 2 @ np.ones(6), 1e-12)[:, None]
        self.means = noise.mean_variance[:, None]
        power = np.mean(y[..., self.waves] ** 2, axis=(1, 3))
        self.level = np.log((0.3 if falling else 1.0) * power + self.floor[:, 0])
        self.slope = np.zeros(count)
        self.falling = falling
        self.white = np.zeros(count)
        self.jitter = noise.jitter
        if self.jitter is not None:
            self.white += 0.7 * np.mean(y[..., self.waves] ** 2, axis=(1, 2, 3)) / np.mean(self.jitter)

    def update(self, left: np.ndarray) -> np.ndarray:
        variance = self._variance(left.shape)
        waves, known = left[..., self.waves], variance[..., self.waves]
        share = self._smooth()[:, None] / known
        gain = 0.5 * share * (waves**2 / known - 1.0)
        weight = 0.5 * share**2 + 1e-9
        w0, w1 = weight.sum(axis=(1, 3)), (weight * self.h).sum(axis=(1, 3))
        w2 = (weight * self.h**2).sum(axis=(1, 2, 3)) + (self.span * SLOPE_SD) ** -2
        g0 = gain.sum(axis=(1, 3))
        g1 = (gain * self.h).sum(axis=(1, 2, 3)) - self.slope / (self.span * SLOPE_SD) ** 2
        step = (g1 - (w1 * g0 / w0).sum(axis=1)) / np.maximum(w2 - (w1**2 / w0).sum(axis=1), 1e-6)
        slope = self.slope + np.clip(step, -2.0, 2.0)
        if self.falling:
            slope = np.minimum(slope, 0.0)
        step = slope - self.slope
        self.level += np.clip((g0 - w1 * step[:, None]) / w0, -2.0, 2.0)
        self.slope = slope
        if self.jitter is not None:
            slope, curve = self._white_score(left, variance)
            self.white = np.maximum(self.white + slope / np.maximum(curve, 1e-300), 0.0)
        return self._variance(left.shape)

    def penalty(self) -> np.ndarray:
        return (self.slope / (self.span * SLOPE_SD)) ** 2

    def _white_score(self, left: np.ndarray, variance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        share = (self.jitter / variance)[..., self.waves]
        left, variance = left[..., self.waves], variance[..., self.waves]
        gain = 0.5 * np.sum(share * (left**2 / variance - 1.0), axis=(1, 2, 3))
        return gain, 0.5 * np.sum(share**2, axis=(1, 2, 3))

    def _smooth(self) -> np.ndarray:
        return self.floor + np.exp(self.level[:, :, None] + self.slope[:, None, None] * self.h)

    def _variance(self, shape: tuple[int, ...]) -> np.ndarray:
        out = np.empty(shape)
        out[..., ~self.waves] = self.means
        out[..., self.waves] = self._smooth()[:, None]
        if self.jitter is not None:
            out += self.white[:, None, None, None] * self.jitter
        return out
