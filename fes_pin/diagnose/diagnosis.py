"""The verdict: which causes are named, how sure, with what gain, and what stays open."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from fes_pin.data.errors import InputError
from fes_pin.data.spikes import without_spikes
from fes_pin.data.study import Study
from fes_pin.data.trial import Trial
from fes_pin.diagnose.decide.doubts import doubts, with_error
from fes_pin.diagnose.decide.held_out import Evidence, Gain, HeldOut, cross_validate, errors_of, gain, separate
from fes_pin.diagnose.driven import AheadErrors, RandomPart, judge_driven
from fes_pin.diagnose.experiment import SEPARABLE, NextExperiment, next_experiment
from fes_pin.diagnose.long_records import searched_part, thinned
from fes_pin.diagnose.plausibility import check_study
from fes_pin.diagnose.remainder.open_set import Remainder, remainder
from fes_pin.diagnose.search.promise import best_by_effect
from fes_pin.diagnose.search.search import Search, Searched, Unfit
from fes_pin.diagnose.search.set_search import Found, SetSearch
from fes_pin.diagnose.search.sets import Sets
from fes_pin.diagnose.search.unfinished import alike
from fes_pin.identify.feedback import is_fed_back
from fes_pin.identify.fit import Fit, rough_noise
from fes_pin.identify.noise import NoiseModel
from fes_pin.identify.per_trial import amplitude
from fes_pin.models.catalogue import Catalogue, Source, catalogue_of, installed
from fes_pin.models.model import Model
from fes_pin.models.nominal import nominal_model
from fes_pin.workers import one_thread_each, time_limit

ABSORBED_BELOW = 0.04
"""Share of its norm that an effect's sensitivity must keep beside the nominal parameters to be testable."""
REFUSED_LEVEL = 1e-6
"""Level of a cause at which something is there even if held-out trials refuse the name."""
CONTENDERS = 4
"""Sets that each fold chooses among anew."""


@dataclass(frozen=True)
class ParameterEstimate:
    """A value with its standard deviation (infinite: not identified) and unit."""

    value: float
    std: float
    unit: str


@dataclass(frozen=True)
class Cause:
    """One named cause; see contract: `equivalents` cannot be told from it by these data."""

    name: str
    stage: str
    parameters: dict[str, ParameterEstimate]
    equivalents: tuple[str, ...]
    p_value: float
    gain_fit: float
    gain_held_out: Gain
    evidence: Evidence | None = None

    def helps(self, complete: bool, alone: bool) -> bool:
        """True if trials that took no part speak for it.

        By their likelihood where the model leaves only noise, by their open-loop errors where it does not; where other
        causes stand beside it by both, for several flexible forms together come near to anything. A cause alone may
        have no gain: if one trial of many reaches a stop, the others do not foretell it.
        """
        known = self.evidence if complete else None
        likely = known is None or known.low > 0.0
        return likely and (self.gain_held_out.low > 0.0 or (known is not None and alone))


@dataclass(frozen=True)
class Ranked:
    """A candidate beside the others: how far the whole fit falls short of the best with it in the cause's place."""

    names: tuple[str, ...]
    shortfall: float


