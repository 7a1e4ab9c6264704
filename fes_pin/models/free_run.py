"""Free simulations of a model along measured trials, as predictions without process noise."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from fes_pin.data.trial import Trial
from fes_pin.infer.noise import NoiseModel, thin, thinning
from fes_pin.models.model import Model
from fes_pin.models.predictions import PredictedTrial, Readings
from fes_pin.models.predictor import StateSpaceNoise, measured_outputs, read_columns
from fes_pin.models.simulate import EachTrial, Simulated, Simulator, Values


class FreeRun:
    """A free simulation of measured trials for any values of a model's parameters.

    It gives the same as a `Predictor` without process noise, in which readings do not correct the state.

    Parameters
    ----------
    model
        Its structure and constants are used; the values of its parameters are given to `run`.
    trials
        MeasuredOutputs trials; samples that were not measured are NaN.
    columns
        Parameters, and unknowns of trials and effects, of the sensitivities.
    noise
        Measurement noise by output column, for its time step or its correlation time; columns without noise are left
        out.
    """

    def __init__(self, model: Model, trials: Sequence[Trial], columns: tuple[str, ...], noise: NoiseModel) -> None:
        self._simulator = Simulator(model, trials, columns)
        self._read = [MeasuredOutputs(model, t, noise) for t in trials]

    def run(
        self, values: Values, noise: NoiseModel | Sequence[NoiseModel], unknowns: EachTrial
    ) -> list[PredictedTrial]:
        """Simulate every trial; see `Predictor.run`."""
        each = [noise] * len(self._read) if isinstance(noise, Mapping) else noise
        run = self._simulator.run(values, unknowns)
        return [read.predicted(one, own) for read, one, own in zip(self._read, run, each, strict=True)]


class MeasuredOutputs:
    """The measured outputs of a trial that have noise, averaged to its time step."""

    def __init__(self, model: Model, trial: Trial, noise: NoiseModel) -> None:
        outputs = tuple(n for n in measured_outputs(model, trial) if n in noise)
        correlation_s = noise.correlation_s if isinstance(noise, StateSpaceNoise) else None
        read = read_columns(model.rig, trial, outputs, correlation_s)
        self.places = [model.rig.outputs(trial.kind).index(n) for n in outputs]
        self.measured, self.seen = read.measured, read.readings.seen
        self.count = thinning(trial.dt, max((noise[n].step_s for n in outputs), default=0.0))
        self.repeated, self.readings = thin(read.repeated, self.count), read.readings
        if self.count > 1:
            seen = thin(self.seen.astype(float), self.count) == 1.0
            self.readings = Readings(outputs, seen, thin(read.readings.repeats, self.count))

    def predicted(self, one: Simulated, noise: NoiseModel) -> PredictedTrial:
        """Return the trial as simulated, at a noise."""
        own = [noise[n] for n in self.readings.outputs]
        white, ar = tuple(n.innovation_std for n in own), tuple(n.ar for n in own)
        first = self.places == list(range(len(self.places)))
        at = slice(len(self.places)) if first else self.places  # a slice needs no copy
        missed = thin(np.where(self.seen, self.measured - one.readings[:, at], 0.0), self.count)
        moved = thin(one.sensitivities[:, at], self.count)
        return PredictedTrial(self.readings, missed, self.repeated * np.square(white), moved, white, ar)


def with_noise(one: PredictedTrial, noise: StateSpaceNoise) -> PredictedTrial:
    """Return a simulated trial with another measurement noise."""
    white, ar = tuple(noise.white[n] for n in one.outputs), tuple(noise.ar.get(n, ()) for n in one.outputs)
    return replace(one, variances=one.variances * np.square(np.divide(white, one.white)), white=white, ar=ar)
