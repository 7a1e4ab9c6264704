"""When a cause is named: what held-out trials say of it."""

import numpy as np
import pytest

from fes_pin.infer.held_out import added_likelihood, is_supported
from fes_pin.infer.result import Evidence, Gain


def test_evidence_covers_what_the_difference_is_worth():
    """97.5 % of the lower ends lie below |Delta|^2 where the extended model leaves white noise."""
    rng, size, runs = np.random.default_rng(0), 12.0, 2000
    difference = rng.standard_normal(500)
    difference *= size / np.linalg.norm(difference)
    below = 0
    for _ in range(runs):
        noise = rng.standard_normal(500)
        found = added_likelihood(noise + difference, noise)
        assert found.squares == pytest.approx(size**2)
        below += found.low < size**2
    assert below / runs == pytest.approx(0.975, abs=0.012)


def test_evidence_against_a_cause_that_only_fits_noise():
    """A difference that noise has nothing to do with costs its own square."""
    rng = np.random.default_rng(1)
    noise, difference = rng.standard_normal(4000), 0.1 * rng.standard_normal(4000)
    assert added_likelihood(noise, noise - difference).low < 0.0


def test_evidence_scatters_by_twice_the_root_of_its_squares():
    assert Evidence(110.0, 100.0).low == pytest.approx(110.0 - 2.0 * 1.959964 * 10.0, rel=1e-6)


def test_held_out_trials_speak_by_likelihood_only_where_noise_is_all_that_is_left():
    sure, unsure = Evidence(100.0, 100.0), Evidence(10.0, 100.0)
    harmful, harmless, useless = Gain(50.0, -5.0, 90.0), Gain(50.0, 5.0, 90.0), Gain(-1.0, -5.0, 90.0)
    assert is_supported(sure, harmful, alone=True) and not is_supported(sure, harmful, alone=False)
    assert is_supported(sure, harmless, alone=False)
    assert not is_supported(unsure, harmless, alone=True)
    assert is_supported(sure, useless, alone=True) and not is_supported(unsure, useless, alone=True)
    assert is_supported(None, harmless, alone=True) and not is_supported(None, harmful, alone=True)
    assert is_supported(None, harmless, alone=False)


def test_no_cause_is_named_that_is_sure_to_do_harm():
    """Over the horizon, a reading of an upright pendulum that was told early made errors larger by 8 to 32 %."""
    sure = Evidence(100.0, 100.0)
    assert is_supported(sure, Gain(-20.0, -32.0, 1.0), alone=True)
    assert not is_supported(sure, Gain(-20.0, -32.0, -8.0), alone=True)
