"""Simulation of a model on the inputs of trials, with sensitivities."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from fes_pin.data.channels import VOLUNTARY
from fes_pin.data.imposed import MOTION, driving_values
from fes_pin.data.trial import Trial, derived_trial
from fes_pin.models.accepted import accepted_trials
from fes_pin.models.compile.layout import Layout, make_layout, widest, width_of
from fes_pin.models.compile.program import Program, compiled_program
from fes_pin.models.least_squares import least_squares
from fes_pin.models.model import Model
from fes_pin.models.plausibility import warn_of_odd_numbers
from fes_pin.models.storage import pass_as_stored

EachTrial = Sequence[Mapping[str, float]]
"""Numbers by name for each trial."""
Values = Mapping[str, float] | EachTrial
"""Every parameter of a model by name: one mapping for all trials, or one for each."""
MAX_STEP_S = 2.5e-3
"""Longest integration step, s: 1/20 of a muscle's time constant; at 1/17 s of damping RK4 errs by 1e-6 rad a swing."""
STABLE = 2.0
"""Longest step in time constants of a decay: RK4 is stable up to 2.785 (Hairer and Wanner, Solving Ordinary
Differential Equations II, Springer, 1996, section IV.2)."""
FINEST = 1e-2
"""Shortest step of a stiff model, in units of `MAX_STEP_S`: a start value may be wrong a thousandfold."""
FIRST_S = 0.2
"""Time from whose samples a rate that was not measured is estimated, s: the error of a line's slope falls with its
power 3/2, and a nominal model is accurate for so short a time."""
FEWEST = 6
"""Least number of samples for an estimate of position and rate."""
NEWTON_STEPS = 3
NUDGE = 1e-4
"""Step of the finite differences in position (rad or m) and rate of that estimate."""


@dataclass(frozen=True)
class Simulated:
    """One trial as simulated.

    Attributes
    ----------
    readings
        Shape (n, outputs).
    sensitivities
        Shape (n, outputs, columns).
    """

    readings: np.ndarray
    sensitivities: np.ndarray


class OnTrials:
    """A model structure on trials, which run in batches of trials that can share a program.

    Parameters
    ----------
    model, trials, columns
        See `Simulator`.
    max_step_s
        Longest integration step.
    """

    def __init__(self, model: Model, trials: Sequence[Trial], columns: tuple[str, ...], max_step_s: float) -> None:
        self.model, self.trials, self.columns, self.max_step_s = model, tuple(trials), columns, max_step_s

    def key(self, trial: Trial) -> tuple[Any, ...]:
        """Return what trials of one batch have in common: kind, inputs and integration steps per sample."""
        return trial.kind, self.model.driven_by(trial), substeps(self.model, trial.dt, self.max_step_s)

    def side_by_side(self) -> Iterator[list[int]]:
        """Yield places of trials of one batch: those of the same key and of similar length."""
        groups: dict[Any, list[int]] = {}
        keys = {trial_id: self.key(trial) for trial_id, trial in {id(t): t for t in self.trials}.items()}
        for i, trial in enumerate(self.trials):
            groups.setdefault(keys[id(trial)], []).append(i)
        for members in groups.values():
            members.sort(key=lambda i: len(self.trials[i]))
            most = widest(self.columns)
            for start in range(0, len(members), most):
                yield members[start : start + most]


