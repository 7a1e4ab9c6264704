"""Checks of the trials on which a model is simulated or fitted, made once where a public function is entered."""

import math
from collections.abc import Iterable

from fes_pin.data.channels import CHANNELS, EMG, EMG_KEYS, ENVELOPE
from fes_pin.data.errors import InputError
from fes_pin.data.numbers import instance
from fes_pin.data.trial import Trial, check_trial
from fes_pin.models.model import Model


def _check_channel(model: Model, trial: Trial) -> None:
    """Require that a trial's stimulus is the one that the rig's recruitment is of, and no other."""
    if EMG in trial:
        raise trial.error(f"expected {ENVELOPE}: a study with {EMG_KEYS[0]} makes it of {EMG}", EMG)
    found = [n for n in CHANNELS if n in trial and trial[n].any()]
    known = model.rig.channel
    if odd := [n for n in found if known is None or n != known.column]:
        low, high = CHANNELS[odd[0]].ends
        if known is None:
            raise trial.error(f"missing; trials with {odd[0]} need {low} and {high} of the rig", f"constants.{low}")
        raise trial.error(f"expected {known.column}, of which the model has the threshold, found {odd[0]}", odd[0])


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
        _check_channel(model, trial)
        model.rig.check_prediction(trial)
    return given
