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
from fes_pin.diagnosis.cause import Cause
from fes_pin.diagnosis.decide.chosen_again import ChosenAgain, is_chosen, share_of
from fes_pin.diagnosis.decide.gains_ahead import Fold, gains_of
from fes_pin.diagnosis.decide.held_out import folds_of
from fes_pin.diagnosis.decide.rivals import absorbed, alternatives, estimates, experiment, ranking
from fes_pin.diagnosis.driven_held_out import (
    Again,
    afresh,
    as_random_as_in_all,
    evidence_of,
    held_errors_ahead,
    make_folds,
    with_choices,
)
from fes_pin.diagnosis.driven_refused import (
    UNMOVED,
    Refused,
    is_moved_by_what_is_recorded,
    refused_from,
    share_in,
    unsupported,
    with_refused_causes,
)
from fes_pin.diagnosis.errors_ahead import (
    Ahead,
    AheadErrors,
    RandomPart,
    errors_ahead,
    random_parts,
)
from fes_pin.diagnosis.form_errors import FRESH, beside_what_is_new, judged_again
from fes_pin.diagnosis.remainder.driven import driven_remainder
from fes_pin.diagnosis.remainder.open_set import Remainder
from fes_pin.diagnosis.result import CROSS_VALIDATED, NOTHING, SEPARATE, Diagnosis
from fes_pin.diagnosis.search.cause_sets import names_of
from fes_pin.diagnosis.search.likelihood_models import Found, LikelihoodSearch
from fes_pin.diagnosis.search.simulation_search import Searched
from fes_pin.identify.ahead import falls
from fes_pin.identify.fit import Fit
from fes_pin.identify.lasting import words_of_reading
from fes_pin.infer.held_out import Evidence, Gain
from fes_pin.infer.scatter import as_wide_as_estimates_differ, as_wide_as_trials_differ, with_honest_intervals
from fes_pin.models.stage import Effect


@dataclass(frozen=True)
class Judged:
    """A driven study, judged.

    Attributes
    ----------
    found
        Of the search.
    left
        What is left.
    refused
        Causes that were certain in the fit, but that held-out trials did not bear out.
    evidence
        Of each cause, from trials held out.
    gains
        Of each cause, over the horizon on held-out trials; in sample where nothing could be held out.
    ahead
        Errors of the nominal and of the extended model on the trials that were fitted.
    held_out_ahead
        The same on trials held out; None where none could be.
    chosen
        For each fold, the fit to all trials of the set that is chosen without its own.
    reason
        Why no cause may be named, if none may.
    again
        The extended model fitted again without each part of the trials that is held out.
    """

    found: Found
    left: Remainder
    refused: dict[str, Refused]
    evidence: dict[str, Evidence]
    gains: dict[str, Gain]
    ahead: tuple[Ahead, Ahead]
    held_out_ahead: tuple[Ahead, Ahead] | None
    horizon_s: float
    random: tuple[RandomPart, ...]
    ceiling_percent: float
    chosen: tuple[Fit, ...]
    reason: str | None
    again: tuple[Fit, ...]

    def gain_fit(self, name: str) -> float:
        """Share, in percent, of what the extended model adds to the log-likelihood that is lost without a cause."""
        return 100.0 * share_in(self.found, name)


def judge_driven(
    search: LikelihoodSearch,
    found: Found,
    train: Sequence[Trial],
    test: Sequence[Trial],
    seed: int,
) -> Judged:
    """Hold out, and judge what is left.

    Trials that took no part speak for a cause, or not, by the rule of rigs that are simulated freely (`speaks_for`),
    with errors over the horizon: several forms together, none of them quite right, come near to anything one sample
    ahead. Before it is said that something is left, other forms of the causes are tried.

    Parameters
    ----------
    search, found
        A search that has run, and what it found.
    train, test
        Trials that were fitted, and those that the study itself holds out.
    seed
        Of critical values.
    """
    refused: dict[str, Refused] = {}
    reason = None if is_moved_by_what_is_recorded(found.best) else UNMOVED
    found = search.result(()) if reason else found
    horizon = search.models.horizon_s
    settled, formed = frozenset(found.without), set[frozenset[str]]()
    again, alike = Again(afresh), Again(as_random_as_in_all)
    while True:
        folds = make_folds(found, train, test, again)
        evidence = evidence_of(folds, found, alike) if folds else {}
        within = folds or [Fold(found.nominal, found.best, found.without, tuple(train))]
        gains = gains_of(within, found.without, horizon, seed)
        seen, random = driven_remainder(found.best, seed), random_parts(found.best)
        names = frozenset(found.without)
        if weak := unsupported(evidence, gains, seen, random):
            weakest = min(weak, key=lambda n: gains[n].low)
            refused[weakest] = refused_from(found, weakest, gains[weakest].percent)
            found = search.result(tuple(sorted(names - {weakest})))
            continue
        if names != settled:
            found, settled = search.settle(tuple(sorted(names)), {n: r.p_value for n, r in refused.items()}), names
            continue
        chosen = _chosen(search, found, train) if folds and folds[0].within and not reason else []
        if rare := [n for n in names if not is_chosen(share_of(chosen, _alike(found, n)))]:
            rarest = min(rare, key=lambda n: gains[n].low)
            refused[rarest] = refused_from(found, rarest, gains[rarest].percent)
            found = search.result(tuple(sorted(names - {rarest})))
            continue
        left = with_refused_causes(seen, random, refused)
        if not left.unexplained or names in formed or not search.form_otherwise(tuple(sorted(names))):
            break
        formed.add(names)
        refused, found = {}, search.settle(tuple(sorted(names)))  # what was refused was so beside another form
        settled = frozenset(found.without)
    falling = falls(found.best.model, train)
    folds = with_choices(folds, chosen, again) if chosen and found.without else folds
    return Judged(
        found=found,
        left=left,
        refused=refused,
        evidence=evidence,
        gains=gains,
        ahead=tuple(errors_ahead([(f, train)], horizon, falling) for f in (found.nominal, found.best)),  # type: ignore[arg-type]
        held_out_ahead=held_errors_ahead(folds, horizon, falling),
        horizon_s=horizon,
        random=random,
        ceiling_percent=_ceiling(found.best),
        chosen=tuple(chosen),
        reason=reason,
        again=tuple(f.best for f in folds if f.within),
    )


