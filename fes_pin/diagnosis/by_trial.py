"""Zeros and scales that differ between trials: faults of a record, which causes of the rig imitate.

An amplifier that is balanced before each trial may have another zero in each. Where a zero of each trial's own lowers
the penalised likelihood of the set that was found, in addition to its causes or in the place of one, the causes are
searched again in a model that has it. That search is the answer if

1. its penalised likelihood is lower, by more than what distinguishes the two (`infer.corrected`),
2. the zeros differ significantly between trials, corrected for errors of form as any further parameter is,
3. a nominal parameter that differs between trials cannot explain as much,
4. a zero that is estimated from other parts of its trial lowers the errors of prediction.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fes_pin.data.trial import Trial
from fes_pin.diagnosis.held_out import Again, Fold, Found, gains_of, make_folds
from fes_pin.diagnosis.likelihood_models import LikelihoodSearch
from fes_pin.diagnosis.restate import Made, with_first
from fes_pin.diagnosis.result import Diagnosis
from fes_pin.identify.likelihood_fit import LikelihoodFit, at_noise, maximum_from, refit
from fes_pin.identify.per_trial import as_parameters, cross_fitted_unknowns, halves, pieces
from fes_pin.infer.corrected import Correction, lead_of
from fes_pin.infer.distributions import chi2_quantile, chi2_tail
from fes_pin.infer.fits import more_degrees
from fes_pin.infer.levels import IDENTIFIABLE_SHARE, SEPARABLE, UNUSUAL_LEVEL
from fes_pin.infer.projection import Projection
from fes_pin.infer.result import Cause, ParameterEstimate
from fes_pin.infer.scatter import excess_scatter, with_honest_intervals
from fes_pin.infer.search import SearchResult
from fes_pin.models.model import Model
from fes_pin.models.predictor import StateSpaceNoise
from fes_pin.models.stage import Effect, Stage
from fes_pin.remainder.unrepeated import voluntary_effort
from fes_pin.search.library import Library
from fes_pin.search.likelihood_maxima import look
from fes_pin.search.starts import STARTED
from fes_pin.workers import attempted

Ran = tuple[LikelihoodSearch, Found, Made | None]
"""A search, its result, and the trial that was restated, if any."""
Ask = Callable[[Model, Model | None], Ran]
"""Search of causes in a model, which begins with another that has some of them; with None it begins with none."""
ZERO, SCALE = "zero_by_trial", "scale_by_trial"


@dataclass(frozen=True)
class ByTrial:
    """A zero or scale of each trial's own.

    Attributes
    ----------
    effect
        The effect of which every trial has its own amplitude.
    p_value
        Against one amplitude of all trials, over all kinds.
    """

    effect: Effect
    p_value: float = 1.0

    @property
    def name(self) -> str:
        """Of the fault."""
        return SCALE if self.effect.scales else ZERO

    @property
    def path(self) -> str:
        """Name of the amplitude among a trial's unknowns."""
        return f"{self.effect.name}.{self.effect.amplitudes()[0]}"

    def common(self, fitted: LikelihoodFit) -> LikelihoodFit:
        """Return a fit again with one amplitude of all trials."""
        mean = float(np.mean([u[self.path] for u in fitted.unknowns]))
        model = (fitted.model - self.effect + type(self.effect)()).with_parameters({self.path: mean})
        return maximum_from(replace(fitted, model=model, parameters=model.parameters()), fitted.trials)

    def values(self, fitted: LikelihoodFit, relative: bool) -> dict[str, ParameterEstimate]:
        """Return the zero or scale of the record in each trial; the effect of an effort is of the one that acts.

        Where the estimates from both halves of a trial differ more than is expected, the intervals are as much wider.

        Parameters
        ----------
        relative
            Whether only the ratio of a scale to the mean of all is known.
        """
        wide, count = with_honest_intervals(as_parameters(fitted, self.effect)), len(fitted.trials)
        values, stds = np.array([[wide.values[n], wide.std(n)] for n in wide.free[-count:]]).T
        both = [cross_fitted_unknowns(fitted.model, t, fitted.noise) for t in fitted.trials]
        apart = np.array([odd[self.path] - even[self.path] for (_, odd), (_, even) in both])
        ratio = float(np.mean((0.5 * apart / stds) ** 2))
        stds = stds * math.sqrt(ratio) if count * ratio > chi2_quantile(1.0 - UNUSUAL_LEVEL, count) else stds
        if self.effect.scales:
            values, stds = 1.0 + values, stds / (1.0 + values)
            values = 1.0 / values if self.effect.signal == "effort" else values
            values, stds = (values / np.mean(values) if relative else values), stds * values
        elif self.effect.signal == "effort":
            values = -values
        unit = self.effect.parameters()[self.effect.amplitudes()[0]].in_units(fitted.model.rig.units()).unit
        each = zip(fitted.trials, values, stds, strict=True)
        return {t.name: ParameterEstimate(float(v), float(s), unit) for t, v, s in each}


