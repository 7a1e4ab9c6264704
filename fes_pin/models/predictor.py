"""One-step predictions of measured trials with sensitivities: innovations and their variances."""

import math
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from fes_pin.data.counts import SAME, begins_of_runs, count_of, hunts, lengths_of_runs
from fes_pin.data.read_only import ReadOnly
from fes_pin.data.trial import Trial, derived_trial
from fes_pin.infer.noise import Noise
from fes_pin.models.autoregression import noise_ahead, stationary_variance
from fes_pin.models.disturbance import disturbed
from fes_pin.models.model import Model
from fes_pin.models.predictions import PredictedOutput, PredictedTrial, Readings
from fes_pin.models.rigs.base import Rig
from fes_pin.models.simulate import Block, EachTrial, OnTrials, Values, max_step, spread

_COUNTED = "_counted"
"""Where a trial keeps which of its readings are counts: many models predict it in turn."""


@dataclass(frozen=True, eq=False)
class StateSpaceNoise(ReadOnly, Mapping[str, Noise]):
    """Process noise of a rig, and measurement noise of its readings.

    As a mapping it holds the measurement noise by output column.

    Attributes
    ----------
    white
        Standard deviation of the white noise of each output, in its unit, by column name.
    std, time
        Stationary standard deviation and time constant (s) of each first-order random process, by its name: "effort"
        at the joint, "force" of a held muscle, "reading" of the first output.
    correlation_s
        Correlation time of measurement noise, s: one reading in that time enters the likelihood, see
        `identify.correlation_time`. It is 0 where the noise of every sample is new.
    ar
        Autoregression of the innovations of each output, by column name; `white` is then the standard deviation of its
        own innovations. See `models.autoregression`.
    still
        Names of random processes whose size is fixed at a negligible value.
    timed
        Names of random processes whose time constant is fixed.
    slowest_s
        Longest time constant of a random process, s; 0 for that of one trial.
    """

    white: Mapping[str, float]
    std: Mapping[str, float] = field(default_factory=dict)
    time: Mapping[str, float] = field(default_factory=dict)
    correlation_s: float = 0.0
    ar: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    still: tuple[str, ...] = ()
    timed: tuple[str, ...] = ()
    slowest_s: float = 0.0

    @property
    def processes(self) -> tuple[str, ...]:
        """Names of the random processes."""
        return tuple(self.std)

    @property
    def acting(self) -> tuple[str, ...]:
        """Names of the random processes that have an effect: all but `still`."""
        return tuple(n for n in self.std if n not in self.still)

    def with_values(self, values: Mapping[str, float]) -> "StateSpaceNoise":
        """Return the same noise with other values, by name as in `parameters`."""
        parts = {part: dict(getattr(self, part)) for part in ("white", "std", "time")}
        for name, value in values.items():
            part, _, which = name.partition(".")
            parts[part][which] = value
        return replace(self, white=parts["white"], std=parts["std"], time=parts["time"])

    def __getitem__(self, column: str) -> Noise:
        ar = self.ar.get(column, ())
        return Noise(self.white[column], ar, self.white[column] * math.sqrt(stationary_variance(ar)))

    def __iter__(self) -> Iterator[str]:
        return iter(self.white)

    def __len__(self) -> int:
        return len(self.white)

    @property
    def lasts_s(self) -> float:
        """`correlation_s` by its old name. Deprecated."""
        said = "StateSpaceNoise.lasts_s is StateSpaceNoise.correlation_s now; it ends with version 0.3"
        warnings.warn(said, DeprecationWarning, stacklevel=2)
        return self.correlation_s

    def parameters(self) -> dict[str, float]:
        """Return every value by name: white.position, std.effort, time.effort."""
        return {f"{part}.{n}": v for part in ("white", "std", "time") for n, v in getattr(self, part).items()}