def _chosen(search: LikelihoodSearch, found: Found, train: Sequence[Trial]) -> list[Fit]:
    """What each fold would have chosen without its trials, fitted to all."""
    choose = ChosenAgain({**search.possible(), names_of(found.best): found.best}, search.earns)
    return [choose.without(out) for out in folds_of(train)]


def _alike(found: Found, name: str) -> tuple[str, ...]:
    """A cause, and what cannot be told from it."""
    return (name, *alternatives(found.best, found.rivals[name], name))


def _ceiling(fitted: Fit) -> float:
    """E of the reading noise alone, percent."""
    assert fitted.doubt is not None
    rig = fitted.model.rig
    columns = [(t[rig.output(t.kind)], fitted.doubt.white[rig.output(t.kind)] ** 2) for t in fitted.trials]
    noise = sum(float(np.isfinite(y).sum()) * variance for y, variance in columns)
    return 100.0 * noise / max(sum(float(np.nansum((y - np.nanmean(y)) ** 2)) for y, _ in columns), 1e-300)


def driven_diagnosis(
    study: Study, search: LikelihoodSearch, found: Found, trials: tuple[list[Trial], list[Trial]], seed: int
) -> Diagnosis:
    """The diagnosis of a rig whose effort answers what is read, from a search that has run."""
    judged = likeliest = judge_driven(search, found, search.models.trials, trials[1], seed)
    fresh = beside_what_is_new(search, judged.found)
    again = None if fresh is None else judged_again(search, judged.found, fresh)
    if again is not None:
        judged = _foretelling_more(judge_driven(*again, search.models.trials, trials[1], seed), judged)
    found, left = judged.found, judged.left
    best = as_wide_as_trials_differ(with_honest_intervals(found.best), judged.again)
    other = fresh if judged.found is likeliest.found else likeliest.found.best
    if other is not None and names_of(other) == names_of(best):
        best = as_wide_as_estimates_differ(best, other)
    searched = Searched(
        nominal=found.nominal,
        best=best,
        p_values=found.p_values,
        rivals=found.rivals,
        judged=best,
        without=found.without,
        scored=search.models.scored(found),
        floor=best.noise,
    )
    causes = [_cause(judged, one, best) for one in best.model.effects]
    causes.sort(key=lambda c: -c.gain_held_out.percent)
    fitted, held = judged.ahead, judged.held_out_ahead
    return Diagnosis(
        study=study,
        verdict="causes_found" if causes else ("unexplained" if left.unexplained else "adequate"),
        causes=tuple(causes),
        remainder=left,
        absorbed=absorbed(searched, search.models.library.silent()),
        nominal=found.nominal,
        extended=best,
        nominal_error=(fitted[0].free, held[0].free if held else None),
        extended_error=(fitted[1].free, held[1].free if held else None),
        ceiling_percent=judged.ceiling_percent,
        next_experiment=experiment(searched, causes, study),
        ranking=ranking(searched),
        held_out_by=SEPARATE if trials[1] else CROSS_VALIDATED if held else NOTHING,
        left_out={},
        wall_s=0.0,
        warnings=_words(best, trials[0]),
        random=judged.random,
        reason=judged.reason,
        ahead=AheadErrors(judged.horizon_s, *fitted, *(held or (None, None))),
    )


def _words(fitted: Fit, trials: Sequence[Trial]) -> tuple[str, ...]:
    """What is to be said of what is random in a fit."""
    assert fitted.doubt is not None
    said = words_of_reading(fitted.doubt, fitted.model.rig, trials)
    return (*said, FRESH) if fitted.doubt.timed else said


def _foretelling_more(other: Judged, one: Judged) -> Judged:
    """What errs less over the horizon, on trials held out where there are such; what is left by either is left.

    Beside efforts that are new in every sample little of what is left stands out: it is not what they say is random.
    """

    def error(judged: Judged) -> float:
        return (judged.held_out_ahead or judged.ahead)[1].horizon

    if not error(other) < error(one):
        return one
    return other if other.left.unexplained else replace(other, left=one.left)


def _cause(judged: Judged, one: Effect, best: Fit) -> Cause:
    """What is told of one cause; `best` has intervals as wide as its scores scatter."""
    found, name = judged.found, one.name
    alike = _alike(found, name)
    return Cause(
        name=name,
        stage=str(one.stage),
        parameters=estimates(best, name),
        equivalents=alike[1:],
        p_value=found.p_values[name],
        gain_fit=judged.gain_fit(name),
        gain_held_out=judged.gains[name],
        evidence=judged.evidence.get(name),
        chosen_again=share_of(judged.chosen, alike),
    )
