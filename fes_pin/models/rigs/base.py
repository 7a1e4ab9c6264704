"""Base of rigs: names of the signals and equations of the nominal model."""

import dataclasses
import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Any, ClassVar

import numpy as np

from fes_pin.data.channels import CHANNELS, ENVELOPE, RATE, VOLUNTARY, Channel, channel_of
from fes_pin.data.errors import InputError
from fes_pin.data.imposed import MOTION, imposed_motion, same_motion
from fes_pin.data.read_only import ReadOnly
from fes_pin.data.schema import IMPOSED, START_S, NumberKey, RigSchema
from fes_pin.data.study import Study
from fes_pin.data.trial import Trial, derived_trial
from fes_pin.models.in_channel import in_channel
from fes_pin.models.parameters import ANY_NUMBER, ROTARY, ParameterInfo, check_parameters, checked_number, parameters_of
from fes_pin.models.rigs.stimuli import AT_START, shaped
from fes_pin.models.session import Session, checked_session, past_of
from fes_pin.models.stage import Effect, Signals

GRAVITY = 9.81
"""Standard gravity as the paper rounds it, m/s2 (eq. 7)."""

IMPOSED_STOPPING = 1e9
"""Rate at which friction could stop an imposed motion, 1/s: it does not, and its direction is that of the velocity."""

RUN_OUT = "inertia over damping"
"""Time constant of a joint without gravity; that of light damping is longer than any trial."""


