"""Every trial of a study with the predictions of its nominal and its extended model, and all samples as one table."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fes_pin.data.trial import Trial, derived_trial
from fes_pin.diagnosis.errors_ahead import AheadErrors
from fes_pin.diagnosis.result import Diagnosis
from fes_pin.identify.ahead import over_horizon
from fes_pin.identify.likelihood_fit import LikelihoodFit
from fes_pin.identify.per_trial import predictions
from fes_pin.infer.held_out import percent_of_spread, within
from fes_pin.infer.levels import RUNAWAY
from fes_pin.infer.noise import NoiseModel


@dataclass(frozen=True)
class Replay:
    """One trial as measured, and as both models predict it from its inputs.

    Attributes
    ----------
    measured, nominal, extended
        Trials of the same time and inputs; `nominal` and `extended` hold the predicted outputs.
    outputs
        The measured columns that both models predict.
    nominal_error, extended_error
        E of eq. (2) of this trial alone, percent; all channels in units of their noise.
    has_cause
        Whether the extended model is shown: it has named causes.
    """

    measured: Trial
    nominal: Trial
    extended: Trial
    outputs: tuple[str, ...]
    nominal_error: float
    extended_error: float
    has_cause: bool

    @property
    def models(self) -> dict[str, Trial]:
        """The predictions that are shown, by the name of their model."""
        return {**({"extended": self.extended} if self.has_cause else {}), "nominal": self.nominal}

    @property
    def errors(self) -> tuple[float, ...]:
        """Errors E of the nominal and, if it is shown, of the extended model."""
        return (self.nominal_error, self.extended_error)[: 1 + self.has_cause]

    def residuals(self, name: str) -> dict[str, np.ndarray]:
        """Return the residuals of an output by model, each of shape (n,)."""
        return {of: self.measured.residual(simulated, name) for of, simulated in self.models.items()}


def replayed_trials(diagnosis: Diagnosis) -> tuple[Replay, ...]:
    """Return every trial of the study as both models of a diagnosis predict it, in the order of the study."""
    trials, noise = diagnosis.study.trials, diagnosis.extended.noise
    nominal = _predicted(diagnosis.nominal, trials, noise, diagnosis.over_horizon)
    extended = _predicted(diagnosis.extended, trials, noise, diagnosis.over_horizon)
    made = []
    for trial, before, after in zip(trials, nominal, extended, strict=True):
        outputs = tuple(n for n in diagnosis.model.rig.outputs(trial.kind) if n in trial)
        one, other = (percent_of_spread(*squares_of(trial, m, outputs, noise)) for m in (before, after))
        made.append(Replay(trial, before, after, outputs, one, other, bool(diagnosis.causes)))
    return tuple(made)


def _predicted(
    fitted: LikelihoodFit, trials: Sequence[Trial], noise: NoiseModel, ahead: AheadErrors | None
) -> list[Trial]:
    """Return trials as predicted from their inputs; for a rig in closed loop, over the horizon.

    A free simulation of such a rig integrates its errors, or falls: it says little or nothing about the model. One that
    diverges is limited; see `levels.RUNAWAY`.
    """
    model, out = fitted.model, []
    if ahead is not None:
        moves = [over_horizon(model, t, fitted.noise, ahead.horizon_s) for t in trials]
        return [derived_trial(t, columns={**t.columns, **m}) for t, m in zip(trials, moves, strict=True)]
    for trial in trials:
        columns, readings = dict(trial.columns), predictions(model, trial, noise, fitted.unknowns_of(trial))
        for k, name in enumerate(model.rig.outputs(trial.kind)):
            most = RUNAWAY * float(np.abs(trial[name]).max()) if name in trial else np.inf
            columns[name] = within(readings[:, k], most if most > 0.0 else 1.0)
        out.append(derived_trial(trial, columns=columns))
    return out


def squares_of(measured: Trial, simulated: Trial, outputs: Sequence[str], noise: NoiseModel) -> tuple[float, float]:
    """Return the squared error of a trial, and the measurement's squares about its mean, in units of the noise."""
    squares = spread = 0.0
    for name in outputs:
        variance = noise[name].std ** 2 if name in noise else 1.0
        squares += float(np.sum(measured.residual(simulated, name) ** 2)) / variance
        spread += float(np.sum((measured[name] - measured[name].mean()) ** 2)) / variance
    return squares, spread


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
    for one in replayed_trials(diagnosis):
        columns = {"time_s": one.measured.time, **one.measured.columns}
        for name in diagnosis.model.rig.outputs(one.measured.kind):
            columns[f"{name}_nominal"], columns[f"{name}_extended"] = one.nominal[name], one.extended[name]
            if name in one.measured:
                columns[f"{name}_residual"] = one.measured.residual(one.extended, name)
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
