"""The signal path, and what acts on it: stages, signals, effects."""

from __future__ import annotations

import dataclasses
import math
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from enum import StrEnum
from importlib import import_module
from pkgutil import iter_modules
from types import SimpleNamespace
from typing import Any, ClassVar, TypeVar

import numpy as np

from fes_pin.data.errors import InputError
from fes_pin.data.schema import unknown
from fes_pin.models.maths import where
from fes_pin.models.parameters import (  # noqa: F401 - what the file of a cause needs is imported from here
    ParameterInfo,
    check_parameters,
    parameter,
    parameters_of,
    refinement,
)

Scalar = Any
"""A number, an array of them, or an expression of CasADi."""
Measured = Mapping[str, np.ndarray]
"""Every measured column, all trials end to end, by name; `time` since each trial began, s."""
ByName = Mapping[str, Any]
"""Values of states or memories, or their rates, by name."""
Bounds = dict[str, tuple[float, float]]
"""The least and the largest value of parameters, by name."""
Grids = dict[str, tuple[float, ...]]
"""Values of parameters that are tried, by name."""


_RENAMED = {"beside": "screened_with", "foretold_step_s": "predictor_step_s"}
"""Attributes of an effect that an earlier version named otherwise; a file of one's own may still set these."""


class Stage(StrEnum):
    """Where on the path from stimulus to reading something acts."""

    NERVE = "nerve"
    MUSCLE = "muscle"
    JOINT = "joint"
    RIG = "rig"
    SENSOR = "sensor"


