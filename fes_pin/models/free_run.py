"""One-step predictions of measured trials without process noise: a free simulation."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fes_pin.data.trial import Trial
from fes_pin.models.model import Model
from fes_pin.models.predictions import PredictedTrial
from fes_pin.models.predictor import StateSpaceNoise, measured_outputs, read_columns
from fes_pin.models.simulate import EachTrial, Simulator, Values


class FreeRun:
    """A free simulation of measured trials for any values of a model's parameters.

    It gives the same as a `Predictor` without process noise, in which readings do not correct the state.

    Parameters
    ----------
    model
        Its structure and constants are used; the values of its parameters are given to `run`.
    trials
        Measured trials; samples that were not measured are NaN.
    columns
        Parameters, and unknowns of trials and effects, of the sensitivities.
    correlation_s
        Correlation time of measurement noise, s; see `StateSpaceNoise`.
    """

    def __init__(
        self, model: Model, trials: Sequence[Trial], columns: tuple[str, ...], correlation_s: float = 0.0
    ) -> None:
        self.trials = tuple(trials)
        self._simulator = Simulator(model, trials, columns)
        outputs = [measured_outputs(model, t) for t in trials]
        self._places = [[model.rig.outputs(t.kind).index(n) for n in o] for t, o in zip(trials, outputs, strict=True)]
        self._read = [read_columns(model.rig, t, o, correlation_s) for t, o in zip(trials, outputs, strict=True)]

    def run(
        self, values: Values, noise: StateSpaceNoise | Sequence[StateSpaceNoise], unknowns: EachTrial
    ) -> list[PredictedTrial]:
        """Simulate every trial; see `Predictor.run`."""
        each = [noise] * len(self.trials) if isinstance(noise, StateSpaceNoise) else noise
        run, out = self._simulator.run(values, unknowns), []
        for one, places, read, own in zip(run, self._places, self._read, each, strict=True):
            outputs, seen = read.readings.outputs, read.readings.seen
            white = tuple(own.white[n] for n in outputs)
            missed = np.where(seen, read.measured - one.readings[:, places], 0.0)
            variances, ar = read.repeated * np.square(white), tuple(own.ar.get(n, ()) for n in outputs)
            out.append(PredictedTrial(read.readings, missed, variances, -one.sensitivities[:, places], white, ar))
        return out


def with_noise(one: PredictedTrial, noise: StateSpaceNoise) -> PredictedTrial:
    """Return a simulated trial with another measurement noise."""
    white, ar = tuple(noise.white[n] for n in one.outputs), tuple(noise.ar.get(n, ()) for n in one.outputs)
    return replace(one, variances=one.variances * np.square(np.divide(white, one.white)), white=white, ar=ar)
