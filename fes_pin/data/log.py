"""How a log differs from what acted and from what was read: when it was written down, and what it was smoothed by."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fes_pin.data.trial import Trial

LATE_COLUMN = "effort"
"""What a controller's log may write down after it acted."""


@dataclass(frozen=True)
class Log:
    """What the log of a rig does to all of its trials.

    Attributes
    ----------
    effort_late_s
        How long after it acted the effort is written down, s.
    low_pass_hz
        Cut-off of the low pass, without delay, that readings go through before they are stored, Hz; None of none.
    """

    effort_late_s: float = 0.0
    low_pass_hz: float | None = None

    def applied(self, trial: Trial) -> Trial:
        """The trial with its effort where it acted, and with what is simulated of it low-passed as its readings are."""
        late = self.effort_late_s and LATE_COLUMN in trial
        timed = advanced(trial, LATE_COLUMN, self.effort_late_s) if late else trial
        return replace(timed, low_pass_hz=self.low_pass_hz) if self.low_pass_hz else timed


def advanced(trial: Trial, column: str, by_s: float) -> Trial:
    """The trial with a column that is held between samples as it is `by_s` later, averaged over each sample.

    With u(t) the held column: u'_k = 1/dt integral of u(t + by_s) from t_k to t_(k+1). The last sample goes on.
    """
    time, dt = trial.time - trial.time[0], trial.dt
    whole = np.concatenate([[0.0], np.cumsum(trial[column] * dt)])
    ends = np.append(time, time[-1] + dt)
    beyond = np.interp(ends + by_s, ends, whole) + trial[column][-1] * np.maximum(ends + by_s - ends[-1], 0.0)
    return trial.with_columns(**{column: np.diff(beyond) / dt})
