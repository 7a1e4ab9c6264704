"""How far ahead a model foretells what a rig reads, and what acts on a driven rig at random."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fes_pin.data.trial import Trial
from fes_pin.diagnose.decide.held_out import Errors
from fes_pin.identify.ahead import SquaredErrors, forecast_errors, one_step, over_horizon, own_noise
from fes_pin.identify.doubts import driving_size
from fes_pin.identify.fit import Fit
from fes_pin.identify.noise import NoiseModel
from fes_pin.models.simulate import Simulator
from fes_pin.workers import in_parallel

AVERAGED_S = 0.05
"""Time over which a random effort is averaged before it is compared, s: what is faster moves no limb, and of what is
much faster than the rig data tell the intensity 2 std^2 time alone, not deviation and time one by one."""


@dataclass(frozen=True)
class RandomPart:
    """What acts at random on a rig.

    Attributes
    ----------
    name
        "effort" or "force".
    std
        Stationary standard deviation, in the rig's unit of effort.
    time_constant_s
        s.
    share
        Deviation of its means over `AVERAGED_S`, over the root mean square of what drives the rig.
    """

    name: str
    std: float
    time_constant_s: float
    share: float


@dataclass(frozen=True)
class Ahead:
    """Errors E of one model, percent: one sample ahead, over the horizon, free (None where the rig falls)."""

    one_step: float
    horizon: float
    free: float | None

    @classmethod
    def of(cls, total: SquaredErrors) -> Ahead:
        """From squared errors."""
        share = 100.0 / max(total.around, 1e-300)
        return cls(share * total.one_step, share * total.horizon, share * total.free)


@dataclass(frozen=True)
class AheadErrors:
    """Errors over time, of both models: on the trials that were fitted, and on trials held out if there were any."""

    horizon_s: float
    nominal: Ahead
    extended: Ahead
    nominal_held_out: Ahead | None
    extended_held_out: Ahead | None


def random_parts(fitted: Fit) -> tuple[RandomPart, ...]:
    """The random efforts of a fit, with their share of what drives the rig."""
    assert fitted.doubt is not None
    sizes = driving_size(fitted.model, fitted.trials)
    parts = ((n, std, fitted.doubt.time[n]) for n, std in fitted.doubt.std.items() if n in sizes)
    return tuple(RandomPart(n, std, time, _averaged(std, time) / sizes[n]) for n, std, time in parts)


def _averaged(std: float, time: float) -> float:
    """Deviation of the means over `AVERAGED_S` of a first-order process.

    With x = time / AVERAGED_S, std sqrt(2 x (1 - x (1 - exp(-1 / x)))).
    """
    x = time / AVERAGED_S
    return std * float(np.sqrt(max(2.0 * x * (1.0 - x * (1.0 - np.exp(-1.0 / x))), 0.0)))


def free_errors(
    nominal: Fit,
    extended: Fit,
    floor: NoiseModel,
    horizon_s: float,
    held_out: tuple[SquaredErrors, SquaredErrors] | None,
) -> AheadErrors:
    """Errors over time of two models that are simulated freely.

    Parameters
    ----------
    floor
        Noise whose deviations weigh the channels.
    held_out
        Squared errors of both on trials that took no part, if there are such.
    """
    inside = [Ahead.of(forecast_errors(f.model, f.trials, own_noise(f), floor, horizon_s)) for f in (nominal, extended)]
    outside = [Ahead.of(total) for total in held_out] if held_out else [None, None]
    return AheadErrors(horizon_s, inside[0], inside[1], outside[0], outside[1])


def errors_over_horizon(pairs: Sequence[tuple[Fit, Fit, Sequence[Trial]]], horizon_s: float) -> Errors:
    """Squared errors over the horizon, by seconds of each trial.

    Parameters
    ----------
    pairs
        A fit, the one whose white noise is the unit of its errors, so that models can be compared, and trials.
    """
    work = [(fitted, floor, trial) for fitted, floor, trials in pairs for trial in trials]
    found = in_parallel(lambda w: _squares(*w, horizon_s), work)
    squares, spread, counts = (np.concatenate([f[k] for f in found]) for k in range(3))
    return Errors(squares, spread, counts)


def _squares(fitted: Fit, floor: Fit, trial: Trial, horizon_s: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    assert fitted.doubt is not None and floor.doubt is not None
    foretold = over_horizon(fitted.model, trial, fitted.doubt, horizon_s)
    total, around = np.zeros(len(trial)), np.zeros(len(trial))
    for name, values in foretold.items():
        variance = floor.doubt.white[name] ** 2
        total += np.nan_to_num(trial[name] - values, posinf=0.0, neginf=0.0) ** 2 / variance
        around += np.nan_to_num(trial[name] - np.nanmean(trial[name])) ** 2 / variance
    pieces = [np.array_split(x, max(1, round(trial.duration))) for x in (total, around)]
    sizes = np.array([float(len(foretold) * len(p)) for p in pieces[0]])
    return np.array([p.sum() for p in pieces[0]]), np.array([p.sum() for p in pieces[1]]), sizes


def errors_ahead(pairs: Sequence[tuple[Fit, Sequence[Trial]]], horizon_s: float, falling: bool) -> Ahead:
    """E of the first output one sample ahead, over the horizon, and free."""
    missed = {"one_step": 0.0, "horizon": 0.0, "free": 0.0}
    around = 0.0
    for fitted, trials in pairs:
        assert fitted.doubt is not None
        for trial in trials:
            name = fitted.model.rig.output(trial.kind)
            measured = trial[name]
            free = Simulator(fitted.model, [trial]).run(fitted.values)[0].readings[:, 0]
            errors = {
                "one_step": one_step(fitted.model, trial, fitted.doubt)[name],
                "horizon": measured - over_horizon(fitted.model, trial, fitted.doubt, horizon_s)[name],
                "free": measured - free,
            }
            with np.errstate(all="ignore"):
                for key, values in errors.items():
                    missed[key] += float(np.nansum(values**2))
            around += float(np.nansum((measured - np.nanmean(measured)) ** 2))
    percent = {n: 100.0 * v / max(around, 1e-300) for n, v in missed.items()}
    return Ahead(percent["one_step"], percent["horizon"], None if falling else percent["free"])
