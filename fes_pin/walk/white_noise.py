"""White noise of markers, estimated from differences between strides."""

from dataclasses import replace

import numpy as np

from fes_pin.walk.designs import Designs
from fes_pin.walk.likelihood import ROUNDS, Spectra, WalkNoise, by_frequency

WHITE_TRIED = 0.2, 40.0, 200
"""Levels of white noise, in units: from, to, how many; a step is less than 3 %."""


def white_level(y: np.ndarray, noise: WalkNoise, draws: np.ndarray) -> tuple[float, float, float]:
    """Estimate white noise on the coordinates from differences between strides.

    Other differences fall with frequency, while noise of differentiated coordinates grows. A stride is no whole period
    of the noise, so that its waves are correlated. The scatter of the level is therefore taken from the draws, as that
    of a score with correlated terms (H. White, Econometrica 50:1, 1982).

    Parameters
    ----------
    y
        (n, 6, k) differences of strides, in rotated channels.
    noise
        The noise model; its `nuisance` is not used.
    draws
        (d, 6, k) residuals of a stride by noise of one unit, in rotated channels.

    Returns
    -------
    level, std, gain
        Level of the noise, in units, its standard deviation, and the fall of the deviance.
    """
    unit = by_frequency(np.mean(draws**2, axis=0), noise.harmonics)
    tried = np.concatenate([[0.0], np.geomspace(*WHITE_TRIED)])
    many = np.broadcast_to(y, (len(tried), *y.shape))
    spectra = Spectra(many, noise, True, tried[:, None, None, None] ** 2 * unit)
    for _ in range(4 * ROUNDS):
        variance = spectra.update(many**2)
    waves = noise.harmonics > 0
    deviance = np.sum((np.log(variance) + many**2 / variance)[..., waves], axis=(1, 2, 3)) + spectra.penalty()
    best = int(np.argmin(deviance))
    saved = float(deviance[0] - deviance[best])
    if best in (0, 1, len(tried) - 1):
        return float(tried[best]), float("inf"), saved
    before, least, after = deviance[best - 1 : best + 2]
    step = 0.5 * (before - after) / max(before - 2.0 * least + after, 1e-12)
    level = float(tried[best] * (tried[best + 1] / tried[best]) ** step)
    share = (tried[best] ** 2 * unit / variance[best])[..., waves]
    shape = (draws**2 / unit)[..., waves]
    return level, 0.5 * level * _spread_of_white(spectra, share, shape), saved


def _spread_of_white(spectra: Spectra, share: np.ndarray, squares: np.ndarray) -> float:
    """Return the standard deviation of the logarithm of white noise's variance.

    With its share s of a variance v, the score is sum s (y^2 / v - 1) / 2. Its information is reduced by the part that
    levels and steps of the spectrum explain. Its scatter is that of the draws in the white part, s^2 z^2 / 2.

    Parameters
    ----------
    spectra
        Spectra of all levels that were tried.
    share
        (n, 6, waves): share of white noise in the variance.
    squares
        (d, 6, waves): squares of the draws over their mean.
    """
    n, d = len(share), len(squares)
    curve = spectra.curvature((1.0 - share)[None])[0]
    both = 0.5 * (share * (1.0 - share)).sum(axis=0) @ spectra.gather
    cross = np.r_[both.sum(axis=1), both.sum(axis=0) @ spectra.steps]
    alone = 0.5 * np.sum(share**2)
    white = np.var(0.5 * np.sum(share[0] ** 2 * squares, axis=(1, 2)), ddof=1)
    scatter = 0.5 * np.sum(share**2 * (1.0 - share**2)) + n * (1.0 + n / d) * white
    return float(np.sqrt(scatter / alone / (alone - cross @ np.linalg.solve(curve, cross))))


def white_noise(designs: Designs) -> tuple[float, float, float] | None:
    """Return white noise of markers, mm, its standard deviation, and its gain in deviance; None for a single stride."""
    if designs.strides.count < 2:
        return None
    y, _ = designs.by_stride(())
    waves = designs.noise.harmonics > 0
    shaken = designs.shaken[..., waves]
    values, vectors = np.linalg.eigh(np.einsum("dik,djk->ij", shaken, shaken) / (len(shaken) * waves.sum()))
    turn = (vectors / np.sqrt(values)).T  # channels in which white noise of the coordinates is independent
    noise = replace(designs.noise, turn=turn)
    degrees = np.sqrt(len(y) / (len(y) - 1.0))
    level, std, saved = white_level(noise.rotated((y - y.mean(axis=0)) * degrees), noise, noise.rotated(designs.shaken))
    return level, std * degrees, saved
