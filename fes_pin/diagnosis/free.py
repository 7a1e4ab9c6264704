"""The diagnosis of rigs that are judged by free simulation: from the inputs alone, each trial from its start."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from fes_pin.data.study import Study
from fes_pin.data.trial import Trial
from fes_pin.diagnosis.decide.chosen_again import ChosenAgain, is_chosen, share_of
from fes_pin.diagnosis.decide.doubts import doubts, with_error
from fes_pin.diagnosis.decide.held_out import HeldOut, cross_validate, errors_of, separate
from fes_pin.diagnosis.decide.rivals import absorbed, equivalents, estimates, experiment, ranking
from fes_pin.diagnosis.errors_ahead import free_errors
from fes_pin.diagnosis.remainder.open_set import unexplained_remainder
from fes_pin.diagnosis.result import Diagnosis
from fes_pin.diagnosis.search.cause_sets import names_of
from fes_pin.diagnosis.search.misspecified import under_one_noise
from fes_pin.diagnosis.search.simulation_search import Searched, SimulationSearch
from fes_pin.identify.ahead import default_horizon
from fes_pin.identify.fit import Fit, rough_noise
from fes_pin.infer.held_out import held_out_gain, speaks_for
from fes_pin.infer.levels import CERTAIN_LEVEL
from fes_pin.infer.noise import NoiseModel
from fes_pin.infer.result import CROSS_VALIDATED, FITTED, HELD_OUT, STOPPED, Cause, Remainder
from fes_pin.models.model import Model

OF_THE_MEAN = 100.0
"""E in percent of a prediction that is nothing but the mean of what was measured, by eq. (2): a set of causes that
predicts worse than that, on the very trials it was fitted to, explains nothing."""
CONTENDERS = 4
"""Rivals that are fitted again, for least error, where no set leaves only noise; folds choose among them."""


def judge_free(
    study: Study, search: SimulationSearch, searched: Searched, test: Sequence[Trial], seed: int
) -> Diagnosis:
    """The verdict on what a search found: causes that trials held out bear out, and what is left."""
    horizon = study.horizon_s or default_horizon(searched.nominal.trials)
    left = unexplained_remainder(searched.best, seed)
    causes, held = _causes(search, searched, left, test, seed, horizon)
    refused: list[Cause] = []
    if searched.stopped and not all(is_supported(c, True) for c in causes):
        searched = search.stopped(())
        left = unexplained_remainder(searched.best, seed)
        causes, held = [], None
    while not searched.stopped and (weak := [c for c in causes if not is_supported(c, len(causes) == 1)]):
        weakest = min(weak, key=lambda c: c.gain_held_out.low)
        refused.append(weakest)
        searched = search.settle(tuple(sorted(c.name for c in causes if c is not weakest)))
        left = unexplained_remainder(searched.best, seed)
        causes, held = _causes(search, searched, left, test, seed, horizon)
    worthless = bool(causes) and _error(searched.best, searched.floor) > OF_THE_MEAN
    if worthless:
        searched, causes = search.stopped(()) if searched.stopped else search.settle(()), []
        left, held = unexplained_remainder(searched.best, seed), _held_out(search, searched, test, horizon)
    causes.sort(key=lambda c: -c.gain_held_out.percent)
    left, reason = with_error(with_refused(left, refused), searched)
    if worthless:
        left, reason = replace(left, unexplained=True), "the best set of causes predicts worse than a mean would"
    if not causes and not searched.complete and not searched.stopped:
        searched = search.for_prediction(searched)
        held = _held_out(search, searched, test, horizon)
    nominal, best = searched.nominal, searched.best
    verdict = "causes_found" if causes else ("unexplained" if left.unexplained else "adequate")
    in_sample = errors_of(best.model, best.trials, searched.floor)
    return Diagnosis(
        study=study,
        verdict=verdict,
        causes=tuple(causes),
        remainder=left,
        absorbed=absorbed(searched, search.library.silent()),
        nominal=nominal,
        extended=best,
        nominal_error=(_error(nominal, searched.floor), held.nominal.error_percent() if held else None),
        extended_error=(in_sample.error_percent(), held.chosen.error_percent() if held else None),
        ceiling_percent=in_sample.ceiling_percent(),
        next_experiment=experiment(searched, causes, study),
        ranking=ranking(searched),
        held_out_by=_on(test, held),
        left_out={},
        wall_s=0.0,
        warnings=tuple(doubts(searched, len(causes))),
        reason=reason,
        ahead=free_errors(nominal, best, searched.floor, horizon, held.ahead if held else None),
    )


def unfitted(study: Study, nominal: Fit, reason: str, test: Sequence[Trial]) -> Diagnosis:
    """The diagnosis where fits did not converge: that the search stopped, and why."""
    floor = rough_noise(Model(nominal.model.rig), nominal.trials)
    inside = errors_of(nominal.model, nominal.trials, floor)
    outside = errors_of(nominal.model, test, floor).error_percent() if test else None
    return Diagnosis(
        study=study,
        verdict=STOPPED,
        causes=(),
        remainder=Remainder(True, math.nan, None),
        absorbed=(),
        nominal=nominal,
        extended=nominal,
        nominal_error=(inside.error_percent(), outside),
        extended_error=(inside.error_percent(), outside),
        ceiling_percent=inside.ceiling_percent(),
        next_experiment=None,
        ranking={},
        held_out_by=HELD_OUT if test else FITTED,
        left_out={},
        wall_s=0.0,
        reason=reason,
    )


def is_supported(cause: Cause, alone: bool) -> bool:
    """True if trials that took no part support a cause, and it is chosen without them as well; see `speaks_for`.

    By their errors alone where the model leaves more than noise: a likelihood says little there, and is no `evidence`.
    """
    return speaks_for(cause.evidence, cause.gain_held_out, alone) and is_chosen(cause.chosen_again)


def _on(test: Sequence[Trial], held: HeldOut | None) -> str:
    """What data gains are found on."""
    return HELD_OUT if test else CROSS_VALIDATED if held else FITTED


def with_refused(left: Remainder, refused: Sequence[Cause]) -> Remainder:
    """A remainder also where a cause was certain, but trials that took no part did not bear out its form."""
    certain = [c for c in refused if c.p_value < CERTAIN_LEVEL]
    if left.unexplained or not certain:
        return left
    surest = min(certain, key=lambda c: c.p_value)
    return replace(left, unexplained=True, p_value=surest.p_value, where=surest.stage)


def _error(fitted: Fit, floor: NoiseModel) -> float:
    return errors_of(fitted.model, fitted.trials, floor).error_percent()


def _held_out(search: SimulationSearch, searched: Searched, test: Sequence[Trial], horizon_s: float) -> HeldOut | None:
    nominal, best, without, floor = searched.nominal, searched.best, searched.without, searched.floor
    if test:
        return separate(nominal, best, without, test, floor, horizon_s)
    if len(nominal.trials) < 2 or searched.stopped:
        return None
    fits = search.sets.fits
    if not searched.complete:
        near = sorted((f for fits in searched.rivals.values() for f in fits), key=lambda f: f.sse)[:CONTENDERS]
        others = under_one_noise(near, best.trials, best.noise)
        fits = {names_of(f): f for f in (*others, *without.values(), nominal)}
    again = ChosenAgain({**fits, names_of(best): best}, search.claims.earns)
    return cross_validate(nominal, best, without, again.without, floor, horizon_s)


def _causes(
    search: SimulationSearch, searched: Searched, left: Remainder, test: Sequence[Trial], seed: int, horizon_s: float
) -> tuple[list[Cause], HeldOut | None]:
    best, nominal = searched.best, searched.nominal
    held = _held_out(search, searched, test, horizon_s)
    inside = {n: errors_of(f.model, f.trials, searched.floor) for n, f in searched.without.items()}
    inside_nominal = errors_of(nominal.model, nominal.trials, searched.floor)
    inside_best = errors_of(best.model, best.trials, searched.floor)
    measured = held or HeldOut(inside_nominal, inside_best, inside, {}, inside_best)
    on, out = _on(test, held), []
    for one in best.model.effects:
        name = one.name
        alike = equivalents(searched, name, left)
        gain = held_out_gain(measured.nominal, measured.without[name], measured.extended, seed)
        evidence = measured.evidence.get(name)
        out.append(
            Cause(
                name=name,
                stage=str(one.stage),
                parameters=estimates(best, name),
                equivalents=alike,
                p_value=searched.p_values[name],
                gain_fit=held_out_gain(inside_nominal, inside[name], inside_best, seed).percent,
                gain_held_out=replace(gain, on=on),
                evidence=replace(evidence, on=on) if evidence and searched.complete else None,
                chosen_again=share_of(measured.folds, (name, *alike)),
            )
        )
    return out, held
