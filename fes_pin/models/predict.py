"""Prediction of a trial from its inputs and conditions alone."""

import numpy as np

from fes_pin.data.errors import InputError
from fes_pin.data.trial import Trial, derived_trial
from fes_pin.models.model import Model
from fes_pin.models.simulate import simulate


def predict(model: Model, trial: Trial) -> Trial:
    """Predict a trial from its inputs: return its time and the predicted output columns.

    The initial state of a joint is that at which the model, its sensor included, reads the first samples of `position`
    and `velocity`; or it is given by the conditions `position0` and `velocity0`, which are not readings. A missing
    velocity is estimated from the first 0.2 s. Outputs are not used otherwise.

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
