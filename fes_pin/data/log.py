"""How a log differs from what acted and from what was read: how late, with what noise, and smoothed by what it is."""

from dataclasses import dataclass

import numpy as np

from fes_pin.data.answered import ControllerAnswer, answer_of
from fes_pin.data.trial import Trial, derived_trial

EFFORT = "effort"
"""What a controller's log may write down after it acted, or with noise."""


@dataclass(frozen=True)
class Log:
    """What the log of a rig does to all of its trials.

    Attributes
    ----------
    effort_late_s
        How long after it acted the effort is written down, s; negative of one that acts later within its row.
    effort_over_s
        For how long after each row what a controller asked for at times that no row holds acted, s: of the effort that
        acts in a row, its mean over so long, by a cubic spline through all rows. 0 of an effort that is held.
    effort_noise
        Standard deviation of the white noise that the effort is recorded with, in its unit.
    low_pass_hz
        Cut-off of the low pass, without delay, that readings go through before they are stored, Hz; None of none.
    """

    effort_late_s: float = 0.0
    effort_over_s: float = 0.0
    effort_noise: float = 0.0
    low_pass_hz: float | None = None

    def applied(self, trial: Trial) -> Trial:
        """The trial with its effort as and when it acted, and what is simulated of it low-passed as readings are."""
        if EFFORT in trial and self.effort_noise:
            trial = quiet(trial, answered(trial), self.effort_noise)
        if EFFORT in trial and self.effort_late_s:
            trial = advanced(trial, EFFORT, self.effort_late_s)
        if EFFORT in trial and self.effort_over_s:
            trial = followed(trial, EFFORT, self.effort_over_s)
        return derived_trial(trial, low_pass_hz=self.low_pass_hz) if self.low_pass_hz else trial


def answered(trial: Trial) -> ControllerAnswer:
    """What the trial's effort answers to all else that was recorded of it."""
    return answer_of(trial[EFFORT], [values for n, values in trial.columns.items() if n != EFFORT])


def quiet(trial: Trial, answer: ControllerAnswer, noise: float) -> Trial:
    """The trial with the estimate of the effort that acted; see `ControllerAnswer.quieted`."""
    return trial.with_columns(**{EFFORT: answer.quieted(trial[EFFORT], noise)})


def advanced(trial: Trial, column: str, by_s: float) -> Trial:
    """The trial with a column that is held between samples as it is `by_s` later, averaged over each sample.

    With u(t) the held column: u'_k = 1/dt integral of u(t + by_s) from t_k to t_(k+1). The last sample goes on, and the
    first was there before.
    """
    time, dt, held = trial.time - trial.time[0], trial.dt, trial[column]
    ends = np.append(time, time[-1] + dt)
    at = ends + by_s
    whole = np.interp(at, ends, np.concatenate([[0.0], np.cumsum(held * dt)]))
    whole += held[-1] * np.maximum(at - ends[-1], 0.0) + held[0] * np.minimum(at, 0.0)
    return trial.with_columns(**{column: np.diff(whole) / dt})


def followed(trial: Trial, column: str, over_s: float) -> Trial:
    """The trial with a column as it is on average over so long from each sample on, by a cubic spline through all.

    After the last sample it is as it was there.
    """
    from scipy.interpolate import CubicSpline  # noqa: PLC0415 - for rigs that a controller drives

    time, values = trial.time - trial.time[0], trial[column]
    ends = np.append(time, [time[-1] + trial.dt, time[-1] + 2.0 * trial.dt])
    total = CubicSpline(ends, np.append(values, [values[-1]] * 2)).antiderivative()
    return trial.with_columns(**{column: (total(time + over_s) - total(time)) / over_s})
