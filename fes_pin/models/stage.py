"""The signal path and the effects that act on it: stages, signals, effects."""

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
from fes_pin.models.parameters import ParameterInfo, check_parameters, parameter, parameters_of, refinement  # noqa: F401 - what the file of a cause needs is imported from here

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
"""Old and new names of attributes of an effect: an own cause may still set the old ones."""


class Stage(StrEnum):
    """Stage of the path from stimulus to reading at which an effect acts."""

    NERVE = "nerve"
    MUSCLE = "muscle"
    JOINT = "joint"
    RIG = "rig"
    SENSOR = "sensor"


@dataclasses.dataclass(frozen=True)
class Effect:
    """A physical effect that the nominal model leaves out; it vanishes at its null.

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
        True if its amplitudes can differ between trials, as those of effects that do not begin with the trial.
    screened_with
        Names of effects without which it is hardly identifiable: it is screened in models that also contain them.
    remembers
        True if its initial states depend on earlier trials of the session: `rest` reads them by `session`.
    scales
        True if it multiplies its signal. If that is a reading, it scales a filter's gains: see `LikelihoodProblem`.
    of_record
        True if its amplitude is a zero or a scale of an instrument. Where that differs between trials, it is a fault of
        the record.
    may_end
        Names of amplitudes whose bound is a possible size: there, what is stated of a rig is not there at all.
    each_trial
        True if its amplitudes are unknowns of each trial, estimated from that trial alone. The fields then hold their
        nulls, with which a trial that was not measured is predicted. All other parameters are common to all trials.

    Raises
    ------
    InputError
        When it is built with a parameter that is no number, or out of its bounds.
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
    of_record: ClassVar[bool] = False
    may_end: ClassVar[tuple[str, ...]] = ()

    each_trial: bool = dataclasses.field(default=False, kw_only=True)

    @property
    def is_fault(self) -> bool:
        """Whether it is a fault of the record: a zero or a scale of each trial's own."""
        return self.of_record and self.each_trial

    def __init_subclass__(cls) -> None:
        for old, new in _RENAMED.items():
            if old in vars(cls):
                said = f"Effect.{old} is Effect.{new} now; it ends with version 0.3"
                warnings.warn(said, DeprecationWarning, stacklevel=2)
                setattr(cls, new, vars(cls)[old])

    def __post_init__(self) -> None:
        check_parameters(self)

    def apply(self, value: Any, s: Any) -> Any:
        """Return the signal with the effect, from the signal without it."""
        raise NotImplementedError

    def rate(self, s: Any) -> ByName:
        """Return the time derivative of each state."""
        return {}

    def update(self, s: Any) -> ByName:
        """Return the next value of each memory."""
        return {}

    def slack(self, s: Any) -> Mapping[str, tuple[Any, Any]]:
        """Return for each memory with play its target, which it follows by `update`, and half the width of the play."""
        return {}

    def rest(self, s: Any) -> ByName:
        """Return the states and memories that are not zero at rest."""
        return {}

    def intensities(self, c: Any) -> ByName:
        """Return the intensity of the white noise that drives each state, from the constants `random`."""
        return {}

    def stationary_variances(self, c: Any) -> ByName:
        """Return the stationary variance of each random state at the start of a trial, from the constants `random`."""
        return {}

    def start_variances(self, reach: Any, speed: Any) -> ByName:
        """Return prior variances about `rest` of initial states, and of memories that depend on states.

        Parameters
        ----------
        reach, speed
            Range and speed of the reading in the trial; 0 for a rig that begins at rest.
        """
        return {}

    @classmethod
    def on(cls, constants: Mapping[str, float]) -> "type[Effect]":
        """Return the variant of the effect for a rig with these constants: by default itself."""
        return cls

    @classmethod
    def parameters(cls) -> dict[str, ParameterInfo]:
        """Return name and description of every parameter, in order."""
        return parameters_of(cls)

    @classmethod
    def amplitudes(cls) -> tuple[str, ...]:
        """Return the parameters whose null switches the effect off."""
        return tuple(n for n, info in cls.parameters().items() if info.null is not None and not info.optional)

    @classmethod
    def shapes(cls) -> tuple[str, ...]:
        """Return the parameters that have a meaning only where the effect acts."""
        return tuple(n for n, info in cls.parameters().items() if info.null is None and not info.optional)

    @classmethod
    def refinements(cls) -> tuple[tuple[str, ...], ...]:
        """Return the refinements of the effect's form: for each an optional parameter with a null, and its shapes."""
        out: list[tuple[str, ...]] = []
        for name, info in cls.parameters().items():
            if info.optional and info.null is not None:
                out.append((name,))
            elif info.optional:
                out[-1] = (*out[-1], name)
        return tuple(out)

    def refined(self) -> tuple[str, ...]:
        """Return the parameters of the refinements that are switched on."""
        info = self.parameters()
        return tuple(n for names in self.refinements() if getattr(self, names[0]) != info[names[0]].null for n in names)

    def unused(self) -> dict[str, float]:
        """Return the parameters of the refinements that are switched off, with their values."""
        refined = self.refined()
        return {n: float(getattr(self, n)) for n, i in self.parameters().items() if i.optional and n not in refined}

    def kept_of(self, names: tuple[str, ...]) -> tuple[str, ...]:
        """Return its states, or its memories, without those of refinements that are switched off."""
        refined = self.refined() if self.of_form else ()
        return tuple(n for n in names if self.of_form.get(n, n) in (n, *refined))

    def unknowns(self) -> tuple[str, ...]:
        """Return the parameters that have a value of each trial's own."""
        return self.amplitudes() if self.each_trial else ()

    def common(self) -> tuple[str, ...]:
        """Return the parameters that all trials share."""
        return tuple(n for n in self.parameters() if n not in self.unknowns())

    def fitted_parameters(self) -> tuple[str, ...]:
        """Return the fitted common parameters: all but discrete choices and refinements that are switched off."""
        unused, info = self.unused(), self.parameters()
        return tuple(n for n in self.common() if info[n].fitted and n not in unused)

    @classmethod
    def of_each_trial(cls, **shapes: Any) -> "Effect":
        """Return the effect with amplitudes of each trial's own."""
        return dataclasses.replace(cls.absent(), each_trial=True, **shapes)

    @classmethod
    def grids(cls, measured: Measured) -> Grids:
        """Return start values of each parameter for a search, most likely first.

        Parameters
        ----------
        measured
            Every measured column, all trials end to end, by name; `time` since each trial began, s.
        """
        return {n: info.grid or (getattr(cls, n),) for n, info in cls.parameters().items()}

    @classmethod
    def bounded(cls, values: Grids) -> Grids:
        """Return values that a search proposes, each within its physical bounds."""
        info = cls.parameters()
        return {n: tuple(map(info[n].nearest, many)) for n, many in values.items()}

    @classmethod
    def far_sizes(cls, measured: Measured) -> Grids:
        """Return sizes of amplitudes that no descent reaches and at which fits start too; `measured` as in `grids`."""
        info = cls.parameters()
        return {n: info[n].grid for n in cls.amplitudes() if info[n].grid}

    @classmethod
    def forms(cls, measured: Measured) -> tuple[Mapping[str, float], ...]:
        """Return the forms that a screen tries, each by the values of its refinements; by default the plain one alone.

        A refinement belongs here if the effect may not be identifiable without it; `measured` as in `grids`.
        """
        return ({},)

    def limits(self, measured: Measured) -> Bounds:
        """Return bounds of parameters by the measured range, within the physical ones; `measured` as in `grids`."""
        return {}

    def smallest(self, measured: Measured) -> dict[str, float]:
        """Return sizes of amplitudes below which readings of this resolution do not identify them.

        `measured` is as in `grids`, with `answer` the effort of a controller in closed loop.
        """
        return {}

    @classmethod
    def nulls(cls) -> dict[str, float]:
        """Return the values at which the effect vanishes and its refinements are off."""
        return {n: float(info.null) for n, info in cls.parameters().items() if info.null is not None}

    @classmethod
    def absent(cls) -> "Effect":
        """Return the effect at its null."""
        nulls: dict[str, Any] = cls.nulls()
        return cls(**nulls)