def with_faults(
    ran: Ran, ask: Ask, kinds: Sequence[type[Effect]], tests: list[Correction]
) -> tuple[Ran, list[ByTrial]]:
    """Return a search, or that of a model with zeros and scales by trial, and these.

    Parameters
    ----------
    ran
        The search in a model without them.
    tests
        The tests of faults of the record, to which those of zeros and scales are added.
    """
    kinds = [e for e in kinds if e.of_record and e.name not in {one.name for one in ran[0].models.model.effects}]
    found = attempted(lambda: _further(ran, ask, kinds, tests), None)
    if found is None:
        return ran, []
    last, faults = with_faults(found[0], ask, kinds, tests)
    return last, [found[1], *faults]


def _further(ran: Ran, ask: Ask, kinds: Sequence[type[Effect]], tests: list[Correction]) -> tuple[Ran, ByTrial] | None:
    """Return the search with a further kind of fault, and that; None where it is not the answer.

    It is not where a trial is restated as well, since that takes the place of the trial's zero.
    """
    kind = _likeliest(ran, kinds)
    if kind is None:
        return None
    search, found, again = other = ask(begun := _begun(ran, kind), _with_causes(begun, ran[1].best.model))
    best, fault = found.best, ByTrial(kind.of_each_trial())
    one = fault.common(best)
    gain = max(one.sse - best.sse, 0.0) / excess_scatter(as_parameters(best, fault.effect), one)
    p_value = len(kinds) * float(chi2_tail(gain, more_degrees(best, one)))
    lead = lead_of(best, _on(ran[1].best, best.trials))
    test = Correction(fault.name, min(p_value, 1.0), best.level, f"{kind.name} of each trial's own", *lead)
    tests.append(test)
    named = test.is_named and not (search.was_stopped or again or _is_scatter(best, fault.effect))
    return (other, replace(fault, p_value=p_value)) if named and search.models.predicts_better(best, one) else None


def _begun(ran: Ran, kind: type[Effect]) -> Model:
    """Return the model with an amplitude of each trial's own.

    Where the nominal parameters take the place of one amplitude of all trials, as of a scale of the effort where
    gravity is not known, the first of them is held. Whether they do is seen where every trial is simulated freely in
    pieces, each from its own state.
    """
    model, nominal = ran[0].models.model, ran[1].nominal
    fitted, noise, rig = nominal, StateSpaceNoise(nominal.noise.white), nominal.model.rig
    if all(rig.unknowns(t.kind) for t in nominal.trials):
        short = [p for t in nominal.trials for half in halves(len(t)) for p in pieces(t, half)]
        fitted = at_noise(replace(nominal, trials=tuple(short), unknowns=[{} for _ in short]), noise)
    kept = max(s.kept for s in Library(model, fitted.trials, [kind]).scores(fitted).scored)
    if kept < IDENTIFIABLE_SHARE:
        model = Model(replace(rig, fitted=rig.fitted_parameters()[1:]), model.effects)
    return model + kind.of_each_trial()


def _with_causes(model: Model, found: Model) -> Model:
    """Return a model with the causes of another that it lacks."""
    return Model(
        model.rig, (*model.effects, *(e for e in found.effects if e.name not in {m.name for m in model.effects}))
    )