@dataclasses.dataclass(frozen=True)
class Effect:
    """One physical thing that the nominal model leaves out; it vanishes at its null.

    A subclass is a frozen dataclass whose fields are parameters. It names the `signal` that it changes, and says how in
    `apply`. If it has states of its own it lists them in `states` and gives their `rate`; what it remembers from sample
    to sample (updated once per sample, before the rates) goes to `memories` and `update`; `rest` gives both at the
    static equilibrium that a trial starts from. Values may be numbers or CasADi expressions alike.

    Attributes
    ----------
    name
        The canonical name of the cause.
    stage
        Where on the signal path it belongs.
    signal
        What it changes: see the rig's equations for the names.
    rigs
        The rigs it can be part of.
    of_form
        Its states and memories that only a refinement has, each with the parameter that switches the refinement on.
    random
        Names of the constants that say how its states are driven at random; see `models.disturbance`.
    inputs
        Columns of a trial that it reads in addition to those that drive the rig, as `s.u.<name>`.
    dissipative
        True if it can only take energy from the joint.
    max_step_s
        Longest integration step that resolves it, s.
    predictor_step_s
        The same for a one-step predictor, where the step depends on how well the rig's velocity is known.
    varies
        True if its amplitudes can be other in each trial: those of what does not begin with the trial.
    screened_with
        Names of effects without which it shows little or nothing: it is screened in models that also contain them.
    remembers
        True if earlier trials of the session are in its states at the start: `rest` reads them by `session`.
    scales
        True if it multiplies its signal. Where that is a reading it scales a filter's gains: see `LikelihoodProblem`.
    each_trial
        Its amplitudes are unknowns of each trial, estimated from that trial alone; the fields keep what a trial that
        was not measured is predicted with: their nulls. All other parameters stay common to all trials.

    Raises
    ------
    InputError
        When it is built: a parameter that is no number, or out of its bounds.
    """

    name: ClassVar[str]
    stage: ClassVar[Stage]
    signal: ClassVar[str]
    rigs: ClassVar[tuple[str, ...]]
    states: ClassVar[tuple[str, ...]] = ()
    memories: ClassVar[tuple[str, ...]] = ()
    of_form: ClassVar[Mapping[str, str]] = {}
    random: ClassVar[tuple[str, ...]] = ()
    inputs: ClassVar[tuple[str, ...]] = ()
    dissipative: ClassVar[bool] = False
    max_step_s: ClassVar[float] = math.inf
    predictor_step_s: ClassVar[float] = math.inf
    varies: ClassVar[bool] = False
    screened_with: ClassVar[tuple[str, ...]] = ()
    remembers: ClassVar[bool] = False
    scales: ClassVar[bool] = False

    each_trial: bool = dataclasses.field(default=False, kw_only=True)

    def __init_subclass__(cls) -> None:
        for old, new in _RENAMED.items():
            if old in vars(cls):
                said = f"Effect.{old} is Effect.{new} now; it ends with version 0.3"
                warnings.warn(said, DeprecationWarning, stacklevel=2)
                setattr(cls, new, vars(cls)[old])

    def __post_init__(self) -> None:
        check_parameters(self)

    def apply(self, value: Any, s: Any) -> Any:
        """The signal with the effect, from the signal without it."""
        raise NotImplementedError

    def rate(self, s: Any) -> ByName:
        """Time derivative of each state."""
        return {}

    def update(self, s: Any) -> ByName:
        """Next value of each memory."""
        return {}

    def slack(self, s: Any) -> Mapping[str, tuple[Any, Any]]:
        """Of each memory that only follows something by `update` once a slack is taken up: what, and half the slack."""
        return {}

    def rest(self, s: Any) -> ByName:
        """States and memories at rest that are not zero."""
        return {}

    def intensities(self, c: Any) -> ByName:
        """Intensity of the white noise that drives each state at random, from the constants `random`."""
        return {}

    def stationary_variances(self, c: Any) -> ByName:
        """Variance of what is random in each state when a trial begins, from the constants `random`."""
        return {}

    def start_variances(self, reach: Any, speed: Any) -> ByName:
        """Variances about `rest` of states, and of memories that states go into, when a trial begins: unit squared.

        Parameters
        ----------
        reach, speed
            How far and how fast what is read moves in the trial; 0 for a rig that begins at rest.
        """
        return {}

    @classmethod
    def parameters(cls) -> dict[str, ParameterInfo]:
        """Name and description of every parameter, in order."""
        return parameters_of(cls)

    @classmethod
    def amplitudes(cls) -> tuple[str, ...]:
        """The parameters whose null switches the effect off."""
        return tuple(n for n, info in cls.parameters().items() if info.null is not None and not info.optional)

    @classmethod
    def shapes(cls) -> tuple[str, ...]:
        """The parameters that have a meaning only where the effect acts."""
        return tuple(n for n, info in cls.parameters().items() if info.null is None and not info.optional)

    @classmethod
    def refinements(cls) -> tuple[tuple[str, ...], ...]:
        """The refinements of the effect's form: for each an optional parameter with a null, and its shapes after it."""
        out: list[tuple[str, ...]] = []
        for name, info in cls.parameters().items():
            if info.optional and info.null is not None:
                out.append((name,))
            elif info.optional:
                out[-1] = (*out[-1], name)
        return tuple(out)

    def refined(self) -> tuple[str, ...]:
        """The parameters of the refinements that are switched on."""
        info = self.parameters()
        return tuple(n for names in self.refinements() if getattr(self, names[0]) != info[names[0]].null for n in names)

    def unused(self) -> dict[str, float]:
        """The parameters of the refinements that are switched off, with their values."""
        refined = self.refined()
        return {n: float(getattr(self, n)) for n, i in self.parameters().items() if i.optional and n not in refined}

    def kept_states(self) -> tuple[str, ...]:
        """Its states, without those of refinements that are switched off: such a state it does not have at all."""
        return self._kept(self.states)

    def kept_memories(self) -> tuple[str, ...]:
        """Its memories, in the same way."""
        return self._kept(self.memories)

    def _kept(self, names: tuple[str, ...]) -> tuple[str, ...]:
        refined = self.refined() if self.of_form else ()
        return tuple(n for n in names if self.of_form.get(n, n) in (n, *refined))

    def unknowns(self) -> tuple[str, ...]:
        """The parameters that each trial has a value of its own of."""
        return self.amplitudes() if self.each_trial else ()

    def common(self) -> tuple[str, ...]:
        """The parameters that all trials share."""
        return tuple(n for n in self.parameters() if n not in self.unknowns())

    def fitted_parameters(self) -> tuple[str, ...]:
        """What a fit moves in all trials alike: all but discrete choices, and but refinements that are switched off."""
        unused, info = self.unused(), self.parameters()
        return tuple(n for n in self.common() if info[n].fitted and n not in unused)

    @classmethod
    def of_each_trial(cls, **shapes: Any) -> Effect:
        """The effect with amplitudes that are each trial's own."""
        return dataclasses.replace(cls.absent(), each_trial=True, **shapes)

    @classmethod
    def grids(cls, measured: Measured) -> Grids:
        """Start values of each parameter for a search, most likely first.

        Parameters
        ----------
        measured
            Every measured column, all trials end to end, by name; `time` since each trial began, s.
        """
        return {n: info.grid or (getattr(cls, n),) for n, info in cls.parameters().items()}

    @classmethod
    def far_sizes(cls, measured: Measured) -> Grids:
        """Sizes of amplitudes that no slope leads to, and a fit begins with as well; `measured` as in `grids`."""
        info = cls.parameters()
        return {n: info[n].grid for n in cls.amplitudes() if info[n].grid}

    @classmethod
    def forms(cls, measured: Measured) -> tuple[Mapping[str, float], ...]:
        """Forms that a screen tries, each by the values of the refinements that it has: the plain one, by default.

        A refinement belongs here if without it the effect may look like none at all; `measured` as in `grids`.
        """
        return ({},)

    def limits(self, measured: Measured) -> Bounds:
        """Bounds that the measured range sets to parameters, inside the physical ones; `measured` as in `grids`."""
        return {}

    def smallest(self, measured: Measured) -> dict[str, float]:
        """Sizes of amplitudes below which readings as coarse as these do not tell them.

        `measured` is as in `grids`, with `answer` the effort of a controller that answers what is read.
        """
        return {}

    @classmethod
    def nulls(cls) -> dict[str, float]:
        """Values at which the effect vanishes, and its refinements are off."""
        return {n: float(info.null) for n, info in cls.parameters().items() if info.null is not None}

    @classmethod
    def absent(cls) -> Effect:
        """The effect at its null."""
        nulls: dict[str, Any] = cls.nulls()
        return cls(**nulls)


