"""How a log differs from what acted and from what was read: how late, with what noise, and smoothed by what it is."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fes_pin.data.answered import ControllerAnswer, answer_of
from fes_pin.data.trial import Trial

EFFORT = "effort"
"""What a controller's log may write down after it acted, or with noise."""


@dataclass(frozen=True)
class Log:
    """What the log of a rig does to all of its trials.

    Attributes
    ----------
    effort_late_s
        How long after it acted the effort is written down, s; negative of one that acts later within its row.
    effort_noise
        Standard deviation of the white noise that the effort is recorded with, in its unit.
    low_pass_hz
        Cut-off of the low pass, without delay, that readings go through before they are stored, Hz; None of none.
    """

    effort_late_s: float = 0.0
    effort_noise: float = 0.0
    low_pass_hz: float | None = None

    def applied(self, trial: Trial) -> Trial:
        """The trial with its effort as and when it acted, and what is simulated of it low-passed as readings are."""
        if EFFORT in trial and self.effort_noise:
            trial = quiet(trial, answered(trial), self.effort_noise)
        if EFFORT in trial and self.effort_late_s:
            trial = advanced(trial, EFFORT, self.effort_late_s)
        return replace(trial, low_pass_hz=self.low_pass_hz) if self.low_pass_hz else trial


def answered(trial: Trial) -> ControllerAnswer:
    """What the trial's effort answers to all else that was recorded of it."""
    return answer_of(trial[EFFORT], [values for n, values in trial.columns.items() if n != EFFORT])


def quiet(trial: Trial, answer: ControllerAnswer, noise: float) -> Trial:
    """The trial without so much noise of its effort as its answer tells; see `ControllerAnswer.quieted`."""
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
