"""Where the cost of friction is rough, slopes stay that no step keeps: they are none of the residual's."""

from dataclasses import replace

import numpy as np
import pytest
from driven_rigs.draw import draw

from fes_pin.data.study import read_study
from fes_pin.diagnose.search.likelihood_fits import LikelihoodFits
from fes_pin.diagnose.search.likelihood_search import LikelihoodSearch
from fes_pin.identify.likelihood import LikelihoodProblem, for_gains_as_they_are
from fes_pin.identify.scatter import with_honest_intervals
from fes_pin.models.effects import CoulombFriction, PeriodicTorque
from fes_pin.models.nominal import nominal_model


def test_slopes_for_gains_as_they_are_are_those_that_turns_begin_with(tmp_path):
    study = read_study(draw((), 0.3, 3, tmp_path).study)
    fitted = LikelihoodFits(nominal_model(study), study.trials, []).nominal()
    problem = LikelihoodProblem(fitted.model, fitted.trials, fitted.doubt)
    assert problem.sharpen()
    sharp = problem.linearize(fitted.values, fitted.unknowns)
    for plain, other in zip(for_gains_as_they_are(fitted), sharp, strict=True):
        assert np.array_equal(plain.residual, other.residual)
        beyond = other.jacobian - plain.jacobian
        assert np.linalg.matrix_rank(beyond, tol=1e-9 * np.abs(other.jacobian).max()) == 1
        along = np.outer(plain.residual, plain.residual @ beyond) / (plain.residual @ plain.residual)
        assert beyond == pytest.approx(along, abs=1e-9 * np.abs(beyond).max())


def test_a_torque_is_found_beside_friction_whose_cost_is_rough(tmp_path):
    """It gains 650 in twice the log-likelihood; beside friction that falls off within a thousandth of a radian a second
    its score was 0.1, for one column of the fit was the residual itself."""
    study = read_study(draw(("coulomb_friction", "periodic_torque"), 0.3, 1430036, tmp_path, recorded=True).study)
    sets = LikelihoodFits(nominal_model(study), study.trials, [CoulombFriction, PeriodicTorque])
    found = LikelihoodSearch(sets, 0, lambda share, words: None).run()
    assert {e.name for e in found.best.model.effects} == {"coulomb_friction", "periodic_torque"}


def test_a_slope_that_no_step_keeps_narrows_no_interval(tmp_path):
    """A column that holds the residual a thousand times over seems to tell its parameter; what it tells is noise."""
    study = read_study(draw((), 0.3, 3, tmp_path).study)
    fitted = LikelihoodFits(nominal_model(study), study.trials, []).nominal()
    k = fitted.free.index("damping")
    rough = []
    for part in fitted.parts:
        jacobian = part.jacobian.copy()
        jacobian[:, k] += 1e3 * part.residual
        rough.append(replace(part, jacobian=jacobian))
    honest, same = (with_honest_intervals(one) for one in (fitted, replace(fitted, parts=tuple(rough))))
    for name in fitted.free:
        assert same.std(name) == pytest.approx(honest.std(name), rel=1e-6)
        assert honest.std(name) >= 0.99 * fitted.std(name)
