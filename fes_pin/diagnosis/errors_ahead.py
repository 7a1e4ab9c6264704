"""Errors of predictions one step ahead, over a horizon and in free simulation; and the process noise of driven rigs."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from weakref import finalize

import numpy as np

from fes_pin.data.trial import Trial
from fes_pin.identify.ahead import first_ahead, forecast, forecasts, free_ahead, free_residuals, one_step
from fes_pin.identify.likelihood import is_simulated
from fes_pin.identify.likelihood_fit import LikelihoodFit
from fes_pin.identify.process_noise import driving_size, first_guess
from fes_pin.infer.held_out import FOLDS, Errors
from fes_pin.infer.levels import AVERAGED_S, SMALL_SHARE
from fes_pin.infer.noise import NoiseModel
from fes_pin.infer.result import shown
from fes_pin.models.model import Model
from fes_pin.models.predictions import PredictedOutput
from fes_pin.models.predictor import StateSpaceNoise
from fes_pin.workers import in_parallel

TENTHS = 10
"""Pieces into which the error of a free simulation is divided where there are fewer than `FOLDS` trials."""

Pairs = Sequence[tuple[LikelihoodFit, LikelihoodFit, Sequence[Trial]]]
"""Fits, each with the fit whose white noise is the unit of its errors so that models can be compared, and trials."""


@dataclass(frozen=True)
class RandomPart:
    """Process noise of a rig: a random effort.

    Attributes
    ----------
    name
        "effort" or "force".
    std
        Stationary standard deviation, in the rig's unit of effort.
    time_constant_s
        Its time constant, s.
    share
        Standard deviation of its means over `AVERAGED_S`, divided by the root mean square of the driving effort.
    """

    name: str
    std: float
    time_constant_s: float
    share: float

    def record(self) -> dict[str, float | None]:
        """As JSON files have it."""
        sizes = {"std": self.std, "time_constant_s": self.time_constant_s, "share_percent": 100.0 * self.share}
        return {n: shown(value) for n, value in sizes.items()}

    def words(self, unit: str) -> str:
        """Return it in words; `unit` is that of the effort."""
        share = f"{100.0 * self.share:.2g} % of what drives the rig"
        return f"{self.std:.3g} {unit}, {share}, changing within {self.time_constant_s:.2g} s"


@dataclass(frozen=True)
class Ahead:
    """Errors E of one model, percent: one sample ahead, over the horizon, free (None where the rig falls).

    `noise` is the error over the horizon of noise alone, see `noise_that_is_small`; None for a free simulation.
    """

    one_step: float
    horizon: float
    free: float | None
    noise: float | None = None


@dataclass(frozen=True)
class AheadErrors:
    """Errors of both models by horizon: on the trials that were fitted, and on trials held out if there were any."""

    horizon_s: float
    nominal: Ahead
    extended: Ahead
    nominal_held_out: Ahead | None
    extended_held_out: Ahead | None

    @property
    def words(self) -> str:
        """Return in words what is predicted."""
        return f"predictions {self.horizon_s:g} s ahead"


def random_parts(fitted: LikelihoodFit) -> tuple[RandomPart, ...]:
    """Return the random efforts that act in a fit, with their share of the driving effort."""
    sizes, still = driving_size(fitted.model, fitted.trials), fitted.noise.still
    parts = ((n, std, fitted.noise.time[n]) for n, std in fitted.noise.std.items() if n in sizes and n not in still)
    return tuple(RandomPart(n, std, time, _averaged(std, time) / sizes[n]) for n, std, time in parts)


def are_large(random: Sequence[RandomPart]) -> bool:
    """Return whether process noise is more than a small share of the driving effort."""
    return any(r.share > SMALL_SHARE for r in random)


def _averaged(std: float, time: float) -> float:
    """Return the standard deviation of the means over `AVERAGED_S` of a first-order process.

    With x = time / AVERAGED_S, std sqrt(2 x (1 - x (1 - exp(-1 / x)))).
    """
    x = time / AVERAGED_S
    return std * float(np.sqrt(max(2.0 * x * (1.0 - x * (1.0 - np.exp(-1.0 / x))), 0.0)))


def squared_errors(pairs: Pairs, ahead_s: float | None) -> Errors:
    """Return squared errors over a horizon, by seconds of each trial; or of free simulations, by trials.

    Parameters
    ----------
    ahead_s
        The horizon, s; None for free simulations, whose errors are correlated all through a trial. Where there are few
        trials, each is divided into tenths.
    """
    if ahead_s is None:
        each = [free_errors(f.model, trials, noise_that_is_small(floor), f) for f, floor, trials in pairs]
        return Errors(*np.concatenate([[e.squares, e.spread, e.noise] for e in each], axis=1))
    work = [(fitted, floor, trial) for fitted, floor, trials in pairs for trial in trials]
    found = in_parallel(lambda w: _squares(*w, ahead_s), work)
    return Errors(*np.concatenate(found, axis=1))


def free_errors(
    model: Model, trials: Sequence[Trial], noise: NoiseModel, fitted: LikelihoodFit | None = None
) -> Errors:
    """Return squared errors of a model that is simulated from the inputs of each trial alone, by trials.

    Where there are few trials, each is divided into tenths. Amplitudes of a trial's own are estimated from other parts
    of it than those on which the error is found: see `identify.per_trial`.

    Parameters
    ----------
    noise
        Its variances are the unit, by output column.
    fitted
        The fit of the model: its own trials are simulated from their fitted initial states.
    """
    pieces = 1 if len(trials) >= FOLDS else TENTHS

    def of_trial(trial: Trial) -> np.ndarray:
        """Return squared errors, spread and number of readings, shape (3, pieces)."""
        missed = free_residuals(model, trial, noise, None if fitted is None else fitted.unknowns_of(trial))
        lines = sum((_lines(trial[n], m, noise[n].std ** 2) for n, m in missed.items()), np.zeros((3, len(trial))))
        return np.array([p.sum(axis=1) for p in np.array_split(lines, pieces, axis=1)]).T

    return Errors(*np.concatenate(in_parallel(of_trial, trials), axis=1))


def _squares(fitted: LikelihoodFit, floor: LikelihoodFit, trial: Trial, horizon_s: float) -> np.ndarray:
    """Return `Errors` of a trial by its seconds, shape (4, seconds); errors within one horizon are correlated."""
    whole = np.zeros((4, len(trial)))
    for name, one in _predicted(fitted, trial, horizon_s).items():
        lines = _lines(trial[name], trial[name] - one.values, floor.noise.white[name] ** 2, one.variances)
        whole += [*lines, 2.0 * lines[2] ** 2 * max(1.0, horizon_s / trial.dt)]
    whole[:, : first_ahead(fitted.model, trial, horizon_s)] = 0.0
    pieces = np.array_split(whole, max(1, round(trial.duration)), axis=1)
    return np.array([p.sum(axis=1) for p in pieces]).T


@np.errstate(all="ignore")
def _lines(measured: np.ndarray, missed: np.ndarray, unit: float, noise: np.ndarray | None = None) -> np.ndarray:
    """Return squared errors, spread and noise of each sample, shape (3, n); 0 where nothing is measured or predicted.

    Parameters
    ----------
    unit
        Variance that is their unit, and by default that of the noise.
    """
    variances = np.full(len(missed), unit) if noise is None else np.nan_to_num(noise)
    squares = missed**2, (measured - np.nanmean(measured)) ** 2, variances
    found = np.isfinite(missed), np.isfinite(measured), np.isfinite(missed)
    return np.where(found, squares, 0.0) / unit


_PREDICTED: dict[int, dict[tuple[int, float], tuple[Trial, dict[str, PredictedOutput]]]] = {}


def _predicted(fitted: LikelihoodFit, trial: Trial, horizon_s: float) -> dict[str, PredictedOutput]:
    """Return predictions over the horizon, with the variance of their errors by noise alone, by output.

    Judging causes and reporting errors need the same predictions: these are cached as long as the fit exists.
    """
    if id(fitted) not in _PREDICTED:
        finalize(fitted, _PREDICTED.pop, id(fitted), None)
    known, key = _PREDICTED.setdefault(id(fitted), {}), (id(trial), horizon_s)
    if key not in known:
        known[key] = (trial, _predict(fitted, trial, horizon_s))  # as long as the trial is here no other has its id
    return known[key][1]


def _predict(fitted: LikelihoodFit, trial: Trial, horizon_s: float) -> dict[str, PredictedOutput]:
    if is_simulated(fitted.noise, [trial]):
        return free_ahead(fitted.model, trial, fitted.noise, horizon_s, fitted.unknowns_of(trial))
    calm = noise_that_is_small(fitted)
    predicted = forecasts(fitted.model, trial, fitted.noise, horizon_s)
    alone = predicted if calm is fitted.noise else forecasts(fitted.model, trial, calm, horizon_s)
    return {n: one._replace(variances=alone[n].variances) for n, one in predicted.items()}


def noise_that_is_small(fitted: LikelihoodFit) -> StateSpaceNoise:
    """Return the part of the process and measurement noise of a fit that is noise and not an error of the model.

    A random effort counts as noise up to `SMALL_SHARE` of the driving effort; more than that is missed by the model.
    The measurement noise of a free simulation counts as far as it is white.
    """
    if is_simulated(fitted.noise, fitted.trials) and not any(fitted.noise.ar.values()):
        rough = first_guess(fitted.model, fitted.trials).white
        white = {n: float(np.fmin(v, rough.get(n, v))) for n, v in fitted.noise.white.items()}
        return replace(fitted.noise, white=white)
    less = {r.name: SMALL_SHARE / r.share for r in random_parts(fitted) if r.share > SMALL_SHARE}
    std = {n: value * less.get(n, 1.0) for n, value in fitted.noise.std.items()}
    return replace(fitted.noise, std=std) if less else fitted.noise


def errors_ahead(pairs: Pairs, horizon_s: float, falling: bool) -> Ahead:
    """Return E of the first output one sample ahead, over the horizon and free."""
    work = [(fitted, floor, trial) for fitted, floor, trials in pairs for trial in trials]
    missed, around = np.sum(in_parallel(lambda one: _sums(*one, horizon_s, falling), work), axis=0)
    one_step, horizon, free, noise = (float(v) for v in 100.0 * missed / np.maximum(around, 1e-300))
    return Ahead(one_step, horizon, None if falling else free, noise)


def _sums(fitted: LikelihoodFit, floor: LikelihoodFit, trial: Trial, horizon_s: float, falling: bool) -> np.ndarray:
    """Return squared errors of the first output of a trial and the squares of its deviations, shape (2, 4).

    The columns are: one sample ahead, over the horizon, free, and over the horizon by noise alone; in units of the
    noise of `floor`.
    """
    name = fitted.model.rig.output(trial.kind)
    measured, later = trial[name], _predicted(fitted, trial, horizon_s)[name]
    free, simulated = np.full(len(trial), np.nan), is_simulated(fitted.noise, [trial])
    if simulated or not falling:
        free = free_residuals(fitted.model, trial, fitted.noise, fitted.unknowns_of(trial))[name]
    if simulated:
        next_one = free - forecast(np.nan_to_num(free), fitted.noise[name], trial.dt, 0.0)
    else:
        next_one = one_step(fitted.model, trial, fitted.noise)[name]
    missed, unit = (next_one, measured - later.values, free), floor.noise.white[name] ** 2
    begun = 0, first_ahead(fitted.model, trial, horizon_s), 0
    each = zip(missed, begun, strict=True)
    one, ahead, alone = (_lines(measured, m, unit, later.variances)[:, k:].sum(axis=1) for m, k in each)
    return np.array([[one[0], ahead[0], alone[0], ahead[2]], [one[1], ahead[1], alone[1], ahead[1]]])
