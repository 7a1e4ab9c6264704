"""Slow independent re-implementations: what the contract means by each rig and each cause, in plain numpy and scipy.

Nothing here comes from the package but the types of a trial and a study, and eq. (1) written without the engine.
"""

from oracle.simulate import simulate
from oracle.studies import TYPICAL, make_study

__all__ = ["TYPICAL", "make_study", "simulate"]
