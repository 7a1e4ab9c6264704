"""Zeros and scales that differ between trials: faults of a record, which causes of the rig imitate.

An amplifier that is balanced before each trial may have another zero in each. Where a zero of each trial's own lowers
the penalised likelihood of the set that was found, in addition to its causes or in the place of one, the causes are
searched again in a model that has it. That search is the answer if

1. its penalised likelihood is lower,
2. the zeros differ significantly between trials, corrected for errors of form as any further parameter is,
3. a zero that is estimated from other parts of its trial lowers the errors of prediction.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fes_pin.data.trial import Trial
from fes_pin.diagnosis.held_out import Again, Found, gains_of, make_folds, refit
from fes_pin.diagnosis.restate import Made, with_first
from fes_pin.diagnosis.result import Diagnosis
from fes_pin.diagnosis.search.likelihood_maxima import look
from fes_pin.diagnosis.search.likelihood_models import LikelihoodSearch
from fes_pin.identify.likelihood_fit import LikelihoodFit, maximum_from
from fes_pin.identify.per_trial import as_parameters
from fes_pin.infer.distributions import chi2_tail
from fes_pin.infer.fits import more_degrees
from fes_pin.infer.levels import SEPARABLE
from fes_pin.infer.result import Cause, ParameterEstimate
from fes_pin.infer.scatter import excess_scatter, with_honest_intervals
from fes_pin.infer.search import SearchResult
from fes_pin.models.model import Model
from fes_pin.models.stage import Effect, Stage
from fes_pin.workers import attempted

Ran = tuple[LikelihoodSearch, Found, Made | None]
"""A search, its result, and the trial that was restated, if any."""
Ask = Callable[[Model], Ran]
"""Search of causes in a model."""
ZERO, SCALE = "zero_by_trial", "scale_by_trial"


@dataclass(frozen=True)
class ByTrial:
    """A zero or scale of each trial's own.

    Attributes
    ----------
    kind
        The effect of which every trial has its own amplitude.
    p_value
        Against one amplitude of all trials, over all kinds.
    """

    kind: type[Effect]
    p_value: float

    @property
    def path(self) -> str:
        """Name of the amplitude among a trial's unknowns."""
        return f"{self.kind.name}.{self.kind.amplitudes()[0]}"

    def common(self, fitted: LikelihoodFit) -> LikelihoodFit:
        """Return a fit again with one amplitude of all trials."""
        mean = float(np.mean([u[self.path] for u in fitted.unknowns]))
        model = (fitted.model - self.kind + self.kind()).with_parameters({self.path: mean})
        return maximum_from(replace(fitted, model=model, parameters=model.parameters()), fitted.trials)

    def values(self, fitted: LikelihoodFit) -> dict[str, ParameterEstimate]:
        """Return the zero or scale of the record in each trial; the effect of an effort is of the one that acts."""
        wide, acts = with_honest_intervals(as_parameters(fitted, self.path)), self.kind.signal == "effort"
        info = self.kind.parameters()[self.kind.amplitudes()[0]].in_units(fitted.model.rig.units())
        out = {}
        for trial in fitted.trials:
            value, std = wide.values[n := f"{self.path}@{trial.name}"], wide.std(n)
            if self.kind.scales:
                value, std = (1.0 / (1.0 + value), std / (1.0 + value) ** 2) if acts else (1.0 + value, std)
            out[trial.name] = ParameterEstimate(-value if acts and not self.kind.scales else value, std, info.unit)
        return out


def with_faults(ran: Ran, ask: Ask, kinds: Sequence[type[Effect]]) -> tuple[Ran, list[ByTrial]]:
    """Return a search, or that of a model with zeros and scales by trial, and these.

    Parameters
    ----------
    ran
        The search in a model without them.
    """
    kinds = [e for e in kinds if e.of_record and e.name not in {one.name for one in ran[0].models.model.effects}]
    kind = attempted(lambda: _likeliest(ran, kinds), None)
    other = None if kind is None else attempted(lambda: ask(ran[0].models.model + kind.of_each_trial()), None)
    fault = None if kind is None or other is None else attempted(lambda: _fault(ran, other, kind, len(kinds)), None)
    if other is None or fault is None:
        return ran, []
    last, faults = with_faults(other, ask, kinds)
    return last, [fault, *faults]


