"""What an adequate model says of absent causes: from which size on each would have been named."""

import pytest
from diagnosis.hidden import diagnosed, study_of

from fes_pin.diagnosis.diagnosis import diagnose_joint
from fes_pin.infer.distributions import normal_quantile
from fes_pin.infer.family import least_seen
from fes_pin.infer.levels import CLAIM_LEVEL, SEEN_POWER

CAUSE, SIZE = "coulomb_friction", "torque_nm"


@pytest.fixture(scope="module")
def least():
    """The size of friction above which a study of the same kind says that it would have been seen."""
    return diagnosed("joint").seen[CAUSE]


def test_one_test_at_a_level_needs_both_quantiles():
    alone = normal_quantile(1.0 - 0.5 * CLAIM_LEVEL) + normal_quantile(SEEN_POWER)
    assert least_seen(CLAIM_LEVEL, 1.0) == pytest.approx(alone) and least_seen(CLAIM_LEVEL, 50.0) > alone


@pytest.mark.parametrize("seed", range(1, 4))
@pytest.mark.parametrize(("share", "named"), [(1.5, True), (0.2, False)])
def test_a_cause_above_that_size_is_named_and_one_far_below_is_not(least, share, named, seed):
    """By the independent simulator, with other inputs and noise."""
    study = study_of("joint", lambda *_: {CAUSE: {SIZE: share * least.value}}, seed=seed)
    sets = [{c.name, *c.equivalents} for c in diagnose_joint(study).causes]
    assert any(CAUSE in names for names in sets) is named


def test_no_other_verdict_says_so(least):
    assert least.unit == "N m" and not diagnosed("joint", (CAUSE,)).seen
    assert "absent (would have been seen in 95 of 100 beyond)" in str(diagnosed("joint"))
