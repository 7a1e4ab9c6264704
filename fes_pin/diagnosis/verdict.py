"""The diagnosis of rigs whose effort answers what is read of them, by one likelihood.

Errors come back as input there (`identify.feedback`), and a free simulation of the best of models runs away. Every set
of causes is judged by the likelihood of its one-step-ahead predictions, with a random effort at the joint; see
`identify.likelihood`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from fes_pin.data.study import Study
from fes_pin.data.trial import Trial
from fes_pin.diagnosis.decide.chosen_again import ChosenAgain, is_chosen, share_of
from fes_pin.diagnosis.decide.rivals import alternatives, estimates, experiment, not_identifiable, ranking
from fes_pin.diagnosis.errors_ahead import (
    Ahead,
    AheadErrors,
    RandomPart,
    are_large,
    errors_ahead,
    free_errors,
    noise_that_is_small,
    random_parts,
)
from fes_pin.diagnosis.estimators import WHITE_PROCESS_NOISE, found_with_white_process_noise, judged_again, least_error
from fes_pin.diagnosis.held_out import (
    Again,
    Fold,
    as_random_as_in_all,
    evidence_of,
    folds_of,
    gains_of,
    held_errors_ahead,
    make_folds,
    refit,
    with_choices,
)
from fes_pin.diagnosis.rejected import UNMOVED, is_moved_by_what_is_recorded, no_noise, with_rejected_causes
from fes_pin.diagnosis.remainder.lack_of_fit import lack_of_fit
from fes_pin.diagnosis.result import Diagnosis
from fes_pin.diagnosis.search.cause_sets import names_of
from fes_pin.diagnosis.search.likelihood_models import Found, LikelihoodModels, LikelihoodSearch
from fes_pin.identify.ahead import falls
from fes_pin.identify.correlation_time import words_of_reading
from fes_pin.identify.likelihood import is_simulated
from fes_pin.identify.likelihood_fit import LikelihoodFit
from fes_pin.infer.levels import FORM_SHARE
from fes_pin.infer.result import CROSS_VALIDATED, FITTED, HELD_OUT, Cause, Remainder
from fes_pin.infer.scatter import as_wide_as_estimates_differ, as_wide_as_trials_differ, with_honest_intervals
from fes_pin.infer.verdict import State, Verdict, Weighed, share_in, word_of
from fes_pin.models.stage import Effect
from fes_pin.workers import in_parallel


@dataclass(frozen=True)
class RigWeighed(Weighed):
    """What trials say of a set of causes; gains are over the horizon.

    Attributes
    ----------
    folds
        Trials that are held out, and fits without them; none where none can be.
    random
        What acts at random beside the set.
    no_noise
        Why the error of a simulation is no noise of a reading, if it is none.
    """

    lack_of_fit: Remainder
    folds: Sequence[Fold]
    random: tuple[RandomPart, ...]
    no_noise: str | None


Judgement = State[LikelihoodFit, RigWeighed]


class RigVerdict(Verdict[LikelihoodFit, LikelihoodModels, RigWeighed]):
    """How it is judged what a search by the likelihood found.

    Trials that took no part speak for a cause, or not, by `speaks_for`, with errors over the horizon: several forms
    together, none of them quite right, come near to anything one sample ahead.

    Parameters
    ----------
    search
        That has run.
    test
        Trials that the study itself holds out.
    seed
        Of critical values.
    """

    def __init__(self, search: LikelihoodSearch, test: Sequence[Trial], seed: int) -> None:
        super().__init__(search)
        self.models, self.test, self.seed = search.models, tuple(test), seed
        self.again, self._alike = Again(refit), Again(as_random_as_in_all)
        self._chosen: dict[int, tuple[Found, list[LikelihoodFit]]] = {}

    def weigh(self, found: Found) -> RigWeighed:
        """What held-out trials, and the tests of lack of fit, say of a set."""
        folds = make_folds(found, self.models.trials, self.test, self.again)
        within = folds or [Fold(found.nominal, found.best, found.without, self.models.trials)]
        return RigWeighed(
            gains=gains_of(within, found.without, self.models.judged_s, self.seed),
            evidence=evidence_of(folds, found, self._alike) if folds else {},
            lack_of_fit=lack_of_fit(found.best, self.seed),
            folds=folds,
            random=random_parts(found.best),
            no_noise=no_noise(found.best),
        )

    def unsupported(self, state: Judgement) -> list[str]:
        """Causes that trials which took no part do not speak for.

        Where something acts that no cause explains, one that explains no more than an error of form may be of that.
        """
        gains = state.weighed.gains
        if are_large(state.weighed.random) and (form := [n for n in gains if gains[n].low < 100.0 * FORM_SHARE]):
            return form
        return super().unsupported(state)

    def lack_of_fit(self, state: Judgement) -> Remainder:
        """What is left: by the features, or a random effort that is too large, or a cause that was refused."""
        stages = {e.name: str(e.stage) for e in self.models.library.effects}
        left = with_rejected_causes(state.weighed.lack_of_fit, state.weighed.random, state.rejected, stages)
        wrong = not left.unexplained and state.weighed.no_noise is not None
        return replace(left, unexplained=True, where="time") if wrong else left

    def is_rarely_chosen(self, state: Judgement, name: str) -> bool:
        """Whether most folds choose neither a cause nor what cannot be told from it."""
        return not is_chosen(share_of(self.chosen(state), _alike(state.found, name)))

    def chosen(self, state: Judgement) -> list[LikelihoodFit]:
        """For each fold, the fit to all trials of the set that is chosen without its own; none where none are made."""
        found, folds = state.found, state.weighed.folds
        if not folds or not folds[0].within:
            return []
        if id(found) not in self._chosen:
            fits = {**self.search.possible(), names_of(found.best): found.best}
            choose = ChosenAgain(fits, self.search.improves)
            self._chosen[id(found)] = found, [choose.without(out) for out in folds_of(self.models.trials)]
        return self._chosen[id(found)][1]


@dataclass(frozen=True)
class Judged:
    """A driven study, judged.

    Attributes
    ----------
    state
        That no claim objects to.
    left
        What is left.
    ahead
        Errors of the nominal and of the extended model on the trials that were fitted.
    held_out_ahead
        The same on trials held out; None where none could be.
    chosen
        For each fold, the fit to all trials of the set that is chosen without its own.
    reason
        Why something is unexplained, where no test of lack of fit says so.
    is_free
        Whether it is judged by free simulations.
    """

    state: Judgement
    left: Remainder
    ahead: tuple[Ahead, Ahead]
    held_out_ahead: tuple[Ahead, Ahead] | None
    horizon_s: float
    chosen: tuple[LikelihoodFit, ...]
    reason: str | None
    is_free: bool

    @property
    def found(self) -> Found:
        """The set, its rivals, and the set less each cause."""
        return self.state.found

    @property
    def again(self) -> tuple[LikelihoodFit, ...]:
        """The extended model fitted again without each part of the trials that is held out."""
        return tuple(f.best for f in self.state.weighed.folds if f.within)


def judged_of(search: LikelihoodSearch, found: Found, test: Sequence[Trial], seed: int) -> Judged:
    """Hold out, and judge what is left; see `RigVerdict` and `infer.verdict`.

    Parameters
    ----------
    search, found
        A search that has run, and what it found.
    test
        Trials that the study itself holds out.
    seed
        Of critical values.
    """
    reason = None if is_moved_by_what_is_recorded(found.best) else UNMOVED
    verdict = RigVerdict(search, test, seed)
    state = verdict.of(search.result(()) if reason else found)
    found, train = state.found, search.models.trials
    falling = search.models.answered and falls(found.best.model, train)
    chosen = [] if reason else verdict.chosen(state)
    folds = (
        with_choices(state.weighed.folds, chosen, verdict.again) if chosen and found.without else state.weighed.folds
    )
    horizon_s, pair = search.models.horizon_s, (found.nominal, found.best)
    one, other = (errors_ahead([(f, found.best, train)], horizon_s, falling) for f in pair)
    left = verdict.lack_of_fit(state)
    if reason is None and left.unexplained and left.where == "time" and not state.weighed.lack_of_fit.unexplained:
        reason = state.weighed.no_noise
    return Judged(
        state=state,
        left=left,
        ahead=(one, other),
        held_out_ahead=held_errors_ahead(folds, horizon_s, falling),
        horizon_s=horizon_s,
        chosen=tuple(chosen),
        reason=reason,
        is_free=search.models.judged_s is None,
    )


def _alike(found: Found, name: str) -> tuple[str, ...]:
    """A cause, and what cannot be told from it."""
    return (name, *alternatives(found.best, found.rivals[name], name))


def _ceiling(fitted: LikelihoodFit) -> float:
    """E of the reading noise alone, percent: of a simulation where there is no process noise."""
    if is_simulated(fitted.noise, fitted.trials):
        return free_errors(fitted.model, fitted.trials, noise_that_is_small(fitted)).ceiling_percent()
    rig = fitted.model.rig
    columns = [(t[rig.output(t.kind)], fitted.noise.white[rig.output(t.kind)] ** 2) for t in fitted.trials]
    noise = sum(float(np.isfinite(y).sum()) * variance for y, variance in columns)
    return 100.0 * noise / max(sum(float(np.nansum((y - np.nanmean(y)) ** 2)) for y, _ in columns), 1e-300)


def diagnosis_of(
    study: Study, search: LikelihoodSearch, found: Found, trials: tuple[list[Trial], list[Trial]], seed: int
) -> Diagnosis:
    """The diagnosis of a rig whose effort answers what is read, from a search that has run."""
    judged = likeliest = judged_of(search, found, trials[1], seed)
    white = found_with_white_process_noise(search, judged.found)
    again = None if white is None else judged_again(search, judged.found, white)
    if judged.left.unexplained and again is None:
        again = least_error(search)
    if again is not None:
        judged = _predicting_better(judged_of(*again, trials[1], seed), judged, search.models)
    found, left = judged.found, judged.left
    best = as_wide_as_trials_differ(with_honest_intervals(found.best), judged.again)
    other = white if judged.found is likeliest.found else likeliest.found.best
    if other is not None and names_of(other) == names_of(best):
        best = as_wide_as_estimates_differ(best, other)
    fitted, held = judged.ahead, judged.held_out_ahead
    on = HELD_OUT if trials[1] else CROSS_VALIDATED if held else FITTED
    causes = [_cause(judged, one, best, on) for one in best.model.effects]
    causes.sort(key=lambda c: -c.gain_held_out.percent)
    return Diagnosis(
        study=study,
        verdict=word_of(bool(causes), left),
        causes=tuple(causes),
        remainder=left,
        absorbed=not_identifiable(best, search.models.scored(found), search.models.library.not_excited()),
        nominal=found.nominal,
        extended=best,
        nominal_error=(fitted[0].free, held[0].free if held else None),
        extended_error=(fitted[1].free, held[1].free if held else None),
        ceiling_percent=_ceiling(found.best),
        next_experiment=experiment(best, found.rivals, causes, study),
        ranking=ranking(best, found.rivals),
        held_out_by=on,
        left_out={},
        wall_s=0.0,
        warnings=_words(best, trials[0]),
        random=judged.state.weighed.random,
        is_driven=search.models.judged_s is not None,
        reason=judged.reason,
        ahead=AheadErrors(judged.horizon_s, *fitted, *(held or (None, None))),
    )


def _words(fitted: LikelihoodFit, trials: Sequence[Trial]) -> tuple[str, ...]:
    """What is to be said of what is random in a fit."""
    said = words_of_reading(fitted.noise, fitted.model.rig, trials)
    return (*said, WHITE_PROCESS_NOISE) if fitted.noise.timed else said


def _predicting_better(other: Judged, one: Judged, models: LikelihoodModels) -> Judged:
    """The estimator whose set predicts better; what either says is unexplained stays unexplained.

    Errors are those of fits to a part of the fitted trials on the other part, or of the fits themselves where there is
    but one trial. Trials that the study holds out have no say: gains on them would be optimistic. Of a rig that a
    controller drives errors are judged over the horizon, of others those of free simulations. With efforts that are new
    in every sample little lack of fit stands out: it is not what these say is random.
    """
    if not error_within(other, models) < error_within(one, models):
        return one
    return other if other.left.unexplained else replace(other, left=one.left, reason=one.reason)


def error_within(judged: Judged, models: LikelihoodModels) -> float:
    """E of a set on the fitted trials, percent, each predicted by a fit to the others."""
    train, folds = models.trials, judged.state.weighed.folds
    if folds and folds[0].within:
        _, ahead = judged.held_out_ahead or judged.ahead
    else:
        best = judged.found.best
        held = folds_of(train) if len(train) > 1 else []
        others = in_parallel(lambda out: refit(best, [t for i, t in enumerate(train) if i not in out]), held)
        pairs = [(f, f, [train[i] for i in out]) for f, out in zip(others, held, strict=True)]
        ahead = errors_ahead(pairs or [(best, best, train)], judged.horizon_s, falling=False)
    return ahead.horizon if ahead.free is None or not judged.is_free else ahead.free


def _cause(judged: Judged, one: Effect, best: LikelihoodFit, on: str) -> Cause:
    """What is reported of one cause; `best` has intervals as wide as its scores scatter.

    Its gains are found `on` such data. A likelihood is no evidence where the model leaves more than noise.
    """
    found, name, weighed = judged.found, one.name, judged.state.weighed
    evidence = None if weighed.lack_of_fit.unexplained else weighed.evidence.get(name)
    alike = _alike(found, name)
    return Cause(
        name=name,
        stage=str(one.stage),
        parameters=estimates(best, name),
        equivalents=alike[1:],
        p_value=found.p_values[name],
        gain_fit=100.0 * share_in(found, name),
        gain_held_out=replace(weighed.gains[name], on=on),
        evidence=replace(evidence, on=on) if evidence else None,
        chosen_again=share_of(judged.chosen, alike),
    )
