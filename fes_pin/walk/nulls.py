"""Simulated null of a walk: distribution of the largest gain, and scatter of values, without a cause."""

import numpy as np

from fes_pin.infer.family import SimulatedFamily
from fes_pin.infer.fits import Names
from fes_pin.walk.designs import Designs
from fes_pin.walk.likelihood import Fitted, fit_many

SIMULATED = 100
"""Number of simulated residuals that give the distribution of the largest gain."""
SIMULATED_ROUNDS = 4
"""Alternations of weights and sizes in a fit of a simulated residual."""
FLOOR_SHARE = 0.3
"""Share of the fitted noise, in amplitude, that is simulated in addition to soft tissue."""


def simulated_nulls(designs: Designs, variance: np.ndarray) -> tuple[SimulatedFamily, dict[str, np.ndarray]]:
    """Return results of the library on residuals without a cause, in noise of this variance, (1, 6, k).

    Returns
    -------
    family : SimulatedFamily
        Family of the gains in evidence of all forms.
    spread : dict of ndarray
        For each form, (p,) root mean square of value over standard deviation: 1 if the intervals are right.
    """
    drawn = _without_a_cause(designs, variance)
    told = np.random.default_rng(designs.seed + 1).normal(size=(SIMULATED, designs.stated.air_n.size))

    def fits(names: Names, x: np.ndarray) -> list[Fitted]:
        read = told, designs.readings([names])[1]
        return fit_many(drawn, x[None], designs.plausible(names)[None], designs.noise, SIMULATED_ROUNDS, read)

    alone = [f.deviance for f in fits((), np.zeros((*variance.shape, 0)))]
    best, spread = np.full(SIMULATED, -np.inf), {}
    for name in designs.forms:
        fitted = fits((name,), designs.noise.rotated(designs.as_read.x[name]))
        best = np.maximum(best, np.subtract(alone, [f.deviance for f in fitted]))
        z = [f.values / np.sqrt(np.diag(f.covariance)) for f in fitted]
        spread[name] = np.sqrt(np.mean(np.square(z), axis=0))
    return SimulatedFamily(best), spread


def _without_a_cause(designs: Designs, variance: np.ndarray) -> np.ndarray:
    """Return simulated residuals in rotated channels: (draws, 1, 6, k).

    They are the sum of soft tissue, as errors in the coordinates, scaled in each wave to the estimated noise, of a
    share of the fitted noise, and of the ordinary errors of every session.
    """
    random = np.random.default_rng(designs.seed)
    drawn = random.normal(size=(SIMULATED, *variance.shape)) * np.sqrt(variance)
    always = random.normal(size=(SIMULATED, designs.ordinary.shape[3])) @ designs.ordinary.reshape(variance.size, -1).T
    mixed = random.normal(size=(SIMULATED, len(designs.tissue))) / np.sqrt(len(designs.tissue))
    shared = designs.noise.rotated(np.einsum("sd,djk->sjk", mixed, designs.tissue))
    waves = designs.noise.harmonics > 0
    power = np.mean(shared[..., waves] ** 2, axis=0)
    h = designs.noise.harmonics[waves]
    size = np.array([np.sqrt(variance[0][:, waves][:, h == w].sum() / power[:, h == w].sum()) for w in h])
    drawn[:, 0][..., waves] = size * shared[..., waves] + FLOOR_SHARE * drawn[:, 0][..., waves]
    return drawn + always.reshape(drawn.shape)