def _likeliest(ran: Ran, kinds: Sequence[type[Effect]]) -> type[Effect] | None:
    """Return the kind that lowers the criterion of the best set most, further or in the place of a cause, if any.

    Of kinds that are not distinguished, as where the effort itself is read, it is the first on the signal path. A kind
    is fitted further only if its first fit, at the noise of the base, gains half of what is required. A subject who
    does not relax has another effort in each trial, which a zero or scale imitates.
    """
    search, found, again = ran
    if search.was_stopped or again is not None or voluntary_effort(found.best) is not None:
        return None
    wanted = found.best.criterion - SEPARABLE
    lowest = dict.fromkeys(kinds, wanted)
    for base in {f.names: f for f in (found.best, *found.without.values(), found.nominal)}.values():
        for kind in kinds:
            bare = base.model - kind if kind.name in base.names else base.model
            first = look(bare + kind.of_each_trial(), base)
            penalty = first.criterion - first.sse
            if base.sse - first.sse > STARTED * (base.sse + penalty - wanted):
                lowest[kind] = min(lowest[kind], maximum_from(first, base.trials).criterion)
    best = min(lowest.values(), default=np.inf)
    near = [k for k in kinds if lowest[k] < best + SEPARABLE]
    return near[0] if best < wanted else None


def _is_scatter(best: LikelihoodFit, effect: Effect) -> bool:
    """Return whether a nominal parameter that differs between trials, as a muscle's strength, may explain as much.

    It is fitted to first order, with one amplitude of all trials, in the place of the amplitudes of each.
    """
    wide, count = as_parameters(best, effect), len(best.parts)
    own, least = list(wide.parameters.values())[-count:], sum(float(p.residual @ p.residual) for p in wide.parts)
    for k in range(len(best.model.rig.fitted_parameters())):
        parts = []
        for row, p in zip(np.eye(count), wide.parts, strict=True):
            acts = p.jacobian[:, -count:]
            jacobian = np.c_[p.jacobian[:, :-count], acts.sum(axis=1), np.outer(p.jacobian[:, k], row)]
            parts.append(replace(p, residual=p.residual + acts @ own, jacobian=jacobian))
        if float(np.sum(Projection(parts).residual ** 2)) < least + SEPARABLE:
            return True
    return False


def _on(fitted: LikelihoodFit, trials: Sequence[Trial]) -> LikelihoodFit:
    """Return a fit, again if it was fitted to parts of these trials."""
    return fitted if len(fitted.trials) == len(trials) else refit(fitted, trials)


def with_fault(
    diagnosis: Diagnosis, fault: ByTrial, nominal: LikelihoodFit, test: Sequence[Trial], seed: int
) -> Diagnosis:
    """Return the diagnosis of a model with a zero or scale by trial with that as its first cause.

    Parameters
    ----------
    nominal
        Fit of the nominal model without it.
    """
    best, effect = diagnosis.extended, fault.effect
    nominal, one = _on(nominal, best.trials), fault.common(best)
    relative = effect.scales and nominal.model.rig.fitted != best.model.rig.fitted
    values = fault.values(best, relative)
    found = SearchResult(nominal, best, {}, {}, {effect.name: one})
    horizon = diagnosis.ahead.horizon_s if diagnosis.ahead and diagnosis.is_driven else None
    whole = [Fold(nominal, best, found.without, best.trials)]
    held = make_folds(found, best.trials, test, Again(refit)) or whole
    gain, fitted = (gains_of(folds, found.without, horizon, seed)[effect.name] for folds in (held, whole))
    column = "effort" if effect.signal == "effort" else best.model.rig.output(best.trials[0].kind)
    said = ", ".join(f"{n} {v.value:.3g}" for n, v in values.items())
    unit = " of their mean" if relative else f" {next(iter(values.values())).unit}".rstrip()
    cause = Cause(
        name=fault.name,
        stage=str(Stage.SENSOR),
        site=column,
        parameters=values,
        equivalents=(),
        p_value=fault.p_value,
        gain_fit=fitted.percent,
        gain_held_out=replace(gain, on=diagnosis.held_out_by),
        words=f"the {'scale' if effect.scales else 'zero'} of {column} differs between trials: {said}{unit}",
    )
    return with_first(replace(diagnosis, nominal=nominal), cause, nominal, best, test)
