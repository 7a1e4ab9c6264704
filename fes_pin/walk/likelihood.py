"""The Whittle likelihood of residuals of the ground reaction, by which sets of causes are judged.

Residuals are waves of the mean stride: soft tissue moves alike in each stride, so that more strides are no more
evidence. They are Gaussian and independent between waves and, after a rotation of the six channels, between channels.
The logarithm of their variance is a level of the channel plus a function of frequency that all channels share.
Variances are estimated from expected squares: the squares that effects and nuisance parameters explain are added to
those of the residuals. Means over a stride are known better. As momentum returns to its initial value, a mean force is
wrong by some 0.05 % of the weight (0.5 mm of noise at both ends of a stride), and a mean moment by that of a centre of
mass 1 mm off.

Sizes of effects are integrated over a normal prior of their plausible sizes (Laplace's evidence, exact as effects are
linear). The penalty of a parameter is therefore log(1 + d^2), with d the standard deviation of the prior over that of
the estimate.

What a plate reads while its foot is in the air is data too (`Known`): it shows an offset of the plate, and nothing
else.

Every set has nuisance parameters with normal priors, which are no causes (`nuisance`): errors of the motion that scale
the required reaction, misplaced landmarks, and plates as accurate as their calibration.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

ROUNDS = 8
"""Alternations of weights and effects; the last changes a deviance by less than 0.1."""
STEP_SD = 1.0
"""Prior standard deviation of a step of the log variance: a factor e from one wave to the next."""
PRIOR_LEFT = 1e-4
"""Share of the prior's weight that is kept in reported sizes: an effect that is not identifiable has a standard
deviation of a hundred times its plausible size."""
FLOOR_N = 0.3
"""Noise of a plate in a wave of a stride, N or N m: no residual is smaller."""
MEAN_FORCE, MEAN_ARM_M, MEAN_TWIST_NM = 0.0005, 0.001, 1.5
"""Errors of mean force, in weights, and of mean level moments, in weights times m, that the nuisance does not hold; see
above. The moment about the vertical has no weight in it: its error is that of the plates' free moment (a round
figure)."""


@dataclass(frozen=True)
class WalkNoise:
    """The noise model of all fits of a diagnosis.

    Attributes
    ----------
    harmonics
        (k,).
    turn
        (6, 6): scale and rotation of the channels for waves; those of means are unchanged.
    mean_variance
        (6,): variances of the means over a stride.
    nuisance
        (n, 6, k, m): columns that every fit has, in rotated channels, each in units of its prior's standard deviation.
    """

    harmonics: np.ndarray
    turn: np.ndarray
    mean_variance: np.ndarray
    nuisance: np.ndarray

    def rotated(self, values: np.ndarray) -> np.ndarray:
        """Return signals (n, 6, k, ...) in rotated channels."""
        out = np.einsum("ij,njk...->nik...", self.turn, values)
        means = self.harmonics == 0
        out[:, :, means] = values[:, :, means]
        return out

    def uncorrelated(self, left: np.ndarray) -> WalkNoise:
        """Return this noise in channels between which the waves of residuals (n, 6, k) are uncorrelated.

        This noise and the residuals are in the channels that were measured.
        """
        waves = left[:, :, self.harmonics > 0]
        scale = 1.0 / np.maximum(np.sqrt(np.mean(waves**2, axis=(0, 2))), FLOOR_N)
        scaled = (scale[:, None] * waves).transpose(1, 0, 2).reshape(6, -1)
        shared = scaled @ scaled.T / scaled.shape[1]
        shared = 0.8 * shared + 0.2 * np.diag(np.diag(shared))  # few strides estimate a correlation badly
        _, vectors = np.linalg.eigh(shared)
        turned = replace(self, turn=vectors.T * scale)
        return replace(turned, nuisance=turned.rotated(self.nuisance))


Known = tuple[np.ndarray, np.ndarray]
"""Readings of known standard deviation, in units of it, (b, m), and their change per unit of each effect, (b, m, p);
b = 1 for all fits. No nuisance parameter changes them."""


@dataclass(frozen=True)
class Fitted:
    """Effects at their most likely values, with the noise of their residual.

    Attributes
    ----------
    values, covariance
        (p,), (p, p) of the effects: most likely values at the estimated noise, without the prior of their sizes.
    believed
        (p,): values with that prior, as in the deviance.
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


