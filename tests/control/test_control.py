"""Position control on a twin that shares no code with the controller's model: accuracy, robustness, limits, fatigue."""

import itertools
import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from paper_ankle.constants import paper_twin
from paper_ankle.ratios import ankle_of
from paper_ankle.twin import RunningTwin

from fes_pin.control.control import PositionController
from fes_pin.control.dynamics import PULSE_S, AnkleDynamics
from fes_pin.control.endurance import RESERVE, least_rest, muscle_budget, scheduled
from fes_pin.control.faults import Status
from fes_pin.control.loop import sine, steps, track
from fes_pin.control.pulse import PulseWidth
from fes_pin.control.reference import LOOKAHEAD
from fes_pin.data.errors import InputError
from fes_pin.models.effects.fatigue import Fatigue
from fes_pin.models.effects.recruitment_hysteresis import RecruitmentHysteresis
from fes_pin.models.model import Model
from fes_pin.models.rigs import Muscle
from fes_pin.muscles.recruitment import LinearRecruitment, SaturatingRecruitment

LOAD = 0.5
TWIN = replace(paper_twin("3-23"), load_kg=LOAD)
LOW = TWIN.rest_angle() + math.radians(1.0)
FATIGUE = {"rate_per_s": 0.068, "recovery_s": 60.0}
TIRING = replace(TWIN, fatigue_per_s=FATIGUE["rate_per_s"], recovery_s=FATIGUE["recovery_s"])
THRESHOLD, SATURATION = 180.0, 1000.0


@cache
def controller_parts(play=0.0):
    model = ankle_of(TWIN)
    return PositionController(model + RecruitmentHysteresis(half_width_us=play) if play else model, LOAD)


def fresh(play=0.0):
    """A controller as new, without tuning it anew."""
    controller = controller_parts(play)
    controller.reset()
    return controller


def changed(gain=1.0, tau=1.0, stiffness=1.0, **more):
    """A twin off by these factors; a stiffer one rests where it did, as the sensor shows before anything else."""
    f1, rest = TWIN.f1_per_rad * stiffness, TWIN.rest_angle() - TWIN.theta_r_rad
    f0 = TWIN.f0_n * math.expm1(TWIN.f1_per_rad * rest) / math.expm1(f1 * rest)
    off = {"gain": TWIN.gain * gain, "time_constant_s": TWIN.time_constant_s * tau, "f0_n": f0, "f1_per_rad": f1}
    return replace(TWIN, **off, **more)


def test_sine_of_fifteen_degrees_within_one_degree():
    assert track(fresh(), RunningTwin(TWIN), sine(LOW, 15.0, 0.5, 12.0)).rms_error_deg() <= 0.2


def test_sine_of_fifteen_degrees_to_each_side_within_one_degree_with_a_light_load():
    light = replace(TWIN, load_kg=0.2)
    controller = PositionController(ankle_of(light), 0.2)
    reference = sine(light.rest_angle() + math.radians(1.0), 30.0, 0.5, 12.0)
    assert track(controller, RunningTwin(light), reference).rms_error_deg() <= 0.4


@pytest.mark.parametrize("factors", list(itertools.product((0.7, 1.3), repeat=3)), ids=str)
def test_thirty_percent_off_in_gain_time_constant_and_stiffness(factors):
    run = track(fresh(), RunningTwin(changed(*factors)), sine(LOW, 15.0, 0.5, 10.0))
    assert run.rms_error_deg() <= 1.0
    assert run.rms_error_deg(start_s=4.0) <= 0.5


@pytest.mark.parametrize("gain", [0.7, 1.0, 1.3])
def test_the_gains_share_is_found(gain):
    run = track(fresh(), RunningTwin(changed(gain)), sine(LOW, 15.0, 0.5, 16.0))
    assert run.share[-1] == pytest.approx(gain, rel=0.05)


def test_steps_settle_on_their_level():
    run = track(fresh(), RunningTwin(TWIN), steps(LOW, (0.0, 5.0, 15.0, 8.0), 2.0))
    error = np.degrees(np.abs(run.reference_rad - run.angle_rad)).reshape(4, -1)
    assert error[:, 45:80].max() < 0.5


def test_a_single_number_as_reference_is_followed_late_by_the_lookahead():
    controller, joint = fresh(), RunningTwin(TWIN)
    reference, angles = sine(LOW, 15.0, 0.5, 10.0), []
    for wanted in reference.tolist():
        angles.append(joint.angle_rad)
        joint.step(controller.step(joint.angle_rad, wanted), PULSE_S)
    error = np.degrees(np.array(angles)[LOOKAHEAD:] - reference[:-LOOKAHEAD])
    assert np.sqrt(np.mean(error**2)) < 0.3