Named = TypeVar("Named", Effect, type[Effect])


Kind = TypeVar("Kind")


def classes_in(folder: Iterable[str], package: str, kind: type[Kind]) -> Iterator[type[Kind]]:
    """Yield the classes of a kind that the files of a package define; `folder` is its `__path__`.

    A class without a name of its own is a variant of another one.
    """
    for file in iter_modules(folder, f"{package}."):
        for one in vars(import_module(file.name)).values():
            its = isinstance(one, type) and issubclass(one, kind) and one.__module__ == file.name
            if its and "name" in vars(one):
                yield one


def by_name(effects: Iterable[type[Effect]], name: str) -> type[Effect]:
    """Return the effect of that name.

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
    """Return effects in the order of the signal path, by name at each stage."""
    return tuple(sorted(effects, key=lambda e: (list(Stage).index(e.stage), e.name)))


class Signals(SimpleNamespace):
    """The signals of one instant, by name, for a rig's equations and the effects.

    `own` holds the states and memories of the effect that is evaluated. `std(x)` is the standard deviation of an
    expression in them, in its unit, where a predictor estimates them and evaluates rates; else it is 0. `sensed_rate`
    is the initial rate of the reading: 0 unless the rig sets it in `set_rest`.
    """

    std: Callable[[Any], Any] = staticmethod(lambda x: 0.0)
    sensed_rate: Any = 0.0

    def __init__(self, effects: Sequence[Effect], **signals: Any) -> None:
        super().__init__(effects=tuple(effects), own=SimpleNamespace(), owned={}, **signals)

    def of(self, effect: Effect) -> "Signals":
        """Return the same signals, with the effect's own states and memories as `own`."""
        self.own = SimpleNamespace(**self.owned.get(effect.name, {}))
        return self

    def through(self, signal: str, value: Any) -> Any:
        """Return a value after every effect that acts on `signal`, in the order of the path."""
        for effect in self.effects:
            if effect.signal == signal:
                value = effect.apply(value, self.of(effect))
        return value


def counted_from(s: Any, place: Any) -> Any:
    """Return the origin of a sensor's deviations: for `place` 0 the reading at the trial's start, for 1 that of the
    joint at rest without a drive, for 2 the model's own zero. On an ankle the first two are the same."""
    return where(place < 0.5, s.rest_reading, where(place < 1.5, s.idle_reading, 0.0))


class FromAPlace(Effect):
    """Base of effects of a sensor on deviations from a place of the rig, the parameter `place`."""

    @classmethod
    def grids(cls, measured: Measured) -> Grids:
        """Return grids with every place that the rig has: a joint's trial may begin anywhere."""
        position = measured.get("position")
        anywhere = position is not None and np.array_equal(position, measured.get("reading", ()))
        return {**super().grids(measured), "place": (1.0, 0.0, 2.0) if anywhere else (0.0,)}


def span(measured: Measured, name: str) -> float:
    """Return the range of a column; 0 where it was not measured."""
    return float(np.ptp(measured.get(name, np.zeros(1))))


def least_step(values: np.ndarray) -> float:
    """Return the least difference above 0 of neighbouring values; infinite where all are equal."""
    steps = np.abs(np.diff(values))
    return float(np.min(steps, where=steps > 0.0, initial=np.inf))
