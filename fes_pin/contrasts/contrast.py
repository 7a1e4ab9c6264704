"""Contrast of groups of trials: the parameters and causes that changed, by how much, and those that did not."""

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

from fes_pin.contrasts.changes import change_of, misread_change, not_changed
from fes_pin.contrasts.faults import ASKED, GroupConditions, comparable
from fes_pin.contrasts.fits import GroupedFits
from fes_pin.contrasts.grouped import Grouped
from fes_pin.contrasts.groups import BY_GROUP, grouped_study, in_groups, labels_of
from fes_pin.contrasts.models import POLICY, ContrastModels, ContrastSearch, Found
from fes_pin.contrasts.result import Contrast
from fes_pin.contrasts.verdict import ContrastVerdict
from fes_pin.data.asked import asked
from fes_pin.data.log import EFFORT, Log
from fes_pin.data.provenance import provenance_now
from fes_pin.data.schema import IMPOSED
from fes_pin.data.study import Study
from fes_pin.data.trial import Trial
from fes_pin.faults.conditions import Restated
from fes_pin.faults.effort_noise import EffortNoise
from fes_pin.faults.log_faults import said_of
from fes_pin.identify.correlation_time import words_of_reading
from fes_pin.identify.feedback import is_fed_back
from fes_pin.infer.corrected import Correction
from fes_pin.infer.why import why_of
from fes_pin.models.catalogue import Catalogue, Source, catalogue_of
from fes_pin.models.nominal import nominal_model
from fes_pin.prepare.long_records import searched_part
from fes_pin.prepare.measured import measured_study, split
from fes_pin.workers import Progress, noting_stops, one_thread_each, time_limit

UNCONFIRMED = "{} is significant in the fitted trials, but {}"


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
    """Find the changes between groups of trials of one rig.

    Parameters
    ----------
    study
        A study with a group in every trial; or the study of the first group.
    after
        The study of the second group, of the same rig.
    by
        "group", or a condition that every trial states.
    groups
        Groups that are compared, in this order; by default all, in the order of the study.
    library
        Causes in addition to those of the library and of installed packages; see `diagnose`.
    seed
        Of simulated critical values.
    limit
        Seconds that the search may take; then it stops at the best set so far, and the verdict is "stopped". The fit of
        the model that all groups share takes time in addition.
    progress
        Called with the share that is done and a few words.

    Returns
    -------
    Contrast

    Raises
    ------
    InputError
        For fewer than two groups, groups that do not exist, trials that belong to none, studies of different rigs, a
        nominal model that predicts nothing finite, and as `diagnose`.
    """
    began = time.perf_counter()
    tell = asked(study, seed, limit, progress)
    catalogue = catalogue_of(library)
    measured = measured_study(grouped_study(study, after, by, groups))
    made = provenance_now(study, seed)
    if after is not None:  # the files of each study are listed by its name
        both = zip(labels_of(study, after), (study, after), strict=True)
        files = {f"{label}/{path}": sha for label, one in both for path, sha in one.inputs().items()}
        made = replace(made, inputs=files)
    warnings = measured.odd()
    with one_thread_each(), noting_stops() as stops:
        end = math.inf if limit is None else began + limit
        found = _Work(measured.study, catalogue, seed, tell, end, stops).contrast()
    tell(1.0, "done")
    found = replace(found, warnings=(*warnings, *found.warnings))
    return found.ended(began, made, limit if stops else None)


@dataclass(frozen=True)
class _Answer:
    """A search that has run: its result, the trials that were restated for it, the log that was applied.

    `recorded` are the trials that would be searched of the log as it is.
    """

    search: ContrastSearch
    found: Found
    made: Restated[Grouped, ContrastModels] | None
    log: Log
    recorded: list[Trial]
    said: list[str]
    tests: list[Correction]


