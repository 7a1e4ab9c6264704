"""Prediction of a trial from its inputs and conditions alone."""

from functools import cache

import numpy as np

from fes_pin.data.errors import InputError
from fes_pin.data.trial import Trial, derived_trial
from fes_pin.models.accepted import accepted_trials
from fes_pin.models.model import Model
from fes_pin.models.plausibility import warn_of_odd_numbers
from fes_pin.models.simulate import simulated_trial


def predict(model: Model, trial: Trial) -> Trial:
    """Predict a trial from its inputs: return its time and the predicted output columns.

    The initial state of a joint is that at which the model, its sensor included, reads the first samples of `position`
    and `velocity`; or it is given by the conditions `position0` and `velocity0`, which are not readings. A missing
    velocity is estimated from the first 0.2 s. Outputs are not used otherwise.

    Raises
    ------
    InputError
        As `simulate`, or if the prediction does not stay finite.

    Warns
    -----
    InputWarning
        As `simulate`.
    """
    accepted, simulated = accepted_trials(model, trial), cache(simulated_trial)
    warn_of_odd_numbers(model, accepted, simulated)
    return _outputs(model, simulated(model, *accepted))


def predicted_trial(model: Model, trial: Trial) -> Trial:
    """Return the result of `predict` without its warnings."""
    return _outputs(model, simulated_trial(model, *accepted_trials(model, trial)))


def _outputs(model: Model, simulated: Trial) -> Trial:
    outputs = {n: simulated[n] for n in model.rig.outputs(simulated.kind)}
    for name, values in outputs.items():
        if not np.isfinite(values).all():
            row = int(np.argmin(np.isfinite(values)))
            raise InputError(f"the prediction of {name} is not finite from sample {row} on: the model is unstable here")
    return derived_trial(simulated, columns=outputs)
