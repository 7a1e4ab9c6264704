"""Faults end the pulses and keep them off; normal use does not. Slices of scripts/control_safety.py, single rules."""

import math
import sys
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from paper_ankle.constants import paper_twin
from paper_ankle.ratios import ankle_of
from paper_ankle.twin import RunningTwin

from fes_pin.control.control import START_READINGS, PositionController
from fes_pin.control.dynamics import PULSE_S
from fes_pin.control.faults import BAD_READINGS, CLIP, FALSE_STOPS_PER_HOUR, WINDOW, FaultMonitor, Status, most_repeats
from fes_pin.control.loop import sine, track
from fes_pin.data.errors import InputError

sys.path.insert(0, str(Path(__file__).parents[2] / "scripts"))
import control_safety

TWIN = replace(paper_twin("3-23"), load_kg=0.5)
REST = TWIN.rest_angle()
WAVE = sine(REST, 15.0, 0.5, 8.0)
RAMP = 9
"""Pulses of the ramp."""


@cache
def made():
    return PositionController(ankle_of(TWIN), 0.5)


def fresh():
    controller = made()
    controller.reset()
    return controller


@pytest.mark.parametrize("kind", list(control_safety.KINDS))
@pytest.mark.parametrize("seed", [11, 12])
def test_a_slice_of_the_faults_is_found_and_off(kind, seed):
    outcome = control_safety.fault(kind, seed)
    assert math.isfinite(outcome.off_s) and not outcome.early and outcome.status != "RUNNING"


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_slice_of_normal_use_is_not_stopped(seed):
    bout = control_safety.normal(seed, 60.0)
    assert bout.status == "RUNNING" and bout.surprise < 1.0


@pytest.mark.parametrize("seed", [1, 2])
def test_a_slice_of_whatever_callers_do_gives_no_width_that_must_not_be(seed):
    """Shared observers, pauses, slips of units, readings, references and times that are none."""
    outcome = control_safety.abused(seed, 800)
    assert outcome.wrong == () and outcome.steps == 1600


@pytest.mark.parametrize("reading", [math.nan, None, 0.2, 3.0, REST + 0.3])
def test_no_pulse_before_a_valid_reading(reading):
    controller = fresh()
    controller.follow(WAVE)
    assert not any(controller.step(reading) for _ in range(300))
    assert controller.status is Status.WAITING


def test_the_first_pulse_comes_after_readings_in_a_row():
    controller, widths = fresh(), []
    controller.follow(np.full(60, REST + 0.2))
    for k in range(30):
        widths.append(controller.step(math.nan if k == 3 else REST + 1e-3 * (k % 3)))
    assert not any(widths[: 3 + START_READINGS]) and all(widths[3 + START_READINGS : 3 + START_READINGS + 5])


@pytest.mark.parametrize(
    ("broken", "status", "within"),
    [
        (lambda k, a: math.nan, Status.MISSING, BAD_READINGS),
        (lambda k, a: 100.0 * a, Status.IMPOSSIBLE, BAD_READINGS),
        (lambda k, a: math.inf, Status.IMPOSSIBLE, BAD_READINGS),
        (lambda k, a: a + 0.3, Status.JUMPING, BAD_READINGS),
        (lambda k, a: math.nan if k % 2 else a, Status.MISSING, 4 * BAD_READINGS),
    ],
)
def test_faults_of_the_sensor_are_named_within_pulses_ramp_down_and_stay_off(broken, status, within):
    controller, start, named = fresh(), 90, []

    def sensor(k, angle):
        named.append(controller.status)
        return broken(k, angle) if k >= start else angle

    widths = track(controller, RunningTwin(TWIN), WAVE, sensor=sensor).pulse_width_us
    found = named.index(status) - 1  # seen at the next pulse
    assert start <= found < start + within and controller.status is status
    ramp = widths[found : found + RAMP]
    assert (np.diff(widths[found - 1 : found + RAMP]) < 0.0).all() and ramp[-2] >= 180.0
    assert not widths[found + RAMP - 1 :].any()
    # off until reset, whatever comes in
    assert controller.step(REST) == 0.0 == controller.step("x", math.nan)
    controller.reset()
    assert controller.status is Status.WAITING
    again = track(controller, RunningTwin(TWIN), WAVE)
    assert controller.status is Status.RUNNING and again.rms_error_deg(1.0) < 0.3


def test_a_frozen_reading_is_named_within_the_pulses_that_noise_allows():
    controller, held = fresh(), []

    def sensor(k, angle):
        held.append(angle)
        return held[min(k, 200)]

    run = track(controller, RunningTwin(TWIN), np.full(300, REST + math.radians(8.0)), sensor=sensor)
    assert controller.status is Status.FROZEN
    assert not run.pulse_width_us[200 + math.ceil(controller.monitor.repeats_allowed) + RAMP :].any()


