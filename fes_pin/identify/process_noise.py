"""Process and measurement noise of a rig: start values, bounds, and process noise that is white.

**White process noise.** The likelihood attributes the error of a model to process noise. An error of form is no noise:
friction behind an elastic drive, for example, is wrong for a moment at every reversal. Where readings are fine,
coloured process noise makes such an error likelier than white noise does. It then also takes the slow part of the
motion, which determines inertia, damping and friction, and these are biased towards the moments of the error. With
white process noise the parameters are those that leave the least effort unexplained, as in an inverse dynamic model
(Khalil and Dombre, Modeling, Identification and Control of Robots, 2002, chapter 12). This is calibration in the mean
square, which gives the model nearest to the data where no model is right (Tuo and Wu, Efficient calibration for
imperfect computer models, Annals of Statistics 43, 2015). Where the process noise of a rig is coloured, errors of
prediction are smaller with a coloured model of it (`diagnosis.estimators`).
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fes_pin.data.trial import Trial
from fes_pin.identify.fit import rough_noise
from fes_pin.models.model import Model
from fes_pin.models.predictor import StateSpaceNoise

FIRST_SHARE = 0.003
"""Process noise at which a fit starts, as a share of the driving effort: small, see `infer.maximise`."""
FIRST_TIME_S = 0.1
"""Time constant at which it starts, s."""
SMALLEST = 1e-6
"""Smallest process noise, as a share of the driving effort or of a reading's range: it counts as none."""
SLOWEST = 0.1
"""Longest time constant of a random process, as a share of the longest trial: a process that changes fewer than ten
times in a trial could not be distinguished from an offset."""


def spread_of_start(model: Model, trial: Trial) -> dict[str, float]:
    """Return the prior standard deviation of each initial state about the estimate from the first samples of a trial.

    It is the range of a position, and the speed of the trial for a rate: the prior is vague.
    """
    if not model.rig.unknowns(trial.kind):
        return {}
    column = trial[model.rig.output(trial.kind)]
    reach = max(float(np.nanmax(column) - np.nanmin(column)), 1e-9)
    lag = max(1, round(0.05 / trial.dt))
    moved = column[lag:] - column[:-lag] if len(column) > lag else column
    rate = max(float(np.sqrt(np.nanmean(moved**2))) / (lag * trial.dt), reach / max(trial.duration, trial.dt))
    return {n: (rate if "velocity" in n else reach) for n in model.rig.unknowns(trial.kind)}


def driving_size(model: Model, trials: Sequence[Trial]) -> dict[str, float]:
    """Return the root mean square of the driving effort, by random process: the reference for process noise.

    The effort at a joint is that of the nominal equations along the measured motion, with the parts of inertia and
    gravity, so that a rig without an input has one too.
    """
    return {n: value for n, value in model.rig.driving_sizes(trials).items() if value > 0.0}


def first_guess(model: Model, trials: Sequence[Trial], correlation_s: float = 0.0) -> StateSpaceNoise:
    """Return start values of noise: measurement noise from second differences, and small process noise."""
    white = {n: noise.std for n, noise in rough_noise(model, trials, correlation_s).items()}
    sizes = driving_size(model, trials)
    std = {n: FIRST_SHARE * v for n, v in sizes.items()}
    return StateSpaceNoise(white, std, dict.fromkeys(sizes, FIRST_TIME_S), correlation_s)


def stilled(model: Model, trials: Sequence[Trial], noise: StateSpaceNoise) -> StateSpaceNoise:
    """Return the noise with process noise too small to have an effect, and fixed there."""
    sizes = driving_size(model, trials)
    return replace(noise, std={n: SMALLEST * sizes[n] for n in noise.std}, still=noise.processes)


def step_s(noise: StateSpaceNoise, trials: Sequence[Trial]) -> float:
    """Return the time from one reading to the next, s."""
    return max(noise.correlation_s, *(t.dt for t in trials))


def without_memory(noise: StateSpaceNoise, trials: Sequence[Trial]) -> StateSpaceNoise:
    """Return the noise with white process noise of the same power at low frequencies: 2 std^2 time."""
    step = step_s(noise, trials)
    std = {n: v * (noise.time[n] / step) ** 0.5 for n, v in noise.std.items()}
    return replace(noise, std=std, time=dict.fromkeys(noise.time, step), timed=noise.processes)


def slowest_of_all(trials: Sequence[Trial]) -> float:
    """Return the longest time constant that all trials together tell, s: it is at most that of the longest."""
    return min(SLOWEST * sum(t.duration for t in trials), max(t.duration for t in trials))


def noise_limits(model: Model, trials: Sequence[Trial], known: StateSpaceNoise) -> dict[str, tuple[float, float]]:
    """Return bounds of every parameter of the noise, by name."""
    step, longest = max(t.dt for t in trials), max(t.duration for t in trials)
    slowest = max(known.slowest_s or SLOWEST * longest, 2.0 * step)
    out: dict[str, tuple[float, float]] = {}
    for name, noise in rough_noise(model, trials, known.correlation_s).items():
        values = np.concatenate([t[name] for t in trials if name in t.columns])
        spread = max(float(np.nanmax(values) - np.nanmin(values)), 1e-9)
        out[f"white.{name}"] = (min(SMALLEST * spread, noise.std), spread)
        out["std.reading"] = (SMALLEST * spread, spread)
    for name, size in driving_size(model, trials).items():
        out[f"std.{name}"] = (SMALLEST * size, 10.0 * size)
    for name in ("effort", "force", "reading"):
        out[f"time.{name}"] = (step, slowest)
    return out
