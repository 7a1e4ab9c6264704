"""Efforts that were written down after they acted, as loggers do that ask a controller less often than it works."""

import json
from dataclasses import replace

import numpy as np
import pytest
from driven_rigs.draw import draw

from fes_pin.cli.main import predict
from fes_pin.data.log import Log, advanced
from fes_pin.data.recorded.text import read_csv
from fes_pin.data.study import read_study
from fes_pin.data.trial import Trial
from fes_pin.data.trial_files import trial_csv
from fes_pin.diagnosis.diagnosis import diagnose_joint
from fes_pin.identify.ahead import predict_ahead
from fes_pin.identify.effort_timing import lateness_of
from fes_pin.identify.likelihood_fit import maximum_from
from fes_pin.identify.stored import load_log, log_table
from fes_pin.models.nominal import nominal_model
from fes_pin.search.likelihood_fits import LikelihoodFits

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


@pytest.mark.parametrize("causes", [(), (), ("coulomb_friction",)], ids=["nothing", "nothing else", "friction"])
def test_an_effort_that_was_written_down_late_is_moved(causes, request, tmp_path):
    """Before, a frame that swings was named, and something was left; the inertia was wrong by up to ten deviations."""
    number = next(iter(request.node.callspec.indices.values()))
    drawn = draw(causes, 0.3, 1151000 + number, tmp_path, recorded=True)
    study, rng = read_study(drawn.study), np.random.default_rng(number)
    recorded = tuple(logged(t, rng) for t in study.trials)
    diagnosis = diagnose_joint(replace(study, trials=recorded))
    assert tuple(c.name for c in diagnosis.causes) == causes, str(diagnosis)
    assert any("ms after it acted, and was moved" in said or "between rows" in said for said in diagnosis.warnings)
    assert any("distinguish" in said for said in diagnosis.explain("late_effort")), diagnosis.explain("late_effort")
    fitted = diagnosis.extended
    assert abs(fitted.values["inertia_scale"] - 1.0) < 4.0 * fitted.std("inertia_scale")
    check_that_a_prediction_knows(diagnosis, recorded[0], tmp_path)


def check_that_a_prediction_knows(diagnosis, trial, folder):
    """A later trial of the same log is foretold with its effort where it acted, from the files alone."""
    for name, text in diagnosis.files().items():
        (folder / name).write_text(text)
    assert load_log(folder / "model.toml") == diagnosis.log
    assert json.loads((folder / "diagnosis.json").read_text())["log"] == log_table(diagnosis.log)
    (folder / "trial.csv").write_text(trial_csv(trial))
    predict(folder / "model.toml", folder / "trial.csv", folder / "out.csv", horizon=0.1)
    table = read_csv(folder / "out.csv")
    found = table.columns["position"]
    near, far = (
        predict_ahead(diagnosis.model, t, diagnosis.extended.noise, 0.1)["position"]
        for t in (diagnosis.log.applied(trial), trial)
    )
    assert np.allclose(found, near, atol=1e-5)
    errors = [np.sqrt(np.mean((trial["position"] - y) ** 2)) for y in (near, far)]
    assert errors[0] < 0.8 * errors[1], errors


def test_a_log_of_every_fifth_sample_is_read_between_its_rows(tmp_path):
    """It holds nothing but what the controller asked for at that time; between, that changed.

    Held for a row and moved by half of it, what is fast in an effort is lost, and the inertia was too small.
    """
    diagnosis = diagnose_joint(read_study(draw((), 0.3, 1151003, tmp_path, recorded=True, every=5).study))
    assert diagnosis.verdict == "adequate", str(diagnosis)
    assert diagnosis.log.effort_over_s == pytest.approx(0.008, rel=0.3) and not diagnosis.log.effort_late_s
    assert any("was interpolated between rows, over" in said for said in diagnosis.warnings)
    load = {n: v for n, v in log_table(diagnosis.log).items() if v}
    assert Log(**load) == diagnosis.log