def fit_many(
    y: np.ndarray, x: np.ndarray, prior: np.ndarray, noise: WalkNoise, rounds: int = ROUNDS, read: Known | None = None
) -> list[Fitted]:
    """Fit effects and noise together, many fits at once.

    Parameters
    ----------
    y, x
        (b, n, 6, k) and (b, n, 6, k, p), waves in rotated channels; `x` of shape (1, n, 6, k, p) for all fits.
    prior
        (b, p), or (1, p) for all fits: prior standard deviation of each effect's size.
    noise
        The noise model of all fits.
    rounds
        Alternations of weights and effects.
    read
        Readings in addition to the waves.
    """
    count, p, size = len(y), x.shape[-1], y[0].size
    scaled = (x * prior[:, None, None, None]).reshape(len(x), size, p)
    nuisance = noise.nuisance.reshape(size, -1)
    flat = np.concatenate([scaled, np.broadcast_to(nuisance, (len(scaled), *nuisance.shape))], axis=2)
    told, shows = read or (np.zeros((1, 0)), np.zeros((1, 0, p)))
    shows = np.pad(shows * prior[:, None], ((0, 0), (0, 0), (0, flat.shape[2] - p)))
    spectra = Spectra(y, noise)
    aim = y.reshape(count, size, 1)
    left, variance = y, spectra.update(y**2)
    for _ in range(rounds):
        weighted = flat / variance.reshape(count, size, 1)
        gram = weighted.transpose(0, 2, 1) @ flat + shows.transpose(0, 2, 1) @ shows + np.eye(flat.shape[2])
        inverse = np.linalg.inv(gram)
        values = inverse @ (weighted.transpose(0, 2, 1) @ aim + shows.transpose(0, 2, 1) @ told[:, :, None])
        left = (aim - flat @ values).reshape(y.shape)
        fitted_away = np.sum((flat @ inverse) * flat, axis=2).reshape(y.shape)
        variance = spectra.update(left**2 + fitted_away)
    deviance = np.sum(np.log(variance) + left**2 / variance, axis=(1, 2, 3)) + spectra.penalty()
    values = values[:, :, 0]
    deviance += np.sum((told - (shows @ values[:, :, None])[:, :, 0]) ** 2, axis=1)
    deviance += np.sum(values**2, axis=1) + np.linalg.slogdet(gram)[1]
    scale = np.broadcast_to(prior, (count, p))
    alone = np.linalg.inv(gram - np.diag(np.r_[np.full(p, 1.0 - PRIOR_LEFT), np.zeros(len(gram[0]) - p)]))
    likely = alone[:, :p] @ (gram @ values[:, :, None])
    covariance = alone[:, :p, :p] * (scale[:, :, None] * scale[:, None, :])
    parts = likely[:, :, 0] * scale, covariance, values[:, :p] * scale, deviance.tolist(), variance
    return [Fitted(*one) for one in zip(*parts, strict=True)]


def by_frequency(values: np.ndarray, harmonics: np.ndarray) -> np.ndarray:
    """Return values (..., k) of coefficients, each the mean over those of its frequency."""
    same = harmonics[:, None] == harmonics
    return values @ (same / same.sum(axis=0))


class Spectra:
    """Variances exp(level + function of frequency), by Fisher scoring of gamma regression.

    The function has a step at every wave, with a normal prior; with `falling` no step may be positive. `white`
    (b, n, 6, k) is the additional variance by white noise on the coordinates.
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
        """Return variances (b, n, 6, k) after one round from expected squared residuals of the same shape."""
        known = self._variance(squares.shape)[..., self.waves]
        share = self._smooth()[:, None] / known
        gain = self._by_wave(share * 0.5 * (squares[..., self.waves] / known - 1.0))
        slope = np.concatenate([gain.sum(axis=2), gain.sum(axis=1) @ self.steps - self.step / STEP_SD**2], axis=1)
        moved = np.clip(np.linalg.solve(self.curvature(share), slope[:, :, None])[:, :, 0], -2.0, 2.0)
        self.level, self.step = self.level + moved[:, :6], self.step + moved[:, 6:]
        if self.falling:
            self.step = np.minimum(self.step, 0.0)
        return self._variance(squares.shape)

    def curvature(self, share: np.ndarray) -> np.ndarray:
        """Return the expected curvature (b, p, p) by levels and steps, from shares (b, n, 6, waves) in variances."""
        weight = self._by_wave(0.5 * share**2) + 1e-9
        steps, cross = self.steps, weight @ self.steps
        levels = weight.sum(axis=2)[:, :, None] * np.eye(6)
        both = (steps.T * weight.sum(axis=1)[:, None]) @ steps + np.eye(steps.shape[1]) / STEP_SD**2
        return np.block([[levels, cross], [cross.transpose(0, 2, 1), both]])

    def penalty(self) -> np.ndarray:
        """Return twice the negative log prior of the steps, (b,)."""
        return np.sum((self.step / STEP_SD) ** 2, axis=1)

    def _by_wave(self, values: np.ndarray) -> np.ndarray:
        """Return sums over strides and over the coefficients of one frequency: (b, 6, frequencies)."""
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
