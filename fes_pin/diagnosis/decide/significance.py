"""The level at which something is claimed of a fit by the likelihood."""

from __future__ import annotations

from fes_pin.identify.likelihood_fit import LikelihoodFit
from fes_pin.infer.levels import CLAIM_LEVEL, DRIVEN_LEVEL


def level_of(fitted: LikelihoodFit) -> float:
    """Family-wise level of a claim in a fit by the likelihood, or of a lack of fit that it has.

    A random effort is of the first order in the model, and as it may be in the rig: noise that is known by less.
    """
    return DRIVEN_LEVEL if fitted.noise.acting else CLAIM_LEVEL
