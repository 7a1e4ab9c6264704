"""Gain on trials that took no part in choosing or fitting."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fes_pin.data.trial import Trial
from fes_pin.identify.ahead import SquaredErrors, default_horizon, forecast_errors, own_noise
from fes_pin.identify.error_measures import percent_of_spread
from fes_pin.identify.fit import Fit, fit_problem, go_on
from fes_pin.identify.noise import NoiseModel
from fes_pin.identify.per_trial import predictions
from fes_pin.identify.problem import Problem
from fes_pin.infer.levels import CONFIDENCE_95, NOTHING_PERCENT, RUNAWAY
from fes_pin.models.model import Model
from fes_pin.workers import in_parallel

FOLDS = 5
"""Parts that trials are dealt to: each is foretold by the other four, which hold most of what is known."""
RESAMPLES = 2000
"""Bootstrap draws of a gain: the standard error of its 95 % bounds is 1.5 % of their distance, of a normal gain."""
FAR = 1e6
"""The same for whitened residuals, in standard deviations."""


@dataclass(frozen=True)
class Gain:
    """Share, in percent, of the nominal model's squared error above the noise that an extension removes.

    `ahead_s` says how far ahead, where that is further than the horizon.
    """

    percent: float
    low: float
    high: float
    ahead_s: float | None = None

    def __str__(self) -> str:
        further = "" if self.ahead_s is None else f", {self.ahead_s:.2g} s ahead"
        return f"{self.percent:.0f} % [{self.low:.0f}, {self.high:.0f}]{further}"

    @property
    def is_material(self) -> bool:
        """Whether the low end of its interval is above `NOTHING_PERCENT`."""
        return self.low > NOTHING_PERCENT


@dataclass(frozen=True)
class Errors:
    """Squared errors of one model, by unit of evidence (trial, or second of a trial where there are few).

    Attributes
    ----------
    squares
        Shape (units,): sums of squares in units of the noise variance, all channels.
    spread
        The same of the measurement about its trial's mean.
    noise
        The same that noise alone leaves, by expectation: of white noise the number of samples.
    variances
        Of that; None where it is white, which leaves twice the number of samples.
    """

    squares: np.ndarray
    spread: np.ndarray
    noise: np.ndarray
    variances: np.ndarray | None = None

    def scatter(self) -> np.ndarray:
        """Variance of what noise alone leaves in each unit."""
        return 2.0 * self.noise if self.variances is None else self.variances

    def error_percent(self) -> float:
        """E of eq. (2), pooled."""
        return percent_of_spread(self.squares, self.spread)

    def ceiling_percent(self) -> float:
        """E of a model that leaves the noise alone."""
        return percent_of_spread(self.noise, self.spread)


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


def held_out_gain(nominal: Errors, without: Errors, extended: Errors, seed: int) -> Gain:
    """What the step from `without` to `extended` removes of the nominal model's error above the noise.

    The interval is a bootstrap over the units of evidence.
    """
    draws = np.random.default_rng(seed).integers(len(nominal.squares), size=(RESAMPLES, len(nominal.squares)))
    told = (nominal.squares, without.squares, extended.squares, extended.noise, extended.scatter())
    many, one = _share(*(e[draws].sum(axis=1) for e in told)), _share(*(e.sum() for e in told))
    low, high = np.quantile(many, (0.025, 0.975))
    return Gain(float(one), float(low), float(high))


def _share(
    nominal: np.ndarray, without: np.ndarray, extended: np.ndarray, noise: np.ndarray, scatter: np.ndarray
) -> np.ndarray:
    """Percent; the error above the noise is at least what the extension removes.

    It is at least its own scatter, too, of which `scatter` is the variance: units of evidence in which there is next to
    no error would else show gains of any size.
    """
    excess = np.maximum(np.maximum(nominal - noise, nominal - extended), np.sqrt(scatter))
    return 100.0 * (without - extended) / excess


def folds_of(trials: Sequence[Trial], count: int = FOLDS) -> list[list[int]]:
    """Trials to hold out together: every kind and every load dealt round."""
    order = sorted(range(len(trials)), key=lambda i: (trials[i].kind, sorted(trials[i].conditions.items()), i))
    count = min(count, len(trials))
    return [sorted(order[k::count]) for k in range(count)]


@dataclass(frozen=True)
class Evidence:
    """What a cause adds to the likelihood of trials that took no part.

    The residual without it is the residual with it plus a difference Delta of predictions, all whitened:
    |r + Delta|^2 - |r|^2 = |Delta|^2 + 2 r'Delta, which scatters by 2 |Delta| where r is noise.

    Attributes
    ----------
    added
        Twice the log-likelihood.
    squares
        |Delta|^2.
    """

    added: float
    squares: float

    @property
    def low(self) -> float:
        """Lower end of the 95 % interval."""
        return self.added - 2.0 * CONFIDENCE_95 * math.sqrt(self.squares)

    def __add__(self, other: Evidence) -> Evidence:
        return Evidence(self.added + other.added, self.squares + other.squares)


def speaks_for(evidence: Evidence | None, gain: Gain, alone: bool) -> bool:
    """Whether trials that took no part speak for a cause.

    By their likelihood where the model leaves only noise, by their errors over time where it does not; where other
    causes stand beside it by both, for several flexible forms together come near to anything. A cause alone may have no
    gain: if one trial of many reaches a stop, the others do not foretell it. None may be sure to do harm.

    Parameters
    ----------
    evidence
        By likelihood; None where the model leaves more than noise, and a likelihood says little.
    gain
        Of its errors over time.
    alone
        Whether no other cause stands beside it.
    """
    likely = evidence is None or evidence.low > 0.0
    return likely and (gain.is_material or (evidence is not None and alone and gain.high > 0.0))


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
    without: dict[str, Fit],
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
        _joined([r.nominal for r in results]),
        _joined([r.extended for r in results]),
        {n: _joined([r.without[n] for r in results]) for n in without},
        {n: sum((r.evidence[n] for r in results), Evidence(0.0, 0.0)) for n in without},
        _joined([r.chosen for r in results]),
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
    without: dict[str, Fit],
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


def within(errors: np.ndarray, most: float) -> np.ndarray:
    """Errors, or readings, no larger than `most`; what is no number is as large."""
    return np.clip(np.nan_to_num(errors, nan=most, posinf=most, neginf=-most), -most, most)


def added_likelihood(without: np.ndarray, extended: np.ndarray) -> Evidence:
    """What a cause adds, from whitened residuals without it and with it."""
    without, extended = within(without, FAR), within(extended, FAR)
    difference = without - extended
    return Evidence(float(without @ without - extended @ extended), float(difference @ difference))


def _joined(errors: Sequence[Errors]) -> Errors:
    return Errors(*(np.concatenate([getattr(e, name) for e in errors]) for name in ("squares", "spread", "noise")))