Named = TypeVar("Named", Effect, type[Effect])


Kind = TypeVar("Kind")


def classes_in(folder: Iterable[str], package: str, kind: type[Kind]) -> Iterator[type[Kind]]:
    """The classes of a kind that the files of a package define; `folder` is its `__path__`."""
    for file in iter_modules(folder, f"{package}."):
        for one in vars(import_module(file.name)).values():
            if isinstance(one, type) and issubclass(one, kind) and one.__module__ == file.name:
                yield one


def by_name(effects: Iterable[type[Effect]], name: str) -> type[Effect]:
    """The effect of that name.

    Raises
    ------
    InputError
        If there is none.
    """
    known = {one.name: one for one in effects}
    if name not in known:
        raise InputError(f"no such effect: {unknown(str(name), known)}", column=str(name))
    return known[name]


def in_order(effects: Iterable[Named]) -> tuple[Named, ...]:
    """Effects in the order of the signal path, by name at each stage."""
    return tuple(sorted(effects, key=lambda e: (list(Stage).index(e.stage), e.name)))


class Signals(SimpleNamespace):
    """The signals of one instant, by name: what a rig's equations and the effects read.

    `own` holds the states and memories of the effect that is being evaluated; `std(x)` is the standard deviation of an
    expression in them, in its unit, where a predictor estimates them and asks for rates; else it is 0. `sensed_rate` is
    how fast what is read moves when a trial begins: 0 unless the rig says otherwise in `set_rest`.
    """

    std: Callable[[Any], Any] = staticmethod(lambda x: 0.0)
    sensed_rate: Any = 0.0

    def __init__(self, effects: Sequence[Effect], **signals: Any) -> None:
        super().__init__(effects=tuple(effects), own=SimpleNamespace(), owned={}, **signals)

    def of(self, effect: Effect) -> Signals:
        """The same signals, with the effect's own states and memories as `own`."""
        self.own = SimpleNamespace(**self.owned.get(effect.name, {}))
        return self

    def through(self, signal: str, value: Any) -> Any:
        """Pass a value through every effect that acts on `signal`, in the order of the path."""
        for effect in self.effects:
            if effect.signal == signal:
                value = effect.apply(value, self.of(effect))
        return value


def counted_from(s: Any, place: Any) -> Any:
    """The reading that a sensor's deviations are counted from: where the trial begins at 0, at 1 where the joint rests
    when nothing drives it, at 2 the model's own zero. On an ankle the first two are one."""
    return where(place < 0.5, s.rest_reading, where(place < 1.5, s.idle_reading, 0.0))


class FromAPlace(Effect):
    """Base of what a sensor does to deviations that are counted from a place of the rig, the parameter `place`."""

    @classmethod
    def grids(cls, measured: Measured) -> Grids:
        """Deviations are counted from any place that the rig has: a joint's trial may begin anywhere."""
        position = measured.get("position")
        anywhere = position is not None and np.array_equal(position, measured.get("reading", ()))
        return {**super().grids(measured), "place": (1.0, 0.0, 2.0) if anywhere else (0.0,)}


def reading_range(measured: Measured) -> float:
    """Largest difference between first readings; 0 where there are none."""
    reading = measured.get("reading", np.zeros(1))
    return float(np.nanmax(reading) - np.nanmin(reading))


def symmetric(size: float) -> tuple[float, float]:
    """From -size to size, or no bounds for no size."""
    return (-size, size) if size > 0.0 else (-math.inf, math.inf)


def span(measured: Measured, name: str) -> float:
    """How far a column goes, from its least to its largest value; 0 where it was not measured."""
    return float(np.ptp(measured.get(name, np.zeros(1))))


def least_step(values: np.ndarray) -> float:
    """The least difference of neighbours that is none of equal ones; infinite where all are equal."""
    steps = np.abs(np.diff(values))
    return float(np.min(steps, where=steps > 0.0, initial=np.inf))