@dataclasses.dataclass(frozen=True)
class Rig(ReadOnly):
    """A rig and its nominal model: fields are what the nominal model fits, `constants` what is known before.

    A subclass writes its equations on `Signals`: `s.x` states, `s.m` memories, `s.u` inputs, `s.c` constants of rig
    and trial, `s.initial` per-trial unknowns, `s.time`, `s.elapsed` since the last sample, `s.step` (no integration
    step is longer), and `s.delayed(now, before)` for what is held between samples and may come late. What an imposed
    motion is at an instant `imposed_now` says.
    Each method serves every `kind` of trial.

    Raises
    ------
    InputError
        When it is built: a parameter or a constant that is no finite number or out of its bounds, a saturation that is
        not above the threshold, a name in `fitted` that is no parameter, a session that is not one.
    """

    constants: Mapping[str, float] = dataclasses.field(default_factory=dict, kw_only=True, hash=False)
    fitted: tuple[str, ...] | None = dataclasses.field(default=None, kw_only=True)
    """Names of the parameters that a nominal fit moves; all of them by default."""
    session: Session = dataclasses.field(default=(), kw_only=True)
    """Earlier stimulation, of trials that state when they began."""

    name: ClassVar[str]
    schema: ClassVar[RigSchema]
    """Schema of its studies: required and optional keys, columns, units."""
    like: ClassVar[tuple[str, ...]] = ()
    """Names of other rigs whose effects it can have as well."""
    needed: ClassVar[tuple[str, ...]] = ()
    """Constants without which there are no equations."""
    computed: ClassVar[Mapping[str, NumberKey]] = {}
    """Constants that a model states and no study does, as what is read off a URDF, and what each may be."""
    elsewhere: ClassVar[str] = "turn the rig's base, or add a sensor on the other side of the joint or frame"
    """A change of the experiment that distinguishes causes where no input does."""
    settings: ClassVar[tuple[str, ...]] = ("",)
    """Examples of `fes-pin predict`'s options for its kinds of trial."""
    rate_of: ClassVar[Mapping[str, str]] = {}
    """Readings that are the rate of another, and may have been computed from it: their column and the other's."""
    begins: ClassVar[str] = ""
    """Initial state of its predictions in one sentence; "" where none is needed."""

    def __post_init__(self) -> None:
        names, schema = tuple(self.parameters()), self.schema
        listed = names if self.fitted is None else self.fitted
        if not isinstance(listed, list | tuple) or sorted(n for n in names if n in listed) != sorted(map(str, listed)):
            raise InputError(f"expected names among {', '.join(names)}, each once", column="fitted")
        check_parameters(self, schema.start)
        known = {**self.computed, **schema.constants, **schema.passive, **schema.start}
        given = {n: (v, known.get(n, ANY_NUMBER)) for n, v in self.constants.items()}
        constants = {n: checked_number(v, f"constants.{n}", key) for n, (v, key) in given.items()}
        for low, high in (channel.ends for channel in CHANNELS.values()):
            if low in constants and constants.get(high, math.inf) <= constants[low]:
                raise InputError(f"expected more than {constants[low]:g}", column=f"constants.{high}")
        vars(self).update(constants=constants, fitted=tuple(listed), session=checked_session(self.session))
        self._freeze()

    @classmethod
    def described(cls) -> RigSchema:
        """Return the schema of its studies, with its name and this class."""
        return dataclasses.replace(cls.schema, name=cls.name, owner=cls)

    @classmethod
    def of_study(cls, study: Study) -> "Rig":
        """The nominal model that a study believes, with its start values.

        Raises
        ------
        InputError
            If a file of the study cannot be read.
        """
        start: dict[str, Any] = dict(study.start)
        return cls(constants=dict(study.constants), **start)

    @classmethod
    def takes(cls, effect: type[Effect] | Effect) -> bool:
        """Return whether the effect can be part of it."""
        return cls.is_one_of(effect.rigs)

    @classmethod
    def is_one_of(cls, rigs: Collection[str]) -> bool:
        """Return whether it, or a rig that it extends, has one of these names."""
        return not {cls.name, *cls.like}.isdisjoint(rigs)

    def time_constants(self, kinds: Collection[str]) -> dict[str, float]:
        """Times in s that its answer takes at its own parameters, by what they are; only those that there are.

        Parameters
        ----------
        kinds
            Of the trials: a joint that is made to move has no time of its own.
        """
        muscle = getattr(self, "time_constant_s", None)
        return {} if muscle is None else {"the muscle's time constant": muscle}

    def decay_s(self) -> float:
        """Return the time constant in s of its motion by damping alone; infinite where nothing damps it."""
        return math.inf

    def check_prediction(self, trial: Trial) -> None:
        """Make sure that a trial holds what a prediction begins with.

        Raises
        ------
        InputError
            If not, with what was expected.
        """

    @classmethod
    def conditions_to_try(cls, study: Study) -> set[tuple[str, tuple[tuple[str, float], ...]]]:
        """Kinds and conditions under which a trial may be proposed: those that the study has been run under.

        No motion that would have to be imposed is proposed.
        """
        free = (t for t in study.trials if t.kind != IMPOSED)
        run = ((t.kind, {n: v for n, v in t.conditions.items() if n not in START_S}) for t in free)
        return {(kind, tuple(sorted(conditions.items()))) for kind, conditions in run}

    @classmethod
    def steered(cls, study: Study) -> str | None:
        """The input column of a study that `driven` can give any shape; None if there is none."""
        unknown = {n for n, c in CHANNELS.items() if c.ends[0] not in study.constants}  # of which nobody knows the ends
        unknown |= {*VOLUNTARY}  # nobody steers a voluntary muscle
        return next((n for n in cls.schema.inputs if n in study.trials[0] and n not in unknown), None)

    @classmethod
    def driven(cls, study: Study, shape: np.ndarray) -> np.ndarray:
        """Values of the steered column of a shape from 0 (off) to 1, shape (n,)."""
        column = cls.steered(study)
        assert column is not None
        return shaped(study, column, shape)

    @classmethod
    def other_stimuli(cls, study: Study, time: np.ndarray) -> Iterator[dict[str, np.ndarray]]:
        """Input columns of trials of a study that steers none: one without inputs by default."""
        yield {}

    @classmethod
    def parameters(cls) -> dict[str, ParameterInfo]:
        """Name and description of what the nominal model can fit."""
        return parameters_of(cls)

    def fitted_parameters(self) -> tuple[str, ...]:
        """The parameters that a nominal fit moves."""
        return self.fitted or ()

    def units(self) -> Mapping[str, str]:
        """Units of position, reading and effort; see `Parameter.in_units`."""
        return ROTARY

    def signals(self, kind: str) -> tuple[str, ...]:
        """Names of the signals that effects can change, in the order of the path."""
        raise NotImplementedError

    def changeable(self, kind: str, inputs: tuple[str, ...]) -> tuple[str, ...]:
        """The signals that trials with these input columns have."""
        return self.signals(kind)

    @property
    def channel(self) -> Channel | None:
        """The quantity of the pulses that recruits, by the threshold that is known; None where none is."""
        return channel_of(self.constants)

    def cause(self, kind: type[Effect]) -> type[Effect]:
        """Return the class of an effect with sizes in the unit of this rig's stimulus: `shift_ma` for `shift_us`."""
        return in_channel(kind, self.channel)

    def ends(self) -> tuple[str, ...]:
        """Names of the constants between which it recruits; without a known threshold, what recruits at the start.

        A program is kept by its layout: what the equations read must stand there.
        """
        return self.channel.ends if self.channel else (AT_START,)

    def driven_signals(self, signals: tuple[str, ...], inputs: tuple[str, ...]) -> tuple[str, ...]:
        """Return those of a muscle's signals that these inputs drive.

        Recorded pulses have no size that recruits. A voluntary muscle has recruitment, and no pulses: none sum, and no
        current spreads to other nerves.
        """
        has_size = self.channel is not None and self.channel.column in inputs
        absent = set() if has_size else {"pulse_width", "recruitment"}
        if ENVELOPE in inputs:
            absent = {"pulse_width", "summation", "net_force"}
        if not has_size and not {"stim", RATE, ENVELOPE} & set(inputs):
            absent |= {"delay", "time_constant", "sensitivity", "summation", "activation"}
        return tuple(s for s in signals if s not in absent)

    def states(self, kind: str) -> tuple[str, ...]:
        """Names of the continuous states."""
        raise NotImplementedError

    def memories(self, kind: str) -> tuple[str, ...]:
        """Names of what is held from sample to sample."""
        raise NotImplementedError

    def unknowns(self, kind: str) -> tuple[str, ...]:
        """Names of what each trial must estimate for itself: its initial state, if that is not known."""
        return ()

    def output(self, kind: str) -> str:
        """Name of the column that the model predicts first."""
        return self.outputs(kind)[0]

    def outputs(self, kind: str) -> tuple[str, ...]:
        """Names of the columns that the model predicts: the one that the schema has, by default."""
        return (self.schema.outputs[kind],)

    def input_columns(self, trial: Trial) -> tuple[str, ...]:
        """Return the columns of a trial that drive the model, an imposed motion among them: by default the schema's."""
        return self.schema.driving(trial.kind, trial.columns)

    def driven_by(self, trial: Trial) -> tuple[str, ...]:
        """Names of what drives the model in a trial: an imposed motion with its rates replaces its columns."""
        moved = self.schema.motion(trial.kind)
        columns = tuple(n for n in self.input_columns(trial) if n not in moved)
        return (*columns, *MOTION) if moved else columns

    def motion_constants(self, trial: Trial) -> dict[str, float]:
        """Constants of a trial with an imposed motion: where that begins."""
        return {"imposed_start": imposed_motion(trial, self.schema.imposed).start} if trial.kind == IMPOSED else {}

    def follows(self, trial: Trial) -> np.ndarray:
        """Samples of a trial that a model can be judged by, shape (n,): where an imposed motion's rates are known."""
        if trial.kind != IMPOSED:
            return np.ones(len(trial), dtype=bool)
        return imposed_motion(trial, self.schema.imposed).known(trial.time)

    def constants_of(self, trial: Trial) -> dict[str, float]:
        """Values of everything that is constant in a trial: of the rig, of its motion, and what was before it."""
        return {**self.trial_constants(trial), **self.motion_constants(trial), **past_of(self.session, trial)}

    def recruited(self, trial: Trial) -> np.ndarray | None:
        """Recruitment of the nominal muscle by a trial's stimulus, shape (n,); None of a rig without one."""
        return None

    def activation(self, trial: Trial) -> np.ndarray | None:
        """Return the activation of the nominal muscle, shape (n,); None of a rig without one.

        The first-order lag answers a recruitment that is held between samples exactly.
        """
        from fes_pin.infer.noise import first_order_low_pass  # noqa: PLC0415 - SciPy, for muscles alone

        if (recruited := self.recruited(trial)) is None:
            return None
        pole = math.exp(-trial.dt / float(getattr(self, "time_constant_s")))  # noqa: B009
        return first_order_low_pass(np.r_[0.0, recruited[:-1]], pole)

    def motion_names(self, kind: str) -> tuple[str, ...]:
        """Names of those constants."""
        return ("imposed_start",) if kind == IMPOSED else ()

    def stated(self, trial: Trial) -> dict[str, float]:
        """Return the stated conditions of a trial that the equations read and that may be misread, by name.

        Where motion is imposed also its position, by the first sample of its column.
        """
        known = set(self.constant_names(trial.kind))
        out = {n: v for n, v in trial.conditions.items() if n in known}
        moved = self.schema.motion(trial.kind)
        return {**out, **({moved[0]: float(trial[moved[0]][0])} if moved else {})}

    def restated(self, trial: Trial, name: str, value: float) -> Trial:
        """The trial with another value of something that it states; an imposed motion is moved as a whole."""
        if name not in trial.columns:
            return same_motion(derived_trial(trial, conditions={**trial.conditions, name: value}), trial)
        further = value - float(trial[name][0])
        moved = derived_trial(trial, columns={**trial.columns, name: trial[name] + further})
        return same_motion(moved, trial, further)

    def undetermined(self) -> tuple[str, ...]:
        """Return the names of causes that nothing but a belief about another cause determines."""
        return ()

    @property
    def predictor_step_s(self) -> float:
        """Longest integration step of a one-step predictor that resolves what the nominal model holds, s."""
        return math.inf

    def constant_names(self, kind: str) -> tuple[str, ...]:
        """Names of the constants of rig and trial that the equations read."""
        raise NotImplementedError

    def trial_constants(self, trial: Trial) -> dict[str, float]:
        """Values of those constants for a trial."""
        raise NotImplementedError

    def initial_unknowns(self, trial: Trial) -> dict[str, float]:
        """Start values of the unknowns of a trial, from its first samples."""
        return {}

    def unmeasured(self, trial: Trial) -> tuple[str, ...]:
        """Names of the unknowns that a trial's first sample does not tell."""
        return ()

    def read_first(self, trial: Trial) -> Mapping[str, str]:
        """The unknowns of a trial that its first sample tells, with the column that they are read in."""
        return {}

    def is_driven(self, trials: Sequence[Trial]) -> bool:
        """Return whether a recorded effort drives the rig in these trials."""
        return False

    def driving_sizes(self, trials: Sequence[Trial]) -> dict[str, float]:
        """Root mean square of what drives the rig in these trials, by random process: "effort" (at the joint) or
        "force" (of a held muscle); about, from the measured columns and start values alone."""
        return {}

    def guess(self, trial: Trial) -> float:
        """Return the start of the search for the static equilibrium."""
        return 0.0

    def set_rest(self, s: Signals, z: Any) -> None:
        """Put states and memories at rest, with the unknown z of the static equilibrium."""
        raise NotImplementedError

    def rest_residual(self, s: Signals, z: Any) -> Any:
        """Return what is zero at the static equilibrium; called after `rates` at rest. By default z is 0 there."""
        return z

    def sample(self, s: Signals) -> dict[str, Any]:
        """Next memories, once per sample, from the inputs."""
        raise NotImplementedError

    def rates(self, s: Signals) -> dict[str, Any]:
        """Time derivatives of the states; leaves the signals that effects read in `s`."""
        raise NotImplementedError

    def readings(self, s: Signals) -> tuple[Any, ...]:
        """The predicted columns, in the order of `outputs`."""
        raise NotImplementedError