class Predictor(OnTrials):
    """One-step predictions of measured trials for any values of a model's parameters.

    Parameters
    ----------
    model
        Its structure and constants are used; the values of its parameters are given to `run`.
    trials
        Measured trials; samples that were not measured are NaN.
    columns
        Parameters, and unknowns of effects, of the sensitivities.
    processes
        Names of the random processes; see `StateSpaceNoise`.
    priors
        For each trial, the prior standard deviation of each initial state about the estimate from its first samples.
    correlation_s
        Correlation time of measurement noise, s; see `StateSpaceNoise`.
    """

    def __init__(
        self,
        model: Model,
        trials: Sequence[Trial],
        columns: tuple[str, ...],
        processes: tuple[str, ...],
        priors: Sequence[Mapping[str, float]],
        correlation_s: float = 0.0,
    ) -> None:
        steps = [max_step(model), model.rig.predictor_step_s, *(e.predictor_step_s for e in model.effects)]
        super().__init__(model, trials, columns, min(steps))
        self.processes, self.priors, self.correlation_s = processes, priors, correlation_s
        self._blocks = [_Prediction(self, lanes) for lanes in self.side_by_side()]

    def key(self, trial: Trial) -> tuple[Any, ...]:
        """Return what trials of one block have in common: also their measured outputs."""
        return (*super().key(trial), measured_outputs(self.model, trial))

    def run(
        self, values: Values, noise: StateSpaceNoise | Sequence[StateSpaceNoise], unknowns: EachTrial
    ) -> list[PredictedTrial]:
        """Predict every trial one step ahead, with sensitivities.

        Parameters
        ----------
        values
            Every parameter of the model, by name; one mapping for all trials, or one for each.
        noise
            Noise of every output; one for all trials, or one for each.
        unknowns
            For each trial its own unknowns: its initial state and those of effects.
        """
        out: dict[int, PredictedTrial] = {}
        noises = [noise] * len(self.trials) if isinstance(noise, StateSpaceNoise) else list(noise)
        for block in self._blocks:
            y, s = block.run(values, [one.parameters() for one in noises], unknowns)
            predicted = block.innovations(y, s, len(self.columns), [noises[i] for i in block.lanes])
            out.update(zip(block.lanes, predicted, strict=True))
        return [out[i] for i in range(len(self.trials))]

    def predict(self, values: Values, noise: StateSpaceNoise, unknowns: EachTrial) -> list[dict[str, PredictedOutput]]:
        """Return the prediction of every output of every trial, by name; see `run`."""
        out: dict[int, dict[str, PredictedOutput]] = {}
        for block in self._blocks:
            y, _ = block.run(values, [noise.parameters()] * len(self.trials), unknowns)
            out.update(zip(block.lanes, block.predicted(y, noise), strict=True))
        return [out[i] for i in range(len(self.trials))]


def _lanes_first(array: np.ndarray) -> np.ndarray:
    """Return an array with its last axis, the lanes, first."""
    return np.ascontiguousarray(np.moveaxis(array, -1, 0))


class ReadColumns(NamedTuple):
    """Measured outputs of a trial, each of shape (n, outputs).

    Attributes
    ----------
    followed
        Whether a sample corrects the state of the filter.
    measured
        The measured values; 0 elsewhere.
    repeated
        Number of equal values in a row.
    readings
        The readings that enter the likelihood.
    """

    followed: np.ndarray
    measured: np.ndarray
    repeated: np.ndarray
    readings: Readings


def read_columns(rig: Rig, trial: Trial, outputs: tuple[str, ...], correlation_s: float | None) -> ReadColumns:
    """Return the measured outputs of a trial, at a correlation time of measurement noise.

    Without one, every sample is a reading, also of equal counts in a row and of counts that hunt.
    """
    columns = np.column_stack([trial[name] for name in outputs])
    followed = np.isfinite(columns) & (rig.follows(trial) & are_news(trial, correlation_s or 0.0))[:, None]
    measured = np.where(followed, columns, 0.0)
    if correlation_s is None:
        once = np.ones(columns.shape)
        return ReadColumns(followed, measured, once, Readings(outputs, followed, once))
    hunting, often, counted = _counts(trial, outputs)
    readings = Readings(outputs, followed & ~hunting, np.where(counted, often, 1.0))
    return ReadColumns(followed, measured, often, readings)


