"""Inverse dynamics names what is hidden in an arm that another integrator simulated, and says where it cannot."""

import numpy as np
import pytest
from bench import DAMPING, study, trial
from harness.effort_alone import NO_EFFORT, REJECTED, search_effort

from fes_pin.data.errors import InputError
from fes_pin.effort.columns import presliding
from fes_pin.effort.motion import Band, Motion, Record, band_of, deviation_of, kernel


def inside(estimate, true):
    low, high = estimate.interval
    return low <= true <= high


def answer(folder, **hidden):
    return search_effort(study(folder, [trial(seed, **hidden) for seed in range(3)]))


@pytest.mark.parametrize("count", [0.0, 2e-3])
def test_nothing_is_named_where_nothing_is_hidden(tmp_path, count):
    """Counts of 2 mrad are a thousand on the way: without a band they would halve the inertia."""
    found = answer(tmp_path, count=count)
    assert (found.verdict, found.causes, found.refusal) == ("adequate", (), None)
    assert found.extended["inertia_scale"].value == pytest.approx(1.0, abs=0.01)
    assert found.extended["damping"].value == pytest.approx(DAMPING, rel=0.1)


@pytest.mark.parametrize("count", [0.0, 2e-3])
def test_friction_is_named_with_its_size(tmp_path, count):
    found = answer(tmp_path, friction=0.1, count=count)
    assert [c.name for c in found.causes] == ["coulomb_friction"]
    assert found.causes[0].parameters["torque_nm"].value == pytest.approx(0.1, rel=0.05)
    assert found.extended["damping"].value == pytest.approx(DAMPING, rel=0.25)


def test_two_causes_are_named_with_intervals_that_hold_them(tmp_path):
    found = answer(tmp_path, friction=0.1, offset=0.08)
    by_name = {c.name: c for c in found.causes}
    assert set(by_name) == {"coulomb_friction", "effort_offset"}
    assert inside(by_name["effort_offset"].parameters["offset"], 0.08)
    assert inside(found.extended["inertia_scale"], 1.0)
    assert all(c.p_value < 1e-3 and c.gain_held_out.low > 0.0 for c in found.causes)


def test_drag_is_not_taken_for_friction_of_another_form(tmp_path):
    found = answer(tmp_path, friction=0.1, drag=0.05)
    assert {c.name for c in found.causes} == {"coulomb_friction", "quadratic_damping"}


def test_a_frame_that_swings_has_the_parameters_of_the_catalogue(tmp_path):
    """Its coupling is not small: the mode that the effort of a motion shows is 10 % slower than that of the frame."""
    found = answer(tmp_path, frame=(0.2, 3.5, 0.05))
    assert [c.name for c in found.causes] == ["frame_vibration"]
    for name, true in (("coupling", 0.2), ("frequency_hz", 3.5), ("damping_ratio", 0.05)):
        assert inside(found.causes[0].parameters[name], true)
    assert found.causes[0].parameters["frequency_hz"].value == pytest.approx(3.5, rel=0.02)
    assert found.extended["inertia_scale"].value == pytest.approx(1.0, abs=0.01)


def test_a_play_is_crossed_from_rest(tmp_path):
    found = answer(tmp_path, play=0.004)
    assert [c.name for c in found.causes] == ["backlash"]
    assert found.causes[0].parameters["half_width"].value == pytest.approx(0.004, rel=0.1)
    assert found.extended["inertia_scale"].value == pytest.approx(1.0, abs=0.005)


def test_a_study_without_efforts_is_rejected_in_words(tmp_path):
    free = [trial(seed).without("effort") for seed in range(2)]
    found = search_effort(study(tmp_path, free))
    assert (found.verdict, found.refusal, found.causes) == (REJECTED, NO_EFFORT, ())


def test_a_motion_below_the_noise_is_an_error(tmp_path):
    one = trial(0)
    still = one.with_columns(position=1e-3 * np.random.default_rng(0).standard_normal(len(one)))
    with pytest.raises(InputError, match="not above the noise"):
        search_effort(study(tmp_path, [still]))


def test_kernels_differentiate_what_they_smooth():
    """A parabola keeps its slope and bend, and an effort that acts late is that of the time before."""
    dt, at = 0.002, np.arange(-400, 401) * 0.002
    signal = 1.0 + 2.0 * at + 3.0 * at**2
    for order, expected in ((1, 2.0), (2, 6.0)):
        weights = kernel(order, deviation_of(5.0), dt)
        half = len(weights) // 2
        assert signal[400 - half : 401 + half] @ weights == pytest.approx(expected, rel=1e-6)
    late, lagging = kernel(0, deviation_of(5.0), dt, late=0.01), kernel(0, deviation_of(5.0), dt, lag=0.01)
    for weights in (late, lagging):
        half = len(weights) // 2
        assert at[400 - half : 401 + half] @ weights == pytest.approx(-0.01, rel=0.05)


def test_friction_builds_up_over_its_way_and_turns_with_the_motion():
    q = np.concatenate([np.linspace(0.0, 1.0, 200), np.linspace(1.0, 0.0, 200)])
    share = presliding(q, 0.1)
    assert share[20] == pytest.approx(1.0 - np.exp(-q[20] / 0.1), rel=1e-6)
    assert share[199] == pytest.approx(1.0, abs=1e-4) and share[-1] == pytest.approx(-1.0, abs=1e-3)
    assert share[220] == pytest.approx(-1.0 + 2.0 * np.exp(-(q[199] - q[220]) / 0.1), abs=0.01)


def test_the_band_narrows_where_an_encoder_is_coarse():
    def band(count):
        one = trial(0, count=count)
        return band_of([Record.of(one)])

    assert band(5e-3).low < band(0.0).low


def test_a_joint_that_is_held_still_says_nothing_of_its_friction():
    """Friction balances any torque of a joint that stands: rows of rest are left out, those of a reversal are not."""
    still = np.sin(np.linspace(0.0, 6.0 * np.pi, 1500))
    stopped = np.concatenate([still, np.full(1500, still[-1]), still])
    record = Record("a", np.arange(len(stopped)) * 0.004, stopped, stopped, "motion")
    track = Motion(record, Band(4.0, 16.0))
    rests = track.resting(3.0)
    inside = (track.rows > 1600) & (track.rows < 2900)
    assert rests[inside].all() and not rests[(track.rows < 1400) | (track.rows > 3100)].any()
