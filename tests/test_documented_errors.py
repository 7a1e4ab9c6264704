# ruff: noqa: E501  (tables, one case a line)
"""What the public functions say that they raise, they raise: one line of `InputError`, whatever is given."""

import copy
import inspect
import pickle
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from data import studies
from view.reported import ankle_study

import fes_pin as fp
from fes_pin.control.loop import track
from fes_pin.paper.kalman import StraightRecruitment

NERVES = fp.Nerves(["left_femoral", "right_femoral"], strength=1.0)
PULL = {"left_knee_flexion": -20.0}
BODY = fp.Body.from_subject(70.0, 1.75)
LINEAR = fp.linearize(BODY, "mid_stance")
STUDY = ankle_study()
TRIAL = STUDY.trials[0]
MODEL = fp.nominal_model(STUDY)
FRICTION = fp.effects.CoulombFriction(torque_nm=0.04)
CURVE = fp.LinearRecruitment()
LOADS = [0.5, 1.0, 1.5, 2.0], [1.5, 1.6, 1.7, 1.75]
NAN = float("nan")


def controller():
    return fp.PositionController(MODEL, 1.0)


def dynamics():
    return fp.AnkleDynamics.of(MODEL, 1.0)


def bare(**fields):
    given = {"name": "a", "kind": "motion", "columns": {"angle_rad": np.full(9, 1.8)}, "time": 0.01 * np.arange(9)}
    return fp.Trial(**{**given, **fields})