def test_play_is_undone():
    twin, reference = replace(TWIN, hysteresis_us=60.0), sine(LOW, 15.0, 0.5, 10.0)
    blind = track(fresh(), RunningTwin(twin), reference).rms_error_deg(2.0)
    aware = track(fresh(60.0), RunningTwin(twin), reference).rms_error_deg(2.0)
    assert aware < 0.2 and aware < 0.5 * blind


def test_no_windup_at_a_level_out_of_reach():
    reference = np.r_[np.full(225, LOW + math.radians(60.0)), np.full(135, LOW + math.radians(10.0))]
    run = track(fresh(), RunningTwin(changed(0.7)), reference)
    assert run.angle_rad[215] < LOW + math.radians(25.0)  # the muscle cannot
    error = np.degrees(np.abs(run.angle_rad - LOW) * 1.0) - 10.0
    assert np.abs(error[225 + 27 :]).max() < 1.0  # back on the level within 0.6 s


@pytest.mark.parametrize("factors", [(1.0, 1.0, 1.0), (1.3, 0.7, 1.3), (1.3, 0.7, 0.7), (0.7, 1.3, 1.3)], ids=str)
def test_square_waves_blind_no_one_and_alarm_no_one(factors):
    """A step that a model 30 % off did not expect is no spike, and following it is no oscillation."""
    controller = fresh()
    reference = np.tile(np.repeat([LOW + math.radians(10.0), LOW], 23), 8)
    run = track(controller, RunningTwin(changed(*factors)), reference)
    assert run.rms_error_deg() < 2.2 and run.angle_rad.max() < LOW + math.radians(18.0)
    assert controller.monitor.bad == 0.0 and controller.calm == 1.0 and controller.warning == ""
    assert controller.status is Status.RUNNING


def test_a_load_that_nobody_told_of_is_taken_up_within_two_seconds():
    run = track(fresh(), RunningTwin(replace(TWIN, load_kg=LOAD + 0.2)), np.full(270, LOW + math.radians(12.0)))
    assert np.degrees(np.abs(run.angle_rad - run.reference_rad))[90:].max() < 0.5


@pytest.mark.parametrize("kind", [np.float32, np.float64, np.array])
def test_readings_of_any_number_type_are_seen(kind):
    controller, joint, noise = fresh(), RunningTwin(TWIN), np.random.default_rng(0).normal(0.0, 2e-3, 135)
    for error in noise.tolist():
        joint.step(controller.step(kind(joint.angle_rad + error), kind(LOW + math.radians(8.0))), PULSE_S)
    assert joint.angle_rad == pytest.approx(LOW + math.radians(8.0), abs=math.radians(0.3))


def in_limits(width):
    return width == 0.0 or THRESHOLD <= width <= SATURATION


NUMBERS = st.one_of(st.floats(), st.floats(1.0, 2.5), st.none(), st.sampled_from([0, -1, 10**400]))
NO_NUMBERS = st.sampled_from(["1.9", True, [1.9], b"2", 2j])


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.tuples(st.one_of(NUMBERS, NO_NUMBERS), st.floats(-1.0, 4.0)), min_size=1, max_size=60),
    st.sampled_from([0.0, 60.0]),
)
def test_whatever_comes_in_a_width_is_allowed_or_the_input_is_refused_and_the_pulses_end(stream, play):
    controller, refused = fresh(play), False
    for angle, reference in stream:
        try:
            width = controller.step(angle, reference)
        except InputError:
            assert not refused  # once; then it is off and says nothing more
            refused = True
        else:
            assert isinstance(width, float) and in_limits(width)
    assert not refused or controller.status is Status.REFUSED


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10**6), st.floats(0.0, 0.5), st.floats(0.0, 0.3), st.sampled_from([0.0, 60.0]))
def test_limits_hold_in_closed_loop_with_dropouts_and_spikes(seed, lost, spiked, play):
    rng = np.random.default_rng(seed)

    def sensor(k, angle):
        if rng.random() < lost:
            return math.nan
        return angle + (np.clip(rng.standard_cauchy(), -4.0, 4.0) if rng.random() < spiked else 0.0)

    wild = np.clip(LOW + 0.4 * rng.standard_cauchy(120), 0.3, 2.8)
    run = track(fresh(play), RunningTwin(replace(TWIN, hysteresis_us=play)), wild, sensor=sensor)
    assert all(in_limits(w) for w in run.pulse_width_us) and np.isfinite(run.share).all()


def test_spikes_and_dropouts_do_not_spoil_the_tracking():
    rng = np.random.default_rng(4)

    def sensor(k, angle):
        chance = rng.random()
        return math.nan if chance < 0.05 else angle + rng.choice([-1.0, 1.0]) * 0.5 if chance < 0.07 else angle

    run = track(controller := fresh(), RunningTwin(TWIN), sine(LOW, 15.0, 0.5, 10.0), sensor=sensor)
    assert run.rms_error_deg() < 0.5 and controller.status is Status.RUNNING