def test_repeats_come_as_rarely_as_stated():
    """Rate of runs as long as allowed, from the simulated chance that a quantized reading comes again."""
    rng, noise, step = np.random.default_rng(0), 2e-3, 1e-3
    shown = np.round(rng.normal(0.0, noise, 400_000) / step)
    again = float(np.mean(shown[1:] == shown[:-1]))
    runs = most_repeats(noise, step)
    assert again ** (runs - 1) * 3600.0 / PULSE_S < FALSE_STOPS_PER_HOUR
    assert most_repeats(noise, 0.0) == BAD_READINGS and most_repeats(noise, 0.02) == math.inf


def test_innovations_of_noise_alone_pass_the_limit_as_rarely_as_stated():
    """Times an hour that a window of noise does, by importance sampling: wide draws, each with its weight.

    Without clipping it is the stated rate, within four standard errors of some 0.3 %; clipping leaves an eighth.
    """
    limit = FaultMonitor(made().dynamics, (0.3, 2.8), 2e-3, 1e-3).limit
    draws, wide = np.random.default_rng(1).normal(0.0, 3.0, (1_000_000, WINDOW)), 3.0
    weight = np.exp(WINDOW * math.log(wide) - 0.5 * (draws**2).sum(axis=1) * (1.0 - wide**-2)) * 3600.0 / PULSE_S
    rates = []
    for clip in (math.inf, CLIP):
        hits = weight * ((np.minimum(np.abs(draws), clip) ** 2).sum(axis=1) > limit)
        rates.append((float(hits.mean()), float(hits.std() / math.sqrt(len(hits)))))
    (plain, error), (clipped, _) = rates
    assert error < 0.005 * FALSE_STOPS_PER_HOUR
    assert plain == pytest.approx(FALSE_STOPS_PER_HOUR, abs=4.0 * error)
    assert 0.1 * FALSE_STOPS_PER_HOUR < clipped < 0.15 * FALSE_STOPS_PER_HOUR


def test_the_rate_of_false_stops_has_the_interval_of_a_count():
    """Garwood's exact interval: none in 10 hours is below 0.30 an hour, one in 10 hours 0.0025 to 0.56."""
    assert control_safety.per_hour(0, 10.0) == pytest.approx((0.0, 0.2996), abs=1e-4)
    assert control_safety.per_hour(1, 10.0) == pytest.approx((0.00253, 0.5572), abs=1e-4)


@pytest.mark.parametrize("angle", ["1.9", [1.9], np.array([1.9]), True, np.True_, b"1", 2j, 105.0, -math.inf])
def test_what_is_no_reading_is_refused_in_one_line_and_nothing_is_stimulated_after(angle):
    controller = fresh()
    with pytest.raises(InputError, match=r"^angle_rad: expected .* in rad.*, found [^\n]*$"):
        controller.step(angle, REST + 0.2)
    assert controller.status is Status.REFUSED and controller.step(REST, REST + 0.2) == 0.0


@pytest.mark.parametrize(
    "reference", [100.0, 1e8, math.nan, "1.8", True, [1.8, math.nan], [1.8, "1"], [], np.full((2, 2), 1.8), {}]
)
def test_what_is_no_reference_is_refused_in_one_line(reference):
    controller = fresh()
    for _ in range(20):
        controller.step(REST, [REST])
    with pytest.raises(InputError, match=r"^reference_rad[^\n]*expected[^\n]*$"):
        controller.step(REST, reference)
    assert controller.status is Status.REFUSED and not any(controller.step(REST, REST) for _ in range(20))


@pytest.mark.parametrize(
    ("row", "where"), [([1.8, 95.0], r"pulse 1: .*found 95.0 \(degrees\?\)"), (1.8, "a row"), ("12", "a row")]
)
def test_a_trajectory_is_checked_before_anything_moves(row, where):
    controller = fresh()
    with pytest.raises(InputError, match=where):
        controller.follow(row)
    assert controller.status is Status.WAITING


def test_single_outliers_do_not_stop():
    def sensor(k, angle):
        return angle + math.radians(6.0) if k in {90, 140, 200} else angle

    track(controller := fresh(), RunningTwin(TWIN), WAVE, sensor=sensor)
    assert controller.status is Status.RUNNING


def test_every_fault_has_words():
    assert len({str(s) for s in Status}) == len(Status) and all(len(str(s)) > 5 for s in Status)
    assert not Status.WAITING.is_fault and not Status.RUNNING.is_fault and Status.SWINGING.is_fault
