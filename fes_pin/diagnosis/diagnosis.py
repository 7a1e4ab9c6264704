"""Diagnosis of a study: it is prepared, its causes are searched, and what is found is judged."""

import math
import time
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from fes_pin.data.asked import asked
from fes_pin.data.log import EFFORT, Log
from fes_pin.data.provenance import provenance_now
from fes_pin.data.study import Study
from fes_pin.data.trial import Trial
from fes_pin.diagnosis.by_effort import begun_by_effort
from fes_pin.diagnosis.by_trial import Ask, Ran, with_fault, with_faults
from fes_pin.diagnosis.likelihood_models import Found, LikelihoodModels, LikelihoodSearch, NominalFitError
from fes_pin.diagnosis.logged import (
    ASKED_OF_EFFORTS,
    ASKED_OF_READINGS,
    LogFaults,
    comparable,
    likeliest,
    with_tests,
    with_warnings,
)
from fes_pin.diagnosis.reported import diagnosis_of, unfitted
from fes_pin.diagnosis.restate import StudyConditions, with_misread
from fes_pin.diagnosis.result import Diagnosis
from fes_pin.diagnosis.testable import given_away
from fes_pin.faults.misread import restated_trials
from fes_pin.identify.feedback import is_answered
from fes_pin.identify.likelihood_fit import LikelihoodFit
from fes_pin.infer.corrected import Correction
from fes_pin.infer.held_out import FOLDS
from fes_pin.infer.text import listed
from fes_pin.models.catalogue import Catalogue, Source, catalogue_of
from fes_pin.models.model import Model
from fes_pin.models.nominal import nominal_model
from fes_pin.prepare.long_records import in_parts, searched_part
from fes_pin.prepare.measured import measured_study, split
from fes_pin.search.likelihood_fits import first_noise
from fes_pin.workers import Progress, noting_stops, one_thread_each, time_limit

LOOKED = 0.1
"""Share of a limit of time that the checks of the fitted nominal model may take in addition."""

UNCHECKED = (
    "the limit of time ended the check for shifted trials and for efforts of the opposite sign: see fes-pin check"
)
"""Warning of a diagnosis whose limit of time ended that check."""


def diagnose_joint(
    study: Study,
    *,
    library: Source | Sequence[Source] | None = None,
    seed: int = 0,
    limit: float | None = None,
    progress: Progress | None = None,
    thorough: bool = False,
) -> Diagnosis:
    """Find the causes that explain the error of a study's nominal model.

    Parameters
    ----------
    study
        Rig, start values and trials. Trials with the role "held_out" serve the gain alone; without such roles the gain
        is cross-validated over all trials.
    library
        Causes in addition to those of the library and of installed packages: files, modules, classes or what
        `load_library` made of them.
    seed
        Of the simulated critical values and bootstrap intervals.
    limit
        Seconds that the search may take; it then stops at the best set so far, and the verdict says so. The first fit
        of the nominal model and the judgement of that set take time in addition.
    progress
        Called with the share that is done and a few words.
    thorough
        Whether both estimators of a joint with recorded efforts search by themselves.

    Returns
    -------
    Diagnosis

    Raises
    ------
    InputError
        If the study has no trial to fit, a rig without a model of trials, or numbers that no verdict could follow
        from; see `prepare.measured.check_study`.
    """
    began = time.perf_counter()
    tell = asked(study, seed, limit, progress)
    catalogue, made = catalogue_of(library), provenance_now(study, seed)
    measured = measured_study(study)
    warnings = measured.odd()
    with time_limit(math.inf if limit is None else LOOKED * limit), noting_stops() as unchecked:
        warnings += given_away(measured.study)
    warnings += [UNCHECKED] * bool(unchecked)
    with one_thread_each(), noting_stops() as stops:
        work = _Work(catalogue, seed, tell, math.inf if limit is None else time.perf_counter() + limit, stops, thorough)
        diagnosis = work.diagnosis_of_log(measured.study)
    tell(1.0, "done")
    warnings += diagnosis.warnings
    train, test = split(measured.study)
    warnings += [*(few_trials(len(train)) if diagnosis.causes else []), *extrapolated(train, test)]
    found = replace(diagnosis, left_out=measured.left_out, warnings=tuple(warnings), catalogue=catalogue)
    return found.ended(began, made, limit if stops else None)


