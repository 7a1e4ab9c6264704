"""Effort that a model leaves and that differs between equal cycles of an imposed motion.

The residual of such an effort is noise where the model contains all that acts; a subject who does not relax leaves
more. How much voluntary effort repeats with the motion nobody knows, so that the part that differs is a lower bound of
what is not of the library.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from fes_pin.data.repeats import effort_of_repeats
from fes_pin.data.schema import IMPOSED
from fes_pin.data.stimulus import is_stimulated
from fes_pin.data.trial import Trial
from fes_pin.identify.ahead import free_residuals
from fes_pin.identify.likelihood_fit import LikelihoodFit


@dataclass(frozen=True)
class Voluntary:
    """Effort that is likely voluntary.

    Attributes
    ----------
    share
        The largest share of a trial, see `data.repeats.Unrepeated`.
    size
        Root mean square over the trials, in the unit of the effort.
    trials
        Those whose equal cycles differ.
    """

    share: float
    size: float
    trials: tuple[Trial, ...]

    @property
    def words(self) -> str:
        """Why there is a lack of fit."""
        differ = f"equal cycles of the motion differ by {100.0 * self.share:.0f} % of the effort in one"
        return f"{differ}, whatever cause is taken: voluntary effort is likely"


def voluntary_effort(fitted: LikelihoodFit) -> Voluntary | None:
    """Return what a model leaves of the effort of trials that nothing stimulates and that differs between equal cycles.

    Returns
    -------
    Voluntary, or None where the cycles of no trial differ by more than those of a passive limb
    """
    schema, found = fitted.model.rig.described(), []
    for trial in (t for t in fitted.trials if t.kind == IMPOSED and not is_stimulated(t)):
        one = effort_of_repeats(trial, schema, left_by(fitted, trial))
        if one is not None and one.is_no_mechanism:
            found.append((one, trial))
    if not found:
        return None
    size = float(np.sqrt(np.mean([one.size**2 for one, _ in found])))
    return Voluntary(max(one.share for one, _ in found), size, tuple(t for _, t in found))


def shares_of_voluntary(
    voluntary: Voluntary, best: LikelihoodFit, without: Mapping[str, LikelihoodFit]
) -> dict[str, float]:
    """Return by how much simulations with and without a cause differ, over the voluntary effort's size, by cause."""
    out = {}
    for name, fitted in without.items():
        apart = [left_by(fitted, t) - left_by(best, t) for t in voluntary.trials]
        out[name] = float(np.sqrt(np.nanmean(np.concatenate(apart) ** 2))) / voluntary.size
    return out


def left_by(fitted: LikelihoodFit, trial: Trial) -> np.ndarray:
    """Return the measured effort of a trial less the simulated one, shape (n,); NaN where it was not measured."""
    own = fitted.unknowns_of(trial)
    return free_residuals(fitted.model, trial, fitted.noise, own)[fitted.model.rig.output(trial.kind)]
