"""What is told of a set of causes beside its rivals: values, what could stand in their place, what would tell."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

from fes_pin.data.study import Study
from fes_pin.diagnosis.experiment import NextExperiment, next_experiment
from fes_pin.diagnosis.search.score import best_by_effect
from fes_pin.diagnosis.search.simulation_search import Searched
from fes_pin.identify.fit import Fit
from fes_pin.identify.per_trial import amplitude
from fes_pin.infer.levels import ABSORBED_BELOW, SEPARABLE
from fes_pin.infer.result import Cause, ParameterEstimate, Ranked, Remainder
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


def equivalents(searched: Searched, name: str, left: Remainder) -> tuple[str, ...]:
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


def alternatives(best: Fit, rivals: Sequence[Fit], name: str) -> tuple[str, ...]:
    """Causes that could stand in the place of one: the price chooses which is named, the likelihood what is told apart.

    A rival that fits as well with more parameters, as a spring does in the place of a constant torque, is not excluded.
    """
    others = {e.name for e in best.model.effects} - {name}
    return tuple(sorted({e.name for f in not_excluded(best, rivals) for e in f.model.effects} - others - {name}))


def not_excluded(best: Fit, rivals: Sequence[F]) -> list[F]:
    """The rivals that are as cheap, or as likely, as far as data tell."""
    return [f for f in rivals if min(f.price - best.price, f.sse - best.sse) < least_apart(best, f)]


def absorbed(searched: Searched, silent: Sequence[str]) -> tuple[str, ...]:
    """Causes that these data could not show: taken up by the nominal parameters, or without effect in any trial."""
    found = {e.name for e in searched.best.model.effects}
    by_effect = best_by_effect(searched.scored)
    taken = {n for n, many in by_effect.items() if n not in found and max(s.kept for s in many) < ABSORBED_BELOW}
    return tuple(sorted(taken | set(silent)))


def ranking(searched: Searched) -> dict[str, tuple[Ranked, ...]]:
    """For each cause the sets that stand in its place, and how far each falls short."""
    best = searched.judged.sse
    return {
        name: tuple(Ranked(tuple(e.name for e in f.model.effects), f.sse - best) for f in rivals)
        for name, rivals in searched.rivals.items()
    }


def experiment(searched: Searched, causes: Sequence[Cause], study: Study) -> NextExperiment | None:
    """The experiment that would tell the first cause that is confounded from its equivalents."""
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
