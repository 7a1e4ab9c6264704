"""Process and measurement noise of a rig: where a fit begins, how large or slow it may become, and without memory.

**Random efforts without memory.** The likelihood gives what a model gets wrong to a random effort, and an error of form
is none: friction behind an elastic drive is wrong for a moment at every reversal. Where readings are fine, a random
effort that lasts makes that likelier than any other does, and takes what is slow in the motion with it, of which
inertia, damping and friction are known; these then bend to the moments. With efforts that are new in every sample,
parameters are those that leave the least effort unexplained, whatever it is, as those of an inverse dynamic model
(Khalil and Dombre, Modeling, Identification and Control of Robots, 2002, chapter 12): calibration in the mean square,
which is the model nearest to what is measured where none is right (Tuo and Wu, Efficient calibration for imperfect
computer models, Annals of Statistics 43, 2015). Where a random effort does last, errors of prediction are smaller with
it (`diagnosis.estimators`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fes_pin.data.trial import Trial, derived_trial
from fes_pin.identify.fit import rough_noise
from fes_pin.infer.noise import Noise
from fes_pin.models.model import Model
from fes_pin.models.predictor import StateSpaceNoise

FIRST_SHARE = 0.003
"""Random effort that a fit begins with, as a share of what drives the rig: little, see `infer.maximise`."""
FIRST_TIME_S = 0.1
"""Time constant that it begins with."""
SMALLEST = 1e-6
"""Smallest random part, as a share of what drives the rig or of a reading's range: it counts as none."""
SLOWEST = 0.1
"""Longest time constant of a random process, as a share of the longest trial: what does not change some ten times in a
trial is an offset, and would hide one."""


def spread_of_start(model: Model, trial: Trial) -> dict[str, float]:
    """How far the start of a trial may be from what its first samples say: nothing is known of it beforehand.

    A position as far as it ever is from another, a rate as fast as the trial moves.
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
    """Root mean square of what drives the rig, by random process: the reference that random efforts are a share of.

    The effort at a joint is that of the nominal equations along the measured motion, inertia's and gravity's parts
    included, so that a rig without an input has one too.
    """
    return {n: value for n, value in model.rig.driving_sizes(trials).items() if value > 0.0}


def first_guess(model: Model, trials: Sequence[Trial], correlation_s: float = 0.0) -> StateSpaceNoise:
    """Noise that a fit begins with: of a reading from second differences, and a small random effort."""
    white = {n: noise.std for n, noise in _rough_noise(model, trials, correlation_s).items()}
    sizes = driving_size(model, trials)
    return StateSpaceNoise(
        white, {n: FIRST_SHARE * v for n, v in sizes.items()}, dict.fromkeys(sizes, FIRST_TIME_S), correlation_s
    )


def _rough_noise(model: Model, trials: Sequence[Trial], correlation_s: float) -> dict[str, Noise]:
    """Of readings so far apart that each has noise of its own."""
    steps = [slice(None, None, max(1, round(correlation_s / t.dt))) for t in trials]
    columns = [{n: v[own] for n, v in t.columns.items()} for t, own in zip(trials, steps, strict=True)]
    apart = [derived_trial(t, columns=c, time=t.time[own]) for t, c, own in zip(trials, columns, steps, strict=True)]
    return rough_noise(model, apart)


def stilled(model: Model, trials: Sequence[Trial], noise: StateSpaceNoise) -> StateSpaceNoise:
    """The same with random processes that are too small to do anything, and stay so."""
    sizes = driving_size(model, trials)
    return replace(noise, std={n: SMALLEST * sizes[n] for n in noise.std}, still=noise.processes)


def step_s(noise: StateSpaceNoise, trials: Sequence[Trial]) -> float:
    """From one reading to the next, s."""
    return max(noise.correlation_s, *(t.dt for t in trials))


def without_memory(noise: StateSpaceNoise, trials: Sequence[Trial]) -> StateSpaceNoise:
    """The same with random efforts that are new in every reading, of the power that they have at rest: 2 std^2 time."""
    step = step_s(noise, trials)
    std = {n: v * (noise.time[n] / step) ** 0.5 for n, v in noise.std.items()}
    return replace(noise, std=std, time=dict.fromkeys(noise.time, step), timed=noise.processes)


def noise_limits(model: Model, trials: Sequence[Trial], correlation_s: float = 0.0) -> dict[str, tuple[float, float]]:
    """Bounds of every parameter of the noise, by name."""
    step, longest = max(t.dt for t in trials), max(t.duration for t in trials)
    out: dict[str, tuple[float, float]] = {}
    for name, noise in _rough_noise(model, trials, correlation_s).items():
        values = np.concatenate([t[name] for t in trials if name in t.columns])
        spread = max(float(np.nanmax(values) - np.nanmin(values)), 1e-9)
        out[f"white.{name}"] = (min(SMALLEST * spread, noise.std), spread)
        out["std.reading"] = (SMALLEST * spread, spread)
    for name, size in driving_size(model, trials).items():
        out[f"std.{name}"] = (SMALLEST * size, 10.0 * size)
    for name in ("effort", "force", "reading"):
        out[f"time.{name}"] = (step, max(SLOWEST * longest, 2.0 * step))
    return out