@dataclass(frozen=True)
class Diagnosis:
    """What a simulation gets wrong.

    Attributes
    ----------
    verdict
        "adequate", "causes_found" or "unexplained".
    causes
        By held-out gain, largest first.
    model
        The extended model: it can be simulated, fitted and diagnosed again.
    absorbed
        Causes that these data could not show.
    ranking
        For each cause, its rivals by shortfall in twice the log-likelihood.
    left_out
        Samples taken for spikes, by trial and column; in `study` they hold what their neighbours say.
    warnings
        What is odd about the study, and what could not be done, one line each.
    reason
        Why something is unexplained, where it is no test of the remainder that says so: nothing could be fitted, or an
        error stays that is no noise.
    catalogue
        The causes that were looked for, of which the rig can have some.
    """

    study: Study
    verdict: str
    causes: tuple[Cause, ...]
    remainder: Remainder
    absorbed: tuple[str, ...]
    nominal: Fit
    extended: Fit
    nominal_error: tuple[float | None, float | None]
    extended_error: tuple[float | None, float | None]
    ceiling_percent: float
    next_experiment: NextExperiment | None
    ranking: dict[str, tuple[Ranked, ...]]
    held_out_by: str
    left_out: dict[str, dict[str, tuple[int, ...]]]
    wall_s: float = field(compare=False)
    warnings: tuple[str, ...] = ()
    reason: str | None = None
    catalogue: Catalogue = field(default_factory=installed, compare=False)
    random: tuple[RandomPart, ...] = ()
    ahead: AheadErrors | None = None

    @property
    def model(self) -> Model:
        """The extended model."""
        return self.extended.model

    def explained_percent(self) -> float:
        """Share of the nominal model's squared error above the noise that all causes together remove, 0 to 100.

        On trials that took no part, where there are such; of a driven rig of the errors over the horizon.
        """
        if self.ahead is not None:
            one = self.ahead.nominal_held_out or self.ahead.nominal
            other = self.ahead.extended_held_out or self.ahead.extended
            return float(np.clip(100.0 * (one.horizon - other.horizon) / max(one.horizon, 1e-300), 0.0, 100.0))
        outside = self.nominal_error[1] is not None and self.extended_error[1] is not None
        before, after = (e[1] if outside else e[0] for e in (self.nominal_error, self.extended_error))
        assert before is not None
        assert after is not None
        excess = max(before - self.ceiling_percent, before - after, 1e-300)
        return float(np.clip(100.0 * (before - after) / excess, 0.0, 100.0))

    def __str__(self) -> str:
        from fes_pin.diagnose.text import verdict_text  # noqa: PLC0415

        return verdict_text(self)


Progress = Callable[[float, str], None]


def diagnose(
    study: Study,
    *,
    library: Source | Sequence[Source] | None = None,
    seed: int = 0,
    limit: float | None = None,
    progress: Progress | None = None,
) -> Diagnosis:
    """Find out what the nominal model of a study gets wrong.

    Parameters
    ----------
    study
        Rig, start values and trials. Trials with the role "held_out" take no part but in the gain; without such roles
        the gain is cross-validated over all trials.
    library
        Causes beside those written here and installed: files, modules, classes or what `load_library` made of them.
    seed
        Of what is simulated: critical values and bootstrap intervals.
    limit
        Seconds that the search may take; then it stops at the best set so far, and says so. What is done with that set,
        and the first fit of the nominal model, come on top.
    progress
        Called with a share done and a few words.

    Returns
    -------
    Diagnosis

    Raises
    ------
    InputError
        If the study has no trial to fit, a rig without a model of trials, or numbers that no verdict could follow
        from; see `plausibility.check_study`.
    """
    began = time.perf_counter()
    tell = progress or (lambda _share, _words: None)
    catalogue = catalogue_of(library)
    study, left_out = despiked_study(study)
    nominal = nominal_model(study)
    warnings = check_study(study, nominal)
    train, test = split(study)
    train, spared, said = searched_part(train)
    test, warnings = test or spared, warnings + said
    effects = catalogue.effects_for(nominal.rig)
    with one_thread_each():
        recorded = train if said else [t for t in study.trials if t.role != "held_out"]
        search: Search | SetSearch
        if is_fed_back(nominal.rig, train):
            search = SetSearch(Sets(nominal, train, effects), seed, tell)
        else:
            search = Search(nominal, train, recorded, seed, tell, effects)
        try:
            with time_limit(math.inf if limit is None else limit - (time.perf_counter() - began)):
                searched = search.run()
            tell(0.88, "held-out gain")
            if isinstance(search, SetSearch):
                diagnosis = _of_driven(study, search, searched, (train, test), seed)  # type: ignore[arg-type]
            else:
                diagnosis = _judge(study, search, searched, test, seed)  # type: ignore[arg-type]
        except Unfit as problem:
            diagnosis = _unfitted(study, problem.nominal, str(problem), test)
        except (ArithmeticError, np.linalg.LinAlgError) as problem:
            reason = f"the search met numbers that cannot be calculated with ({problem})"
            diagnosis = _unfitted(study, search.nominal(), reason, test)
    tell(1.0, "done")
    warnings += diagnosis.warnings
    if limit is not None and search.was_stopped:
        warnings.append(f"the search was stopped at its limit of {limit:g} s: best set so far, gains on fitted trials")
    found = replace(diagnosis, left_out=left_out, warnings=tuple(warnings), catalogue=catalogue)
    return replace(found, wall_s=time.perf_counter() - began)


