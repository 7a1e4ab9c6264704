"""Diagnosis of a study in which the condition of one trial was misread."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from fes_pin.data.trial import Trial
from fes_pin.diagnosis.errors_ahead import errors_ahead, free_errors
from fes_pin.diagnosis.held_out import Again, make_folds
from fes_pin.diagnosis.likelihood_models import Found, LikelihoodModels, LikelihoodSearch
from fes_pin.diagnosis.result import Diagnosis
from fes_pin.faults.conditions import Conditions, Restated
from fes_pin.faults.misread import NAME, Misread, find_misread
from fes_pin.identify.fit import rough_fit
from fes_pin.identify.likelihood_fit import LikelihoodFit, maximum_from, refit
from fes_pin.identify.per_trial import halves
from fes_pin.infer.held_out import Errors, held_out_gain
from fes_pin.infer.result import Cause
from fes_pin.infer.search import SearchResult
from fes_pin.models.model import Model
from fes_pin.models.stage import Stage
from fes_pin.prepare.long_records import in_parts
from fes_pin.remainder.lack_of_fit import lack_of_fit
from fes_pin.remainder.unrepeated import voluntary_effort

Run = Callable[[list[Trial]], tuple[LikelihoodSearch, Found]]
"""Search of trials: returns the search and its result."""
Made = Restated[LikelihoodFit, LikelihoodModels]


class StudyConditions(Conditions[LikelihoodFit, LikelihoodModels]):
    """Conditions of the trials of a diagnosis."""

    def misread(self, trials: Sequence[Trial], searched: Found | None) -> Misread | None:
        """Return the trial that is an outlier under the causes found, or under the nominal model.

        A subject who does not relax makes outliers too: none is returned where equal cycles differ.
        """
        if searched is not None and voluntary_effort(searched.best) is not None:
            return None
        return find_misread(self.nominal if searched is None else searched.best.model, trials)

    def leaves_noise(self, made: Made) -> bool:
        """Return whether the restated trials have no lack of fit."""
        return not made.search.was_stopped and made.search.models.leaves_noise(made.searched.best)

    def is_explained(self, made: Made) -> bool:
        """Return whether no test finds a lack of fit in the restated trials."""
        return not lack_of_fit(made.searched.best).unexplained

    def pair(self, made: Made, trials: Sequence[Trial], searched: Found | None) -> tuple[LikelihoodFit, LikelihoodFit]:
        """Return the fits of both answers."""
        best = made.searched.best
        if searched is not None:
            return best, searched.best
        return best, maximum_from(best, in_parts(best.model.rig, trials, made.search.models.answered))


def with_misread(
    diagnosis: Diagnosis, made: Made, trials: Sequence[Trial], test: Sequence[Trial], seed: int
) -> Diagnosis:
    """Return the diagnosis of the restated study with the misreading as its first cause.

    Parameters
    ----------
    trials, test
        Trials as stated, on which the errors of the nominal model are found.
    """
    before = rough_fit(Model(made.misread.whole.model.rig), trials)
    stated = free_errors(before.model, trials, before.noise)
    removed = held_out_gain(stated, stated, free_errors(diagnosis.nominal.model, made.trials, before.noise), seed)
    cause = _cause(made, removed.percent, trials, seed)
    stated_parts = in_parts(before.model.rig, trials, made.search.models.answered)
    nominal = maximum_from(made.searched.nominal, stated_parts)
    return with_first(diagnosis, cause, nominal, made.searched.best, test)


def with_first(
    diagnosis: Diagnosis, cause: Cause, nominal: LikelihoodFit, best: LikelihoodFit, test: Sequence[Trial]
) -> Diagnosis:
    """Return the diagnosis with a fault of the record as its first cause.

    Parameters
    ----------
    nominal
        Fit of the nominal model to the trials as they were stated and recorded, whose errors are reported.
    best
        Fit whose noise is the unit of the errors.
    test
        Trials held out, as they were stated.
    """
    restated = replace(diagnosis, causes=(cause, *diagnosis.causes), verdict="causes_found")
    if diagnosis.ahead is None:
        return restated
    alone = SearchResult(nominal, nominal, {}, {}, {})
    held = [(f.best, best, f.test) for f in make_folds(alone, nominal.trials, test, Again(refit))]
    horizon, falling = diagnosis.ahead.horizon_s, diagnosis.ahead.nominal.free is None
    inside, outside = (errors_ahead(some, horizon, falling) for some in ([(nominal, best, nominal.trials)], held))
    ahead = replace(diagnosis.ahead, nominal=inside, nominal_held_out=outside)
    return replace(restated, nominal_error=(inside.free, outside.free), ahead=ahead)


def _cause(made: Made, gain_fit: float, trials: Sequence[Trial], seed: int) -> Cause:
    misread = made.misread
    trial = next(t for t in trials if t.name == misread.trial)
    stated, restated = _errors_of_halves(made, trial)
    return Cause(
        name=NAME,
        stage=str(Stage.RIG),
        parameters={misread.condition: misread.estimate},
        equivalents=(),
        p_value=misread.p_value,
        gain_fit=gain_fit,
        gain_held_out=held_out_gain(stated, stated, restated, seed),
        trial=misread.trial,
        words=misread.words,
    )


def _errors_of_halves(made: Made, trial: Trial) -> tuple[Errors, Errors]:
    """Return errors on a trial of the model fitted to the others: as stated, and at the estimate of its other half."""
    misread, others = made.misread, made.misread.others
    plain = free_errors(others.model, [trial], others.noise)
    restated = [others.model.rig.restated(trial, misread.condition, v) for v in misread.halves]
    by_half = [free_errors(others.model, [one], others.noise) for one in restated]
    odd, _ = halves(len(plain.squares))
    squares = np.where(odd, by_half[1].squares, by_half[0].squares)  # each piece by the value of the other half
    return plain, Errors(squares, plain.spread, plain.noise)
