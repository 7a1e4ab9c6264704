"""Faults of a recording that are no change: a trial that states a wrong condition, efforts that were recorded late."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fes_pin.contrasts.fits import GroupedFits
from fes_pin.contrasts.grouped import Grouped
from fes_pin.contrasts.groups import in_groups
from fes_pin.contrasts.models import ContrastModels, Found
from fes_pin.data.log import EFFORT
from fes_pin.data.trial import Trial
from fes_pin.faults.conditions import Conditions, Restated
from fes_pin.faults.misread import Misread, find_misread
from fes_pin.identify.effort_timing import lateness_of
from fes_pin.identify.likelihood_fit import maximum_from
from fes_pin.infer.levels import CLAIM_LEVEL
from fes_pin.workers import attempted, in_parallel


class GroupConditions(Conditions[Grouped, ContrastModels]):
    """Conditions of the trials of a contrast: an outlier is one among the trials of its own group."""

    def misread(self, trials: Sequence[Trial], searched: Found | None) -> Misread | None:
        """Return the trial that is an outlier in its group, of all groups."""
        groups = in_groups(trials)
        models = dict.fromkeys(groups, self.nominal) if searched is None else searched.best.grouped.models
        found = [one for g, many in groups.items() if (one := find_misread(models[g], many)) is not None]
        first = min(found, key=lambda m: m.p_value, default=None)
        if first is None or not len(groups) * first.p_value < CLAIM_LEVEL:
            return None
        return replace(first, p_value=len(groups) * first.p_value)

    def leaves_noise(self, made: Restated[Grouped, ContrastModels]) -> bool:
        """Return True: where nothing changed and nothing is wrong, no explanation is simpler."""
        return True

    def saved(self, searched: Found, trials: Sequence[Trial], made: Restated[Grouped, ContrastModels]) -> float:
        """Return the fall of the criterion, with the noise of the restated trials."""
        best, after = searched.best, made.searched.best
        fits = GroupedFits(self.nominal, in_groups(trials), best.is_driven)
        return fits.again(best, after.weights).criterion - after.criterion


def late_in_groups(models: ContrastModels, found: Found) -> float | None:
    """Return the mean delay over groups with which efforts were recorded, s; None where those of a group are in time.

    A cause of all groups may be mistaken for a delay: the delay is then estimated with the nominal model as well.
    """
    rig, trials = models.nominal_model.rig, [t for many in models.trials.values() for t in many]
    if not models.driven or not all(EFFORT in rig.input_columns(t) for t in trials):
        return None
    asked = [found.best, found.nominal] if set(found.best.items) - set(found.best.changes) else [found.best]
    return next((late for one in asked if (late := _late_in(models, one)) is not None), None)


def _late_in(models: ContrastModels, one: Grouped) -> float | None:
    """Return the delay by a set, each group with nominal values of its own; None where one group is in time."""

    def late_in(group: str) -> float:
        part = models.maxima.part(one, group)
        late = lateness_of(maximum_from(part, part.trials), min(t.dt for t in part.trials))
        return math.nan if late is None else late.log.effort_late_s

    mean = attempted(lambda: float(np.mean(in_parallel(late_in, models.trials))), math.nan)
    return mean if math.isfinite(mean) else None


def is_likelier(timed: Grouped, recorded: Grouped) -> bool:
    """Return whether corrected efforts explain the same readings with a lower criterion."""
    one, other = ({n.correlation_s for n in f.weights.noise.values()} for f in (timed, recorded))
    return one == other and timed.criterion < recorded.criterion