def _of_driven(
    study: Study, search: SetSearch, found: Found, trials: tuple[list[Trial], list[Trial]], seed: int
) -> Diagnosis:
    """The diagnosis of a rig whose effort answers what is read; see `diagnose.driven`."""
    judged = judge_driven(search, found, *trials, seed)
    found, left = judged.found, judged.left
    best = found.best
    searched = Searched(
        nominal=found.nominal,
        best=best,
        p_values=found.p_values,
        rivals=found.rivals,
        judged=best,
        without=found.without,
        scored=found.scored,
        floor=best.noise,
    )
    causes = [
        Cause(
            name=one.name,
            stage=str(one.stage),
            parameters=_estimates(best, one.name),
            equivalents=_alike(best, found.rivals[one.name], one.name),
            p_value=found.p_values[one.name],
            gain_fit=judged.gain_fit(one.name),
            gain_held_out=gain(judged.nominal, judged.without[one.name], judged.extended, seed),
            evidence=judged.evidence.get(one.name),
        )
        for one in best.model.effects
    ]
    causes.sort(key=lambda c: -c.gain_held_out.percent)
    fitted, held = judged.ahead, judged.held_out_ahead
    return Diagnosis(
        study=study,
        verdict="causes_found" if causes else ("unexplained" if left.unexplained else "adequate"),
        causes=tuple(causes),
        remainder=left,
        absorbed=_absorbed(searched, found.silent),
        nominal=found.nominal,
        extended=best,
        nominal_error=(fitted[0].free, held[0].free if held else None),
        extended_error=(fitted[1].free, held[1].free if held else None),
        ceiling_percent=judged.ceiling_percent,
        next_experiment=_experiment(searched, causes, study),
        ranking=_ranking(searched),
        held_out_by="the study's held-out trials" if trials[1] else "cross-validation over trials",
        left_out={},
        wall_s=0.0,
        random=judged.random,
        ahead=AheadErrors(judged.horizon_s, *fitted, *(held or (None, None))),
    )


def despiked_study(study: Study) -> tuple[Study, dict[str, dict[str, tuple[int, ...]]]]:
    """A study without the spikes of its measured columns, and which samples they were, by trial and column.

    A sample that its neighbours replace is no evidence of its own: intervals are too narrow by half the share of such
    samples, half a percent where one in a hundred is a spike.
    """
    rig, trials, found = nominal_model(study).rig, [], {}
    for trial in study.trials:
        clean, spikes = without_spikes(trial, rig.outputs(trial.kind))
        trials.append(clean)
        if spikes:
            found[trial.name] = spikes
    return (replace(study, trials=tuple(trials)) if found else study), found


def split(study: Study) -> tuple[list[Trial], list[Trial]]:
    """Trials to fit and trials that the study holds out.

    Free motion is fitted at the rate that its noise is modelled at: without an input there is nothing faster to follow.
    """
    test = [t for t in study.trials if t.role == "held_out"]
    train = [
        t if set(study.schema.inputs) & set(t.columns) else thinned(t) for t in study.trials if t.role != "held_out"
    ]
    if not train:
        raise InputError("expected at least one trial to fit; all have role = held_out", file=study.folder)
    return train, test


