"""Gain on trials that took no part in choosing or fitting."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fes_pin.data.trial import Trial
from fes_pin.identify.ahead import SquaredErrors, default_horizon, forecast_errors, own_noise
from fes_pin.identify.fit import Fit, fit_problem, go_on
from fes_pin.identify.per_trial import predictions
from fes_pin.identify.problem import Problem
from fes_pin.infer.held_out import Errors, added_likelihood, deal, joined_errors, within
from fes_pin.infer.levels import RUNAWAY
from fes_pin.infer.noise import NoiseModel
from fes_pin.infer.result import Evidence
from fes_pin.models.model import Model
from fes_pin.workers import in_parallel


def errors_of(model: Model, trials: Sequence[Trial], noise: NoiseModel) -> Errors:
    """Open-loop errors of a model that starts each trial as a prediction does.

    What is each trial's own is estimated from other parts of it than those that it is judged on: see
    `identify.per_trial`.
    """
    squares, spread, counts = [], [], []
    pieces = 1 if len(trials) >= 5 else 10
    most = {n: RUNAWAY * max((float(np.abs(t[n]).max()) for t in trials if n in t.columns), default=0.0) for n in noise}
    for trial, readings in zip(trials, predictions(model, trials, noise), strict=True):
        total, around = np.zeros(len(trial)), np.zeros(len(trial))
        channels = 0
        for k, name in enumerate(model.rig.outputs(trial.kind)):
            if name in trial.columns and name in noise:
                variance = noise[name].std ** 2
                total += within(trial[name] - readings[:, k], most[name]) ** 2 / variance
                around += (trial[name] - trial[name].mean()) ** 2 / variance
                channels += 1
        for a, b in zip(np.array_split(total, pieces), np.array_split(around, pieces), strict=True):
            squares.append(float(a.sum()))
            spread.append(float(b.sum()))
            counts.append(channels * len(a))
    return Errors(np.array(squares), np.array(spread), np.array(counts, dtype=float))


def folds_of(trials: Sequence[Trial]) -> list[list[int]]:
    """Trials to hold out together: every kind and every load dealt round; none where there is but one."""
    return deal(sorted(range(len(trials)), key=lambda i: (trials[i].kind, sorted(trials[i].conditions.items()), i)))


@dataclass(frozen=True)
class HeldOut:
    """On held-out trials: errors of the nominal model, of the extension, and of it without each of its causes.

    A cause's gain and its `evidence` are what it adds to the other causes of one model, the extension as it was chosen
    on all trials: from `without` to `extended`. `chosen` are the errors of what each fold itself chooses, which may be
    another set, and `folds` the fits, to all trials, of those sets; none where the study itself holds trials out.
    `ahead` are the errors of the nominal model and of the extension over time.
    """

    nominal: Errors
    extended: Errors
    without: dict[str, Errors]
    evidence: dict[str, Evidence]
    chosen: Errors
    ahead: tuple[SquaredErrors, SquaredErrors] | None = None
    folds: tuple[Fit, ...] = ()


def cross_validate(
    nominal: Fit,
    best: Fit,
    without: Mapping[str, Fit],
    choose: Callable[[Sequence[int]], Fit],
    floor: NoiseModel,
    horizon_s: float | None = None,
) -> HeldOut:
    """Leave trials out in turn, choose again on the others, fit, and predict.

    Parameters
    ----------
    choose
        The fit, to all trials, of the set that is chosen without those in some places.
    horizon_s
        How far ahead errors over a horizon look; `default_horizon` of the trials by default.
    """
    horizon_s = horizon_s or default_horizon(nominal.trials)
    folds = [f for f in folds_of(nominal.trials) if len(f) < len(nominal.trials)]
    chosen = [choose(held) for held in folds]
    many = [(held, [nominal, best, *without.values(), one]) for held, one in zip(folds, chosen, strict=True)]
    wanted = list({(k, id(f)): (held, f) for k, (held, fits) in enumerate(many) for f in fits}.items())
    made = in_parallel(lambda item: _left_out(*item[1]), wanted)
    again = {key: one for (key, _), one in zip(wanted, made, strict=True)}
    results = in_parallel(
        lambda pair: _fold(*pair, nominal.trials, list(without), floor, horizon_s),
        [(held, [again[k, id(f)] for f in fits]) for k, (held, fits) in enumerate(many)],
    )
    return HeldOut(
        joined_errors([r.nominal for r in results]),
        joined_errors([r.extended for r in results]),
        {n: joined_errors([r.without[n] for r in results]) for n in without},
        {n: sum((r.evidence[n] for r in results), Evidence(0.0, 0.0)) for n in without},
        joined_errors([r.chosen for r in results]),
        tuple(sum((r.ahead[k] for r in results if r.ahead), SquaredErrors()) for k in (0, 1)),  # type: ignore[arg-type]
        tuple(chosen),
    )


def _left_out(held: Sequence[int], fitted: Fit) -> Fit:
    """A fit again, without the trials that are held out."""
    train = [t for i, t in enumerate(fitted.trials) if i not in held]
    return go_on(Problem(fitted.model, train, fitted.noise), fitted)


def _fold(
    held: Sequence[int],
    fits: Sequence[Fit],
    trials: Sequence[Trial],
    names: Sequence[str],
    floor: NoiseModel,
    horizon_s: float,
) -> HeldOut:
    """What fits of the nominal model, the best, it without each of `names` and what was chosen say of held trials."""
    nominal, best, *rest, chosen = fits
    without = dict(zip(names, rest, strict=True))
    test = [trials[i] for i in held]
    told = separate(nominal, best, without, test, floor, horizon_s)
    return told if chosen is best else replace(told, chosen=errors_of(chosen.model, test, floor))


def separate(
    nominal: Fit,
    best: Fit,
    without: Mapping[str, Fit],
    test: Sequence[Trial],
    floor: NoiseModel,
    horizon_s: float | None = None,
) -> HeldOut:
    """Errors on trials that the study itself holds out; see `cross_validate`."""
    horizon = horizon_s or default_horizon(test)
    left, extended = _whitened(best, test), errors_of(best.model, test, floor)
    return HeldOut(
        errors_of(nominal.model, test, floor),
        extended,
        {n: errors_of(f.model, test, floor) for n, f in without.items()},
        {n: added_likelihood(_whitened(f, test), left) for n, f in without.items()},
        extended,
        (_missed(nominal, test, floor, horizon), _missed(best, test, floor, horizon)),
    )


def _missed(fitted: Fit, trials: Sequence[Trial], floor: NoiseModel, horizon_s: float) -> SquaredErrors:
    return forecast_errors(fitted.model, trials, own_noise(fitted), floor, horizon_s)


def _whitened(fitted: Fit, test: Sequence[Trial]) -> np.ndarray:
    """Whitened residuals on trials, each with its own unknowns estimated from it, end to end."""
    problem = Problem(fitted.model, test, fitted.noise, ())
    return foretold(fit_problem(problem, fitted.values, problem.simulator.start(fitted.values)))


def foretold(own: Fit) -> np.ndarray:
    """Whitened residuals of trials from their estimated initial states, end to end.

    What effects have of each trial's own is estimated from other parts of it than those that it foretells.
    """
    if not own.model.own_unknowns():
        return np.concatenate([p.residual for p in own.parts])
    out = []
    for trial, readings in zip(own.trials, predictions(own.model, own.trials, own.noise, own.unknowns), strict=True):
        for k, name in enumerate(own.model.rig.outputs(trial.kind)):
            if name in trial.columns and name in own.noise:
                out.append(own.noise[name].whiten(trial[name] - readings[:, k], trial.dt))
    return np.concatenate(out)
