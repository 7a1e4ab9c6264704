"""The one likelihood by which sets of causes are judged: residuals of the ground reaction, as coloured noise.

Residuals are waves of the stride, in the mean over strides: soft tissue moves alike in each, so more strides are no
more evidence. They are Gaussian, independent from wave to wave and, after a rotation of the six channels, from channel
to channel, with a variance whose logarithm is a level of the channel and a course over frequency that all channels
share: Whittle's likelihood at the walk's own frequencies. Variances are taken from expected squares: the squares that
effects and nuisance fitted away are added to those of the residuals first. Means over a stride are known
better: momentum comes back to what it was, so a mean force is wrong by some 0.05 % of the weight (0.5 mm of noise at
both ends of a stride), a mean moment by what a centre of mass 1 mm off makes.

Sizes of effects are integrated over a normal prior of their plausible sizes (Laplace's evidence, exact as effects are
linear): that is the price of a parameter, log(1 + d^2) for one seen with d standard deviations of the prior.

Every set has nuisance parameters with normal priors, of which no cause is made (`nuisance`): errors of the motion that
make the required reaction larger or smaller, landmarks that are not quite found, plates as good as their calibration.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

ROUNDS = 8
"""Of alternating weights and effects; the last changes a deviance by less than 0.1."""
STEP_SD = 1.0
"""Standard deviation of what is believed of a step of log variance beforehand: a factor e from one wave to the next."""
PRIOR_LEFT = 1e-4
"""Of the prior's weight, in reported sizes: an effect that nothing shows has a hundred times its plausible size."""
FLOOR_N = 0.3
"""N, or N m: a plate's own noise in a stride's wave; no residual is smaller."""
MEAN_FORCE, MEAN_ARM_M, MEAN_TWIST_NM = 0.0005, 0.001, 1.5
"""Errors of mean force, in weights, and of mean level moments, in weights times m, that the nuisance does not hold; see
above. The moment about the vertical has no weight in it: its error is that of the plates' free moment (a round
figure)."""


@dataclass(frozen=True)
class WalkNoise:
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
    """

    harmonics: np.ndarray
    turn: np.ndarray
    mean_variance: np.ndarray
    nuisance: np.ndarray

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
        (p,), (p, p) of the effects: most likely under the noise that was found, without the prior of their sizes.
    believed
        (p,) with that prior, as the deviance has them.
    deviance
        -2 log evidence.
    variance
        (n, 6, k) of the noise, in rotated channels.
    """

    values: np.ndarray
    covariance: np.ndarray
    believed: np.ndarray
    deviance: float
    variance: np.ndarray = field(repr=False)


def rotation(left: np.ndarray, harmonics: np.ndarray) -> np.ndarray:
    """Scale and rotation that make the waves of residuals (n, 6, k) uncorrelated between channels: (6, 6)."""
    left = left[:, :, harmonics > 0]
    scale = 1.0 / np.maximum(np.sqrt(np.mean(left**2, axis=(0, 2))), FLOOR_N)
    scaled = (scale[:, None] * left).transpose(1, 0, 2).reshape(6, -1)
    shared = scaled @ scaled.T / scaled.shape[1]
    shared = 0.8 * shared + 0.2 * np.diag(np.diag(shared))  # few strides estimate a correlation badly
    _, vectors = np.linalg.eigh(shared)
    return vectors.T * scale


def fit_walk(y: np.ndarray, x: np.ndarray, prior: np.ndarray, noise: WalkNoise) -> Fitted:
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
    return fit_many(y[None], x, prior, noise)[0]


def fit_many(y: np.ndarray, x: np.ndarray, prior: np.ndarray, noise: WalkNoise, rounds: int = ROUNDS) -> list[Fitted]:
    """`fit_walk` of many at once.

    Parameters
    ----------
    y
        (b, n, 6, k).
    x, prior
        (n, 6, k, p) and (p,), for all alike, or (b, n, 6, k, p) and (b, p).
    noise
        What is common.
    rounds
        Of alternating weights and effects.
    """
    count, p, size = len(y), x.shape[-1], y[0].size
    scaled = x * (prior if prior.ndim == 1 else prior[:, None, None, None])
    scaled = scaled.reshape(1 if prior.ndim == 1 else count, size, p)
    nuisance = noise.nuisance[: y.shape[1]].reshape(size, -1)
    flat = np.concatenate([scaled, np.broadcast_to(nuisance, (len(scaled), *nuisance.shape))], axis=2)
    spectra = Spectra(y, noise)
    aim = y.reshape(count, size, 1)
    left, variance = y, spectra.update(y**2)
    for _ in range(rounds):
        weighted = flat / variance.reshape(count, size, 1)
        gram = weighted.transpose(0, 2, 1) @ flat + np.eye(flat.shape[2])
        inverse = np.linalg.inv(gram)
        values = inverse @ (weighted.transpose(0, 2, 1) @ aim)
        left = (aim - flat @ values).reshape(y.shape)
        fitted_away = np.sum((flat @ inverse) * flat, axis=2).reshape(y.shape)
        variance = spectra.update(left**2 + fitted_away)
    deviance = np.sum(np.log(variance) + left**2 / variance, axis=(1, 2, 3)) + spectra.penalty()
    values = values[:, :, 0]
    deviance += np.sum(values**2, axis=1) + np.linalg.slogdet(gram)[1]
    scale = np.broadcast_to(prior, (count, p))
    alone = np.linalg.inv(gram - np.diag(np.r_[np.full(p, 1.0 - PRIOR_LEFT), np.zeros(len(gram[0]) - p)]))
    likely = alone[:, :p] @ (gram @ values[:, :, None])
    covariance = alone[:, :p, :p] * (scale[:, :, None] * scale[:, None, :])
    parts = likely[:, :, 0] * scale, covariance, values[:, :p] * scale, deviance.tolist(), variance
    return [Fitted(*one) for one in zip(*parts, strict=True)]


