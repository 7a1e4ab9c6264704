"""When a cause is named: what held-out trials say, what a refused certainty leaves, the share of a further cause."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from fes_pin.diagnosis.decide.claims import Claims
from fes_pin.diagnosis.free import is_supported, with_refused
from fes_pin.infer.held_out import added_likelihood, speaks_for
from fes_pin.infer.levels import CERTAIN_LEVEL
from fes_pin.infer.result import Cause, Evidence, Gain, Remainder


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


def test_evidence_adds_up_over_folds():
    total = sum((Evidence(50.0, 40.0), Evidence(60.0, 60.0)), Evidence(0.0, 0.0))
    assert (total.added, total.squares) == (110.0, 100.0)
    assert total.low == pytest.approx(110.0 - 2.0 * 1.959964 * 10.0, rel=1e-6)


def cause(p_value=1e-3, evidence=None, percent=50.0, low=10.0, stage="joint"):
    return Cause(
        name="one",
        stage=stage,
        parameters={},
        equivalents=(),
        p_value=p_value,
        gain_fit=50.0,
        gain_held_out=Gain(percent, low, 90.0),
        evidence=evidence,
    )


def test_held_out_trials_speak_by_likelihood_only_where_noise_is_all_that_is_left():
    sure, unsure = Evidence(100.0, 100.0), Evidence(10.0, 100.0)
    assert is_supported(cause(evidence=sure, low=-5.0), alone=True)
    assert not is_supported(cause(evidence=sure, low=-5.0), alone=False)
    assert is_supported(cause(evidence=sure, low=5.0), alone=False)
    assert not is_supported(cause(evidence=unsure, low=5.0), alone=True)
    assert is_supported(cause(evidence=sure, percent=-1.0, low=-5.0), alone=True)
    assert not is_supported(cause(evidence=unsure, percent=-1.0, low=-5.0), alone=True)
    assert is_supported(cause(low=5.0), alone=True) and not is_supported(cause(low=-5.0), alone=True)
    assert is_supported(cause(low=5.0), alone=False)


def test_no_cause_is_named_that_is_sure_to_do_harm():
    """Over the horizon, a reading of an upright pendulum that was told early made errors larger by 8 to 32 %."""
    sure = Evidence(100.0, 100.0)
    assert speaks_for(sure, Gain(-20.0, -32.0, 1.0), alone=True)
    assert not speaks_for(sure, Gain(-20.0, -32.0, -8.0), alone=True)


def test_a_refused_certainty_is_a_remainder():
    nothing = Remainder(unexplained=False, p_value=0.4, where=None)
    certain = cause(p_value=CERTAIN_LEVEL / 10.0, stage="muscle")
    left = with_refused(nothing, [cause(p_value=1e-4), certain])
    assert left.unexplained and left.where == "muscle" and left.p_value == certain.p_value
    assert with_refused(nothing, [cause(p_value=1e-4)]) is nothing
    found = replace(nothing, unexplained=True, where="time")
    assert with_refused(found, [certain]) is found


@pytest.mark.parametrize(
    ("whitened", "plain", "share"),
    [((0.0, -900.0, -1000.0), (0.0, -10.0, -1000.0), 0.99), ((0.0, -990.0, -1000.0), (0.0, -990.0, -1000.0), 0.01)],
)
def test_the_share_of_a_further_cause_is_of_the_likelihood_or_of_the_errors(whitened, plain, share):
    fits = {
        n: SimpleNamespace(sse=w, plain=p) for n, w, p in zip(((), ("a",), ("a", "b")), whitened, plain, strict=True)
    }
    claims = Claims.__new__(Claims)
    claims.sets = SimpleNamespace(fits=fits)
    assert claims.share(("a", "b"), ("a",)) == pytest.approx(share)
