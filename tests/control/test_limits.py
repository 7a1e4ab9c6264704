"""Limits that a caller sets hold for every pulse, and a trajectory is followed within them."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fes_pin.control.control import PositionController
from fes_pin.control.dynamics import PULSE_S
from fes_pin.control.faults import Status
from fes_pin.control.limits import Limiter, StimulationLimits
from fes_pin.control.loop import sine, track
from fes_pin.control.pulse import PulseWidth
from fes_pin.data.errors import InputError
from fes_pin.muscles.recruitment import LinearRecruitment
from fes_pin.paper.constants import paper_twin
from fes_pin.paper.ratios import ankle_of
from fes_pin.paper.twin import RunningTwin

TWIN = replace(paper_twin("3-23"), load_kg=0.5)
REST = TWIN.rest_angle()
LIMITS = StimulationLimits(pulse_width_us=600.0, rate_us_per_s=4500.0, charge_uc_per_s=900.0, current_ma=40.0)


@settings(max_examples=100, deadline=None)
@given(st.lists(st.one_of(st.floats(), st.floats(-0.2, 1.2)), max_size=200), st.sampled_from([0.0, 60.0]))
def test_limits_hold_whatever_is_wanted(wanted, half):
    pulse = PulseWidth(LinearRecruitment(180.0, 1000.0), half, LIMITS)
    widths = np.array([0.0, *[pulse(r)[0] for r in wanted]])
    assert (((widths >= 180.0) & (widths <= 600.0)) | (widths == 0.0)).all()
    at_least = np.maximum(widths, 180.0)
    assert (np.diff(at_least) <= 100.0 + 1e-9).all()
    second = np.convolve(widths, np.ones(45))
    assert second.max() * 40.0 * 1e-3 <= 900.0 + 1e-9


def test_a_steady_demand_gets_a_steady_width():
    limiter, widths = Limiter(LIMITS, 180.0, 1000.0), []
    for _ in range(200):
        widths.append(limiter.allowed(1000.0))
        limiter.give(widths[-1])
    assert max(widths) > limiter.steady_us and widths[-45:] == [pytest.approx(limiter.steady_us)] * 45


def test_the_joint_is_held_within_limits():
    run = track(
        controller := PositionController(ankle_of(TWIN), 0.5, limits=LIMITS),
        RunningTwin(TWIN),
        sine(REST, 15.0, 0.5, 12.0),
    )
    assert run.pulse_width_us.max() <= 600.0 and controller.status is Status.RUNNING
    # what they leave of the muscle is what is promised
    reached = math.degrees(run.angle_rad.max() - REST)
    assert 4.0 < reached < 15.0 and math.degrees(controller.highest - REST) == pytest.approx(reached, abs=1.5)


def test_a_rate_of_change_does_not_hold_up_the_ramp_after_a_fault():
    slow = StimulationLimits(rate_us_per_s=450.0, ramp_s=0.2)
    controller = PositionController(ankle_of(TWIN), 0.5, limits=slow)
    run = track(
        controller, RunningTwin(TWIN), np.full(400, REST + 0.15), sensor=lambda k, a: a if k < 200 else math.nan
    )
    assert run.pulse_width_us[199] > 300.0 and not run.pulse_width_us[200 + 6 + 9 :].any()


def test_a_fault_may_be_off_at_once():
    controller = PositionController(ankle_of(TWIN), 0.5, limits=StimulationLimits(ramp_s=0.0))
    run = track(
        controller, RunningTwin(TWIN), np.full(300, REST + 0.15), sensor=lambda k, a: a if k < 200 else math.nan
    )
    assert run.pulse_width_us[199] > 0.0 and not run.pulse_width_us[205:].any()


def test_a_reading_outside_the_range_of_motion_is_a_fault_and_a_reference_an_error():
    narrow = StimulationLimits(range_of_motion_rad=(REST - 0.2, REST + 0.1))
    controller = PositionController(ankle_of(TWIN), 0.5, limits=narrow)
    with pytest.raises(InputError, match="reference_rad, pulse 0"):
        controller.follow([REST + 0.2])
    joint = RunningTwin(replace(TWIN, load_kg=0.9))
    for k in range(300):
        controller.step(REST if k < 5 else joint.angle_rad, REST + 0.09)
        joint.step(400.0, PULSE_S)
    assert controller.status is Status.IMPOSSIBLE


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"pulse_width_us": 0.0}, "pulse_width_us: must be positive, got 0.0"),
        ({"pulse_width_us": "300"}, "pulse_width_us: must be a number, got '300'"),
        ({"rate_us_per_s": math.nan}, "rate_us_per_s"),
        ({"charge_uc_per_s": 100.0}, "needs current_ma"),
        ({"charge_uc_per_s": 100.0, "current_ma": -1.0}, "current_ma"),
        ({"current_ma": True}, "current_ma"),
        ({"ramp_s": 2.0}, "ramp_s: must lie between 0 and 1, got 2"),
        ({"range_of_motion_rad": (60.0, 120.0)}, "range_of_motion_rad"),
        ({"range_of_motion_rad": (2.0, 1.0)}, "range_of_motion_rad"),
    ],
)
def test_limits_that_are_none_are_refused(given, message):
    with pytest.raises(InputError, match=message):
        StimulationLimits(**given)


def test_limits_that_allow_no_pulse_are_refused():
    with pytest.raises(InputError, match="at least the threshold of 180 us"):
        Limiter(StimulationLimits(pulse_width_us=100.0), 180.0, 1000.0)
    with pytest.raises(InputError, match="at least 405 uC/s, which steady pulses"):
        Limiter(StimulationLimits(charge_uc_per_s=300.0, current_ma=40.0), 180.0, 1000.0)


@pytest.mark.parametrize("height_deg", [0.0, 0.25, 0.5, 1.0])
def test_pulses_do_not_flicker_near_rest(height_deg):
    run = track(
        PositionController(ankle_of(TWIN), 0.5), RunningTwin(TWIN), np.full(900, REST + math.radians(height_deg))
    )
    on = run.pulse_width_us > 0.0
    assert np.sum(on[1:] != on[:-1]) <= 2.0 * 20.0 and run.rms_error_deg(2.0) < 0.5


def test_a_trajectory_is_followed_in_time_and_a_number_late():
    controller, rms = PositionController(ankle_of(TWIN), 0.5), {}
    reference = sine(REST + math.radians(1.0), 15.0, 0.5, 12.0)
    noise = np.random.default_rng(0).normal(0.0, 2e-3, len(reference))
    for called in ("trajectory", "number"):
        controller.reset()
        joint, errors = RunningTwin(TWIN), []
        if called == "trajectory":
            controller.follow(reference)
        for wanted, error in zip(reference.tolist(), noise.tolist(), strict=True):
            errors.append(math.degrees(wanted - joint.angle_rad))
            reading = joint.angle_rad + error
            width = controller.step(reading) if called == "trajectory" else controller.step(reading, wanted)
            joint.step(width, PULSE_S)
        rms[called] = math.sqrt(np.mean(np.square(errors[90:])))
    assert rms["trajectory"] < 0.15 and 1.8 < rms["number"] < 2.6
