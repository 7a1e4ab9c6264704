"""Where the cost of friction is rough, slopes stay that no step keeps: they are none of the residual's."""

import numpy as np
import pytest
from driven_rigs.draw import draw

from fes_pin.data.study import read_study
from fes_pin.diagnose.search.likelihood_fits import LikelihoodFits
from fes_pin.diagnose.search.likelihood_search import LikelihoodSearch
from fes_pin.identify.problem import Linearized, at_rest
from fes_pin.models.effects import CoulombFriction, PeriodicTorque
from fes_pin.models.nominal import nominal_model


def test_what_is_at_rest_has_no_slope_and_what_has_none_is_at_rest():
    random = np.random.default_rng(5)
    parts = [
        Linearized(r, j, j[:, :0]) for r, j in ((random.normal(size=n), random.normal(size=(n, 2))) for n in (40, 70))
    ]
    rest = at_rest(parts)
    assert np.abs(sum(p.residual @ p.jacobian for p in rest)).max() < 1e-12
    assert sum(abs(p.residual @ p.jacobian).max() for p in rest) > 1.0, "of all trials, not of each"
    for once, twice in zip(rest, at_rest(rest), strict=True):
        assert np.array_equal(once.residual, twice.residual)
        assert twice.jacobian == pytest.approx(once.jacobian, abs=1e-12)


def test_a_torque_is_found_beside_friction_whose_cost_is_rough(tmp_path):
    """It gains 650 in twice the log-likelihood; beside friction that falls off within a thousandth of a radian a second
    its score was 0.1, for one column of the fit was the residual itself."""
    study = read_study(draw(("coulomb_friction", "periodic_torque"), 0.3, 1430036, tmp_path, recorded=True).study)
    sets = LikelihoodFits(nominal_model(study), study.trials, [CoulombFriction, PeriodicTorque])
    found = LikelihoodSearch(sets, 0, lambda share, words: None).run()
    assert {e.name for e in found.best.model.effects} == {"coulomb_friction", "periodic_torque"}