RAISED = {
    "read_study": [lambda: fp.read_study("none"), lambda: fp.read_study(None), lambda: fp.read_study("none", rigs=3)],
    "write_study": [lambda: fp.write_study("x", "out"), lambda: fp.write_study(STUDY, None)],
    "Study": [
        lambda: replace(STUDY, trials=()), lambda: replace(STUDY, start={"gian": 1.0}), lambda: replace(STUDY, folder=3),
        lambda: replace(STUDY, described="ankle"), lambda: replace(STUDY, as_read="x"), lambda: replace(STUDY, files={3: "x"}),
    ],
    "read_trial": [
        lambda: fp.read_trial("none.csv", rig="ankle"), lambda: fp.read_trial(3, rig="ankle"),
        lambda: fp.read_trial("none.csv", rig="knee"), lambda: fp.read_trial("none.csv", rig="joint", conditions=3),
        lambda: fp.read_trial("none.csv", rig="joint", name=3), lambda: fp.read_trial("none.csv", rig="joint", own="x"),
    ],
    "write_trial": [lambda: fp.write_trial(None, "x.csv"), lambda: fp.write_trial(TRIAL, "none/x.csv")],
    "Trial": [lambda: bare(time=[0.0]), lambda: bare(role="heldout"), lambda: bare(as_read="x"), lambda: bare(conditions={"load_kg": "1"})],
    "Model": [
        lambda: fp.Model("ankle"), lambda: fp.Model(MODEL.rig, None), lambda: fp.Model(MODEL.rig, FRICTION),
        lambda: fp.Model(MODEL.rig, ("coulomb_friction",)), lambda: fp.Model(MODEL.rig, (FRICTION, FRICTION)),
        lambda: MODEL - "coulomb_friction", lambda: MODEL - FRICTION, lambda: MODEL - 3, lambda: MODEL - None, lambda: MODEL + "x",
    ],
    "nominal_model": [lambda: fp.nominal_model("study")],
    "load_library": [lambda: fp.load_library("none.py"), lambda: fp.load_library(3), lambda: fp.load_library(["x"])],
    "load_model": [lambda: fp.load_model("none.toml"), lambda: fp.load_model(None)],
    "save_model": [lambda: fp.save_model("x", "m.toml"), lambda: fp.save_model(MODEL, 3)],
    "simulate": [lambda: fp.simulate(MODEL, None), lambda: fp.simulate(None, TRIAL), lambda: fp.simulate(MODEL, TRIAL.without("pulse_width_us"))],
    "predict": [lambda: fp.predict(MODEL, "x"), lambda: fp.predict(MODEL, TRIAL.with_columns(pulse_width_us=-TRIAL["pulse_width_us"]))],
    "fit": [
        lambda: fp.fit(MODEL, []), lambda: fp.fit(None, TRIAL), lambda: fp.fit(MODEL, TRIAL.without("angle_rad")),
        lambda: fp.fit(MODEL, TRIAL, noise=3), lambda: fp.fit(MODEL, TRIAL, max_iterations=None), lambda: fp.fit(MODEL, TRIAL, max_iterations=0),
        lambda: fp.fit(MODEL, TRIAL, max_iterations=3), lambda: fp.fit(MODEL, TRIAL, fixed=None), lambda: fp.fit(MODEL, TRIAL, fixed=3), lambda: fp.fit(MODEL, TRIAL, fixed={3: 1.0}),
        lambda: fp.fit(MODEL, TRIAL, fixed={"gain": "x"}), lambda: fp.fit(MODEL, TRIAL, fixed=np.ones((2, 2))),
        lambda: fp.fit(MODEL, TRIAL, bounds=3), lambda: fp.fit(MODEL, TRIAL, bounds={"gain": ("a", 1.0)}), lambda: fp.fit(MODEL, TRIAL, bounds={"gain": (1.0, 0.5)}),
    ],
    "check": [lambda: fp.check("study"), lambda: fp.check(None), lambda: fp.check(STUDY, library=3)],
    "diagnose": [
        lambda: fp.diagnose("study"), lambda: fp.diagnose(None), lambda: fp.diagnose(STUDY, library=3), lambda: fp.diagnose(STUDY, seed="x"),
        lambda: fp.diagnose(STUDY, seed=-1), lambda: fp.diagnose(STUDY, seed=1e30), lambda: fp.diagnose(STUDY, limit="x"),
        lambda: fp.diagnose(STUDY, limit=-1.0), lambda: fp.diagnose(STUDY, limit=NAN), lambda: fp.diagnose(STUDY, progress="x"),
    ],
    "diagnose_walk": [lambda: fp.diagnose_walk(None), lambda: fp.diagnose_walk(STUDY), lambda: fp.diagnose_walk(STUDY, progress=3)],
    "compare": [
        lambda: fp.compare(None), lambda: fp.compare(STUDY, 3), lambda: fp.compare(STUDY, ["none"]), lambda: fp.compare(STUDY, [[]]),
        lambda: fp.compare(STUDY, extended="x"), lambda: fp.compare(STUDY, horizon_s="x"), lambda: fp.compare(STUDY, given_s=NAN), lambda: fp.compare(STUDY, progress=3),
    ],
    "contrast": [
        lambda: fp.contrast(None), lambda: fp.contrast(STUDY), lambda: fp.contrast(STUDY, "after"), lambda: fp.contrast(STUDY, STUDY, groups=3),
        lambda: fp.contrast(STUDY, STUDY, groups="none"), lambda: fp.contrast(STUDY, STUDY, seed="x"), lambda: fp.contrast(STUDY, STUDY, limit="x"),
    ],
    "report": [lambda: fp.report(STUDY, "r.html"), lambda: fp.report("x", "r.html")],
    "save_result": [lambda: fp.save_result(STUDY, "r.json")],
    "load_result": [lambda: fp.load_result("none.json"), lambda: fp.load_result(None)],
    "Body": [lambda: fp.Body("<x/>", "right"), lambda: fp.Body.from_subject(-1.0, 1.8), lambda: BODY.angles("none")],
    "linearize": [lambda: fp.linearize(None), lambda: fp.linearize(BODY, "none"), lambda: fp.linearize(BODY, check=np.ones(2)), lambda: fp.linearize(BODY, gravity=-9.8)],
    "minimal_sets": [lambda: fp.minimal_sets(None, NERVES), lambda: fp.minimal_sets(LINEAR, NERVES, braces=[[]]), lambda: fp.minimal_sets(LINEAR, NERVES, braces={"mine": 1.0})],
    "NamedArray": [
        lambda: fp.NamedArray("x", ["a"]), lambda: fp.NamedArray({}, ["a"]), lambda: fp.NamedArray([1.0], None),
        lambda: fp.NamedArray([1.0, 2.0], "ab"), lambda: fp.NamedArray([1.0], [3]), lambda: fp.NamedArray([1.0], ["a"])["b"],
    ],
    "posture_angles": [lambda: fp.posture_angles("none", "right"), lambda: fp.posture_angles("neutral", "up")],
    "Inputs": [
        lambda: fp.Inputs(None, ("left_knee_flexion",), np.ones((1, 1)), [0.0], [1.0]), lambda: fp.Inputs(("a",), 3, np.ones((1, 1)), [0.0], [1.0]),
        lambda: fp.Inputs(([],), ("left_knee_flexion",), np.ones((1, 1)), [0.0], [1.0]), lambda: fp.Inputs(("a",), ("left_knee_flexion",), "x", [0.0], [1.0]),
    ],
    "PassiveLegs": [lambda: fp.PassiveLegs(NAN)],
    "ElasticJoints": [lambda: fp.ElasticJoints({"none": 1.0})],
    "attainable": [lambda: fp.attainable(None, NERVES), lambda: fp.attainable(LINEAR, NERVES, gravity="no"), lambda: fp.attainable(LINEAR, NERVES, balance=None), lambda: fp.attainable(LINEAR, np.ones((2, 2)))],
    "catchable": [lambda: fp.catchable(None, NERVES), lambda: fp.catchable(LINEAR, NERVES, gravity="no"), lambda: fp.catchable(LINEAR, NERVES, balance=None)],
    "close_the_loop": [lambda: fp.close_the_loop(None, NERVES, {}), lambda: fp.close_the_loop(LINEAR, NERVES, {}, balance=np.ones(2)), lambda: fp.close_the_loop(LINEAR, NERVES, {}, moving_arms="no")],
    "fewest_goniometers": [lambda: fp.fewest_goniometers(None), lambda: fp.fewest_goniometers(LINEAR, 3), lambda: fp.fewest_goniometers(LINEAR, ["none"])],
    "subject_nerves": [lambda: fp.subject_nerves(None), lambda: fp.subject_nerves(BODY, []), lambda: fp.subject_nerves(BODY, years="9")],
    "show_mode": [lambda: fp.show_mode(None, None), lambda: fp.show_mode(LINEAR, 3)],
    "show_posture": [lambda: fp.show_posture(BODY)],
    "show_influence": [lambda: fp.show_influence(LINEAR, NERVES, "none"), lambda: fp.show_influence(None, NERVES, "left_femoral")],
    "controllability": [lambda: fp.controllability(LINEAR, ["none"]), lambda: fp.controllability(None, NERVES)],
    "allocate": [lambda: fp.allocate(-40.0, fp.Nerves()), lambda: fp.allocate({"none": 1.0}, NERVES), lambda: fp.allocate(PULL, NERVES, previous=[400.0, 0.0]), lambda: fp.allocate(PULL, NERVES, solver="none")],
    "Nerves": [lambda: fp.Nerves([]), lambda: fp.Nerves(["none"]), lambda: NERVES.select([]), lambda: NERVES.select(["left_tibial"]), lambda: fp.Nerves(fatigue=[1.0])],
    "Allocator": [lambda: fp.Allocator("none"), lambda: fp.Allocator(NERVES, effort=NAN)],
    "AttainableTorques": [lambda: fp.AttainableTorques(NERVES, upper=2.0), lambda: fp.AttainableTorques(NERVES, joints=[[]]), lambda: fp.AttainableTorques(NERVES, joints=np.ones((2, 2)))],
    "Horizon": [lambda: fp.Horizon(None), lambda: fp.Horizon(fp.Allocator(NERVES), time_constant_s=50.0)],
    "StrengthFatigue": [lambda: fp.StrengthFatigue(-1.0)],
    "invert_lag": [lambda: fp.invert_lag("x", 0.03, 0.05), lambda: fp.invert_lag(np.zeros((5, 2)), 0.03, 0.05, "x"), lambda: fp.invert_lag(np.zeros((5, 2)), 0.03, 0.05, [0.0])],
    "allocate_walk": [lambda: fp.allocate_walk(np.zeros(3), NERVES, np.zeros((5, 19)))],
    "LinearRecruitment": [lambda: fp.LinearRecruitment(180.0, 1e9)],
    "SaturatingRecruitment": [lambda: fp.SaturatingRecruitment(curvature=NAN)],
    "SigmoidRecruitment": [lambda: fp.SigmoidRecruitment(middle=50.0)],
    "GompertzRecruitment": [lambda: fp.GompertzRecruitment(growth="x")],
    "HillRecruitment": [lambda: fp.HillRecruitment(log_bend=800.0)],
    "MeasuredRecruitment": [lambda: fp.MeasuredRecruitment([100.0, 200.0, np.inf], [0.0, 0.5, 1.0])],
    "Hysteresis": [lambda: fp.Hysteresis(CURVE, -1.0), lambda: fp.Hysteresis(None, 10.0)],
    "AnkleDynamics": [lambda: replace(dynamics(), inertia=-1.0), lambda: fp.AnkleDynamics.of("x", 1.0)],
    "JointObserver": [lambda: fp.JointObserver(None), lambda: fp.JointObserver(dynamics(), angle_std_rad=0.0)],
    "PositionController": [lambda: fp.PositionController("x"), lambda: fp.PositionController(MODEL, 1000.0), lambda: fp.PositionController(MODEL, 1.0, limits=3)],
    "StimulationLimits": [lambda: fp.StimulationLimits(np.ones(2)), lambda: fp.StimulationLimits(rate_us_per_s=np.array([])), lambda: fp.StimulationLimits(500.0, 9000.0, 900.0, 0.04)],
    "delay_margin": [lambda: fp.delay_margin(None, fp.JointObserver(dynamics()), None), lambda: fp.delay_margin(dynamics(), None, None), lambda: fp.delay_margin(dynamics(), fp.JointObserver(dynamics()), None)],
    "least_rest": [lambda: fp.least_rest(MODEL, 1.0, "x", 2), lambda: fp.least_rest(MODEL, 1.0, 1.8, 2), lambda: fp.least_rest(MODEL, 1.0, [1.8], 0)],
    "muscle_budget": [lambda: fp.muscle_budget(MODEL, 1.0, [1.8]), lambda: fp.muscle_budget(MODEL, 1.0, [1.8], capacity=NAN)],
    "track": [lambda: track(controller(), None, [NAN])],
    "GainFilter": [lambda: fp.GainFilter(0.01, CURVE, 0.2), lambda: fp.GainFilter(0.0, StraightRecruitment.of(STUDY.constants), 0.2)],
    "track_gain": [lambda: fp.track_gain(None, {}, 0.2), lambda: fp.track_gain(TRIAL, STUDY.constants, 0.2)],
    "fit_antagonist": [lambda: fp.fit_antagonist(*LOADS, 0.002, np.inf), lambda: fp.fit_antagonist(LOADS[0], np.degrees(LOADS[1]), 0.002, 0.1)],
}  # fmt: skip
CASES = [pytest.param(call, id=f"{name}-{k}") for name, calls in RAISED.items() for k, call in enumerate(calls)]


