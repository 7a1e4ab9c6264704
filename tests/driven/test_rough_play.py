"""A play, whose likelihood is rough: fits end hundreds apart by rounding, and what they differ by is no cause."""

import pytest
from driven_rigs.draw import draw

from fes_pin.data.study import read_study
from fes_pin.diagnose.diagnosis import diagnose_joint
from fes_pin.diagnose.search.likelihood_fits import LikelihoodFits
from fes_pin.identify.roughness import roughness
from fes_pin.models.effects import Backlash, QuadraticDamping
from fes_pin.models.nominal import nominal_model


@pytest.mark.rounding
def test_nothing_is_named_or_left_beside_a_play(tmp_path):
    """Under some processors' rounding something was left of it, by p-values of 1e-4 and 1e-159."""
    found = diagnose_joint(read_study(draw(("backlash",), 0.3, 1118025, tmp_path, recorded=True).study))
    assert [c.name for c in found.causes] == ["backlash"], str(found)
    assert not found.remainder.unexplained


def test_a_smooth_likelihood_is_not_rough(tmp_path):
    study = read_study(draw(("backlash",), 0.3, 1118025, tmp_path, recorded=True).study)
    sets = LikelihoodFits(nominal_model(study), study.trials, [Backlash, QuadraticDamping])
    sets.nominal()
    sets.extend_all(())
    assert roughness(sets.fits[()]) < 0.5
    assert roughness(sets.fits["quadratic_damping",]) < 0.5
    assert roughness(sets.fits["backlash",]) > 10.0
