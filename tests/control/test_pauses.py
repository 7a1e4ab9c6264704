"""A controller owns its observer, notices a pause, and says when a reference is out of reach."""

import copy
import math
import pickle
import time
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from paper_ankle.constants import STEPWISE, paper_twin
from paper_ankle.ratios import ankle_of
from paper_ankle.twin import RunningTwin, record, staircase

import fes_pin as fp
from fes_pin.control.control import RISE_PULSES, START_RAD, START_READINGS, PositionController
from fes_pin.control.dynamics import PULSE_S, AnkleDynamics, JointObserver
from fes_pin.control.faults import Status
from fes_pin.control.loop import track
from fes_pin.control.timing import CLOCK_PAUSE_S, PAUSE_S
from fes_pin.data.errors import InputError

TWIN = replace(paper_twin("3-23"), load_kg=0.5)
REST = TWIN.rest_angle()
UP = REST + math.radians(12.0)


@cache
def made():
    return PositionController(ankle_of(TWIN), 0.5)


def fresh():
    controller = made()
    controller.reset()
    return controller


def test_two_legs_that_were_given_one_observer_do_not_share_it():
    """One leg is moved; the other was told to rest and must not be stimulated by what the first one's sensor read."""
    shared = JointObserver(AnkleDynamics.of(ankle_of(TWIN), 0.5))
    legs = [PositionController(ankle_of(TWIN), 0.5, shared) for _ in range(2)]
    assert legs[0].observer is not legs[1].observer and shared not in [leg.observer for leg in legs]
    joints, widths = [RunningTwin(TWIN) for _ in legs], []
    for k in range(135):
        given = [
            leg.step(joint.angle_rad, w, k * PULSE_S) for leg, joint, w in zip(legs, joints, (UP, REST), strict=True)
        ]
        for joint, width in zip(joints, given, strict=True):
            joint.step(width, PULSE_S)
        widths.append(given)
    assert np.array(widths)[:, 0].max() > 400.0 and not np.array(widths)[:, 1].any()


def test_an_observer_of_another_ankle_is_refused():
    other = JointObserver(AnkleDynamics.of(ankle_of(TWIN), 1.0))
    with pytest.raises(InputError, match=r"observer: expected a JointObserver of this ankle with 0.5 kg"):
        PositionController(ankle_of(TWIN), 0.5, other)
    with pytest.raises(InputError, match="observer"):
        PositionController(ankle_of(TWIN), 0.5, "kalman")


def running(controller, joint, seconds=3.0, start=0.0):
    """Hold the joint up; the last width and the time of the next call."""
    count = round(seconds / PULSE_S)
    for k in range(count):
        width = controller.step(joint.angle_rad, UP, start + k * PULSE_S)
        joint.step(width, PULSE_S)
    return width, start + count * PULSE_S


def test_after_a_minute_without_calls_pulses_begin_from_rest_and_smoothly():
    controller, joint = fresh(), RunningTwin(TWIN)
    before, now = running(controller, joint)
    assert before > 400.0 and controller.status is Status.RUNNING and controller.warning == ""
    for _ in range(round(60.0 / PULSE_S)):
        joint.step(0.0, PULSE_S)
    start, widths, seen = now + 60.0, [], []
    for k in range(60):
        widths.append(controller.step(joint.angle_rad, UP, start + k * PULSE_S))
        seen.append(controller.status)
        joint.step(widths[-1], PULSE_S)
    assert not any(widths[: START_READINGS - 1]) and seen[0] is Status.WAITING
    assert seen[-1] is Status.RUNNING and widths[-1] == pytest.approx(before, abs=40.0)
    assert controller.paused_s == pytest.approx(60.0, abs=0.1) and "the calls paused for 60 s" in controller.warning


def test_a_joint_that_is_not_at_rest_after_a_pause_is_not_stimulated():
    controller, joint = fresh(), RunningTwin(TWIN)
    _, now = running(controller, joint)
    for k in range(90):
        assert controller.step(REST + START_RAD + 0.02, UP, now + 1.0 + k * PULSE_S) == 0.0
    assert controller.status is Status.WAITING


@pytest.mark.parametrize(("gap", "status"), [(PAUSE_S, Status.WAITING), (0.8 * PAUSE_S, Status.RUNNING)])
def test_a_gap_of_six_pulses_is_a_pause(gap, status):
    controller, joint = fresh(), RunningTwin(TWIN)
    _, now = running(controller, joint)
    controller.step(joint.angle_rad, UP, now - PULSE_S + gap)
    assert controller.status is status


@pytest.mark.parametrize("stated", [True, False])
def test_a_pause_is_noticed_by_stated_times_and_without_them_by_the_clock(stated, monkeypatch):
    controller, joint, now = fresh(), RunningTwin(TWIN), [1e4]
    monkeypatch.setattr(time, "monotonic", lambda: now[0])

    def step(gap):
        now[0] += gap
        width = controller.step(joint.angle_rad, UP, now[0] if stated else None)
        joint.step(width, gap)
        return width

    for _ in range(30):
        step(PULSE_S)
    assert controller.status is Status.RUNNING
    assert step(2.0 * CLOCK_PAUSE_S) == 0.0 and controller.status is Status.WAITING