@pytest.mark.parametrize("call", CASES)
def test_what_cannot_be_is_one_line(call, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(fp.InputError) as raised:
        call()
    assert str(raised.value).strip() and "\n" not in str(raised.value)
    assert not [*tmp_path.iterdir()]  # and nothing was written


def test_every_public_name_that_documents_an_error_is_called():
    documented = {
        name
        for name in fp._WHERE
        if "InputError" in (inspect.getdoc(getattr(fp, name)) or "") and getattr(fp, name) is not fp.InputError
    }
    assert documented - set(RAISED) == set()


def test_without_inputs_a_body_that_leans_falls_in_the_closed_loop():
    assert fp.close_the_loop(LINEAR, [], {"left_knee_flexion": 0.01}, seconds=0.1, balance=False).lost


def test_what_a_check_says_is_hashed_and_equal_to_its_copy():
    found = fp.check(fp.read_study(Path(__file__).parents[1] / "analysis/studies/ankle_demo"))
    for copied in (copy.deepcopy(found), pickle.loads(pickle.dumps(found))):
        assert copied == found and hash(copied) == hash(found)
    with pytest.raises(TypeError):
        found.testable.shown["x"] = 1.0


def test_a_run_of_the_closed_loop_is_a_frame_of_its_joints():
    run = fp.close_the_loop(LINEAR, NERVES, {"left_knee_flexion": 0.01}, seconds=0.1, balance=False)
    pytest.importorskip("pandas")
    table = run.to_frame().reset_index()
    assert table["left_knee_flexion"].iloc[0] == 0.01 and table["time_s"].tolist() == run.time_s.tolist()
    assert "left_knee_flexion" in run._repr_html_()


def test_of_a_study_in_memory_nobody_is_sent_to_a_file():
    with pytest.raises(fp.InputError, match=r"has no group; expected every trial in one$"):
        fp.contrast(STUDY)


def test_trials_are_found_by_any_whole_number():
    assert STUDY[np.int64(0)] is TRIAL
    with pytest.raises(KeyError, match="has no trial"):
        STUDY["none"]
    with pytest.raises(IndexError):
        STUDY[len(STUDY)]


def test_where_a_study_was_read_from_cannot_be_changed(tmp_path):
    for one in (read := fp.read_study(studies.ankle(tmp_path)), read.trials[0]):
        with pytest.raises(TypeError):
            one.as_read.sha256["x"] = "y"