@settings(max_examples=100, deadline=None)
@given(st.lists(st.one_of(st.floats(), st.floats(0.0, 1.0)), max_size=40), st.floats(0.1, 170.0))
def test_pulse_widths_with_play(wanted, half):
    for curve in (LinearRecruitment(), SaturatingRecruitment(THRESHOLD, SATURATION, 3.0)):
        pulse, followed = PulseWidth(curve, half), 0.0
        for r in wanted:
            width, made = pulse(r)
            assert in_limits(width)
            followed = min(max(followed, width - half), width + half)  # the nerve, written once more
            assert made == pytest.approx(float(curve.recruitment(followed)), abs=1e-12)
            within = half <= (SATURATION - THRESHOLD) / 4 and 0.3 < r < 0.6
            if within and type(curve) is LinearRecruitment:
                assert made == pytest.approx(r, abs=1e-9)


@pytest.mark.parametrize("half", [-1.0, math.nan, 180.0, 500.0])
def test_play_as_wide_as_the_threshold_is_refused(half):
    with pytest.raises(InputError, match=r"half.width"):
        PulseWidth(LinearRecruitment(), half)


def test_five_minutes_with_fatigue_to_sixty_percent():
    model, joint = ankle_of(TIRING) + Fatigue(**FATIGUE), RunningTwin(TIRING)
    reference = sine(LOW, 15.0, 0.5, 300.0)
    spending = muscle_budget(model, LOAD, reference)
    assert spending.respected and 0.58 < spending.capacity[-1] < 0.62
    controller = PositionController(model, LOAD)
    run = track(controller, joint, reference)
    assert joint.capacity == pytest.approx(spending.capacity[-1], abs=0.01)
    assert run.share[-1] == pytest.approx(joint.capacity, abs=0.03)
    assert run.rms_error_deg() <= 1.5 and run.rms_error_deg(240.0) <= 0.5 and controller.warning == ""


def test_warning_comes_before_the_joint_falls_short():
    model = ankle_of(TIRING) + Fatigue(**FATIGUE)
    reference = sine(LOW, 20.0, 0.5, 90.0)
    spending = muscle_budget(model, LOAD, reference)
    assert 5.0 < spending.short_at_s < 60.0
    controller, joint = PositionController(model, LOAD), RunningTwin(TIRING)
    warned, short = math.inf, math.inf
    for k in range(len(reference) - LOOKAHEAD):
        joint.step(controller.step(joint.angle_rad, reference[k : k + LOOKAHEAD + 1]), PULSE_S)
        if controller.warning:
            warned = min(warned, k * PULSE_S)
        held = joint.angle_rad - reference[k + 1]
        if k > 45 and math.degrees(held) < -1.0:
            short = min(short, k * PULSE_S)
    assert warned < short - 5.0


def test_rests_bring_a_schedule_within_the_budget():
    model = ankle_of(TIRING) + Fatigue(**FATIGUE)
    bout = sine(LOW, 19.0, 0.5, 20.0)
    rest = least_rest(model, LOAD, bout, 4)
    assert 0.0 < rest < 120.0
    low = AnkleDynamics.of(model, LOAD).rest_angle()
    kept = muscle_budget(model, LOAD, scheduled(bout, 4, rest, low))
    assert kept.respected and (kept.needed <= (1.0 - RESERVE) * kept.capacity).all()
    assert not muscle_budget(model, LOAD, scheduled(bout, 4, rest - 0.5, low)).respected


@pytest.mark.parametrize("capacity", [math.nan, -0.1, 1.5, "1"])
def test_a_capacity_that_is_none_is_no_budget(capacity):
    with pytest.raises(InputError, match=r"^capacity: "):
        muscle_budget(ankle_of(TIRING) + Fatigue(), LOAD, np.full(3, 1.8), capacity)


def test_bad_input_is_one_line():
    with pytest.raises(InputError, match="needs the rig ankle"):
        PositionController(Model(Muscle()), LOAD)
    with pytest.raises(InputError, match="load"):
        PositionController(ankle_of(TWIN), math.nan)
    with pytest.raises(InputError, match="effect fatigue"):
        muscle_budget(ankle_of(TWIN), LOAD, np.full(3, 1.8))
    with pytest.raises(InputError, match="finite angles"):
        muscle_budget(ankle_of(TIRING) + Fatigue(), LOAD, np.array([1.8, math.nan]))
    with pytest.raises(InputError, match="no rest"):
        least_rest(ankle_of(TIRING) + Fatigue(**FATIGUE), LOAD, sine(LOW, 60.0, 0.5, 4.0), 3)
    for bouts, rest_s in ((0, 1.0), (2.5, 1.0), (2, -1.0), (2, math.nan)):
        with pytest.raises(InputError):
            scheduled(sine(LOW, 15.0, 0.5, 4.0), bouts, rest_s, LOW)
    with pytest.raises(InputError, match="rad"):
        muscle_budget(ankle_of(TIRING) + Fatigue(), LOAD, np.degrees(sine(LOW, 15.0, 0.5, 4.0)))
