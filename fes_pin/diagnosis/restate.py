"""A diagnosis of a study of which one trial's condition was misread."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fes_pin.data.study import Study
from fes_pin.data.trial import Trial
from fes_pin.diagnosis.conditions import Conditions, Restated
from fes_pin.diagnosis.decide.held_out import cross_validate, errors_of, separate
from fes_pin.diagnosis.errors_ahead import Ahead
from fes_pin.diagnosis.misread import NAME, Misread, find_misread, restated_trials
from fes_pin.diagnosis.remainder.driven import driven_remainder
from fes_pin.diagnosis.result import Diagnosis
from fes_pin.diagnosis.search.simulation_search import Searched
from fes_pin.diagnosis.searches import Result, Search
from fes_pin.identify.ahead import forecast_errors, own_noise
from fes_pin.identify.fit import fit_multistart, fit_problem, noise_of, rough_noise
from fes_pin.identify.likelihood_fit import LikelihoodFit
from fes_pin.identify.per_trial import halves
from fes_pin.identify.problem import Problem
from fes_pin.infer.held_out import Errors, held_out_gain
from fes_pin.infer.result import Cause, ParameterEstimate
from fes_pin.models.model import Model
from fes_pin.models.stage import Stage


class StudyConditions(Conditions[Search, Result]):
    """Conditions of the trials of a diagnosis."""

    def misread(self, trials: Sequence[Trial], searched: Result | None) -> Misread | None:
        """The trial that stands out under what was found, or under the nominal model."""
        return find_misread(Model(self.nominal.rig) if searched is None else searched.best.model, trials)

    def has_causes(self, searched: Result) -> bool:
        """Whether any cause was found."""
        return bool(searched.best.model.effects)

    def leaves_noise(self, made: Restated[Search, Result]) -> bool:
        """Whether simulations of the restated trials leave noise alone."""
        return isinstance(made.searched, Searched) and made.searched.complete and not made.search.was_stopped

    def is_explained(self, made: Restated[Search, Result]) -> bool:
        """Whether nothing that was looked for stands out of what the restated trials leave."""
        if isinstance(made.searched, Searched):
            return made.searched.complete
        return not driven_remainder(made.searched.best).unexplained

    def saved(self, searched: Result, trials: Sequence[Trial], made: Restated[Search, Result]) -> float:
        """By how much the price falls.

        Simulations are compared under one noise, that of the restated trials; likelihoods hold their own.
        """
        one, other = searched.best, made.searched.best
        if isinstance(one, LikelihoodFit) and isinstance(other, LikelihoodFit):
            return one.price - other.price
        noise = noise_of(other)
        pairs = ((one, trials), (other, made.trials))
        before, after = (fit_problem(Problem(f.model, many, noise), f.values).price for f, many in pairs)
        return before - after


def restated_study(study: Study, nominal: Model, misread: Misread) -> Study:
    """The study with the trial's value in the place of what it states."""
    return replace(study, trials=tuple(restated_trials(nominal, study.trials, misread)))


def with_misread(
    diagnosis: Diagnosis, made: Restated[Search, Result], trials: Sequence[Trial], test: Sequence[Trial], seed: int
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


def _cause(made: Restated[Search, Result], gain_fit: float, trials: Sequence[Trial], seed: int) -> Cause:
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


def _errors_of_halves(made: Restated[Search, Result], trial: Trial) -> tuple[Errors, Errors]:
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


__all__ = ["StudyConditions", "restated_study", "with_misread"]
