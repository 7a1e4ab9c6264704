"""Checks of the trials on which a model is simulated or fitted, made once where a public function is entered."""

import math
from collections.abc import Iterable

from fes_pin.data.errors import InputError
from fes_pin.data.numbers import instance
from fes_pin.data.trial import Trial, check_trial
from fes_pin.models.model import Model


def accepted_trials(model: Model, trials: Trial | Iterable[Trial], inputs_only: bool = True) -> tuple[Trial, ...]:
    """Return the trials, if the model's rig can have them; see `check_trial`.

    Parameters
    ----------
    trials
        One trial, or several.
    inputs_only
        Whether outputs may be missing.

    Raises
    ------
    InputError
        If there is no model or no trial; for a kind, column or condition that the rig does not have, or that is
        missing; for values in another unit.
    """
    instance(model, Model, "model")
    given = (trials,) if isinstance(trials, Trial) else tuple(trials) if isinstance(trials, Iterable) else (trials,)
    if not given:
        raise InputError("expected at least one trial, found none", column="trials")
    schema, also = model.rig.described(), {n for e in model.effects for n in e.inputs}
    threshold_us = float(model.rig.constants.get("threshold_us", math.inf))
    for trial in given:
        if not isinstance(trial, Trial):
            raise InputError(f"expected trials, found a {type(trial).__name__}", column="trials")
        check_trial(trial, schema, inputs_only=inputs_only, threshold_us=threshold_us, also=also)
        if "pulse_width_us" in trial and "threshold_us" not in model.rig.constants:
            message = "missing; trials with pulse_width_us need threshold_us and saturation_us of the rig"
            raise trial.error(message, "constants.threshold_us")
        model.rig.check_prediction(trial)
    return given
