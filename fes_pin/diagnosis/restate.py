"""A study with one trial's condition in doubt is searched with the value that the trial must have had.

Where that takes away most of what the nominal model gets wrong it comes first, and where only noise is then left
nothing can be simpler. Else trials are searched as stated, and one that stands out beside the causes that were found is
restated then. A misreading competes with every other explanation by price: the causes that the restated trials still
need, with its own parameter, against those that the trials as stated need.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fes_pin.data.study import Study
from fes_pin.data.trial import Trial
from fes_pin.diagnosis.decide.held_out import cross_validate, errors_of, separate
from fes_pin.diagnosis.errors_ahead import Ahead
from fes_pin.diagnosis.misread import NAME, Misread, find_misread, restated_trials, takes_most
from fes_pin.diagnosis.remainder.driven import driven_remainder
from fes_pin.diagnosis.result import Diagnosis
from fes_pin.diagnosis.search.simulation_search import Searched
from fes_pin.diagnosis.searches import Result, Search
from fes_pin.identify.ahead import forecast_errors, own_noise
from fes_pin.identify.fit import Fit, fit_multistart, fit_problem, noise_of, rough_noise
from fes_pin.identify.likelihood_fit import LikelihoodFit
from fes_pin.identify.per_trial import halves
from fes_pin.identify.problem import Problem
from fes_pin.infer.held_out import Errors, held_out_gain
from fes_pin.infer.levels import PARAMETER_PRICE, SEPARABLE
from fes_pin.infer.result import Cause, ParameterEstimate
from fes_pin.models.model import Model
from fes_pin.models.stage import Stage
from fes_pin.workers import OutOfTime

Run = Callable[[list[Trial]], tuple[Search, Result]]


@dataclass(frozen=True)
class Restated:
    """A search on trials of which one is restated, and why.

    Attributes
    ----------
    misread
        What the trial must have had.
    trials
        Those that were searched, restated.
    search, searched
        On them.
    """

    misread: Misread
    trials: list[Trial]
    search: Search
    searched: Result


def search_with_conditions(nominal: Model, trials: Sequence[Trial], run: Run) -> tuple[Search, Result, Restated | None]:
    """Search trials, and again with one of them restated if it stands out and that is the cheaper explanation.

    Parameters
    ----------
    nominal
        With start values.
    run
        Searches trials.
    """
    first = _found(Model(nominal.rig), trials)
    chief = first is not None and takes_most(first, trials)  # some trial is always the worst
    made = _restated(nominal, trials, first, run) if first is not None and chief else None
    if made is not None and not made.searched.best.model.effects and _leaves_noise(made):
        return made.search, made.searched, made
    search, searched = run(list(trials))
    if made is None and not search.was_stopped:
        best = searched.best.model
        misread = _found(best, trials) if best.effects else first
        made = None if misread is None else _restated(nominal, trials, misread, run)
        if made is not None and not _leaves_nothing(made):
            made = None  # beside a model that is not right itself, a trial is odd by the model's error
    if made is None or search.was_stopped or made.search.was_stopped:
        return search, searched, None
    price = PARAMETER_PRICE + 2.0 * math.log(sum(len(nominal.rig.stated(t)) for t in trials))
    if not _saved(searched.best, trials, made.searched.best, made.trials) > price + SEPARABLE:
        return search, searched, None
    return made.search, made.searched, made


def _found(model: Model, trials: Sequence[Trial]) -> Misread | None:
    """A misreading under a model; none where time is over, or where the model cannot be calculated with."""
    try:
        return find_misread(model, trials)
    except (OutOfTime, ArithmeticError, np.linalg.LinAlgError):
        return None


def _restated(nominal: Model, trials: Sequence[Trial], misread: Misread, run: Run) -> Restated:
    """A search of the restated trials; once more with the value beside the causes that it finds."""
    other = restated_trials(nominal, trials, misread)
    search, searched = run(other)
    if searched.best.model.effects and not search.was_stopped:
        again = _found(searched.best.model, trials)
        if again is not None and (again.trial, again.condition) == (misread.trial, misread.condition):
            misread, other = again, restated_trials(nominal, trials, again)
            search, searched = run(other)
    return Restated(misread, other, search, searched)


def _leaves_nothing(made: Restated) -> bool:
    """Whether the restated trials are explained: nothing that was looked for stands out of what is left."""
    if isinstance(made.searched, Searched):
        return made.searched.complete
    return not driven_remainder(made.searched.best).unexplained


def _leaves_noise(made: Restated) -> bool:
    return isinstance(made.searched, Searched) and made.searched.complete and not made.search.was_stopped


def _saved(one: Fit, trials: Sequence[Trial], other: Fit, restated_trials: Sequence[Trial]) -> float:
    """By how much the price falls from the best set of the trials as stated to that of the restated ones.

    Simulations are compared under one noise, that of the latter; likelihoods hold their own.
    """
    if isinstance(one, LikelihoodFit) and isinstance(other, LikelihoodFit):
        return one.price - other.price
    noise = noise_of(other)
    pairs = ((one, trials), (other, restated_trials))
    before, after = (fit_problem(Problem(f.model, many, noise), f.values).price for f, many in pairs)
    return before - after


def restated_study(study: Study, nominal: Model, misread: Misread) -> Study:
    """The study with the trial's value in the place of what it states."""
    return replace(study, trials=tuple(restated_trials(nominal, study.trials, misread)))


