"""Large causes of joints that run out, of one trial, of twitches on a resting force: fits begin far from the data."""

from itertools import islice

import pytest
from harness.large import Large

import fes_pin as fp

FOUND = {
    15: {"coulomb_friction"},  # a joint that runs out: damping and inertia are known by their ratio alone
    23: {"quadratic_damping"},  # the same, without noise
    63: {"quadratic_damping"},
    64: {"coulomb_friction"},  # one swing, read in counts; then the joint rests, which identifies nothing
    45: {"threshold_shift", "coulomb_friction"},  # first fits end where the ankle has no inertia
    98: {"sensor_offset", "second_order_activation", "electromechanical_delay"},  # twitches on a resting force
    322: {"sensor_offset", "second_order_activation"},  # without noise: a lag of the sensor does the same
    9088: {"passive_relaxation"},  # one swing: half of it would begin with a stretch that no reading shows
}
"""What is hidden in a study, by its number."""
NULLS = (21, 28, 327)
"""Studies in which nothing is hidden: an end that bends, no noise, readings in counts."""


@pytest.fixture
def study_of(tmp_path):
    large = Large()
    return lambda number: large.make(next(islice(large.plan(number), 1)), tmp_path)[0]


@pytest.mark.parametrize("number", FOUND)
def test_what_is_hidden_is_found(number, study_of):
    found = fp.diagnose(study_of(number))
    sets = [{c.name, *c.equivalents} for c in found.causes]
    assert len(sets) == len(FOUND[number]) and all(any(n in s for s in sets) for n in FOUND[number])


@pytest.mark.parametrize("number", NULLS)
def test_nothing_is_found_where_nothing_is_hidden(number, study_of):
    assert fp.diagnose(study_of(number)).verdict == "adequate"