def _judge(study: Study, search: Search, searched: Searched, test: Sequence[Trial], seed: int) -> Diagnosis:
    left = remainder(searched.best, seed)
    causes, held = _causes(searched, left, test, seed)
    refused: list[Cause] = []
    if searched.stopped and not all(c.helps(False, True) for c in causes):
        searched = search.stopped(())
        left = remainder(searched.best, seed)
        causes, held = [], None
    while not searched.stopped and (weak := [c for c in causes if not c.helps(searched.complete, len(causes) == 1)]):
        weakest = min(weak, key=lambda c: c.gain_held_out.low)
        refused.append(weakest)
        searched = search.settle(tuple(sorted(c.name for c in causes if c is not weakest)))
        left = remainder(searched.best, seed)
        causes, held = _causes(searched, left, test, seed)
    causes.sort(key=lambda c: -c.gain_held_out.percent)
    left, reason = with_error(_with_refused(left, refused), searched)
    if searched.stopped and not causes:
        left, reason = replace(left, unexplained=True), "the search was stopped before a cause earned its place"
    if not causes and not searched.complete and not searched.stopped:
        searched = search.for_prediction(searched)
        held = _held_out(searched, test)
    nominal, best = searched.nominal, searched.best
    verdict = "causes_found" if causes else ("unexplained" if left.unexplained else "adequate")
    in_sample = errors_of(best.model, best.trials, searched.floor)
    return Diagnosis(
        study=study,
        verdict=verdict,
        causes=tuple(causes),
        remainder=left,
        absorbed=_absorbed(searched, search.library.silent()),
        nominal=nominal,
        extended=best,
        nominal_error=(_error(nominal, searched.floor), held.nominal.error_percent() if held else None),
        extended_error=(in_sample.error_percent(), held.chosen.error_percent() if held else None),
        ceiling_percent=in_sample.ceiling_percent(),
        next_experiment=_experiment(searched, causes, study),
        ranking=_ranking(searched),
        held_out_by="held-out trials" if test else "cross-validation over trials",
        left_out={},
        wall_s=0.0,
        warnings=tuple(doubts(searched, len(causes))),
        reason=reason,
    )


def _unfitted(study: Study, nominal: Fit, reason: str, test: Sequence[Trial]) -> Diagnosis:
    """What is said where no fit carries a verdict: that something is unexplained, and why."""
    floor = rough_noise(Model(nominal.model.rig), nominal.trials)
    inside = errors_of(nominal.model, nominal.trials, floor)
    outside = errors_of(nominal.model, test, floor).error_percent() if test else None
    return Diagnosis(
        study=study,
        verdict="unexplained",
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
        held_out_by="held-out trials" if test else "cross-validation over trials",
        left_out={},
        wall_s=0.0,
        reason=reason,
    )


def _with_refused(left: Remainder, refused: Sequence[Cause]) -> Remainder:
    """A remainder also where a cause was certain, but trials that took no part did not bear out its form."""
    certain = [c for c in refused if c.p_value < REFUSED_LEVEL]
    if left.unexplained or not certain:
        return left
    surest = min(certain, key=lambda c: c.p_value)
    return replace(left, unexplained=True, p_value=surest.p_value, where=surest.stage)


def _error(fitted: Fit, floor: NoiseModel) -> float:
    return errors_of(fitted.model, fitted.trials, floor).error_percent()


def _held_out(searched: Searched, test: Sequence[Trial]) -> HeldOut | None:
    if test:
        return separate(searched.nominal, searched.best, searched.without, test, searched.floor)
    if len(searched.nominal.trials) < 2 or searched.stopped:
        return None
    contenders = sorted((f for fits in searched.rivals.values() for f in fits), key=lambda f: f.sse)[:CONTENDERS]
    if not searched.complete:
        contenders = alike(contenders, searched.best.trials, searched.best.noise)
    return cross_validate(searched.nominal, searched.best, searched.without, contenders, searched.floor)


