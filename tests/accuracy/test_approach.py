"""The sets by which least squares come near the data where the nominal model is far."""

import pytest
from harness.large import Large

import fes_pin as fp
from fes_pin.diagnosis.likelihood_models import LikelihoodModels
from fes_pin.models.nominal import nominal_model
from fes_pin.prepare.measured import split
from fes_pin.search.approach import approach
from fes_pin.search.likelihood_fits import WHITE


def study_of(seed, folder):
    return Large().make(next(Large().plan(seed)), folder)[0]


@pytest.mark.long
@pytest.mark.parametrize("seed", [929200, 929128])
def test_the_nearest_set_has_no_cause_that_the_others_replace(seed, tmp_path):
    """A joint that dry friction stops at once, tilted or pushed. A spring was tried before the friction, and stayed."""
    study = study_of(seed, tmp_path)
    sets = LikelihoodModels(nominal_model(study), split(study)[0], None, False, noise=WHITE)
    sets.nominal()
    friction, other = approach(sets)
    assert friction == "coulomb_friction" and other in ("base_tilt", "effort_offset", "sensor_offset")


@pytest.mark.long
def test_no_zero_by_trial_is_named_in_a_model_that_is_none(tmp_path):
    """A joint that dry friction stops in other places: the zeros of an effort differed, and E was 25 %."""
    found = fp.diagnose(study_of(929200, tmp_path))
    friction, other = sorted(found.causes, key=lambda c: c.name != "coulomb_friction")  # each gains about as much
    assert friction.name == "coulomb_friction" and found.extended_error[1] < 0.1
    assert {other.name, *other.equivalents} >= {"base_tilt", "sensor_offset"}