class Simulator(OnTrials):
    """A model structure on a set of trials, ready to run for any parameter values.

    Parameters
    ----------
    model
        Its structure and constants are used; the values of its parameters are given to `run`.
    trials
        The trials whose inputs and conditions drive it.
    columns
        Parameters (and unknowns of a trial) of the sensitivities; none by default.
    max_step_s
        Longest integration step; by default what the model needs.
    """

    def __init__(
        self, model: Model, trials: Sequence[Trial], columns: tuple[str, ...] = (), max_step_s: float | None = None
    ) -> None:
        super().__init__(model, trials, columns, max_step(model) if max_step_s is None else max_step_s)
        self._blocks = [Block(self, lanes, model) for lanes in self.side_by_side()]
        self._fixed = {n: value for block in self._blocks for n, value in block.layout.fixed}

    def run(self, values: Values, unknowns: EachTrial | None = None) -> list[Simulated]:
        """Simulate every trial.

        Parameters
        ----------
        values
            Every parameter of the model, by name; one for all trials, or one for each.
        unknowns
            For each trial its own unknowns, if the model has any; by default from its first samples: see `start`.

        Raises
        ------
        ValueError
            For another value of a parameter that belongs to a form of an effect that is off in `model`: such forms are
            left out of the equations, unless sensitivities to them are asked for.
        """
        out: list[Simulated | None] = [None] * len(self.trials)
        if unknowns is None:
            unknowns = self.start(values if isinstance(values, Mapping) else values[0])
        for own in [values] if isinstance(values, Mapping) else values:
            for name, value in self._fixed.items():
                if own[name] != value:
                    raise ValueError(f"{name} is {value:g} in the model that this simulator is for, not {own[name]:g}")
        for block in self._blocks:
            y, s = block.run_all(values, unknowns)
            pass_as_stored(block.trials, (y, s))
            for lane, i in enumerate(block.lanes):
                n = len(self.trials[i])
                out[i] = Simulated(y[:n, :, lane], spread(s[:n, ..., lane], block.places, len(self.columns)))
        return [s for s in out if s is not None]

    def start(self, values: Mapping[str, float]) -> list[dict[str, float]]:
        """Return start values of each trial's unknowns from its first samples.

        The model reads the first sample of each measured output. A rate that was not measured is fitted, together with
        the position, to the first 0.2 s. Unknowns of effects are at their nulls.
        """
        rig, out = self.model.rig, [self.model.initial_unknowns(t) for t in self.trials]
        if unmeasured := [i for i, t in enumerate(self.trials) if rig.unmeasured(t)]:
            kind = self.trials[unmeasured[0]].kind
            found = self._following(values, out, unmeasured, rig.unknowns(kind), rig.output(kind))
            for i, own in zip(unmeasured, found, strict=True):
                out[i].update({n: own[n] for n in rig.unmeasured(self.trials[i])})
        if any(e.signal in ("play", "reading") for e in self.model.effects):
            read = [rig.read_first(t) for t in self.trials]
            for name, column in dict.fromkeys(pair for own in read for pair in own.items()):
                those = [i for i, own in enumerate(read) if own.get(name) == column]
                found = self._following(values, out, those, (name,), column, samples=1)
                for i, own in zip(those, found, strict=True):
                    out[i] = own
        return out

    def _following(
        self,
        values: Mapping[str, float],
        unknowns: Sequence[dict[str, float]],
        places: Sequence[int],
        names: Sequence[str],
        column: str,
        samples: int | None = None,
    ) -> list[dict[str, float]]:
        """Return unknowns that fit the first samples of a column of some trials: Gauss-Newton on finite differences."""
        begun, guess = [self.trials[i] for i in places], [dict(unknowns[i]) for i in places]
        short = [t.first(max(FEWEST, math.ceil(FIRST_S / t.dt))) for t in begun]
        simulator = Simulator(self.model, short)
        for _ in range(NEWTON_STEPS):
            base = simulator.run(values, guess)
            moved = [simulator.run(values, [{**u, n: u[n] + NUDGE} for u in guess]) for n in names]
            for i, trial in enumerate(short):
                k = self.model.rig.outputs(trial.kind).index(column)
                reading = base[i].readings[:samples, k]
                slopes = np.stack([(m[i].readings[:samples, k] - reading) / NUDGE for m in moved], axis=1)
                for name, step in zip(names, least_squares(slopes, trial[column][:samples] - reading), strict=True):
                    guess[i][name] += float(step)
        return guess


class Block:
    """Trials of one kind that run as a batch in the lanes of one program, at most `widest` of them.

    Parameters
    ----------
    all_of
        The model and all trials. Sensitivities that the model does not have are left out.
    lanes
        Places of the trials of this batch.
    model
        The model with its process noise.
    measured
        Outputs whose measurement corrects the states, for a predictor.
    """

    def __init__(self, all_of: OnTrials, lanes: list[int], model: Model, measured: tuple[str, ...] = ()) -> None:
        self.lanes, self.trials, columns = lanes, [all_of.trials[i] for i in lanes], all_of.columns
        first = self.trials[0]
        self.model, self.rig, self.inputs = model, model.rig, model.driven_by(first)
        model = model.acting(first.kind, self.rig.input_columns(first))
        available = set(model.parameters()) | set(model.unknowns(first.kind))
        chosen, width = tuple(c for c in columns if c in available), width_of(len(lanes))
        self.layout, self.width = make_layout(model, first.kind, self.inputs, chosen, measured, width), width
        self.program: Program = compiled_program(model, self.layout)
        self.places = tuple(columns.index(n) for n in self.layout.columns)
        self.substeps = substeps(model, first.dt, all_of.max_step_s)
        self.count = max(len(t) for t in self.trials)
        padded = self.trials + [self.trials[-1]] * (width - len(lanes))
        known = [{**self.rig.constants_of(t), **timing(t, self.substeps)} for t in padded]
        self.constants = np.array([[c.get(n, 0.0) for c in known] for n in self.layout.constants], dtype=float)
        self.constants = self.constants.reshape(-1, width)
        self.guess = np.array([self.rig.guess(t) for t in padded], dtype=float)
        self._latest: tuple[tuple[int, ...], np.ndarray] | None = None

    def _inputs(self, shift: tuple[int, ...]) -> np.ndarray:
        """Return inputs of all lanes, shape (count, inputs, width), each delayed by whole samples; zero before.

        An imposed motion is never delayed: a delay is that of the response to a stimulus. An EMG was before as it is at
        first.
        """
        u = np.zeros((self.count, len(self.inputs), self.width))
        for lane, trial in enumerate(self.trials):
            for j, name in enumerate(self.inputs):
                late = 0 if name in MOTION else min(shift[lane], len(trial))
                values = driving_values(trial, name, self.rig.schema.imposed)
                u[late : len(trial), j, lane] = values[: len(trial) - late]
                u[:late, j, lane] = values[0] if name in VOLUNTARY else 0.0
        return u

    def _delayed(self, shift: tuple[int, ...]) -> np.ndarray:
        """Return the result of `_inputs`, kept for the latest shift: a cache of this method would hold its block."""
        latest = self._latest  # another thread may replace it
        if latest is None or latest[0] != shift:
            self._latest = latest = (shift, self._inputs(shift))
        return latest[1]

    def _set(self, constants: np.ndarray, name: str, values: Sequence[float]) -> None:
        """Write a constant of each lane; unused lanes equal the last trial."""
        constants[self.layout.constants.index(name)] = [*values, *[values[-1]] * (self.width - len(values))]

    def run_all(self, values: Values, unknowns: EachTrial, **known: Sequence[float]) -> tuple[np.ndarray, np.ndarray]:
        """Run the program of all lanes, and return its results; see `Program`.

        Parameters
        ----------
        values, unknowns
            Those of all trials.
        known
            Further constants of each lane.
        """
        own = [values] * len(self.lanes) if isinstance(values, Mapping) else [values[i] for i in self.lanes]
        p, constants = lane_values(self.layout, own, [unknowns[i] for i in self.lanes]), self.constants.copy()
        delays = [total_delay(self.model, v) for v in own]
        shift = tuple(math.floor(late / t.dt + 1e-9) for late, t in zip(delays, self.trials, strict=True))
        for name, each in {**known, "shift": shift}.items():
            self._set(constants, name, each)
        return self.program.run(self._delayed(shift), p, constants, self.guess, self.substeps)