class _Work:
    """The steps from a study of groups to its contrast.

    Parameters
    ----------
    study
        The measured study, with a group in every trial.
    catalogue, seed, tell
        As in `contrast`.
    end
        Time at which searches stop, of `time.perf_counter`.
    stops
        Not empty once a search was stopped; see `noting_stops`.
    """

    def __init__(
        self, study: Study, catalogue: Catalogue, seed: int, tell: Progress, end: float, stops: list[float]
    ) -> None:
        self.study, self.catalogue, self.seed, self.tell = study, catalogue, seed, tell
        self.end, self.stops = end, stops
        self.nominal, (train, _) = nominal_model(study), split(study)
        self.fed_back = is_fed_back(self.nominal.rig, train)
        self.driven = self.fed_back or any(t.kind == IMPOSED for t in train)

    def contrast(self) -> Contrast:
        """Search the changes, judge them, and return the contrast."""
        answer, tests = self._logged(Log(effort_noise=self._noise_of_efforts())), list[Correction]()
        for estimate in ASKED:
            fault = None if self.stops else estimate(answer.search.models, answer.found, answer.log, answer.recorded)
            if fault is not None:
                answer, test = fault.decided(answer, self._logged, lambda one: one.found.best, comparable)
                tests.append(test)
        self.tell(0.9, "held-out evidence")
        said = said_of(tests, self.study.trials)
        return self._judged(answer, [*answer.said, *said], (*tests, *answer.tests))

    def _logged(self, log: Log) -> _Answer:
        """Return the answer for a log, before it is judged."""
        trials, said = self._searched([log.applied(t) for t in self.study.trials])
        recorded, _ = self._searched(self.study.trials)
        conditions = GroupConditions(self.nominal, self._run)
        with time_limit(self.end - time.perf_counter()):
            found = conditions.search(trials)
        return _Answer(*found, log, recorded, said, conditions.tests)

    def _noise_of_efforts(self) -> float:
        """Return the noise of recorded efforts in all groups, in their unit; 0 where the likelihood supports none."""
        if not self.fed_back or not all(EFFORT in self.nominal.rig.input_columns(t) for t in self.study.trials):
            return 0.0
        faults = EffortNoise(self.study.trials, lambda trials: self._searched(trials)[0], self.end)
        return faults.of_nominal(self.nominal)

    def _searched(self, trials: Sequence[Trial]) -> tuple[list[Trial], list[str]]:
        """Return the trials of each group, or the parts of them, that a search takes, and warnings."""
        groups, out, said = in_groups(split(replace(self.study, trials=tuple(trials)))[0]), [], []
        for group, many in groups.items():
            part, _, words = searched_part(many, self.study.schema, self.fed_back, len(groups))
            out += part
            said += [f"group {group}: {one}" for one in words]
        if min(map(len, in_groups(out).values())) < 2:
            said.append("a group has one trial only: differences between repeats are estimated from its parts")
        return out, said

    def _run(self, trials: Sequence[Trial]) -> tuple[ContrastSearch, Found]:
        effects = self.catalogue.effects_for(self.nominal.rig)
        models = ContrastModels(GroupedFits(self.nominal, in_groups(trials), self.driven, effects), self.seed)
        search = ContrastSearch(models, self.tell, POLICY)
        return search, search.run()

    def _judged(self, answer: _Answer, said: list[str], tests: tuple[Correction, ...]) -> Contrast:
        """Return the contrast of a search that has run."""
        search, made = answer.search, answer.made
        state = ContrastVerdict(search).of(answer.found)
        models, found, best, left = search.models, state.found, state.found.best, state.weighed.lack_of_fit
        evidence = state.weighed.evidence
        changes = [change_of(models, found, i, evidence.get(str(i))) for i in best.changes]
        changes += [misread_change(models, made.misread)] if made is not None else []
        unchanged, excluded, untestable = not_changed(models, best)
        smoothed = max(best.weights.noise.values(), key=lambda n: n.correlation_s)
        said += [*state.weighed.said, *words_of_reading(smoothed, best.grouped.rig, best.trials)]
        said += [UNCONFIRMED.format(n, one.reason) for n, one in state.rejected.items()]
        if left.of_some:
            said.append("with a lack of fit in one group no change can be excluded")
        if left.of_some or self.stops:  # excluded sizes hold for a right model and a whole search only
            unchanged, excluded = {}, {}
        return Contrast(
            study=self.study,
            groups=tuple(models.trials),
            verdict="changed" if changes else "unexplained" if left.of_some else "nothing_changed",
            causes=tuple(sorted(changes, key=lambda c: c.p_value)),
            common=best.common,
            unchanged=unchanged,
            excluded=excluded,
            untestable=untestable,
            remainder=left,
            fit=best,
            driven=best.is_driven,
            repeats=best.repeats,
            warnings=tuple(said),
            catalogue=self.catalogue,
            why=replace(why_of(state), corrections=tests),
        )


__all__ = ["contrast"]
