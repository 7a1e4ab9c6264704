"""Filters and splines: what they keep, what they take, and what they say of it."""

import numpy as np
import pytest
from scipy.signal import lfilter

from fes_pin.data.errors import InputError
from fes_pin.data.smooth import low_pass, rates, smoothed_rates

TIME = np.arange(400) / 100.0


def gain(frequency, cutoff):
    wave = np.sin(2 * np.pi * frequency * TIME)
    smooth = low_pass(wave, 0.01, cutoff)[100:-100]
    return (smooth @ wave[100:-100]) / (wave[100:-100] @ wave[100:-100])


def test_half_the_power_passes_at_the_cut_off_without_delay():
    assert gain(6.0, 6.0) == pytest.approx(np.sqrt(0.5), abs=0.01)
    assert gain(1.0, 6.0) == pytest.approx(1.0, abs=0.002)
    assert gain(20.0, 6.0) < 0.02
    wave = np.sin(2 * np.pi * 2.0 * TIME)
    smooth = low_pass(wave, 0.01, 6.0)
    assert np.argmax(np.correlate(smooth[100:-100], wave[100:-100], "full")) == 199


def test_a_cut_off_beyond_the_sample_rate_changes_nothing():
    wave = np.sin(TIME)
    assert np.array_equal(low_pass(wave, 0.01, 100.0), wave)


@pytest.mark.parametrize(("values", "cutoff", "words"), [(TIME, -1.0, "positive"), (TIME[:5], 6.0, "too few")])
def test_what_cannot_be_filtered_is_refused(values, cutoff, words):
    with pytest.raises(InputError, match=words):
        low_pass(values, 0.01, cutoff)


def test_splines_differentiate():
    first, second = rates(np.sin(3 * TIME)[:, None], TIME)
    assert np.abs(first[5:-5, 0] - 3 * np.cos(3 * TIME[5:-5])).max() < 1e-5
    assert np.abs(second[5:-5, 0] + 9 * np.sin(3 * TIME[5:-5])).max() < 1e-3


@pytest.mark.parametrize("noise", [1e-4, 1e-2])
def test_rates_of_a_reading_are_as_sure_as_they_say(noise):
    """At the ends as well, where a spline with a penalty has a bend of zero."""
    rng, time = np.random.default_rng(5), np.arange(2000) * 2e-3
    w = 2.0 * np.pi * 1.3
    truth = [np.sin(w * time + 0.4), w * np.cos(w * time + 0.4), -(w**2) * np.sin(w * time + 0.4)]
    found, doubt, bandwidth = smoothed_rates(truth[0] + noise * rng.standard_normal(len(time)), time)
    assert 1.3 < bandwidth < 8.0
    for value, true, std in zip(found, truth, doubt, strict=True):
        assert 0.4 < (value - true)[100:-100].std() / std < 2.5
        assert np.abs(value - true).max() < max(60.0 * std, 0.03 * np.ptp(true))


@pytest.mark.parametrize("seed", range(4))
def test_a_clock_that_is_late_for_some_samples_is_no_motion(seed):
    """A servo's counts, read 0.7 ms early or late for two or three rows of a log that is interpolated afterwards."""
    rng = np.random.default_rng(seed)
    logged = np.cumsum(rng.uniform(0.003, 0.007, 2000))
    late = 0.0007 * np.sqrt(1.0 - 0.5**2) * lfilter([1.0], [1.0, -0.5], rng.standard_normal(2000))
    time, count = np.arange(0.01, 6.0, 0.005), 2.0 * np.pi / 4096.0
    w, phase = 2.0 * np.pi * np.array([0.4, 1.1]), rng.uniform(0.0, 6.0, 2)
    reading = count * np.round(np.sin(np.outer(logged + late, w) + phase).sum(axis=1) / count)
    found, doubt, bandwidth = smoothed_rates(np.interp(time, logged, reading), time)
    true = -(w**2 * np.sin(np.outer(time, w) + phase)).sum(axis=1)
    wrong = (found[2] - true)[60:-60]
    assert 1.1 < bandwidth < 6.0
    assert wrong.std() < 0.03 * true.std()
    assert 0.4 < wrong.std() / doubt[2] < 2.5


def test_a_step_is_motion():
    """A quick release in noise that is white: knots for the step, whatever samples far apart would show."""
    rng, time = np.random.default_rng(3), np.arange(2000) * 1e-3
    step = 1e-3 / (1.0 + np.exp(-(time - 1.0) / 0.003))
    found, _, bandwidth = smoothed_rates(step + 1e-6 * rng.standard_normal(2000), time)
    assert bandwidth > 50.0
    assert np.abs(found[0] - step).max() < 2e-5
