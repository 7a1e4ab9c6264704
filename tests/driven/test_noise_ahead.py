"""What a right model is off by over a horizon is noise, and is told as such; what moves a rig unseen is no cause."""

from dataclasses import replace

import numpy as np
import pytest
from identify.test_likelihood import TRUE, believed, held

from fes_pin.diagnosis.errors_ahead import errors_ahead, noise_that_is_small, random_parts, squared_errors
from fes_pin.diagnosis.rejected import is_moved_by_what_is_recorded
from fes_pin.identify.likelihood import LikelihoodProblem
from fes_pin.identify.likelihood_fit import maximise
from fes_pin.identify.process_noise import first_guess
from fes_pin.infer.levels import SMALL_SHARE


def fitted_to(trials):
    model = believed()
    return maximise(LikelihoodProblem(model, trials, first_guess(model, trials)))


@pytest.fixture(scope="module")
def fitted():
    return fitted_to([held(k, 0.03) for k in range(4)])


@pytest.mark.parametrize("horizon_s", [0.1, 0.3])
def test_errors_of_a_right_model_are_those_of_noise(horizon_s, fitted):
    """Pieces as long as the horizon err together: their sum is within three of its own deviations."""
    found = squared_errors([(fitted, fitted, fitted.trials)], horizon_s)
    assert abs(found.squares.sum() - found.noise.sum()) < 3.0 * np.sqrt(found.scatter().sum())
    assert found.noise.sum() > 5.0 * sum(map(len, fitted.trials))
    told = errors_ahead([(fitted, fitted, fitted.trials)], horizon_s, falling=False)
    assert told.noise == pytest.approx(100.0 * found.noise.sum() / found.spread.sum(), rel=0.05)
    assert told.horizon == pytest.approx(100.0 * found.squares.sum() / found.spread.sum(), rel=0.05)


def test_a_random_effort_that_is_large_is_no_noise(fitted):
    assert noise_that_is_small(fitted) is fitted.noise
    large = replace(fitted, noise=fitted.noise.with_values({"std.effort": 3.0 * TRUE["weight"]}))
    (part,) = random_parts(replace(fitted, noise=noise_that_is_small(large)))
    assert part.share == pytest.approx(SMALL_SHARE)


def test_an_effort_that_did_not_move_the_rig_is_seen_not_to(fitted):
    """One of another task, or in another order; but one of half its size, or beside a large random one, is seen."""
    trials = fitted.trials
    assert is_moved_by_what_is_recorded(fitted)
    for scale, torque in ((0.5, 0.03), (1.0, 0.6)):
        weak = [held(k, torque) for k in range(2)]
        assert is_moved_by_what_is_recorded(fitted_to([t.with_columns(effort=scale * t["effort"]) for t in weak]))
    others = [t.with_columns(effort=held(k + 10, 0.03, slow=0.37)["effort"]) for k, t in enumerate(trials)]
    rng = np.random.default_rng(0)
    mixed = [t.with_columns(effort=rng.permutation(t["effort"])) for t in trials]
    assert not any(is_moved_by_what_is_recorded(fitted_to(some)) for some in (others, mixed))
    still = fitted_to([t.with_columns(effort=np.zeros(len(t))) for t in trials])
    assert not is_moved_by_what_is_recorded(still)
