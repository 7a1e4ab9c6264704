"""Prediction of a trial from its inputs and conditions alone."""

from __future__ import annotations

import numpy as np

from fes_pin.data.errors import InputError
from fes_pin.data.trial import Trial, derived_trial
from fes_pin.models.model import Model
from fes_pin.models.simulate import simulate


def predict(model: Model, trial: Trial) -> Trial:
    """What the model predicts for a trial: its time and the predicted output columns.

    A joint begins where the model, its sensor included, reads the first sample of `position`, at the first sample of
    `velocity`; or at the conditions `position0` and `velocity0`, which are the joint's own, not readings. A velocity
    that is missing is estimated from the first 0.2 s. Nothing else of the outputs is used.

    Raises
    ------
    InputError
        As `simulate`, or if the prediction does not stay finite.
    """
    simulated = simulate(model, trial)
    outputs = {n: simulated[n] for n in model.rig.outputs(trial.kind)}
    for name, values in outputs.items():
        if not np.isfinite(values).all():
            row = int(np.argmin(np.isfinite(values)))
            raise InputError(f"the prediction of {name} is not finite from sample {row} on: the model is unstable here")
    return derived_trial(trial, columns=outputs)
