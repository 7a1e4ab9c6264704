"""Faults of a recording that are no change: a trial that states a wrong condition, efforts that were recorded late."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from fes_pin.contrasts.fits import GroupedFits
from fes_pin.contrasts.grouped import Grouped
from fes_pin.contrasts.groups import in_groups
from fes_pin.contrasts.models import ContrastModels, Found
from fes_pin.data.log import EFFORT, Log
from fes_pin.data.trial import Trial
from fes_pin.faults.conditions import Conditions, Restated
from fes_pin.faults.effort_noise import words_of_noise
from fes_pin.faults.log_faults import EFFORT_NOISE, LATE_EFFORT, LogFault
from fes_pin.faults.misread import Misread, find_misread
from fes_pin.identify.effort_timing import Lateness, lateness_of, words_of_lateness
from fes_pin.identify.likelihood_fit import maximum_from
from fes_pin.infer.levels import CERTAIN_GAIN, CLAIM_LEVEL
from fes_pin.workers import attempted, in_parallel

Fault = LogFault[Grouped]


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

    def pair(
        self, made: Restated[Grouped, ContrastModels], trials: Sequence[Trial], searched: Found | None
    ) -> tuple[Grouped, Grouped]:
        """Return both fits with the noise of the restated trials."""
        after = made.searched.best
        best = after if searched is None else searched.best
        return after, GroupedFits(self.nominal, in_groups(trials), best.is_driven).again(best, after.weights)


def noise_in_groups(models: ContrastModels, found: Found, log: Log, recorded: Sequence[Trial]) -> Fault | None:
    """Return the noise of efforts that was removed before the search, with a fit to the efforts as recorded.

    It is None where none was removed, and where no time is left.
    """
    if not log.effort_noise:
        return None
    best = found.best
    fits = GroupedFits(models.nominal_model, in_groups(recorded), best.is_driven)
    bare = attempted(lambda: fits.again(best), None)
    if bare is None:
        return None
    unit = models.nominal_model.rig.units()["effort"]
    words = words_of_noise(log.effort_noise, unit)
    return Fault(EFFORT_NOISE, replace(log, effort_noise=0.0), log, bare.sse - best.sse, words, bare)


def late_in_groups(models: ContrastModels, found: Found, log: Log, recorded: Sequence[Trial]) -> Fault | None:
    """Return the mean delay over groups with which efforts were recorded; None where no effort can be late.

    Its gain is the least of a group. A cause of all groups may be mistaken for a delay: the delay is then estimated
    with the nominal model as well.
    """
    rig = models.nominal_model.rig
    if not models.driven or not all(EFFORT in rig.input_columns(t) for t in recorded):
        return None
    asked = [found.best, found.nominal] if set(found.best.items) - set(found.best.changes) else [found.best]
    late = [one for one in (attempted(partial(_late_in, models, f), None) for f in asked) if one is not None]
    if not late:
        return None
    late_s, gain = next((one for one in late if one[1] > CERTAIN_GAIN), late[0])
    timed = replace(log, effort_late_s=late_s)
    return Fault(LATE_EFFORT, log, timed, gain, words_of_lateness(timed))


def _late_in(models: ContrastModels, one: Grouped) -> tuple[float, float]:
    """Return the delay by a set, each group with nominal values of its own, and its least gain."""

    def late_in(group: str) -> Lateness:
        part = models.maxima.part(one, group)
        return lateness_of(maximum_from(part, part.trials), min(t.dt for t in part.trials))

    late = in_parallel(late_in, models.trials)
    return float(np.mean([each.log.effort_late_s for each in late])), min(each.gain for each in late)


def comparable(one: Grouped, other: Grouped) -> tuple[Grouped, Grouped] | None:
    """Return two fits as they are; None where their noise has other correlation times, so that other readings count."""
    times = ({n.correlation_s for n in f.weights.noise.values()} for f in (one, other))
    return (one, other) if next(times) == next(times) else None


ASKED = (noise_in_groups, late_in_groups)
"""Faults of a log in the order in which they are estimated."""
