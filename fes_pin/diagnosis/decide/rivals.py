"""Reports on a set of causes and its rivals: estimates, equivalents, ranking and the next experiment."""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from fes_pin.data.study import Study
from fes_pin.diagnosis.experiment import NextExperiment, next_experiment
from fes_pin.identify.likelihood_fit import LikelihoodFit
from fes_pin.identify.per_trial import amplitude
from fes_pin.infer.covariance import covariance_of
from fes_pin.infer.family import least_seen
from fes_pin.infer.levels import IDENTIFIABLE_SHARE
from fes_pin.infer.result import Cause, ParameterEstimate, Ranked
from fes_pin.search.score import Scored, Scores, best_by_effect


def estimates(fitted: LikelihoodFit, name: str) -> dict[str, ParameterEstimate]:
    """Return the estimates of a cause's parameters, by name; for amplitudes of each trial's own, their size."""
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


def not_identifiable(best: LikelihoodFit, scored: Sequence[Scored], not_excited: Sequence[str]) -> tuple[str, ...]:
    """Return the causes that are not identifiable: nominal parameters take their place, or they act in no trial."""
    kept = {n: max(s.kept for s in many) for n, many in best_by_effect(scored).items() if n not in best.names}
    return tuple(sorted({n for n, share in kept.items() if share < IDENTIFIABLE_SHARE} | set(not_excited)))


def seen_sizes(best: LikelihoodFit, scores: Scores, tests: float) -> dict[str, ParameterEstimate]:
    """Return for each cause its first amplitude, the size above which it would have been seen at 95 % power.

    It is that of the linearized cause, of the shape that is seen worst. Causes that are not identifiable have none.

    Parameters
    ----------
    scores
        Score tests of the causes in a fit without them.
    tests
        Number of tests in their family.
    """
    reach = least_seen(best.level, tests)
    sizes, units = dict[str, ParameterEstimate](), best.model.rig.units()
    for one, block in zip(scores.scored, scores.blocks, strict=False):  # those of each trial have no block
        name, own = one.effect.name, scores.gram[block, block]
        if one.kept < IDENTIFIABLE_SHARE:
            continue
        size = reach * math.sqrt(covariance_of(own, np.ones(len(own), dtype=bool))[0, 0])
        if math.isfinite(size) and size > (sizes[name].value if name in sizes else 0.0):
            unit = one.effect.parameters()[one.effect.amplitudes()[0]].in_units(units).unit
            sizes[name] = ParameterEstimate(size, 0.0, unit)
    return sizes


def ranking(best: LikelihoodFit, rivals: Mapping[str, Sequence[LikelihoodFit]]) -> dict[str, tuple[Ranked, ...]]:
    """Return for each cause the sets with another cause in its place, and the shortfall of each."""
    return {
        name: tuple(Ranked(tuple(e.name for e in f.model.effects), f.sse - best.sse) for f in fits)
        for name, fits in rivals.items()
    }


def experiment(
    best: LikelihoodFit, rivals: Mapping[str, Sequence[LikelihoodFit]], causes: Sequence[Cause], study: Study
) -> NextExperiment | None:
    """Return the experiment that distinguishes the first confounded cause from its equivalents."""
    for cause in causes:
        others = set(best.names) - {cause.name}
        confounded: dict[str, LikelihoodFit] = {}
        for rival in sorted(rivals[cause.name], key=lambda f: f.criterion):
            (instead,) = set(rival.names) - others
            if instead in cause.equivalents:
                confounded.setdefault(instead, rival)
        if confounded:
            return next_experiment(best, confounded, cause.name, study)
    return None
