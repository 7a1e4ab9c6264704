"""Features of the test of lack of fit: functions of state, input and time that act as efforts or on the reading.

They are effects that belong to no library, and functions of the states of the model at each instant. In a one-step
predictor these are estimated from earlier samples, so that features are independent of the noise of the test.
"""

import dataclasses
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from types import SimpleNamespace
from typing import Any

import numpy as np

from fes_pin.data.channels import STIMULI
from fes_pin.data.trial import Trial
from fes_pin.models.maths import cos, sin, sqrt, tanh
from fes_pin.models.parameters import parameter
from fes_pin.models.rigs.base import Rig
from fes_pin.models.stage import Effect, Stage

SHARP = 10.0
"""Steepness of a smoothed sign: it changes within a tenth of the range."""

FeatureFunction = Callable[[Any], Any]

MOTION: Mapping[str, FeatureFunction] = {
    "offset: 1": lambda f: 1.0,
    "time: t": lambda f: f.t,
    "time: t2": lambda f: f.t * f.t,
    "angle: q": lambda f: f.q,
    "angle: q2": lambda f: f.q * f.q,
    "angle: q3": lambda f: f.q * f.q * f.q,
    "rate: v": lambda f: f.v,
    "rate: sign v": lambda f: tanh(SHARP * f.v),
    "rate: v|v|": lambda f: f.v * sqrt(f.v * f.v + 1e-6),
    "rate: v3": lambda f: f.v * f.v * f.v,
    "rate: v2": lambda f: f.v * f.v,
    "angle: q v": lambda f: f.q * f.v,
    "angle: q2 v": lambda f: f.q * f.q * f.v,
    "angle: q sign v": lambda f: f.q * tanh(SHARP * f.v),
    "time: q t": lambda f: f.q * f.t,
    "time: v t": lambda f: f.v * f.t,
    "time: sign v t": lambda f: tanh(SHARP * f.v) * f.t,
    "stimulus: u": lambda f: f.u,
    "stimulus: u|u|": lambda f: f.u * sqrt(f.u * f.u + 1e-6),
    "stimulus: u q": lambda f: f.u * f.q,
    "stimulus: u v": lambda f: f.u * f.v,
    "stimulus: u t": lambda f: f.u * f.t,
    "activation: act": lambda f: f.act,
    "activation: act2": lambda f: f.act * f.act,
    "activation: act q": lambda f: f.act * f.q,
    "activation: act v": lambda f: f.act * f.v,
    "activation: act t": lambda f: f.act * f.t,
}
WAVES = (1, 2, 4, 8)
"""Waves over a trial, and over the range of the angle."""
SHORT_WAVES = tuple(float(k) for k in np.arange(3.0, 30.0, 0.75))
"""Waves over the range of the angle of the test for detents, three quarters of what the range can resolve apart. Fewer
waves are smooth enough for the library and the polynomials in the angle; more would be about a degree long on a joint
that moves by half a radian."""


def _waves() -> Iterator[tuple[str, FeatureFunction]]:
    for k in WAVES:
        yield f"time: sin {k}", partial(_wave, sin, "t", 2.0 * math.pi * k)
        yield f"time: cos {k}", partial(_wave, cos, "t", 2.0 * math.pi * k)
        yield f"angle: sin {k} q", partial(_wave, sin, "q", math.pi * k)
        yield f"angle: cos {k} q", partial(_wave, cos, "q", math.pi * k)


def _short_waves() -> Iterator[tuple[str, FeatureFunction]]:
    for k in SHORT_WAVES:
        yield f"angle: sin {k} waves", partial(_wave, sin, "q", math.pi * k)
        yield f"angle: cos {k} waves", partial(_wave, cos, "q", math.pi * k)


def _wave(function: Any, variable: str, rate: float, f: Any) -> Any:
    return function(rate * getattr(f, variable))


EFFORTS: Mapping[str, FeatureFunction] = {**MOTION, **dict(_waves())}
"""Features as an effort, by "variable: function"."""
READINGS: Mapping[str, FeatureFunction] = {
    n: MOTION[n] for n in ("offset: 1", "time: t", "time: t2", "rate: v", "rate: sign v", "angle: q2", "angle: q3")
}
"""Features as a part of the reading."""
SCALES = ("centre", "reach", "speed", "drive", "duration")
"""Origins and units of the variables: see `_Features.scaled`."""


class _Features(Effect):
    """A sum of features, each with an amplitude; subclasses are dataclasses made below."""

    functions: Mapping[str, FeatureFunction]
    rigs = ("ankle", "joint", "muscle")

    def apply(self, value: Any, s: Any) -> Any:
        f = self.scaled(s)
        for k, one in enumerate(self.functions.values()):
            value = value + getattr(self, f"a{k:02d}") * one(f)
        return value

    def scaled(self, s: Any) -> SimpleNamespace:
        """Return angle, rate, drive, activation and time, each from about -1 to 1."""
        drive = next((getattr(s.u, n) for n in ("effort", *STIMULI) if hasattr(s.u, n)), 0.0)
        centre, reach, speed, most, duration = (getattr(self, n) for n in SCALES)
        return SimpleNamespace(
            q=(getattr(s.x, "q", getattr(s, "q", 0.0)) - centre) / reach,
            v=getattr(s.x, "v", getattr(s, "v", 0.0)) / speed,
            u=drive / most,
            act=getattr(s.x, "act", 0.0),
            t=s.time / duration,
        )


def _made(name: str, stage: Stage, signal: str, functions: Mapping[str, FeatureFunction]) -> type[_Features]:
    scales = [(n, float, parameter(1.0, fitted=False)) for n in SCALES]
    amplitudes = [(f"a{k:02d}", float, parameter(0.0, null=0.0)) for k in range(len(functions))]
    title = "".join(part.capitalize() for part in name.split("_"))
    own = {"name": name, "stage": stage, "signal": signal, "functions": functions, "__module__": __name__}
    return dataclasses.make_dataclass(title, [*amplitudes, *scales], bases=(_Features,), namespace=own, frozen=True)


EffortFeatures = _made("effort_features", Stage.JOINT, "torque", EFFORTS)
ForceFeatures = _made("force_features", Stage.MUSCLE, "force", EFFORTS)
ReadingFeatures = _made("reading_features", Stage.SENSOR, "reading", READINGS)
AngleWaves = _made("angle_waves", Stage.JOINT, "torque", dict(_short_waves()))


def scaled_to(features: _Features, rig: Rig, trials: Sequence[Trial]) -> _Features:
    """Return features whose variables run from about -1 to 1 in some trials."""
    moved = [t[(*rig.schema.motion(t.kind), rig.output(t.kind))[0]] for t in trials]
    low, high = float(np.nanmin(np.concatenate(moved))), float(np.nanmax(np.concatenate(moved)))
    lag = [min(max(1, round(0.05 / t.dt)), len(t) - 1) for t in trials]
    rates = [np.abs(q[k:] - q[:-k]) / (k * t.dt) for q, t, k in zip(moved, trials, lag, strict=True)]
    drives = [np.abs(t[n]) for t in trials for n in rig.input_columns(t)]
    scales: dict[str, Any] = {
        "centre": 0.5 * (low + high),
        "reach": max(0.5 * (high - low), 1e-9),
        "speed": max(float(np.nanmax(np.concatenate(rates))), 1e-9),
        "drive": max((float(np.nanmax(d)) for d in drives), default=0.0) or 1.0,
        "duration": max(t.duration for t in trials),
    }
    return dataclasses.replace(features, **scales)
