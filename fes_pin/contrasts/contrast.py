"""What differs between groups of trials: which parameter or cause, by how much, and what certainly did not change."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import replace

from fes_pin.contrasts.changes import change_of, not_changed
from fes_pin.contrasts.conditions import ContrastSearched, Trials, contrast_with_conditions, misread_change
from fes_pin.contrasts.fits import Fits
from fes_pin.contrasts.grouped import Grouped, noise_in
from fes_pin.contrasts.groups import BY_GROUP, grouped_study
from fes_pin.contrasts.late import is_cheaper, late_in_groups
from fes_pin.contrasts.left import left_in_groups
from fes_pin.contrasts.result import Contrast
from fes_pin.contrasts.search import ContrastFound, ContrastSearch
from fes_pin.data.asked import asked
from fes_pin.data.log import EFFORT, Log
from fes_pin.data.schema import IMPOSED
from fes_pin.data.study import Study
from fes_pin.data.trial import Trial
from fes_pin.diagnosis.diagnosis import measured_study, split
from fes_pin.diagnosis.logged import LogFaults
from fes_pin.diagnosis.long_records import searched_part
from fes_pin.diagnosis.plausibility import check_study
from fes_pin.identify.effort_noise import words_of_noise
from fes_pin.identify.feedback import is_fed_back
from fes_pin.identify.lasting import words_of_reading
from fes_pin.identify.lateness import words_of_lateness
from fes_pin.infer.result import STOPPED, Remainder
from fes_pin.models.catalogue import Catalogue, Source, catalogue_of
from fes_pin.models.model import Model
from fes_pin.models.nominal import nominal_model
from fes_pin.workers import Progress, noting_stops, one_thread_each, time_limit


def contrast(
    study: Study,
    after: Study | None = None,
    *,
    by: str = BY_GROUP,
    groups: Sequence[str] | None = None,
    library: Source | Sequence[Source] | None = None,
    seed: int = 0,
    limit: float | None = None,
    progress: Progress | None = None,
) -> Contrast:
    """Find out what differs between groups of trials of one rig.

    Parameters
    ----------
    study
        With a group in every trial; or what was measured before.
    after
        A study of the same rig: the second group.
    by
        "group", or a condition that every trial states.
    groups
        Those that are compared, in this order; by default all, in the order of the study.
    library
        Causes beside those written here and installed; see `diagnose`.
    seed
        Of simulated critical values.
    limit
        Seconds that the search may take; then it stops at the best set so far, and the verdict is "stopped". The fit of
        the model that all groups share comes on top.
    progress
        Called with a share done and a few words.

    Returns
    -------
    Contrast

    Raises
    ------
    InputError
        For fewer than two groups, groups that do not exist, trials that belong to none, studies of different rigs, and
        as `diagnose`.
    """
    began = time.perf_counter()
    tell = asked(study, seed, limit, progress)
    catalogue = catalogue_of(library)
    measured = measured_study(grouped_study(study, after, by, groups))
    joined, nominal = measured.study, nominal_model(measured.study)
    names = tuple(dict.fromkeys(t.group for t in joined.trials if t.group is not None))
    noted = [*measured.warnings, *check_study(joined, nominal)]
    end = math.inf if limit is None else began + limit
    with one_thread_each(), noting_stops() as stops:
        effects = catalogue.effects_for(nominal.rig)
        joined, words = _quieted(joined, names, nominal, end)
        trials, driven, said = _by_group(joined, names, nominal)
        said = [*noted, *words, *said]

        def run(those: Trials) -> tuple[Fits, ContrastFound]:
            made = Fits(nominal, those, effects, driven)
            with time_limit(end - time.perf_counter()):
                return made, ContrastSearch(made, seed, tell).run()

        searched = contrast_with_conditions(nominal, trials, run)
        if not stops and (late_s := late_in_groups(searched)) is not None:
            log = Log(effort_late_s=late_s)
            moved = {g: [log.applied(t) for t in many] for g, many in trials.items()}
            timed = contrast_with_conditions(nominal, moved, run)
            if is_cheaper(timed, searched):
                searched, said = timed, [words_of_lateness(log), *said]
        tell(0.95, "what is left")
        left, words = left_in_groups(searched.fits, searched.found.best, seed)
    said += [*words, *_smoothed(searched.found.best, trials)]
    tell(1.0, "done")
    answer = _answer(joined, searched, left, catalogue, said)
    if stops:
        stop = (*answer.warnings, f"the search was stopped at its limit of {limit:g} s: best set so far")
        answer = replace(answer, verdict=STOPPED, unchanged={}, excluded={}, warnings=stop)
    return replace(answer, wall_s=time.perf_counter() - began)


def _answer(
    study: Study, searched: ContrastSearched, left: Remainder, catalogue: Catalogue, said: Sequence[str]
) -> Contrast:
    """Everything that is said of a search that has run."""
    fits, found, groups = searched.fits, searched.found, tuple(searched.fits.trials)
    changes = [change_of(fits, found, i, groups, catalogue) for i in found.best.changes] + misread_change(searched)
    unchanged, excluded, untestable = not_changed(found)
    if left.unexplained:  # sizes that would have been seen are those beside a model that is right
        unchanged, excluded = {}, {}
        said = [*said, "beside what is left unexplained it cannot be said what did not change"]
    return Contrast(
        study=study,
        groups=groups,
        verdict="changed" if changes else "unexplained" if left.unexplained else "nothing_changed",
        causes=tuple(sorted(changes, key=lambda c: c.p_value)),
        common=_common(found.best),
        unchanged=unchanged,
        excluded=excluded,
        untestable=untestable,
        remainder=left,
        fit=found.best.fit,
        driven=fits.driven,
        repeats=found.best.repeats,
        warnings=tuple(said),
    )


def _by_group(study: Study, names: Sequence[str], nominal: Model) -> tuple[dict[str, list[Trial]], bool, list[str]]:
    """The trials of each group that are searched; whether the likelihood judges them; what is to be said."""
    train, _ = split(study)
    fed_back = is_fed_back(nominal.rig, train)
    trials: dict[str, list[Trial]] = {}
    warnings: list[str] = []
    for group in names:
        own = [t for t in train if t.group == group]
        trials[group], _, said = searched_part(own, study.schema, fed_back, len(names))
        warnings += [f"group {group}: {one}" for one in said]
    if any(len(many) < 2 for many in trials.values()):
        warnings.append("a group has one trial only: how much repeats differ is judged from its parts")
    return trials, fed_back or any(t.kind == IMPOSED for t in train), warnings


def _quieted(study: Study, names: Sequence[str], nominal: Model, end: float) -> tuple[Study, list[str]]:
    """The study without noise that the efforts of all groups were recorded with, and what is to be said of it."""
    train, _ = split(study)
    logged = all(EFFORT in nominal.rig.input_columns(t) for t in study.trials)
    if not logged or not is_fed_back(nominal.rig, train):
        return study, []

    def prepared(trials: Sequence[Trial]) -> list[Trial]:
        by_group, _, _ = _by_group(replace(study, trials=tuple(trials)), names, nominal)
        return [t for many in by_group.values() for t in many]

    noise = LogFaults(study.trials, prepared, end).noise_beside_nominal(nominal)
    if not noise:
        return study, []
    log = Log(effort_noise=noise)
    quiet = replace(study, trials=tuple(log.applied(t) for t in study.trials))
    return quiet, [words_of_noise(noise, nominal.rig.units()["effort"])]


def _smoothed(best: Grouped, trials: Trials) -> tuple[str, ...]:
    """What is to be said of readings of a driven rig that were smoothed: their noise lasts as long in all groups."""
    group, noise = next(iter(best.weights.items()))
    return words_of_reading(noise_in(noise), best.model.rig, trials[group])


def _common(best: Grouped) -> tuple[str, ...]:
    """Causes of all groups, but for those that differ in one."""
    differ = {i.name for i in best.changes}
    return tuple(i.name for i in best.items if i.group is None and i.name not in differ)


__all__ = ["contrast"]