@pytest.mark.parametrize(("gap", "refused"), [(0.022, False), (PULSE_S, False), (0.02, True), (0.6 * PULSE_S, True)])
def test_calls_that_come_faster_than_pulses_are_refused_and_a_timer_of_22_ms_is_not(gap, refused):
    """Every pulse moves the controller's model on by 22.2 ms."""
    controller, joint = fresh(), RunningTwin(TWIN)
    try:
        for k in range(300):
            joint.step(controller.step(joint.angle_rad, UP, k * gap + 0.2 * gap * (k % 2)), gap)
    except InputError as error:
        assert refused and str(error).startswith("time_s: expected one call per pulse")
    else:
        assert not refused and controller.status is Status.RUNNING


def test_a_fault_stays_a_fault_over_a_pause():
    controller, joint = fresh(), RunningTwin(TWIN)
    _, now = running(controller, joint)
    with pytest.raises(InputError):
        controller.step(joint.angle_rad, "up", now)
    assert [controller.step(REST, UP, now + 100.0 + k * PULSE_S) for k in range(60)][-1] == 0.0
    assert controller.status is Status.REFUSED


@pytest.mark.parametrize("broken", ["reference", "reading"])
def test_a_pause_in_the_ramp_after_a_fault_ends_the_ramp(broken):
    """The rest of the ramp was given after it: 294 us out of nothing."""
    controller, joint = fresh(), RunningTwin(TWIN)
    _, now = running(controller, joint)
    if broken == "reference":
        with pytest.raises(InputError):
            controller.step(joint.angle_rad, "up", now)
    else:
        for k in range(6):
            controller.step(math.nan, UP, now + k * PULSE_S)
    assert controller.status.is_fault
    assert not any(controller.step(REST, UP, now + 60.0 + k * PULSE_S) for k in range(20))


def test_after_a_pause_the_reference_is_let_in_within_half_a_second():
    controller, joint, widths, angles = fresh(), RunningTwin(TWIN), [], []
    controller.step(REST, UP, 0.0)
    for k in range(60):
        angles.append(joint.angle_rad)
        widths.append(controller.step(joint.angle_rad, [UP], 10.0 + k * PULSE_S))
        joint.step(widths[-1], PULSE_S)
    begun = np.flatnonzero(widths)[0]
    assert begun >= START_READINGS - 1 and controller.wanted_rad == pytest.approx(UP)
    assert widths[begun] < 0.75 * widths[-1]  # without it the first pulse was all that the muscle has
    assert max(widths[: begun + RISE_PULSES]) < 1.5 * widths[-1]
    assert np.degrees(np.diff(angles)).max() < 2.0  # 90 degrees a second


@pytest.mark.parametrize("called", ["trajectory", "row", "number"])
def test_a_reference_beyond_reach_is_said(called):
    controller, joint = fresh(), RunningTwin(TWIN)
    beyond = controller.dynamics.rest_angle(1.0) + math.radians(20.0)
    if called == "trajectory":
        controller.follow(np.full(100, beyond))
    for k in range(90):
        wanted = {"trajectory": None, "row": [beyond], "number": beyond}[called]
        joint.step(controller.step(joint.angle_rad, wanted, k * PULSE_S), PULSE_S)
    assert math.degrees(controller.beyond_rad) == pytest.approx(22.0, abs=0.2)  # 2 are kept for the feedback
    assert controller.short_of > 0.3 and "degrees beyond what the muscle is asked for" in controller.warning
    reached = controller.dynamics.rest_angle(1.0) - math.radians(2.0)
    assert joint.angle_rad == pytest.approx(reached, abs=math.radians(0.5))
    controller.follow([REST])
    assert controller.warning == ""


def test_a_reference_below_rest_is_said():
    controller, joint = fresh(), RunningTwin(TWIN)
    for k in range(30):
        joint.step(controller.step(joint.angle_rad, REST - math.radians(20.0), k * PULSE_S), PULSE_S)
    assert "20.0 degrees beyond" in controller.warning and controller.short_of == 0.0


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda c: pickle.loads(pickle.dumps(c))], ids=["deepcopy", "pickle"])
def test_a_copy_of_a_controller_goes_on_as_the_controller_does(copied):
    controller, joint = fresh(), RunningTwin(TWIN)
    _, now = running(controller, joint)
    other, another = copied(controller), copied(joint)
    for k in range(60):
        widths = [c.step(j.angle_rad, UP, now + k * PULSE_S) for c, j in ((controller, joint), (other, another))]
        assert widths[0] == widths[1]
        joint.step(widths[0], PULSE_S)
        another.step(widths[1], PULSE_S)
    assert other.observer is not controller.observer


def test_a_controller_takes_a_fit_by_its_model_and_refuses_what_has_none():
    motion = record(TWIN, staircase(list(STEPWISE)), "motion", noise_std=2e-3)
    fitted = fp.fit(ankle_of(TWIN), [motion])
    controller = fp.PositionController(fitted, 0.5)
    assert controller.dynamics == AnkleDynamics.of(fitted.model, 0.5)
    run = track(controller, RunningTwin(TWIN), np.full(90, UP))
    assert run.angle_rad[-1] == pytest.approx(UP, abs=0.01)
    for nothing in (None, 0.5, {"gain": 1.0}, TWIN):
        with pytest.raises(InputError, match=r"^model: expected a model"):
            PositionController(nothing, 0.5)