def by_frequency(values: np.ndarray, harmonics: np.ndarray) -> np.ndarray:
    """Values (..., k) of coefficients, each the mean over those of its frequency."""
    out = np.array(values)
    for h in np.unique(harmonics):
        out[..., harmonics == h] = values[..., harmonics == h].mean(axis=-1, keepdims=True)
    return out


class Spectra:
    """Variances exp(level + course over frequency), by Fisher scoring of gamma regression.

    The course takes a step at every wave, of any sign with a normal prior; `falling`: no step may go up. `white`
    (b, n, 6, k) is a variance that white noise on the coordinates adds.
    """

    def __init__(self, y: np.ndarray, noise: WalkNoise, falling: bool = False, white: np.ndarray | None = None) -> None:
        self.waves = noise.harmonics > 0
        count, h = len(y), noise.harmonics[self.waves]
        self.kinds, self.kind = np.unique(h, return_inverse=True)
        self.gather = (self.kind[:, None] == np.arange(len(self.kinds))).astype(float)
        steps = (self.kinds[:, None] > self.kinds[None, :-1]).astype(float)
        self.steps = steps - steps.mean(axis=0)
        self.floor = np.maximum((FLOOR_N * noise.turn) ** 2 @ np.ones(6), 1e-12)[:, None]
        self.means = noise.mean_variance[:, None]
        power = np.mean(y[..., self.waves] ** 2, axis=(1, 3))
        self.level = np.log((0.3 if falling else 1.0) * power + self.floor[:, 0])
        self.step = np.zeros((count, self.steps.shape[1]))
        self.falling = falling
        self.white = white

    def update(self, squares: np.ndarray) -> np.ndarray:
        """Variances (b, n, 6, k) after one round; `squares`, of the same shape, are expected squares of residuals."""
        slope, curve = self._scores(squares)
        moved = np.linalg.solve(curve, slope[:, :, None])[:, :, 0]
        self.level += np.clip(moved[:, :6], -2.0, 2.0)
        self.step = self.step + np.clip(moved[:, 6:], -2.0, 2.0)
        if self.falling:
            self.step = np.minimum(self.step, 0.0)
        return self._variance(squares.shape)

    def _scores(self, squares: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Slope (b, p) and expected curvature (b, p, p) of the log-likelihood by levels and steps."""
        known = self._variance(squares.shape)[..., self.waves]
        share = self._smooth()[:, None] / known
        gain = self._by_wave(share * 0.5 * (squares[..., self.waves] / known - 1.0))
        slope = np.concatenate([gain.sum(axis=2), gain.sum(axis=1) @ self.steps - self.step / STEP_SD**2], axis=1)
        return slope, self.curvature(share)

    def curvature(self, share: np.ndarray) -> np.ndarray:
        """Expected curvature (b, p, p) by levels and steps, of their shares (b, n, 6, waves) in variances."""
        weight = self._by_wave(0.5 * share**2) + 1e-9
        count, size = self.step.shape
        curve = np.zeros((count, 6 + size, 6 + size))
        curve[:, range(6), range(6)] = weight.sum(axis=2)
        curve[:, :6, 6:] = weight @ self.steps
        curve[:, 6:, :6] = curve[:, :6, 6:].transpose(0, 2, 1)
        curve[:, 6:, 6:] = (self.steps.T * weight.sum(axis=1)[:, None]) @ self.steps + np.eye(size) / STEP_SD**2
        return curve

    def penalty(self) -> np.ndarray:
        """Twice the negative log prior of the steps, (b,)."""
        return np.sum((self.step / STEP_SD) ** 2, axis=1)

    def _by_wave(self, values: np.ndarray) -> np.ndarray:
        """Sums over strides and over the coefficients of one frequency: (b, 6, frequencies)."""
        return values.sum(axis=1) @ self.gather

    def _smooth(self) -> np.ndarray:
        course = (self.step @ self.steps.T)[:, self.kind]
        return self.floor + np.exp(self.level[:, :, None] + course[:, None])

    def _variance(self, shape: tuple[int, ...]) -> np.ndarray:
        out = np.empty(shape)
        out[..., ~self.waves] = self.means
        out[..., self.waves] = self._smooth()[:, None]
        if self.white is not None:
            out += self.white
        return out
