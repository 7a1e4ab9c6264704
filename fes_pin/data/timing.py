"""When what drove a rig was written down."""

from __future__ import annotations

import numpy as np

from fes_pin.data.trial import Trial


def advanced(trial: Trial, column: str, by_s: float) -> Trial:
    """The trial with a column that is held between samples as it is `by_s` later, averaged over each sample.

    With u(t) the held column: u'_k = 1/dt integral of u(t + by_s) from t_k to t_(k+1). The last sample goes on.
    """
    time, dt = trial.time - trial.time[0], trial.dt
    whole = np.concatenate([[0.0], np.cumsum(trial[column] * dt)])
    ends = np.append(time, time[-1] + dt)
    beyond = np.interp(ends + by_s, ends, whole) + trial[column][-1] * np.maximum(ends + by_s - ends[-1], 0.0)
    return trial.with_columns(**{column: np.diff(beyond) / dt})
