"""Limits that a caller sets hold for every pulse, and a trajectory is followed within them."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from paper_ankle.constants import paper_twin
from paper_ankle.ratios import ankle_of
from paper_ankle.twin import RunningTwin

from fes_pin.control.control import PositionController
from fes_pin.control.dynamics import PULSE_S
from fes_pin.control.faults import Status
from fes_pin.control.loop import sine, track
from fes_pin.control.pulse import RANGES, Limiter, PulseWidth, StimulationLimits
from fes_pin.data.errors import InputError
from fes_pin.muscles.recruitment import LinearRecruitment

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
        ({"pulse_width_us": 0.0}, "pulse_width_us: expected 10 to 5000 us, found 0.0"),
        ({"pulse_width_us": "300"}, "pulse_width_us: must be a number, got '300'"),
        ({"rate_us_per_s": math.nan}, "rate_us_per_s"),
        ({"charge_uc_per_s": 100.0}, "needs current_ma"),
        ({"charge_uc_per_s": 100.0, "current_ma": -1.0}, "current_ma"),
        ({"current_ma": True}, "current_ma"),
        ({"current_ma": 0.04}, "current_ma: expected 0.2 to 200 mA, found 0.04"),  # in A
        ({"pulse_width_us": 0.5}, "pulse_width_us: expected 10 to 5000 us, found 0.5"),  # in ms
        ({"rate_us_per_s": 9.0}, "rate_us_per_s: expected 20 to 20000 us/s, found 9.0"),  # in ms/s
        (
            {"charge_uc_per_s": 0.9, "current_ma": 40.0},
            "charge_uc_per_s: expected 5 to 5000 uC/s, found 0.9",
        ),  # in mC/s
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


def test_a_slip_of_units_does_not_disable_the_charge_limit():
    """A for mA left 400 000 us in a second in place of 400; nothing is built from such limits."""
    with pytest.raises(InputError, match="current_ma"):
        StimulationLimits(500, 9000, 900, 0.04)
    assert Limiter(StimulationLimits(500, 9000, 900, 40), 180.0, 1000.0).left_us == pytest.approx(4500.0)


def test_no_range_of_limits_holds_both_a_number_and_its_thousandth():
    assert all(high <= 1000.0 * low for low, high, _ in RANGES.values())


@pytest.mark.parametrize(
    ("limits", "message"),
    [({"pulse_width": 500.0}, "limits: expected StimulationLimits, or a mapping"), (500.0, "limits"), ([], "limits")],
)
def test_what_is_no_limits_is_refused(limits, message):
    with pytest.raises(InputError, match=message):
        PositionController(ankle_of(TWIN), 0.5, limits=limits)


def test_limits_may_be_a_mapping_of_their_names():
    controller = PositionController(ankle_of(TWIN), 0.5, limits={"pulse_width_us": 600.0})
    assert controller.limits == StimulationLimits(pulse_width_us=600.0)


def test_where_charge_and_rate_contradict_each_other_the_charge_limit_wins():
    """The last pulse of a bucket is followed by a fall that the rate alone would not allow."""
    limits = StimulationLimits(500, 1980, 900, 40)  # a change of 44 us from pulse to pulse
    limiter, widths = Limiter(limits, 180.0, 1000.0), []
    for _ in range(100):
        widths.append(limiter.allowed(1000.0))
        limiter.give(widths[-1])
    falls = -np.diff(widths)
    assert falls.max() > 44.0 + 1.0  # the charge is not exceeded for the sake of a slow fall
    assert np.convolve(widths, np.ones(45)).max() * 40.0 * 1e-3 <= 900.0 + 1e-9


WIDTHS = st.one_of(st.just(math.inf), st.floats(), st.floats(10.0, 5000.0))


@settings(max_examples=300, deadline=None)
@given(WIDTHS, WIDTHS, WIDTHS, st.floats(), st.floats(), st.floats(), st.lists(st.floats(), max_size=30))
def test_no_limits_and_no_muscle_that_can_be_built_give_a_width_above_their_limit(
    width, rate, charge, current, threshold, saturation, wanted
):
    try:
        limits = StimulationLimits(width, rate, charge, current)
        limiter = Limiter(limits, threshold, saturation)
    except InputError:
        return
    for each in [*wanted, 1e9]:
        given = limiter.allowed(each)
        limiter.give(given)
        assert given == 0.0 or threshold <= given <= min(width, saturation, 5000.0)


@settings(max_examples=300, deadline=None)
@given(
    st.floats(10.0, 5000.0),
    st.floats(20.0, 20_000.0),
    st.floats(5.0, 5000.0),
    st.floats(0.2, 200.0),
    st.floats(0.0, 1000.0),
    st.floats(10.0, 5000.0),
    st.lists(st.floats(0.0, 6000.0), max_size=120),
)
def test_sane_limits_hold_in_every_second(width, rate, charge, current, threshold, saturation, wanted):
    try:
        limiter = Limiter(StimulationLimits(width, rate, charge, current), threshold, saturation)
    except InputError:
        return
    widths = [0.0]
    for each in wanted:
        widths.append(limiter.allowed(each))
        limiter.give(widths[-1])
    second = np.convolve(widths, np.ones(45)).max() * current * 1e-3
    assert second <= charge * (1.0 + 1e-9) and max(widths) <= min(width, saturation)
    assert (np.diff(np.maximum(widths, threshold)) <= rate * PULSE_S + 1e-6).all()


@pytest.mark.parametrize("saturation", [6.7e8, 8000.0])
def test_a_muscle_whose_saturation_no_stimulator_gives_is_refused(saturation):
    model = ankle_of(replace(TWIN, saturation_us=saturation))
    with pytest.raises(InputError, match="saturation_us"):
        PositionController(model, 0.5)


def test_what_is_no_curve_is_refused():
    with pytest.raises(InputError, match="curve: expected a recruitment curve"):
        PulseWidth(180.0)


@pytest.mark.parametrize("load", [1000.0, -0.1, "0.5", math.nan])
def test_a_load_that_no_ankle_holds_is_refused(load):
    with pytest.raises(InputError, match="load"):
        PositionController(ankle_of(TWIN), load)


@pytest.mark.parametrize("ends", [(0.4, 0.6), (REST + 0.01, 2.8)])
def test_a_range_of_motion_that_does_not_hold_the_joint_at_rest_is_refused(ends):
    with pytest.raises(InputError, match=r"range_of_motion_rad: expected a range that holds the 1.62 rad at which"):
        PositionController(ankle_of(TWIN), 0.5, limits=StimulationLimits(range_of_motion_rad=ends))


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