def spread(sensitivities: np.ndarray, places: tuple[int, ...], width: int) -> np.ndarray:
    """Return sensitivities of a trial at their places among all columns, (n, outputs, width); zero elsewhere."""
    if len(places) == width:
        return sensitivities
    full = np.zeros((*sensitivities.shape[:2], width))
    full[..., list(places)] = sensitivities
    return full


def max_step(model: Model) -> float:
    """Return the longest integration step that resolves the model, s."""
    stable = max(STABLE * model.rig.decay_s(), FINEST * MAX_STEP_S)
    return min([MAX_STEP_S, stable, *(e.max_step_s for e in model.effects)])


def substeps(model: Model, dt: float, max_step_s: float) -> int:
    """Return integration steps per sample; a delay needs one more, which ends where the input jumps."""
    return max(1, math.ceil(dt / max_step_s - 1e-6)) + is_delayed(model)


def lane_values(layout: Layout, values: EachTrial, unknowns: EachTrial) -> np.ndarray:
    """Return values of a program's parameters, shape (values, width); unused lanes equal the last trial."""
    p = np.empty((len(layout.values), layout.width))
    for k, name in enumerate(layout.values):
        own = [known[name] for known in (unknowns if name in layout.unknowns else values)]
        p[k] = own + [own[-1]] * (layout.width - len(own))
    return p


def timing(trial: Trial, steps: int) -> dict[str, float]:
    """Return the constants that every program reads, s; `t0` is the time of the first sample from the origin."""
    return {"t0": float(trial.since_origin[0]), "dt": trial.dt, "step": trial.dt / steps, "shift": 0.0}


def is_delayed(model: Model) -> bool:
    """Return whether the model has an effect that delays the input."""
    return any(e.signal == "delay" for e in model.effects)


def total_delay(model: Model, values: Mapping[str, float]) -> float:
    """Return the delay from stimulus to muscle in s, all effects together."""
    delay = 0.0
    for effect in model.with_parameters(values).effects if is_delayed(model) else ():
        if effect.signal == "delay":
            delay = effect.apply(delay, None)
    return max(float(delay), 0.0)


def simulate(model: Model, trial: Trial) -> Trial:
    """Simulate a trial from its inputs, conditions and, for a joint, its first sample alone.

    Returns
    -------
    Trial
        A trial of the same time and inputs, with the predicted outputs; for a joint the velocity as well.

    Raises
    ------
    InputError
        If the rig cannot have such a trial: it lacks an input, a condition or its initial state, has a column that the
        rig does not read, or values in another unit.

    Warns
    -----
    InputWarning
        Of numbers that are odd, as `check` and `fes-pin predict` find them.
    """
    accepted, simulated = accepted_trials(model, trial), cache(simulated_trial)
    warn_of_odd_numbers(model, accepted, simulated)
    return simulated(model, *accepted)


def simulated_trial(model: Model, trial: Trial) -> Trial:
    """Return the result of `simulate` for a trial that is known to belong to the model's rig."""
    (simulated,) = Simulator(model, [trial]).run(model.parameters())
    rig = model.rig
    columns = {name: trial[name] for name in rig.input_columns(trial)}
    columns.update({n: simulated.readings[:, k].copy() for k, n in enumerate(rig.outputs(trial.kind))})
    return derived_trial(trial, columns=columns)
