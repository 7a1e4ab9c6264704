"""Every trial of a study with the predictions of its nominal and its extended model, and all samples as one table."""

from collections.abc import Mapping, Sequence

import numpy as np

from fes_pin.data.trial import Trial
from fes_pin.diagnosis.result import Diagnosis
from fes_pin.identify.ahead import first_ahead
from fes_pin.identify.replay import Replay, replayed


def replayed_trials(diagnosis: Diagnosis, both: bool = False) -> tuple[Replay, ...]:
    """Return every trial of the study, in its order, as the models "nominal" and "extended" predict it.

    The extended model is left out where no cause is named, unless `both` are asked for.
    """
    extended = {"extended": diagnosis.extended} if both or diagnosis.causes else {}
    fits = {"nominal": diagnosis.nominal, **extended}
    noise, ahead, rig = diagnosis.extended.noise, diagnosis.over_horizon, diagnosis.model.rig
    horizon_s = None if ahead is None else ahead.horizon_s
    made = []
    for trial in diagnosis.study.trials:
        models = {n: replayed(f.model, trial, noise, f.noise, horizon_s, f.unknowns_of(trial)) for n, f in fits.items()}
        outputs = tuple(n for n in rig.outputs(trial.kind) if n in trial)
        made.append(Replay(trial, models, noise, outputs, first_ahead(diagnosis.model, trial, horizon_s)))
    return tuple(made)


def trajectories(diagnosis: Diagnosis) -> tuple[list[str], dict[str, np.ndarray]]:
    """Return measured, predicted and residual samples of all trials.

    Returns
    -------
    trials : list of str
        The trial of each row.
    columns : dict of ndarray, shape (n,)
        `time_s`; the inputs; for each output its reading, `<output>_nominal`, `<output>_extended`, and
        `<output>_residual`: the reading minus the extended model. NaN where a trial has no such column. For a rig in
        closed loop, predictions are those over the horizon of the diagnosis.
    """
    rows: list[dict[str, np.ndarray]] = []
    for one in replayed_trials(diagnosis, both=True):
        columns, (nominal, extended) = {"time_s": one.measured.time, **one.measured.columns}, one.models.values()
        for name in diagnosis.model.rig.outputs(one.measured.kind):
            columns[f"{name}_nominal"], columns[f"{name}_extended"] = nominal[name], extended[name]
            if name in one.measured:
                columns[f"{name}_residual"] = one.measured.residual(extended, name)
        rows.append(columns)
    return trial_table(diagnosis.study.trials, rows)


def trial_table(
    trials: Sequence[Trial], rows: Sequence[Mapping[str, np.ndarray]]
) -> tuple[list[str], dict[str, np.ndarray]]:
    """Return several trials as one long table: the trial of each row, and columns, NaN where a trial has none."""
    names = dict.fromkeys(n for columns in rows for n in columns)
    absent = [np.full(len(columns["time_s"]), np.nan) for columns in rows]
    words = [trial.name for trial, columns in zip(trials, rows, strict=True) for _ in columns["time_s"]]
    return words, {n: np.concatenate([c.get(n, a) for c, a in zip(rows, absent, strict=True)]) for n in names}