class _Work:
    """The steps from a measured study to its diagnosis.

    Parameters
    ----------
    catalogue, seed, tell
        As of `diagnose_joint`.
    end
        Time at which searches stop, of `time.perf_counter`.
    stops
        Not empty once a search was stopped; see `noting_stops`.
    thorough
        As of `diagnose_joint`.

    Attributes
    ----------
    tests
        The tests of faults of the record of the study that was searched last.
    nominal
        The fit of the nominal model to the trials as recorded, where there is one.
    """

    tests: list[Correction]
    nominal: LikelihoodFit | None = None

    def __init__(
        self, catalogue: Catalogue, seed: int, tell: Progress, end: float, stops: list[float], thorough: bool = False
    ) -> None:
        self.catalogue, self.seed, self.tell, self.end, self.stops = catalogue, seed, tell, end, stops
        self.thorough = thorough

    def diagnosis_of_log(self, study: Study) -> Diagnosis:
        """Return the diagnosis of a study as recorded, with the faults of its log corrected where that is possible."""
        nominal, (train, _) = nominal_model(study), split(study)
        driven = is_answered(nominal.rig, train)
        logged = driven and all(EFFORT in nominal.rig.input_columns(t) for t in study.trials)
        faults = LogFaults(study.trials, lambda trials: _searched(study, trials, driven), self.end)
        first = Log(effort_noise=faults.of_nominal(nominal)) if logged else Log()
        self.nominal = faults.nominal
        answer = self._logged(study, first)
        tests = list[Correction]()
        for estimate in ASKED_OF_EFFORTS if logged else ASKED_OF_READINGS:
            fault = None if self.stops else estimate(faults, answer)
            if fault is not None:
                again = partial(self._logged, study)
                answer, test = fault.decided(answer, again, likeliest, comparable)
                tests.append(test)
        timed = faults.with_timing(answer) if logged else answer
        return with_warnings(with_tests(timed, tests), tests, study.trials)

    def _logged(self, study: Study, log: Log) -> Diagnosis:
        """Return the diagnosis of a study with the given faults of its log corrected."""
        found = self.diagnosis(replace(study, trials=tuple(log.applied(t) for t in study.trials)))
        return replace(found, log=log)

    def diagnosis(self, study: Study) -> Diagnosis:
        """Search the causes of one study, judge them, and return the diagnosis."""
        nominal = nominal_model(study)
        train, test = split(study)
        answered = is_answered(nominal.rig, train)
        train, spared, said = searched_part(train, study.schema, answered)
        test = test or spared
        effects = self.catalogue.effects_for(nominal.rig)
        ran: list[LikelihoodSearch] = []
        self.tests = []

        def asked_of(model: Model, begun: Model | None = None) -> Ran:
            known = [e for e in effects if e.name not in {one.name for one in model.effects}]

            def run(trials: Sequence[Trial]) -> tuple[LikelihoodSearch, Found]:
                own = (known, answered, self.seed, study.horizon_s, first_noise(trials, answered))
                parts = trials if model.effects else in_parts(model.rig, trials, answered)
                models = LikelihoodModels(model, parts, *own)
                models.take_nominal(self.nominal)
                models.proposed = begun
                ran.append(LikelihoodSearch(models, self.tell, begun_by_effort(models, trials, self.thorough)))
                return ran[-1], ran[-1].run()

            conditions = StudyConditions(model, run)
            found = conditions.search(train)
            self.tests += conditions.tests
            return found

        try:
            found = self._judged(study, nominal, asked_of, train, test)
        except (ArithmeticError, np.linalg.LinAlgError) as problem:
            own = isinstance(problem, NominalFitError)
            reason = str(problem) if own else f"the search met numbers that are not finite ({problem})"
            found = unfitted(study, ran[-1].nominal(), reason, test)
        return replace(found, warnings=(*said, *found.warnings))

    def _judged(self, study: Study, nominal: Model, ask: Ask, train: list[Trial], test: list[Trial]) -> Diagnosis:
        with time_limit(self.end - time.perf_counter()):
            first = ask(nominal, None)
            kinds = self.catalogue.effects_for(nominal.rig) if len(train) > 1 else ()
            (search, found, again), faults = with_faults(first, ask, kinds, self.tests)
        self.tell(0.88, "held-out gain")
        whole, stated = study, train
        if again is not None:
            restated = restated_trials(nominal, study.trials, again.misread)
            train, whole = again.trials, replace(study, trials=tuple(restated))
        diagnosis = diagnosis_of(whole, search, found, (train, test))
        for fault in faults:
            diagnosis = with_fault(diagnosis, fault, first[1].nominal, test, self.seed)
        if again is not None:
            diagnosis = with_misread(diagnosis, again, stated, test, self.seed)
        return with_tests(diagnosis, self.tests)


def _searched(study: Study, trials: Sequence[Trial], driven: bool) -> list[Trial]:
    """Return the trials of a study, or the parts of them, that a search fits."""
    train, _ = split(replace(study, trials=tuple(trials)))
    return in_parts(nominal_model(study).rig, searched_part(train, study.schema, driven)[0], driven)


def few_trials(count: int) -> list[str]:
    """Return a warning that the names rest on few trials; none if there are many."""
    few = f"the names rest on {count} trial{'s' if count > 1 else ''}, fewer than {FOLDS}: more may change them"
    return [few] * (count < FOLDS)


def extrapolated(train: Sequence[Trial], test: Sequence[Trial]) -> list[str]:
    """Return a warning for each kind of held-out trial that no fitted trial has."""
    new = dict.fromkeys(t.kind for t in test if t.kind not in {one.kind for one in train})
    names = {kind: listed([t.name for t in test if t.kind == kind]) for kind in new}
    return [f"no fitted trial is of kind {kind}: errors of {names[kind]} are of an extrapolation" for kind in new]
