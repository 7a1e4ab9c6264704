"""Efforts along the measured motion: as a right model has them, whatever the sensor does; and their figures."""

import csv
import io
from dataclasses import replace

import numpy as np
import pytest
from effort.bench import DAMPING, study, trial
from scipy.signal import bilinear, lfilter
from view.reported import ankle_diagnosis, diagnosed, joint_study

import fes_pin as fp
from fes_pin.data.trial import derived_trial
from fes_pin.diagnosis.along_motion import AlongMotion, along_motion, effort_band, effort_percent, left_out
from fes_pin.effort.motion import Motion, Record
from fes_pin.models.effects import effect_named
from fes_pin.models.nominal import nominal_model
from fes_pin.models.simulate import simulated_trial
from fes_pin.view.report import report_html
from fes_pin.view.report_effort import effort_drawing, effort_section, friction_drawing
from fes_pin.view.style import short_unit

HIDDEN = {"friction": 0.1, "offset": 0.08, "drag": 0.05}
TORQUE_NOISE = 0.003 / np.sqrt(1.0 - 0.97**2)
"""Standard deviation of the torque that no column holds; see `bench`."""


def arm(folder, **effects):
    """The arm at its true values, with effects by name."""
    model = nominal_model(study(folder, [trial(0, seconds=1.0)]))
    model = model.with_parameters({"inertia_scale": 1.0, "damping": DAMPING, "gravity_scale": 1.0})
    for name, values in effects.items():
        model = model + effect_named(name)(**values)
    return model


@pytest.fixture(scope="module")
def recorded():
    return trial(3, **HIDDEN)


def true_effects():
    return {
        "coulomb_friction": {"torque_nm": HIDDEN["friction"]},
        "quadratic_damping": {"coefficient": HIDDEN["drag"]},
        "effort_offset": {"offset": HIDDEN["offset"]},
    }


def efforts(models, one):
    (found,) = along_motion(models, [one], effort_band(next(iter(models.values())).rig, [one]))
    return found


@pytest.mark.parametrize(
    "form",
    [
        {},
        {"stretch": 0.02},
        {"creep_speed": 0.15, "stiction": 2.9, "stribeck_speed": 0.08},
        {"softness": 1.0},
        {"creep_speed": 0.05},
    ],
)
def test_a_model_needs_the_effort_that_moved_it_whatever_the_form_of_its_friction(tmp_path, recorded, form):
    """Its own law is evaluated along the motion: a regression's forms of friction are other functions of the speed."""
    model = arm(tmp_path, coulomb_friction={"torque_nm": 0.1, **form})
    moved = simulated_trial(model, recorded)
    band = effort_band(model.rig, [moved])
    assert effort_percent(model, [moved], band) < 0.02
    assert effort_percent(arm(tmp_path), [moved], band) > 0.5


def test_a_trial_that_is_shorter_than_the_filter_has_no_effort_along_it(tmp_path, recorded):
    model = arm(tmp_path)
    assert effort_percent(model, [recorded.part(slice(0, 12))], effort_band(model.rig, [recorded])) is None


def test_a_frame_that_swings_is_not_in_the_effort_along_a_motion(tmp_path, recorded):
    model = arm(tmp_path, frame_vibration={})
    assert effort_percent(model, [recorded], effort_band(model.rig, [recorded])) is None


def test_a_right_model_predicts_the_measured_effort(tmp_path, recorded):
    found = efforts({"nominal": arm(tmp_path), "extended": arm(tmp_path, **true_effects())}, recorded)
    assert np.std(found.residual("extended")) < TORQUE_NOISE
    assert np.std(found.residual("nominal")) > 0.08


def test_what_stays_without_other_causes_is_friction(tmp_path, recorded):
    found = efforts({"extended": arm(tmp_path, **true_effects())}, recorded)
    v = found.velocity
    expected = DAMPING * v + HIDDEN["friction"] * np.sign(v) + HIDDEN["drag"] * v * np.abs(v)
    moving = np.abs(v) > 0.5
    assert moving.sum() > 40
    assert np.abs(found.friction["extended"] - expected)[moving].max() < 0.01
    assert np.std((found.without_others("extended") - expected)[moving]) < TORQUE_NOISE
    wrong_offset = {**true_effects(), "effort_offset": {"offset": 0.0}}
    other = efforts({"extended": arm(tmp_path, **wrong_offset)}, recorded)
    shift = np.median(other.without_others("extended") - found.without_others("extended"))
    assert shift == pytest.approx(-HIDDEN["offset"], rel=1e-6)


