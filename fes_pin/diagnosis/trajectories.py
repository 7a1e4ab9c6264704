"""Every sample of a study with the predictions of both models, as one long table for other programs."""

from collections.abc import Mapping, Sequence

import numpy as np

from fes_pin.data.trial import Trial
from fes_pin.diagnosis.replay import replayed_trials
from fes_pin.diagnosis.result import Diagnosis


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
    trials: list[Trial] = []
    rows: list[dict[str, np.ndarray]] = []
    for one in replayed_trials(diagnosis):
        columns = {"time_s": one.measured.time, **one.measured.columns}
        for name in diagnosis.model.rig.outputs(one.measured.kind):
            columns[f"{name}_nominal"], columns[f"{name}_extended"] = one.nominal[name], one.extended[name]
            if name in one.measured:
                columns[f"{name}_residual"] = one.measured.residual(one.extended, name)
        trials.append(one.measured)
        rows.append(columns)
    return trial_table(trials, rows)


def trial_table(
    trials: Sequence[Trial], rows: Sequence[Mapping[str, np.ndarray]]
) -> tuple[list[str], dict[str, np.ndarray]]:
    """Return several trials as one long table: the trial of each row, and columns, NaN where a trial has none."""
    names = dict.fromkeys(n for columns in rows for n in columns)
    absent = [np.full(len(columns["time_s"]), np.nan) for columns in rows]
    words = [trial.name for trial, columns in zip(trials, rows, strict=True) for _ in columns["time_s"]]
    return words, {n: np.concatenate([c.get(n, a) for c, a in zip(rows, absent, strict=True)]) for n in names}