def test_a_log_of_every_tenth_sample_tells_more_between_its_rows_than_held(tmp_path):
    """Held and moved by as much, an effort has less of what is fast in it, and the inertia comes out too small."""
    off = []
    for seed in range(4072900, 4072906):
        study = read_study(draw((), 0.3, seed, tmp_path, recorded=True, every=10).study)
        fitted = LikelihoodFits(nominal_model(study), study.trials, []).nominal()
        late = lateness_of(fitted, study.trials[0].dt, as_logged=True)
        if not late.is_certain:
            continue
        held = Log(effort_late_s=0.5 * late.log.effort_over_s)
        fits = [maximum_from(fitted, [log.applied(t) for t in fitted.trials]) for log in (held, late.log)]
        assert fits[1].sse < fits[0].sse - 5.0
        off.append([f.values["inertia_scale"] - 1.0 for f in fits])
    assert len(off) > 3
    sizes = np.sqrt(np.mean(np.square(off), axis=0))
    assert sizes[1] < 0.75 * sizes[0], off


def test_an_effort_that_acts_later_within_its_row_is_no_cause(tmp_path):
    """What is read of the slide is as old as it is in a row that the controller writes before its effort acts.

    Before, a spring that relaxes was named, and the inertia was wrong by seven deviations.
    """
    study, late_s = read_study(draw((), 0.3, 1151002, tmp_path, recorded=True).study), 0.0008
    older = tuple(t.with_columns(position=np.interp(t.time - late_s, t.time, t["position"])) for t in study.trials)
    diagnosis = diagnose_joint(replace(study, trials=older))
    assert diagnosis.verdict == "adequate", str(diagnosis)
    assert diagnosis.log.effort_late_s == pytest.approx(-late_s, rel=0.2)
    assert any("ms before it acted, and was moved" in said for said in diagnosis.warnings)
    fitted = diagnosis.extended
    assert abs(fitted.values["inertia_scale"] - 1.0) < 3.0 * fitted.std("inertia_scale")


def test_a_reading_that_is_late_stays_so(tmp_path):
    drawn = draw(("sensor_lag",), 0.3, 1151004, tmp_path, recorded=True)
    diagnosis = diagnose_joint(read_study(drawn.study))
    (cause,) = diagnosis.causes
    assert cause.name == "sensor_lag"
    assert cause.parameters["lag_s"].value > 0.0


def test_between_rows_an_effort_is_what_a_spline_has_over_so_long():
    time = np.arange(400) * 0.01
    smooth = Trial("00", "motion", {"effort": np.sin(7.0 * time)}, time)
    over_s = 0.008
    mean = (np.cos(7.0 * time) - np.cos(7.0 * (time + over_s))) / (7.0 * over_s)
    found = Log(effort_over_s=over_s).applied(smooth)["effort"]
    assert np.allclose(found[:-8], mean[:-8], atol=2e-5)  # after the last row it goes on as it was
    assert found[-1] == pytest.approx(smooth["effort"][-1], abs=0.01)


def test_what_is_held_is_moved_by_parts_of_a_sample():
    time = np.arange(6) * 0.01
    trial = Trial("00", "motion", {"effort": np.array([0.0, 0.0, 4.0, 4.0, 0.0, 8.0])}, time)
    assert np.allclose(advanced(trial, "effort", 0.0)["effort"], trial["effort"])
    assert np.allclose(advanced(trial, "effort", 0.0025)["effort"], [0.0, 1.0, 4.0, 3.0, 2.0, 8.0])
    assert np.allclose(advanced(trial, "effort", 0.02)["effort"], [4.0, 4.0, 0.0, 8.0, 8.0, 8.0])
    assert np.allclose(advanced(trial, "effort", -0.0025)["effort"], [0.0, 0.0, 3.0, 4.0, 1.0, 6.0])
    begun = trial.with_columns(effort=trial["effort"] + 2.0)
    assert np.allclose(advanced(begun, "effort", -0.0025)["effort"], [2.0, 2.0, 5.0, 6.0, 3.0, 8.0])
