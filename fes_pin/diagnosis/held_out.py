"""Trials held out of a diagnosis: evidence for each cause from their likelihood, and gains on their errors."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

from fes_pin.data.trial import Trial
from fes_pin.diagnosis.errors_ahead import squared_errors
from fes_pin.identify.likelihood_fit import LikelihoodFit, fit_of, problem_on
from fes_pin.infer.held_out import Errors, held_out_gain, identified_folds, marginal_cost
from fes_pin.infer.maximise import together
from fes_pin.infer.optimum import minimise
from fes_pin.infer.result import CROSS_VALIDATED, FITTED, Evidence, Gain
from fes_pin.infer.search import SearchResult
from fes_pin.prepare.measured import folds_of
from fes_pin.workers import in_parallel

Found = SearchResult[LikelihoodFit]
"""Result of a search among causes."""


@dataclass(frozen=True)
class Fold:
    """Trials that are held out together, and the fits without them.

    Attributes
    ----------
    out
        Numbers of the trials in the fit to all; none if the study itself holds them out, so that they are in no fit.
    chosen
        The set that is chosen again without the trials, fitted to the others; None where no choice is made again.
    """

    nominal: LikelihoodFit
    best: LikelihoodFit
    without: dict[str, LikelihoodFit]
    test: tuple[Trial, ...]
    out: tuple[int, ...] = ()
    chosen: LikelihoodFit | None = None

    @property
    def within(self) -> bool:
        """Whether the trials are in the fit to all."""
        return bool(self.out)


class Again:
    """Cache of fits to other trials: a set without a rejected cause is the next set that is judged.

    Parameters
    ----------
    refitted
        Fits the model of a fit to other trials.
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


def make_folds(
    found: Found,
    train: Sequence[Trial],
    test: Sequence[Trial],
    refitted: Again,
    held: Sequence[list[int]] | None = None,
) -> list[Fold]:
    """Return the trials that the study holds out as one fold, or folds to cross-validate; none of one trial.

    Parameters
    ----------
    held
        Trials of each fold; by default `folds_that_tell` of the best set.
    """
    if test:
        return [Fold(found.nominal, found.best, found.without, tuple(test))]
    if len(train) < 2:
        return []
    held = folds_that_tell(found.best) if held is None else held
    fits = {"": found.nominal, "+": found.best, **found.without}
    others = [[t for i, t in enumerate(found.best.trials) if i not in out] for out in held]
    wanted = [(k, n) for k in range(len(held)) for n in fits]
    again = dict(zip(wanted, refitted([(fits[n], others[k]) for k, n in wanted]), strict=True))
    each = [(again[k, ""], again[k, "+"], {n: again[k, n] for n in found.without}) for k in range(len(held))]
    return [Fold(*fitted, tuple(train[i] for i in out), tuple(out)) for fitted, out in zip(each, held, strict=True)]


def folds_that_tell(fitted: LikelihoodFit) -> list[list[int]]:
    """Return the trials of each fold that is predicted; see `infer.held_out.identified_folds`."""
    return identified_folds(fitted, fitted.parts, folds_of(fitted.trials))


def as_random_as_in_all(fitted: LikelihoodFit, trials: Sequence[Trial]) -> LikelihoodFit:
    """Return the fit of the same model to other trials, with the noise of its own trials."""
    problem, unknowns = problem_on(fitted, trials)
    if problem.is_simulated:
        return fit_of(problem, minimise(problem, fitted.values, unknowns))
    return fit_of(problem, together(problem, fitted.values, unknowns, with_noise=False))


def evidence_of(folds: Sequence[Fold], found: Found, alike: Again) -> dict[str, Evidence]:
    """Return the evidence for each cause: what it adds to twice the log-likelihood of held-out trials, or of all.

    Held-out trials are predicted by fits to the others. Noise is that of all trials: estimated without a trial that is
    unlike the others, it makes that trial so unlikely that no cause is supported. See `infer.held_out.marginal_cost`.
    """
    on, every = CROSS_VALIDATED if folds else FITTED, {"": found.best, **found.without}
    predicted = {n: 0.0 if folds else f.sse for n, f in every.items()}
    for fold in folds:
        trials = fold.best.trials if fold.within else (*found.best.trials, *fold.test)
        others = dict(zip(every, alike([(f, trials) for f in every.values()]), strict=True))
        whole, part = (every, others) if fold.within else (others, every)
        for n in predicted:
            predicted[n] += _cost(whole[n]) - _cost(part[n])
    return {n: replace(Evidence.of(predicted[n] - predicted[""]), on=on) for n in found.without}


def _cost(fitted: LikelihoodFit) -> float:
    return marginal_cost(fitted, {n: one.scale for n, one in fitted.model.parameter_info().items()})


def gains_of(
    folds: Sequence[Fold], without: Mapping[str, LikelihoodFit], horizon_s: float | None, seed: int
) -> dict[str, Gain]:
    """Return the gain of each cause in errors over the horizon, or in errors of free simulations.

    A cause that gains nothing over the horizon is judged over the time constant of the process noise that takes its
    place in the fit without it, if that is longer: a filter follows a slow cause, as the torque of a spring, and
    predicts it for as long as the noise is correlated.

    Parameters
    ----------
    folds
        Trials, and the fits that predict them.
    without
        By cause, the fit to all trials without it.
    horizon_s, seed
        The horizon, s, None for free simulations; the seed of the bootstrap of intervals.
    """
    found_over = _gains_over(folds, tuple(without) if folds else (), horizon_s, seed)
    if horizon_s is None or not found_over:
        return found_over
    shortest = min(t.duration for f in folds for t in f.test)
    for name, gain in found_over.items():
        correlation_s = min(max(without[name].noise.time.values(), default=0.0), shortest)
        if not gain.is_material and correlation_s > horizon_s:
            longer = _gains_over(folds, (name,), correlation_s, seed)[name]
            found_over[name] = replace(longer, ahead_s=correlation_s) if longer.is_material else gain
    return found_over


def _gains_over(folds: Sequence[Fold], names: Sequence[str], horizon_s: float | None, seed: int) -> dict[str, Gain]:
    """Return the gains of causes on the trials of the folds over one horizon."""

    def errors(fits: Sequence[LikelihoodFit]) -> Errors:
        pairs = zip(fits, folds, strict=True)
        return squared_errors([(one, fold.best, fold.test) for one, fold in pairs], horizon_s)

    if not names:
        return {}
    nominal, best = errors([f.nominal for f in folds]), errors([f.best for f in folds])
    return {n: held_out_gain(nominal, errors([f.without[n] for f in folds]), best, seed) for n in names}
