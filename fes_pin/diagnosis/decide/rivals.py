"""What is told of a set of causes beside its rivals: values, what could stand in their place, what would tell."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TypeVar

from fes_pin.data.study import Study
from fes_pin.diagnosis.experiment import NextExperiment, next_experiment
from fes_pin.diagnosis.search.score import Scored, best_by_effect
from fes_pin.identify.fit import Fit
from fes_pin.identify.likelihood_fit import LikelihoodFit
from fes_pin.identify.per_trial import amplitude
from fes_pin.infer.levels import IDENTIFIABLE_SHARE
from fes_pin.infer.result import Cause, ParameterEstimate, Ranked
from fes_pin.infer.scatter import least_apart

F = TypeVar("F", bound=Fit)


def estimates(fitted: Fit, name: str) -> dict[str, ParameterEstimate]:
    """Values of a cause's parameters, by name; of amplitudes that each trial has its own their size."""
    info, out = fitted.model.parameter_info(), {}
    (one,) = (e for e in fitted.model.effects if e.name == name)
    refined = one.refined()
    if one.each_trial:
        first = one.parameters()[one.unknowns()[0]]
        out["amplitude"] = ParameterEstimate(*amplitude(fitted, one), first.in_units(fitted.model.rig.units()).unit)
    for n in one.common():
        key = f"{name}.{n}"
        if info[key].optional and n not in refined:
            continue
        out[n] = ParameterEstimate.of(fitted, key, info[key].unit)
    return out


def alternatives(best: Fit, rivals: Sequence[Fit], name: str) -> tuple[str, ...]:
    """Causes that could stand in the place of one: the price chooses which is named, the likelihood what is told apart.

    A rival that fits as well with more parameters, as a spring does in the place of a constant torque, is not excluded.
    """
    others = {e.name for e in best.model.effects} - {name}
    return tuple(sorted({e.name for f in not_excluded(best, rivals) for e in f.model.effects} - others - {name}))


def not_excluded(best: Fit, rivals: Sequence[F]) -> list[F]:
    """The rivals that are as cheap, or as likely, as far as data tell."""
    return [f for f in rivals if min(f.criterion - best.criterion, f.sse - best.sse) < least_apart(best, f)]


def not_identifiable(best: Fit, scored: Sequence[Scored], not_excited: Sequence[str]) -> tuple[str, ...]:
    """Causes that these data could not show: taken up by the nominal parameters, or without effect in any trial."""
    found = {e.name for e in best.model.effects}
    by_effect = best_by_effect(scored)
    taken = {n for n, many in by_effect.items() if n not in found and max(s.kept for s in many) < IDENTIFIABLE_SHARE}
    return tuple(sorted(taken | set(not_excited)))


def ranking(best: Fit, rivals: Mapping[str, Sequence[Fit]]) -> dict[str, tuple[Ranked, ...]]:
    """For each cause the sets that stand in its place, and how far each falls short."""
    return {
        name: tuple(Ranked(tuple(e.name for e in f.model.effects), f.sse - best.sse) for f in fits)
        for name, fits in rivals.items()
    }


def experiment(
    best: LikelihoodFit, rivals: Mapping[str, Sequence[LikelihoodFit]], causes: Sequence[Cause], study: Study
) -> NextExperiment | None:
    """The experiment that would tell the first cause that is confounded from its equivalents."""
    for cause in causes:
        others = {e.name for e in best.model.effects} - {cause.name}
        confounded: dict[str, LikelihoodFit] = {}
        for rival in sorted(rivals[cause.name], key=lambda f: f.criterion):
            (instead,) = {e.name for e in rival.model.effects} - others
            if instead in cause.equivalents:
                confounded.setdefault(instead, rival)
        if confounded:
            return next_experiment(best, confounded, cause.name, study)
    return None
