"""The level of a claim about a fit by the likelihood."""

from fes_pin.identify.likelihood_fit import LikelihoodFit
from fes_pin.infer.levels import CLAIM_LEVEL, DRIVEN_LEVEL


def level_of(fitted: LikelihoodFit) -> float:
    """Return the family-wise level of a claim in a fit by the likelihood, or of its lack of fit.

    The level is stricter with process noise: it is of first order in the model, while that of the rig is not known.
    """
    return DRIVEN_LEVEL if fitted.noise.acting else CLAIM_LEVEL