def late(time, q, seconds):
    return np.interp(time - seconds, time, q)


@pytest.mark.parametrize(
    ("name", "values", "read"),
    [
        ("sensor_offset", {"offset": 0.1}, lambda t, q: q + 0.1),
        ("sensor_drift", {"rate_per_s": 0.02}, lambda t, q: q + 0.02 * t),
        ("sensor_gain", {"error": 0.2, "place": 2.0}, lambda t, q: 1.2 * q),
        ("sensor_nonlinearity", {"curvature": 0.2, "place": 2.0}, lambda t, q: q + 0.2 * q**2),
        ("sensor_lag", {"lag_s": 0.03, "shift": 1.0}, lambda t, q: late(t, q, 0.03)),
        ("sensor_lag", {"lag_s": 0.03}, lambda t, q: lfilter(*bilinear([1.0], [0.03, 1.0], 1.0 / (t[1] - t[0])), q)),
    ],
)
def test_what_a_sensor_does_is_taken_off_the_reading(tmp_path, recorded, name, values, read):
    one = recorded.with_columns(position=read(recorded.time, recorded["position"]))
    right, without = arm(tmp_path, **{name: values}), arm(tmp_path)
    band = effort_band(right.rig, [recorded])
    (true,), (found,) = along_motion({"": without}, [recorded], band), along_motion({"": right}, [one], band)
    (wrong,) = along_motion({"": without}, [one], band)
    inner = slice(10, -10)
    error, uncorrected = (np.std((x.predicted[""] - true.predicted[""])[inner]) for x in (found, wrong))
    assert error < 0.1 * uncorrected


def test_a_play_is_crossed_from_rest_while_the_reading_stands(tmp_path, recorded):
    """A view that changes side at once has larger errors than no correction."""
    read, followed = [], recorded["position"][0]
    for q in recorded["position"]:
        followed = min(max(followed, q - 0.02), q + 0.02)
        read.append(followed)
    rng = np.random.default_rng(4)
    one = recorded.with_columns(position=np.array(read) + 1e-4 * rng.standard_normal(len(read)))
    right, without = arm(tmp_path, backlash={"half_width": 0.02}), arm(tmp_path)
    band = effort_band(right.rig, [recorded])
    (true,), (found,) = along_motion({"": without}, [recorded], band), along_motion({"": right}, [one], band)
    (wrong,) = along_motion({"": without}, [one], band)
    error, uncorrected = (np.std(x.predicted[""] - true.predicted[""]) for x in (found, wrong))
    assert error < 0.5 * uncorrected


def test_an_imposed_motion_is_predicted_as_the_model_predicts_it(tmp_path, recorded):
    one = derived_trial(recorded, kind="imposed")
    model = arm(tmp_path, **true_effects(), sensor_offset={"offset": 0.3})
    found = efforts({"": model}, one)
    simulated = simulated_trial(model, one)["effort"]
    record = Record.of(one)
    expected = Motion(record, effort_band(model.rig, [one])).low(simulated)
    assert np.std(found.predicted[""] - expected) < 0.05 * np.std(expected)
    assert np.mean(found.predicted[""] - expected) == pytest.approx(0.0, abs=0.01)
    assert left_out(model, [one]) == []


def test_causes_that_no_torque_or_reading_has_are_named(tmp_path, recorded):
    model = arm(tmp_path, frame_vibration={"coupling": 0.1}, sensor_lag={"lag_s": 0.01})
    assert left_out(model, [recorded]) == ["frame_vibration"]


OWN = """
from dataclasses import dataclass
from fes_pin.models.stage import Effect, Stage, parameter

@dataclass(frozen=True)
class {title}(Effect):
    size: float = parameter(0.1, null=0.0, lower=-1.0, upper=1.0, scale=0.1)
    name, stage, signal, rigs = "{name}", Stage.JOINT, "torque", ("joint",)

    def apply(self, value, s):
        return value - self.size * s.{read}
"""


