"""When a controller may be called: late calls, bursts and clocks that are set; limits hold by the time that passes."""

import math
import sys
from dataclasses import replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from paper_ankle.constants import paper_twin
from paper_ankle.ratios import ankle_of
from paper_ankle.twin import RunningTwin

from fes_pin.control.control import PositionController
from fes_pin.control.dynamics import PULSE_S
from fes_pin.control.faults import Status
from fes_pin.control.pulse import PulseWidth, StimulationLimits
from fes_pin.control.timing import NEAR_S, PulseClock
from fes_pin.data.errors import InputError
from fes_pin.muscles.recruitment import LinearRecruitment

sys.path.insert(0, str(Path(__file__).parents[2] / "scripts"))
import control_safety

TWIN = replace(paper_twin("3-23"), load_kg=0.5)
REST = TWIN.rest_angle()
UP = REST + math.radians(12.0)
LIMITS = StimulationLimits(charge_uc_per_s=700.0, current_ma=40.0)
"""Of charge; 10 degrees take 800 uC in a second."""


@cache
def made(limits=None):
    return PositionController(ankle_of(TWIN), 0.5, limits=limits)


def fresh(limits=None):
    controller = made(limits)
    controller.reset()
    return controller


def called(controller, times, stated=True):
    """The widths of calls at these times, with the joint that they move; the controller's own errors are not caught."""
    joint, widths, lasts = RunningTwin(TWIN), [], (0.0, 0.0)
    for now, gap in zip(times, np.diff(times, append=times[-1] + PULSE_S), strict=True):
        widths.append(controller.step(joint.angle_rad, [UP], float(now) if stated else None))
        lasts = control_safety.pulsed(joint, (widths[-1], PULSE_S) if widths[-1] else lasts, gap)
    return np.array(widths)


@pytest.fixture
def clock(monkeypatch):
    """The computer's clock, set by hand."""
    now = SimpleNamespace(s=1e4)
    monkeypatch.setattr("fes_pin.control.timing.time", SimpleNamespace(monotonic=lambda: now.s))
    return now


def test_a_call_that_is_late_and_the_next_that_is_not_are_pulses():
    """It was refused until reset."""
    times = np.arange(90) * PULSE_S
    times[60] += 0.012
    controller = fresh()
    widths = called(controller, times)
    assert controller.status is Status.RUNNING and (widths[55:] > 0.0).all()


@pytest.mark.parametrize("seed", range(5))
def test_a_mean_of_45_hz_with_jitter_of_5_ms_is_not_refused(seed):
    """It was after 26 to 167 calls."""
    gaps = np.maximum(PULSE_S + np.random.default_rng(seed).normal(0.0, 5e-3, 450), 1e-4)
    controller = fresh()
    widths = called(controller, np.cumsum(gaps))
    assert controller.status is Status.RUNNING and np.mean(widths[100:] > 0.0) > 0.95


@pytest.mark.parametrize("late_s", [0.05, 0.1, 0.13])
@pytest.mark.parametrize("caught_up", [True, False], ids=["caught up", "left out"])
def test_a_program_that_was_held_up_goes_on(late_s, caught_up):
    """The joint falls meanwhile, and the model of the controller with it; no fault."""
    times = np.arange(200) * PULSE_S
    held_up = (times > times[100]) & (times < times[100] + late_s)
    times = np.where(held_up, times[100] + late_s, times) + 1e-4 * np.arange(200) if caught_up else times[~held_up]
    controller = fresh()
    called(controller, times)
    assert controller.status is Status.RUNNING and controller.calm == 1.0


@pytest.mark.parametrize("when", [math.nan, math.inf, "1", True])
def test_a_time_that_is_none_is_refused_once(when):
    controller, times = fresh(), np.arange(60) * PULSE_S
    before = called(controller, times)
    with pytest.raises(InputError, match=r"^time_s: "):
        controller.step(UP, [UP], when)
    assert controller.status is Status.RUNNING and before[-1] > 0.0
    assert controller.step(UP, [UP], float(times[-1]) + PULSE_S) > 0.0


@pytest.mark.parametrize("gap", [0.0, 0.2 * PULSE_S])
def test_a_call_that_is_too_near_gives_no_pulse_and_the_next_does(gap):
    controller, times = fresh(), np.arange(60) * PULSE_S
    called(controller, times)
    state = list(controller.observer.x)
    assert controller.step(UP, [UP], float(times[-1]) + gap) == 0.0
    assert controller.observer.x == state  # nothing goes on
    assert controller.step(UP, [UP], float(times[-1]) + PULSE_S) > 0.0 and controller.status is Status.RUNNING


