"""The diagnosis that reports a verdict on a rig, or that its fits did not converge."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from fes_pin.data.study import Study
from fes_pin.data.trial import Trial
from fes_pin.diagnosis.by_effort import InverseDynamics, ValuesOfInverseDynamics, ValuesOfTheSameSet, named_by_one
from fes_pin.diagnosis.decide.chosen_again import share_of
from fes_pin.diagnosis.decide.rivals import estimates, experiment, not_identifiable, ranking, seen_sizes
from fes_pin.diagnosis.errors_ahead import AheadErrors, free_errors, noise_that_is_small
from fes_pin.diagnosis.estimators import WHITE_PROCESS_NOISE, LeastSquares, SlowProcessNoise, WhiteProcessNoise
from fes_pin.diagnosis.likelihood_models import Found, LikelihoodModels, LikelihoodSearch
from fes_pin.diagnosis.rejected import UNMOVED
from fes_pin.diagnosis.result import Diagnosis
from fes_pin.diagnosis.verdict import RigState, RigVerdict
from fes_pin.identify.afar import at_a_bound
from fes_pin.identify.correlation_time import words_of_reading
from fes_pin.identify.fit import rough_noise
from fes_pin.identify.likelihood import is_simulated
from fes_pin.identify.likelihood_fit import LikelihoodFit
from fes_pin.infer.estimators import choose
from fes_pin.infer.result import CROSS_VALIDATED, FITTED, HELD_OUT, STOPPED, Cause, Gain, ParameterEstimate, Remainder
from fes_pin.infer.scatter import as_wide_as_estimates_differ, with_honest_intervals
from fes_pin.infer.verdict import ADEQUATE, Rejected, word_of
from fes_pin.infer.why import why_of
from fes_pin.models.describe import fitted_equation, fitted_sentence
from fes_pin.models.model import Model
from fes_pin.models.stage import Effect
from fes_pin.search.likelihood_fits import LikelihoodFits


def _ceiling(fitted: LikelihoodFit) -> float:
    """Return E of the measurement noise alone, percent; without process noise, that of a free simulation."""
    if is_simulated(fitted.noise, fitted.trials):
        return free_errors(fitted.model, fitted.trials, noise_that_is_small(fitted)).ceiling_percent()
    rig = fitted.model.rig
    columns = [(t[rig.output(t.kind)], fitted.noise.white[rig.output(t.kind)] ** 2) for t in fitted.trials]
    noise = sum(float(np.isfinite(y).sum()) * variance for y, variance in columns)
    return 100.0 * noise / max(sum(float(np.nansum((y - np.nanmean(y)) ** 2)) for y, _ in columns), 1e-300)


def diagnosis_of(
    study: Study, search: LikelihoodSearch, found: Found, trials: tuple[list[Trial], list[Trial]]
) -> Diagnosis:
    """Return the diagnosis of a rig from a search by the likelihood that has run."""
    first, white = RigVerdict(search, trials[1]).of(found), WhiteProcessNoise()
    by_effort = (InverseDynamics(), ValuesOfInverseDynamics())
    estimators = (SlowProcessNoise(), *by_effort, white, LeastSquares(), ValuesOfTheSameSet())
    state: RigState = choose(first, estimators, search.models.seed)
    verdict = state.verdict
    assert isinstance(verdict, RigVerdict)
    other = white.fit if state.replaced is None else state.replaced.found.best
    found, left, best = state.found, verdict.lack_of_fit(state), _with_intervals(state, other)
    fitted, *others = verdict.errors(state)
    held = others[0] if others else None
    on = HELD_OUT if trials[1] else CROSS_VALIDATED if held else FITTED
    causes = [
        _cause(verdict, state, e, best, (state.weighed.fitted[e.name], on))
        for e in best.model.effects
        if not e.is_fault
    ]
    causes.sort(key=lambda c: -c.gain_held_out.percent)
    said = [*named_by_one(first, state), *words_of_reading(best.noise, best.model.rig, trials[0])]
    said += _words_of_far(search.models, found.nominal)
    said += words_of_bounds(state.rejected, found.best, search.models.model)
    reached = [e for e in (fitted[1].free, held and held[1].free) if e is not None]
    word = word_of(bool(causes), left)
    return Diagnosis(
        study=study,
        verdict=word,
        causes=tuple(causes),
        remainder=left,
        absorbed=not_identifiable(best, search.models.scored(found), search.models.library.not_excited()),
        nominal=found.nominal,
        extended=best,
        nominal_error=(fitted[0].free, held[0].free if held else None),
        extended_error=(fitted[1].free, held[1].free if held else None),
        ceiling_percent=min([_ceiling(found.best), *reached]),
        next_experiment=experiment(best, found.rivals, causes, study),
        ranking=ranking(state.likeliest, found.rivals),
        held_out_by=on,
        warnings=(*said, *[WHITE_PROCESS_NOISE] * bool(best.noise.timed)),
        seen=_seen(search.models, found.nominal, word),
        random=state.weighed.random,
        is_driven=search.models.judged_s is not None,
        likeliest=state.likeliest,
        reason=left.reason if not left.unexplained or state.weighed.is_moved else UNMOVED,
        why=why_of(state),
        ahead=AheadErrors(search.models.horizon_s, *fitted, *(held or (None, None))),
    )


def words_of_bounds(rejected: Mapping[str, Rejected], fitted: LikelihoodFit, believed: Model) -> list[str]:
    """Return a sentence for each cause that explains much and is not named as a nominal parameter ended at a bound."""
    ended = " and ".join(f"{n} = {fitted.values[n]:.4g}" for n in sorted(at_a_bound(fitted, believed)))
    of_none = [n for n, one in rejected.items() if one.claim == "drop_of_no_model" and one.gain.low > 0.0]
    why = f"is not named, as {ended} ends at a bound: hold it in [rig], or mend what is believed of the rig"
    return [f"{n} explains {rejected[n].gain.percent:.3g} % and {why}" for n in of_none] if ended else []


def _seen(models: LikelihoodModels, nominal: LikelihoodFit, verdict: str) -> dict[str, ParameterEstimate]:
    """Return the size of each cause above which a search would have named it; none of a model that is not adequate."""
    if verdict != ADEQUATE:
        return {}
    return seen_sizes(nominal, models.library.scores(nominal), models.family.tests)


def _with_intervals(state: RigState, other: LikelihoodFit | None) -> LikelihoodFit:
    """Return the fit of a set with its intervals, which include the differences between estimators.

    Parameters
    ----------
    other
        Fit by another estimator, which counts if it is of the same set; None without one.
    """
    best = state.verdict.estimated(state)
    if other is not None and other.names == best.names:
        best = as_wide_as_estimates_differ(best, with_honest_intervals(other))
    return state.search.models.as_wide_as_efforts(best)


def _words_of_far(models: LikelihoodFits, nominal: LikelihoodFit) -> list[str]:
    """Return a warning where the nominal model does not follow the data."""
    far = "the nominal model does not follow the data: causes were fitted from least squares"
    return [far] if models.is_far(nominal) else []


def unfitted(study: Study, nominal: LikelihoodFit, reason: str, test: Sequence[Trial]) -> Diagnosis:
    """Return the diagnosis where fits did not converge: the verdict is "stopped", with the reason."""
    floor = rough_noise(Model(nominal.model.rig), nominal.trials)
    inside = free_errors(nominal.model, nominal.trials, floor)
    outside = free_errors(nominal.model, test, floor).error_percent() if test else None
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
        held_out_by=HELD_OUT if test else FITTED,
        reason=reason,
    )


def _cause(verdict: RigVerdict, state: RigState, one: Effect, best: LikelihoodFit, judged: tuple[Gain, str]) -> Cause:
    """Return the report of one cause.

    Parameters
    ----------
    best
        The fit, with the intervals of the sandwich estimator.
    judged
        Its gain on the fitted trials, and the data on which it is judged.
    """
    fitted, on = judged
    found, name, evidence = state.found, one.name, verdict.evidence(state)[one.name]
    alike = verdict.alike(state, name)
    return Cause(
        name=name,
        sentence=fitted_sentence(one, best.model.rig),
        equation=fitted_equation(one, best.model.rig),
        stage=str(one.stage),
        parameters=estimates(best, name),
        equivalents=alike[1:],
        p_value=found.p_values[name],
        gain_fit=fitted.percent,
        gain_held_out=replace(state.weighed.gains[name], on=on),
        evidence=None if evidence is None else replace(evidence, on=on),
        chosen_again=share_of(verdict.chosen(state), alike),
    )