def with_misread(
    diagnosis: Diagnosis, made: Restated, trials: Sequence[Trial], test: Sequence[Trial], seed: int
) -> Diagnosis:
    """The diagnosis of the restated study with the misreading as its first cause.

    Parameters
    ----------
    trials, test
        As they were stated: the errors of the nominal model are those on these.
    """
    before = made.misread.whole
    if before.model.effects:
        bare = Model(before.model.rig)
        before = fit_multistart(Problem(bare, trials, before.noise), bare.parameters())
    floor = rough_noise(before.model, trials)
    pair = (errors_of(before.model, trials, floor), errors_of(diagnosis.nominal.model, made.trials, floor))
    cause = _cause(made, held_out_gain(pair[0], *pair, seed).percent, trials, seed)
    told = replace(diagnosis, causes=(cause, *diagnosis.causes), verdict="causes_found")
    if isinstance(before, LikelihoodFit) or diagnosis.ahead is None:
        return told
    horizon = diagnosis.ahead.horizon_s
    held = (
        separate(before, before, {}, test, floor, horizon)
        if test
        else cross_validate(before, before, {}, lambda _: before, floor, horizon)
    )
    assert held.ahead is not None
    inside = Ahead.of(forecast_errors(before.model, trials, own_noise(before), floor, horizon))
    ahead = replace(diagnosis.ahead, nominal=inside, nominal_held_out=Ahead.of(held.ahead[0]))
    return replace(told, nominal_error=(pair[0].error_percent(), held.nominal.error_percent()), ahead=ahead)


def _cause(made: Restated, gain_fit: float, trials: Sequence[Trial], seed: int) -> Cause:
    misread = made.misread
    unit = made.misread.whole.model.rig.schema.conditions.get(misread.condition)
    trial = next(t for t in trials if t.name == misread.trial)
    stated, told = _errors_of_halves(made, trial)
    return Cause(
        name=NAME,
        stage=str(Stage.RIG),
        parameters={
            misread.condition: ParameterEstimate(misread.value, misread.std, unit.unit if unit is not None else "m")
        },
        equivalents=(),
        p_value=misread.p_value,
        gain_fit=gain_fit,
        gain_held_out=held_out_gain(stated, stated, told, seed),
        trial=misread.trial,
        words=misread.words,
    )


def _errors_of_halves(made: Restated, trial: Trial) -> tuple[Errors, Errors]:
    """Errors on the trial of the model that was fitted to the others: as stated, and as its other half tells it."""
    misread, others = made.misread, made.misread.others
    plain = errors_of(others.model, [trial], others.noise)
    by_half = [
        errors_of(others.model, [others.model.rig.restated(trial, misread.condition, v)], others.noise)
        for v in misread.halves
    ]
    pieces = len(plain.squares)
    odd = halves(pieces)[0]
    squares = np.where(odd, by_half[1].squares, by_half[0].squares)  # each piece by the value of the other half
    return plain, Errors(squares, plain.spread, plain.noise)


__all__ = ["Restated", "restated_study", "search_with_conditions", "with_misread"]