def test_a_clock_that_is_set_back_is_a_pause():
    controller, times = fresh(), np.arange(60) * PULSE_S
    called(controller, times)
    assert controller.step(UP, [UP], float(times[-1]) - 1.0) == 0.0 and controller.status is Status.WAITING


@pytest.mark.parametrize("stated", [True, False])
@pytest.mark.parametrize("hz", [50.0, 60.0, 100.0, 1000.0])
def test_calls_too_fast_for_long_are_an_error_and_then_the_right_ones_are_pulses_again(clock, hz, stated):
    controller, begin, errors = fresh(LIMITS), clock.s, []
    for k in range(round(8.0 * hz)):
        clock.s = begin + k / hz
        try:
            controller.step(REST, [REST], clock.s if stated else None)
        except InputError as error:
            errors.append(clock.s - begin)
            assert str(error).startswith("time_s: expected one call per pulse")
    assert errors and errors[0] < 6.0
    assert controller.status is Status.RUNNING
    for _ in range(200):
        clock.s += PULSE_S
        controller.step(REST, [REST], clock.s if stated else None)


def test_a_clock_that_stands_still_is_an_error(clock):
    controller = fresh()
    with pytest.raises(InputError, match="time_s: expected one call per pulse"):
        for _ in range(200):
            controller.step(REST, [REST], 1.0)


@pytest.mark.parametrize("stated", [True, False])
@pytest.mark.parametrize("hz", [40.0, 45.0, 47.0, 60.0, 100.0, 200.0])
def test_no_second_holds_more_charge_than_its_limit_however_fast_the_calls(clock, hz, stated):
    """Without stated times 100 calls a second gave 808 uC of 700."""
    controller, joint, times, widths, lasts = fresh(LIMITS), RunningTwin(TWIN), [], [], (0.0, 0.0)
    for k in range(round(4.0 * hz)):
        clock.s += 1.0 / hz
        times.append(1.0 / hz * k)
        try:
            widths.append(controller.step(joint.angle_rad, [UP], clock.s if stated else None))
        except InputError:
            widths.append(0.0)
        lasts = control_safety.pulsed(joint, (widths[-1], PULSE_S) if widths[-1] else lasts, 1.0 / hz)
    times, widths = np.array(times), np.array(widths)
    assert control_safety.passed(times, widths, LIMITS) == [] and (widths > 0.0).sum() > 50
    assert np.diff(times[widths > 0.0]).min() > NEAR_S


def test_a_simulation_without_limits_of_charge_or_rate_needs_no_times(clock):
    """It runs as fast as it can: the clock stands still."""
    controller, joint = fresh(), RunningTwin(TWIN)
    for _ in range(200):
        joint.step(controller.step(joint.angle_rad, [UP]), PULSE_S)
    assert joint.angle_rad == pytest.approx(UP, abs=math.radians(0.3))


def test_no_schedule_of_a_thousand_is_refused_and_none_passes_a_limit():
    """Whatever the muscle is asked for in each: nothing up to some moment, then everything that is allowed."""
    curve, near = LinearRecruitment(180.0, 1000.0), 0.0
    for seed in range(1000):
        rng = np.random.default_rng([seed, 80])
        limits = StimulationLimits(
            pulse_width_us=rng.uniform(300.0, 1000.0),
            rate_us_per_s=rng.uniform(2000.0, 20_000.0),
            charge_uc_per_s=rng.uniform(450.0, 1500.0),
            current_ma=40.0,
        )
        when, begin, now, widths = control_safety.calls(rng, 4.0), rng.uniform(0.2, 2.0), [0.0], []
        clock, pulse = PulseClock(True), PulseWidth(curve, 0.0, limits)
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr("fes_pin.control.timing.time", SimpleNamespace(monotonic=lambda now=now: now[0]))
            for k, true_s in enumerate(when.true_s.tolist()):
                now[0] = true_s
                call = clock.take(None if when.stated_s is None else when.stated_s[k])  # no InputError
                if call is None:
                    widths.append(0.0)
                    continue
                pulse.limiter.wait(call[0])
                widths.append(pulse(1.0 if true_s > begin else 0.0)[0])
        assert control_safety.passed(when.true_s, widths, limits) == []
        total = np.r_[0.0, np.cumsum(widths)]
        second = total[np.searchsorted(when.true_s, when.true_s + 1.0)] - total[:-1]
        near = max(near, 0.04 * second.max() / limits.charge_uc_per_s)
    assert 0.97 < near <= 1.0  # and what a limit allows is given


@pytest.mark.parametrize("seed", range(12))
def test_a_slice_of_the_schedules_is_not_stopped(seed):
    outcome = control_safety.called(seed, 6.0)
    assert outcome.refused == 0 and outcome.passed == () and outcome.faults == ()
