"""A trial as measured and as several models predict it, with the error of each."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fes_pin.data.trial import Trial, derived_trial
from fes_pin.identify.ahead import over_horizon
from fes_pin.identify.per_trial import predictions
from fes_pin.infer.held_out import percent_of_spread, within
from fes_pin.infer.levels import RUNAWAY
from fes_pin.infer.noise import NoiseModel
from fes_pin.infer.problem import Unknowns
from fes_pin.models.model import Model
from fes_pin.models.predictor import StateSpaceNoise


@dataclass(frozen=True)
class Replay:
    """One trial as measured, and as models predict it from its inputs.

    Attributes
    ----------
    measured
        The trial.
    models
        By name of the model a trial of the same time and inputs, with the predicted outputs.
    noise
        Of each output: `residual` of a figure is compared with it, and channels of an error are in its units.
    outputs
        The measured columns that the models predict.
    first
        The first sample that counts in errors.
    """

    measured: Trial
    models: Mapping[str, Trial]
    noise: NoiseModel
    outputs: tuple[str, ...]
    first: int = 0

    @property
    def errors(self) -> dict[str, float]:
        """E of eq. (2) of this trial alone by model, percent; all channels in units of their noise."""
        return {n: percent_of_spread(*one) for n, one in self.squares.items()}

    @property
    def squares(self) -> dict[str, tuple[float, float]]:
        """Squared errors by model, and the measurement's squares about its mean; see `squares_of`."""
        given = self.outputs, self.noise, self.first
        return {n: squares_of(self.measured, simulated, *given) for n, simulated in self.models.items()}

    def residuals(self, name: str) -> dict[str, np.ndarray]:
        """Return the residuals of an output by model, each of shape (n,)."""
        return {of: self.measured.residual(simulated, name) for of, simulated in self.models.items()}


def replayed(
    model: Model, trial: Trial, noise: NoiseModel, own: StateSpaceNoise, horizon_s: float | None, known: Unknowns | None
) -> Trial:
    """Return a trial as a model predicts it from its inputs; for a rig in closed loop, over a horizon.

    A free simulation of such a rig integrates its errors, or falls: it says little or nothing about the model. One that
    diverges is limited; see `levels.RUNAWAY`.

    Parameters
    ----------
    noise
        Of each output, by which channels are weighted.
    own
        Process and measurement noise of the model, for a rig in closed loop.
    horizon_s
        The horizon, s; None for a free simulation.
    known
        The unknowns of the trial where it was fitted; None for none.
    """
    if horizon_s is not None:
        return derived_trial(trial, columns={**trial.columns, **over_horizon(model, trial, own, horizon_s)})
    columns, readings = dict(trial.columns), predictions(model, trial, noise, known)
    for k, name in enumerate(model.rig.outputs(trial.kind)):
        most = RUNAWAY * float(np.abs(trial[name]).max()) if name in trial else np.inf
        columns[name] = within(readings[:, k], most if most > 0.0 else 1.0)
    return derived_trial(trial, columns=columns)


def squares_of(
    measured: Trial, simulated: Trial, outputs: Sequence[str], noise: NoiseModel, first: int = 0
) -> tuple[float, float]:
    """Return the squared error of a trial, and the measurement's squares about its mean, in units of the noise.

    Samples count from the number `first` on.
    """
    squares = spread = 0.0
    for name in outputs:
        variance = noise[name].std ** 2 if name in noise else 1.0
        squares += float(np.sum(measured.residual(simulated, name)[first:] ** 2)) / variance
        spread += float(np.sum((measured[name] - measured[name].mean())[first:] ** 2)) / variance
    return squares, spread
