"""What a model is simulated on or fitted to: checked once, where a public verb is entered."""

from __future__ import annotations

from collections.abc import Iterable

from fes_pin.data.checks import check_columns, check_values, checked_kind
from fes_pin.data.errors import InputError
from fes_pin.data.schema import check_conditions
from fes_pin.data.trial import Trial
from fes_pin.models.model import Model


def accepted_trials(model: Model, trials: Trial | Iterable[Trial], inputs_only: bool = True) -> tuple[Trial, ...]:
    """The trials, if the model's rig can have them; see `fes_pin.data.checks`.

    Parameters
    ----------
    trials
        One, or any number but none.
    inputs_only
        Do not require what is measured.

    Raises
    ------
    InputError
        No model, no trials; a kind, a column or a condition that the rig does not have, or lacks; values in another
        unit.
    """
    if not isinstance(model, Model):
        raise InputError(f"expected a Model, found a {type(model).__name__}", column="model")
    given = (trials,) if isinstance(trials, Trial) else tuple(trials) if isinstance(trials, Iterable) else (trials,)
    if not given:
        raise InputError("expected at least one trial, found none", column="trials")
    schema, also = model.rig.described(), {n for e in model.effects for n in e.inputs}
    for trial in given:
        if not isinstance(trial, Trial):
            raise InputError(f"expected trials, found a {type(trial).__name__}", column="trials")

        def fault(key: str, message: str, trial: Trial = trial) -> InputError:
            return trial.error(message, key)

        kind = checked_kind(schema, trial.kind, fault)
        check_columns([n for n in trial.columns if n not in also], schema, kind, inputs_only, trial.error)
        check_values(trial.columns, schema, trial.error)
        check_conditions(schema, kind, trial.conditions, fault)
        model.rig.check_prediction(trial)
    return given