def stated(known: Mapping[str, float], names: Sequence[str], trial: Trial) -> dict[str, float]:
    """Return values by name, of those that the equations of a trial read.

    Raises
    ------
    InputError
        One is not known, as of a model that was fitted without a stimulus.
    """
    if missing := [n for n in names if n not in known]:
        raise InputError(f"the model states no {' and '.join(missing)}, which trial {trial.name} needs")
    return {n: float(known[n]) for n in names}


def imposed_now(s: Signals) -> tuple[Any, Any, Any]:
    """Position, velocity and acceleration of an imposed motion now, between samples by the latter two."""
    e, bend = s.elapsed, s.u.imposed_acceleration
    rate = s.u.imposed_rate + e * bend
    return s.u.imposed + e * (s.u.imposed_rate + 0.5 * e * bend), rate, bend


def undone(s: Signals, signal: str, value: Any) -> Any:
    """The signal before the effects that turn it into `value`: each effect on it is linear in it, or adds to it."""
    at_zero, at_one = s.through(signal, 0.0), s.through(signal, 1.0)
    return (value - at_zero) / (at_one - at_zero)


def first_rate(time: np.ndarray, position: np.ndarray, span_s: float = 0.05) -> float:
    """The rate of a position at the first sample, from a parabola through the first `span_s` seconds.

    Parameters
    ----------
    time, position
        Shape (n,), s and rad or m.
    """
    count = int(np.clip(np.searchsorted(time - time[0], span_s), min(6, len(time)), len(time)))
    t = time[:count] - time[0]
    return float(np.polynomial.polynomial.polyfit(t, position[:count], min(2, count - 1))[1])
