"""Trials held out of the diagnosis of a driven rig: what its causes add to their likelihood, and to errors ahead."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from fes_pin.data.trial import Trial
from fes_pin.diagnosis.decide.folds import folds_of
from fes_pin.diagnosis.decide.gains_ahead import Fold
from fes_pin.diagnosis.errors_ahead import Ahead, errors_ahead
from fes_pin.diagnosis.search.likelihood_models import Found
from fes_pin.identify.likelihood import LikelihoodProblem
from fes_pin.identify.likelihood_fit import LikelihoodFit, fit_of, maximise
from fes_pin.infer.held_out import marginal_cost
from fes_pin.infer.maximise import together
from fes_pin.infer.optimum import minimise
from fes_pin.infer.problem import Unknowns
from fes_pin.infer.result import Evidence
from fes_pin.workers import in_parallel


class Again:
    """Fits made again to other trials, each once: a set less a cause that is refused is the next set.

    Parameters
    ----------
    refitted
        Makes a fit to other trials from one.
    """

    def __init__(self, refitted: Callable[[LikelihoodFit, Sequence[Trial]], LikelihoodFit]) -> None:
        self._refitted = refitted
        self._kept: dict[tuple[int, tuple[int, ...]], tuple[LikelihoodFit, LikelihoodFit]] = {}

    def __call__(self, wanted: Sequence[tuple[LikelihoodFit, Sequence[Trial]]]) -> list[LikelihoodFit]:
        keys = [(id(fitted), tuple(map(id, trials))) for fitted, trials in wanted]
        missing = {k: w for k, w in zip(keys, wanted, strict=True) if k not in self._kept}
        made = in_parallel(lambda w: self._refitted(*w), list(missing.values()))
        self._kept |= {k: (w[0], one) for (k, w), one in zip(missing.items(), made, strict=True)}
        return [self._kept[k][1] for k in keys]


def make_folds(found: Found, train: Sequence[Trial], test: Sequence[Trial], refitted: Again) -> list[Fold]:
    """The study's own held-out trials, or every trial in its turn; none where there is but one."""
    if test:
        return [Fold(found.nominal, found.best, found.without, tuple(test), within=False)]
    if len(train) < 2:
        return []
    held = folds_of(train)
    fits = {"": found.nominal, "+": found.best, **found.without}
    others = [[t for i, t in enumerate(found.best.trials) if i not in out] for out in held]
    wanted = [(k, n) for k in range(len(held)) for n in fits]
    again = dict(zip(wanted, refitted([(fits[n], others[k]) for k, n in wanted]), strict=True))
    return [
        Fold(again[k, ""], again[k, "+"], {n: again[k, n] for n in found.without}, tuple(train[i] for i in out))
        for k, out in enumerate(held)
    ]


def with_choices(folds: Sequence[Fold], chosen: Sequence[LikelihoodFit], refitted: Again) -> list[Fold]:
    """The folds with what each chooses anew.

    Parameters
    ----------
    chosen
        For each fold, the fit to all trials of the set that is chosen without its own.
    """
    again = refitted([(one, fold.best.trials) for one, fold in zip(chosen, folds, strict=True)])
    return [replace(fold, chosen=one) for fold, one in zip(folds, again, strict=True)]


def afresh(fitted: LikelihoodFit, trials: Sequence[Trial]) -> LikelihoodFit:
    """A fit again, to other trials, with what is random in these."""
    problem, unknowns = _problem(fitted, trials)
    return maximise(problem, fitted.values, unknowns, near=True)


def as_random_as_in_all(fitted: LikelihoodFit, trials: Sequence[Trial]) -> LikelihoodFit:
    """A fit again, to other trials, at what was random in its own."""
    problem, unknowns = _problem(fitted, trials)
    if problem.is_simulated:
        return fit_of(problem, minimise(problem, fitted.values, unknowns))
    return fit_of(problem, together(problem, fitted.values, unknowns, with_noise=False))


def _problem(fitted: LikelihoodFit, trials: Sequence[Trial]) -> tuple[LikelihoodProblem, Unknowns]:
    """The problem of a fit on other trials, and where their unknowns begin."""
    known = {id(t): u for t, u in zip(fitted.trials, fitted.unknowns, strict=True)}
    problem = LikelihoodProblem(fitted.model, trials, fitted.noise)
    return problem, [known.get(id(t), u) for t, u in zip(trials, problem.start_unknowns(), strict=True)]


def evidence_of(folds: Sequence[Fold], found: Found, alike: Again) -> dict[str, Evidence]:
    """What each cause adds to twice the log-likelihood of held-out trials, foretold by fits to the others.

    What is random is as in all trials: learned without one that is unlike the others, it made that one so unlikely
    that no cause could speak for itself. See `infer.held_out.marginal_cost`.
    """
    foretold = {n: 0.0 for n in ("", *found.without)}
    for fold in folds:
        whole = part = {"": found.best, **found.without}
        if fold.within:
            part = dict(zip(whole, alike([(f, fold.best.trials) for f in whole.values()]), strict=True))
        else:
            whole = dict(zip(part, alike([(f, (*f.trials, *fold.test)) for f in part.values()]), strict=True))
        for n in foretold:
            foretold[n] += _cost(whole[n]) - _cost(part[n])
    return {n: Evidence.of(foretold[n] - foretold[""]) for n in found.without}


def _cost(fitted: LikelihoodFit) -> float:
    return marginal_cost(fitted, {n: one.scale for n, one in fitted.model.parameter_info().items()})


def held_errors_ahead(folds: Sequence[Fold], horizon_s: float, falling: bool) -> tuple[Ahead, Ahead] | None:
    """Errors ahead of the nominal model and of what each fold chooses, on trials held out; None where none are."""
    if not folds:
        return None
    return (
        errors_ahead([(f.nominal, f.best, f.test) for f in folds], horizon_s, falling),
        errors_ahead([(f.chosen or f.best, f.best, f.test) for f in folds], horizon_s, falling),
    )
