"""Effort that a model leaves and that differs between equal cycles of an imposed motion.

A model that contains all that acts leaves noise of such an effort; a subject who does not relax leaves more. Nobody
knows how much voluntary effort repeats with the motion. The part that differs is a lower bound of what is no cause.
"""

from dataclasses import dataclass

import numpy as np

from fes_pin.data.repeats import effort_of_repeats
from fes_pin.data.schema import IMPOSED
from fes_pin.data.stimulus import is_stimulated
from fes_pin.data.trial import Trial
from fes_pin.identify.ahead import free_residuals
from fes_pin.identify.likelihood_fit import LikelihoodFit
from fes_pin.models.model import Model


@dataclass(frozen=True)
class Voluntary:
    """Effort that is likely voluntary.

    Attributes
    ----------
    share
        The largest share of a trial, see `data.repeats.Unrepeated`.
    size
        Root mean square over the trials, in the unit of the effort.
    cycles
        How many equal cycles were compared.
    trials
        Those whose equal cycles differ.
    """

    share: float
    size: float
    cycles: int
    trials: tuple[Trial, ...]

    @property
    def words(self) -> str:
        """Why there is a lack of fit."""
        differ = f"equal cycles of the motion differ by {100.0 * self.share:.0f} % of the effort in one"
        repeats = "what of it repeats cannot be told from a cause"
        return f"{differ}, whatever cause is taken: voluntary effort is likely, and {repeats}"


def voluntary_effort(fitted: LikelihoodFit) -> Voluntary | None:
    """Return what a model leaves of the effort of trials that nothing stimulates and that differs between equal cycles.

    Returns
    -------
    Voluntary, or None where the cycles of no trial differ by more than those of a passive limb
    """
    schema, found = fitted.model.rig.described(), []
    for trial in (t for t in fitted.trials if t.kind == IMPOSED and not is_stimulated(t)):
        one = effort_of_repeats(trial, schema, _left_by(fitted, trial, fitted.model))
        if one is not None and one.is_no_mechanism:
            found.append((one, trial))
    if not found:
        return None
    size = float(np.sqrt(np.mean([one.size**2 for one, _ in found])))
    share, cycles = max(one.share for one, _ in found), sum(one.cycles for one, _ in found)
    return Voluntary(share, size, cycles, tuple(t for _, t in found))


def over_voluntary(voluntary: Voluntary, best: LikelihoodFit) -> dict[str, float]:
    """Return what each cause of a fit adds to a constant effort, in deviations of a mean over the cycles, by cause.

    A subject who does not relax may hold: a constant effort in each trial is voluntary too. What differs between cycles
    repeats with the motion by chance alone.
    """
    out, whole = {}, [_left_by(best, t, best.model) for t in voluntary.trials]
    for effect in best.model.effects:
        left = [_left_by(best, t, best.model - effect) for t in voluntary.trials]
        added = [one - other for one, other in zip(left, whole, strict=True)]
        explained = np.concatenate([one - np.nanmean(one) for one in added])
        out[effect.name] = float(np.sqrt(np.nanmean(explained**2) * voluntary.cycles)) / voluntary.size
    return out


def _left_by(fitted: LikelihoodFit, trial: Trial, model: Model) -> np.ndarray:
    """Return the measured effort of a trial less that of a model at the values of a fit, shape (n,)."""
    return free_residuals(model, trial, fitted.noise, fitted.unknowns_of(trial))[model.rig.output(trial.kind)]