def _causes(
    searched: Searched, left: Remainder, test: Sequence[Trial], seed: int
) -> tuple[list[Cause], HeldOut | None]:
    best, nominal = searched.best, searched.nominal
    held = _held_out(searched, test)
    inside = {n: errors_of(f.model, f.trials, searched.floor) for n, f in searched.without.items()}
    inside_nominal = errors_of(nominal.model, nominal.trials, searched.floor)
    inside_best = errors_of(best.model, best.trials, searched.floor)
    out = []
    for one in best.model.effects:
        name = one.name
        measured = held or HeldOut(inside_nominal, inside_best, inside, {}, inside_best)
        out.append(
            Cause(
                name=name,
                stage=str(one.stage),
                parameters=_estimates(best, name),
                equivalents=_equivalents(searched, name, left),
                p_value=searched.p_values[name],
                gain_fit=gain(inside_nominal, inside[name], inside_best, seed).percent,
                gain_held_out=gain(measured.nominal, measured.without[name], measured.extended, seed),
                evidence=measured.evidence.get(name),
            )
        )
    return out, held


def _estimates(fitted: Fit, name: str) -> dict[str, ParameterEstimate]:
    info, values, out = fitted.model.parameter_info(), fitted.values, {}
    (one,) = (e for e in fitted.model.effects if e.name == name)
    refined = one.refined()
    if one.each_trial:
        first = one.parameters()[one.unknowns()[0]]
        out["amplitude"] = ParameterEstimate(*amplitude(fitted, one), first.in_units(fitted.model.rig.units()).unit)
    for n in one.common():
        key = f"{name}.{n}"
        if info[key].optional and n not in refined:
            continue
        std = fitted.std(key) if key in fitted.free else 0.0
        out[n] = ParameterEstimate(values[key], std, info[key].unit)
    return out


def _equivalents(searched: Searched, name: str, left: Remainder) -> tuple[str, ...]:
    """Causes that could stand in the place of one: rivals that do not fall short by what separates at 95 %.

    Where the best set itself leaves something unexplained, its order among its rivals is no surer than that.
    """
    best = searched.judged
    others = {e.name for e in best.model.effects} - {name}
    margin = SEPARABLE + left.excess
    out = []
    for rival in searched.rivals[name]:
        (instead,) = {e.name for e in rival.model.effects} - others
        if rival.price - best.price < margin:
            out.append(instead)
    return tuple(sorted(set(out)))


def _alike(best: Fit, rivals: Sequence[Fit], name: str) -> tuple[str, ...]:
    """Causes that could stand in the place of one: the price chooses which is named, the likelihood what is told apart.

    A rival that fits as well with more parameters, as a spring does in the place of a constant torque, is not excluded.
    """
    others = {e.name for e in best.model.effects} - {name}
    near = [f for f in rivals if min(f.price - best.price, f.sse - best.sse) < SEPARABLE]
    return tuple(sorted({e.name for f in near for e in f.model.effects} - others - {name}))


def _absorbed(searched: Searched, silent: Sequence[str]) -> tuple[str, ...]:
    """Causes that these data could not show: taken up by the nominal parameters, or without effect in any trial."""
    found = {e.name for e in searched.best.model.effects}
    by_effect = best_by_effect(searched.scored)
    taken = {n for n, many in by_effect.items() if n not in found and max(s.kept for s in many) < ABSORBED_BELOW}
    return tuple(sorted(taken | set(silent)))


def _ranking(searched: Searched) -> dict[str, tuple[Ranked, ...]]:
    best = searched.judged.sse
    return {
        name: tuple(Ranked(tuple(e.name for e in f.model.effects), f.sse - best) for f in rivals)
        for name, rivals in searched.rivals.items()
    }


def _experiment(searched: Searched, causes: Sequence[Cause], study: Study) -> NextExperiment | None:
    for cause in causes:
        others = {e.name for e in searched.judged.model.effects} - {cause.name}
        rivals: dict[str, Fit] = {}
        for rival in sorted(searched.rivals[cause.name], key=lambda f: f.price):
            (instead,) = {e.name for e in rival.model.effects} - others
            if instead in cause.equivalents:
                rivals.setdefault(instead, rival)
        if rivals:
            return next_experiment(searched.judged, rivals, cause.name, study)
    return None


__all__ = ["Cause", "Diagnosis", "ParameterEstimate", "Ranked", "diagnose", "split"]