def _counts(trial: Trial, outputs: tuple[str, ...]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return which readings hunt and how many are equal in a row, shape (n, outputs) each, and which are counts."""
    known, found = vars(trial).get(_COUNTED, ((), ()))
    if known != outputs:
        columns = [trial[name] for name in outputs]
        hunting = [hunts(c) for c in columns]
        often = [repeated(c, h) for c, h in zip(columns, hunting, strict=True)]
        found = np.column_stack(hunting), np.column_stack(often), np.array([count_of(c) > 0.0 for c in columns])
        vars(trial)[_COUNTED] = outputs, found
    return found


def measured_outputs(model: Model, trial: Trial) -> tuple[str, ...]:
    """Return the outputs that a trial has, in the order of its rig."""
    return tuple(n for n in model.rig.outputs(trial.kind) if n in trial.columns)


class _Prediction(Block):
    """A block of trials with their measurements."""

    def __init__(self, all_of: Predictor, lanes: list[int]) -> None:
        first = all_of.trials[lanes[0]]
        kind, self.outputs = first.kind, measured_outputs(all_of.model, first)
        super().__init__(all_of, lanes, disturbed(all_of.model, kind, all_of.processes), self.outputs)
        for name in self.rig.unknowns(kind):
            self._set(self.constants, f"prior.{name}", [all_of.priors[i][name] for i in lanes])
        self.noise_names = [n for n in self.layout.constants if n.startswith(("white.", "std.", "time."))]
        self.seen = np.zeros((self.count, len(self.outputs), self.width), dtype=bool)
        self.measured = np.zeros((self.count, len(self.outputs), self.width))
        self.repeated = np.ones((self.count, len(self.outputs), self.width))
        self.readings: list[Readings] = []
        for lane, trial in enumerate(self.trials):
            read, n = read_columns(self.rig, trial, self.outputs, all_of.correlation_s), len(trial)
            self.seen[:n, :, lane], self.measured[:n, :, lane], self.repeated[:n, :, lane] = read[:3]
            self.readings.append(read.readings)

    def _inputs(self, shift: tuple[int, ...]) -> np.ndarray:
        """Return inputs of all lanes, delayed by whole samples, with measurements and whether there are any."""
        return np.concatenate([super()._inputs(shift), self.measured, self.seen.astype(float), self.repeated], axis=1)

    def run(self, values: Values, noises: EachTrial, unknowns: EachTrial) -> tuple[np.ndarray, np.ndarray]:
        """Run the program of all lanes; see `Program`. Arguments are those of all trials."""
        known = {n: [noises[i][n] for i in self.lanes] for n in self.noise_names}
        return self.run_all(values, unknowns, **known)

    def innovations(
        self, y: np.ndarray, s: np.ndarray, width: int, noises: Sequence[StateSpaceNoise]
    ) -> Iterator[PredictedTrial]:
        """Yield the innovations of each lane at its noise, with sensitivities to `width` columns."""
        k, rows, by_lane = len(self.outputs), _lanes_first(y), -_lanes_first(s)
        for lane, readings in enumerate(self.readings):
            n = len(readings.seen)
            sensitivities = spread(by_lane[lane, :n], self.places, width)
            values = rows[lane, :n, :k] if readings.all_seen else np.where(readings.seen, rows[lane, :n, :k], 0.0)
            white = tuple(noises[lane].white[o] for o in self.outputs)
            ar = tuple(noises[lane].ar.get(o, ()) for o in self.outputs)
            yield PredictedTrial(readings, values, rows[lane, :n, k:], sensitivities, white, ar)

    def predicted(self, y: np.ndarray, noise: StateSpaceNoise) -> Iterator[dict[str, PredictedOutput]]:
        """Yield the predictions of each lane, by output: measurements minus innovations.

        They include the prediction of autoregressive noise from its measured past.
        """
        count = len(self.outputs)
        for lane, trial in enumerate(self.trials):
            n = len(trial)
            predicted, variances = self.measured[:n, :, lane] - y[:n, :count, lane], y[:n, count:, lane]
            each = {o: PredictedOutput(predicted[:, k], variances[:, k]) for k, o in enumerate(self.outputs)}
            for k, o in enumerate(self.outputs):
                if ar := noise.ar.get(o):
                    each[o] = _with_noise_ahead(each[o], y[:n, k, lane], self.seen[:n, k, lane], ar)
            yield each


def _with_noise_ahead(
    predicted: PredictedOutput, missed: np.ndarray, seen: np.ndarray, ar: tuple[float, ...]
) -> PredictedOutput:
    size = np.sqrt(predicted.variances)
    ahead, growth = noise_ahead(missed / size, seen, ar)
    return PredictedOutput(predicted.values + size * ahead, predicted.variances * growth)


def are_news(trial: Trial, correlation_s: float) -> np.ndarray:
    """Return which samples have independent noise, one in each correlation time, shape (n,).

    Where noise is correlated, samples within two correlation times of an end are left out: a smoother has less to
    average there.
    """
    step, k = max(1, round(correlation_s / trial.dt)), np.arange(len(trial))
    inner = 2 * (step - 1)
    return np.asarray((k % step == 0) & (k >= inner) & (k < len(trial) - inner))


def repeated(column: np.ndarray, hunting: np.ndarray | None = None) -> np.ndarray:
    """Return the number of equal values in a row at each sample, shape (n,): 1 where its neighbours differ.

    If fewer than the share `SAME` are equal, they are so by chance, of numbers with few digits, and all are 1. Samples
    that hunt between two counts are together one reading.

    Parameters
    ----------
    hunting
        The result of `hunts` for the column, if known.
    """
    if len(column) - len(begins_of_runs(column)) < SAME * len(column):
        return np.ones(len(column))
    hunting = hunts(column) if hunting is None else hunting
    return np.where(hunting, lengths_of_runs(hunting), lengths_of_runs(column))


def masked(trial: Trial, outputs: Sequence[str], hidden: Sequence[range]) -> Trial:
    """Return the trial with its outputs unmeasured in some ranges of samples."""
    rows = np.zeros(len(trial), dtype=bool)
    for some in hidden:
        rows[some.start : some.stop] = True
    columns = {n: np.where(rows & (n in outputs), np.nan, v) for n, v in trial.columns.items()}
    return derived_trial(trial, columns=columns)