@pytest.mark.parametrize(("read", "absent"), [("q", []), ("u.effort", ["mine"])])
def test_a_cause_of_the_user_acts_where_it_reads_the_motion_alone(tmp_path, recorded, read, absent):
    (tmp_path / "mine.py").write_text(OWN.format(title="Mine", name="mine", read=read))
    (kind,) = (e for e in fp.load_library(tmp_path / "mine.py").effects if e.name == "mine")
    model = arm(tmp_path)
    found = efforts({"without": model, "with": model + kind(size=0.1)}, recorded)
    assert left_out(model + kind(size=0.1), [recorded]) == absent
    added = found.predicted["with"] - found.predicted["without"]
    assert added == pytest.approx(0.1 * found.position * (not absent), abs=1e-3)


def test_no_band_is_no_section(tmp_path, recorded):
    still = recorded.with_columns(position=1e-3 * np.random.default_rng(0).standard_normal(len(recorded)))
    rig = arm(tmp_path).rig
    assert effort_band(rig, [still]) is None
    assert effort_band(rig, [recorded.without("effort")]) is None
    assert effort_band(ankle_diagnosis().model.rig, ankle_diagnosis().study.trials) is None
    assert "Effort along" not in report_html(ankle_diagnosis())


def rows_of(drawing):
    return list(csv.reader(io.StringIO(drawing.csv)))[1:]


def test_a_friction_map_shows_friction_that_depends_on_the_angle():
    rng = np.random.default_rng(1)
    v, q = rng.uniform(-2.0, 2.0, 600), rng.uniform(-1.0, 1.0, 600)
    friction = np.sign(v) * np.where(q > 1.0 / 3.0, 2.0, 1.0)
    one = AlongMotion("", np.arange(600.0), q, v, friction, {"nominal": np.sign(v)}, {"nominal": np.sign(v)})
    rows = rows_of(friction_drawing([one], "nominal", "N m", "rad"))
    size = {n: np.median([abs(float(y)) for what, _, y in rows if what == n]) for n in {r[0] for r in rows}}
    assert size == {"fitted": 1.0, "lower": 1.0, "middle": 1.0, "upper": 2.0}


def test_the_report_of_a_joint_has_its_efforts_and_their_numbers(tmp_path):
    diagnosis = diagnosed(joint_study(tmp_path), ("coulomb_friction",))
    page = report_html(diagnosis)
    for name in ("effort_1", "effort_2", "effort_against_rate", "effort_against_angle", "friction_map"):
        assert page.count(f'download="{name}.csv"') == 1
    assert f"{diagnosis.record()['effort_band_hz']:.3g} Hz" in page
    assert "effort (N m)" in page and "fitted, extended" in page
    of_nominal = report_html(diagnosed(joint_study(tmp_path)))
    assert "fitted, nominal" in of_nominal


def test_large_efforts_are_in_thousands(recorded):
    here = {"nominal": 3e3 * np.ones(20)}
    drawn = effort_drawing(AlongMotion("", np.arange(20.0), *np.ones((2, 20)), 1e4 * np.ones(20), here, here), "N").svg
    assert "effort (kN)" in drawn and ">(kN)<" in drawn


def test_measured_efforts_are_in_front(tmp_path, recorded):
    found = efforts({"nominal": arm(tmp_path), "extended": arm(tmp_path, **true_effects())}, recorded)
    drawn = effort_drawing(found, "N m").svg
    places = [drawn.index(f"var(--{name}") for name in ("extended", "nominal", "measured")]
    assert places == sorted(places)
    assert "N m off" in drawn
    table = rows_of(effort_drawing(found, "N m"))
    assert [float(r[1]) for r in table] == pytest.approx(found.measured, rel=1e-4)


@pytest.mark.parametrize(
    ("largest", "expected"),
    [
        (1e4, (1e-3, "kN")),
        (2000.0, (1e-3, "kN")),
        (1999.0, (1.0, "N")),
        (0.05, (1.0, "N")),
        (0.04, (1e3, "mN")),
        (0, (1, "N")),
    ],
)
def test_an_axis_has_short_numbers(largest, expected):
    assert short_unit(np.array([-largest]), "N") == expected


@pytest.mark.parametrize("samples", [8, 12, 40])
def test_trials_shorter_than_the_filter_have_no_figure(tmp_path, recorded, samples):
    model, short = arm(tmp_path), recorded.first(samples)
    assert [one.name for one in along_motion({"": model}, [short, recorded], effort_band(model.rig, [recorded]))] == [
        "3"
    ]
    alone = replace(diagnosed(joint_study(tmp_path)), study=study(tmp_path, [short]))
    assert effort_section(alone) == []