def _likeliest(ran: Ran, kinds: Sequence[type[Effect]]) -> type[Effect] | None:
    """Return the kind that lowers the criterion of the best set most, further or in the place of a cause, if any.

    Of kinds that are not distinguished, as where the effort itself is read, it is the first on the signal path.
    """
    search, found, _ = ran
    if search.was_stopped or len(found.best.trials) < 2:
        return None
    bases = {f.names: f for f in (found.best, *found.without.values(), found.nominal)}
    lowest = dict.fromkeys(kinds, np.inf)
    for base in bases.values():
        for kind in kinds:
            bare = base.model - kind if kind.name in base.names else base.model
            one = look(bare + kind.of_each_trial(), base)
            single = float(chi2_tail(max(base.sse - one.sse, 0.0), more_degrees(one, base)))
            if len(kinds) * single < base.level:
                lowest[kind] = min(lowest[kind], maximum_from(one, one.trials).criterion)
    best = min(lowest.values(), default=np.inf)
    return next(k for k in kinds if lowest[k] < best + SEPARABLE) if best < found.best.criterion - SEPARABLE else None


def _on(fitted: LikelihoodFit, trials: Sequence[Trial]) -> LikelihoodFit:
    """Return a fit, again if it was fitted to parts of these trials."""
    return fitted if len(fitted.trials) == len(trials) else refit(fitted, trials)


def _fault(ran: Ran, other: Ran, kind: type[Effect], count: int) -> ByTrial | None:
    """Return a kind of fault that is the answer of a search with it; None where it is not.

    Parameters
    ----------
    count
        Number of kinds that were looked for.
    """
    (_, before, _), (search, found, _), fault = ran, other, ByTrial(kind, 1.0)
    best, one = found.best, fault.common(found.best)
    gain = max(one.sse - best.sse, 0.0) / excess_scatter(as_parameters(best, fault.path), one)
    p_value = count * float(chi2_tail(gain, more_degrees(best, one)))
    lower = best.criterion < _on(before.best, best.trials).criterion - SEPARABLE
    named = p_value < best.level and lower and not search.was_stopped and search.models.predicts_better(best, one)
    return replace(fault, p_value=p_value) if named else None


def with_fault(
    diagnosis: Diagnosis, fault: ByTrial, nominal: LikelihoodFit, test: Sequence[Trial], seed: int
) -> Diagnosis:
    """Return the diagnosis of a model with a zero or scale by trial with that as its first cause.

    Parameters
    ----------
    nominal
        Fit of the nominal model without it.
    """
    best, kind = diagnosis.extended, fault.kind
    nominal, one, values = _on(nominal, best.trials), fault.common(best), fault.values(best)
    found = SearchResult(nominal, best, {}, {}, {kind.name: one})
    horizon = diagnosis.ahead.horizon_s if diagnosis.ahead and diagnosis.is_driven else None
    gain = gains_of(make_folds(found, best.trials, test, Again(refit)), found.without, horizon, seed)[kind.name]
    column = "effort" if kind.signal == "effort" else best.model.rig.output(best.trials[0].kind)
    said = ", ".join(f"{n} {v.value:.3g}" for n, v in values.items())
    words = f"the {'scale' if kind.scales else 'zero'} of {column} differs between trials: {said}"
    cause = Cause(
        name=SCALE if kind.scales else ZERO,
        stage=str(Stage.SENSOR),
        site=column,
        parameters=values,
        equivalents=(),
        p_value=fault.p_value,
        gain_fit=100.0 * (one.sse - best.sse) / max(nominal.sse - best.sse, 1e-9),
        gain_held_out=replace(gain, on=diagnosis.held_out_by),
        words=f"{words} {next(iter(values.values())).unit}".strip(),
    )
    return with_first(replace(diagnosis, nominal=nominal), cause, nominal, best, test)
