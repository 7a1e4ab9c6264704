"""Efforts that were written down after they acted, as loggers do that ask a controller less often than it works."""

from dataclasses import replace

import numpy as np
import pytest
from driven_rigs.draw import draw

from fes_pin.data.study import read_study
from fes_pin.diagnose.diagnosis import diagnose_joint
from fes_pin.models.effects import SensorLag

ROWS = (2, 3, 4)
"""Samples of the controller between two rows of the log, at random."""
GRID = 0.005
"""Sampling to which rows are brought, s: positions on a line between them, the effort of the last."""


def logged(trial, rng):
    rows = np.cumsum(rng.choice(ROWS, size=len(trial)))
    at = rows[rows < len(trial)]
    time = np.arange(trial.time[at[0]], trial.time[at[-1]], GRID)
    last = at[np.searchsorted(trial.time[at], time, side="right") - 1]
    position = np.interp(time, trial.time[at], trial["position"][at])
    return replace(trial, columns={"effort": trial["effort"][last], "position": position}, time=time - time[0])


@pytest.mark.parametrize("number", range(2))
def test_a_late_record_of_the_effort_is_a_reading_that_is_early(number, tmp_path):
    """Before, a frame that swings was named, and something was left."""
    drawn = draw((), 0.3, 1151000 + number, tmp_path, recorded=True)
    study, rng = read_study(drawn.study), np.random.default_rng(number)
    diagnosis = diagnose_joint(replace(study, trials=tuple(logged(t, rng) for t in study.trials)))
    (cause,) = diagnosis.causes
    assert (cause.name, cause.equivalents) == ("sensor_lag", ()), str(diagnosis)
    assert -0.008 < cause.parameters["lag_s"].value < -0.001
    fitted = diagnosis.extended
    assert abs(fitted.values["inertia_scale"] - 1.0) < 4.0 * fitted.std("inertia_scale")


def test_nothing_is_early_where_no_effort_is_recorded():
    time = np.linspace(0.0, 1.0, 50)
    columns = {"time": time, "position": np.sin(time), "reading": np.sin(time)}
    assert SensorLag().limits(columns) == {"lag_s": (0.0, np.inf)}
    assert SensorLag().limits({**columns, "effort": time}) == {}
