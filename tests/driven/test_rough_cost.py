"""Where the cost of friction is rough, slopes stay that no step keeps: they are none of the residual's."""

from dataclasses import replace

import pytest
from driven_rigs.draw import draw

from fes_pin.data.study import read_study
from fes_pin.diagnosis.held_out import as_random_as_in_all, folds_of
from fes_pin.diagnosis.likelihood_models import LikelihoodModels, LikelihoodSearch
from fes_pin.identify.likelihood import LikelihoodProblem
from fes_pin.identify.likelihood_fit import maximise
from fes_pin.infer.left_out import LeftOut
from fes_pin.infer.levels import PARAMETER_PENALTY
from fes_pin.infer.scatter import with_honest_intervals
from fes_pin.models.effects import CoulombFriction, PeriodicTorque
from fes_pin.models.nominal import nominal_model


def friction_fitted(folder):
    """A rig that hides friction, fitted with it: to where slopes for gains as they are end, and on from there."""
    study = read_study(draw(("coulomb_friction",), 0.3, 7, folder).study)
    sets = LikelihoodModels(nominal_model(study), study.trials, [CoulombFriction])
    sets.nominal()
    sets.extend(())
    ended = sets.fits["coulomb_friction",]
    problem = LikelihoodProblem(ended.model, study.trials, ended.noise)
    return maximise(problem, ended.unknowns, near=True)


def test_what_has_moved_together_is_where_no_single_step_leads_down(tmp_path):
    """Slopes for gains as they are end above it beside this rig's friction; the maximum is the cost's own."""
    fitted = friction_fitted(tmp_path)
    assert fitted.together
    problem = LikelihoodProblem(fitted.model, fitted.trials, fitted.noise)
    points = [
        ({**fitted.values, n: fitted.values[n] + side * 0.3 * fitted.std(n)}, fitted.unknowns)
        for n in fitted.free
        if n not in fitted.at_bound
        for side in (-1.0, 1.0)
    ]
    assert min(problem.costs(points)) > fitted.sse - 0.2


def test_a_torque_is_found_beside_friction_whose_cost_is_rough(tmp_path):
    """It gains 650 in twice the log-likelihood; beside friction that falls off within a thousandth of a radian a second
    its score was 0.1, for one column of the fit was the residual itself."""
    study = read_study(draw(("coulomb_friction", "periodic_torque"), 0.3, 1430036, tmp_path, recorded=True).study)
    sets = LikelihoodModels(nominal_model(study), study.trials, [CoulombFriction, PeriodicTorque])
    found = LikelihoodSearch(sets, lambda share, words: None).run()
    assert {e.name for e in found.best.model.effects} == {"coulomb_friction", "periodic_torque"}


def test_a_slope_that_no_step_keeps_narrows_no_interval(tmp_path):
    """A column that holds the residual a thousand times over seems to tell its parameter; what it tells is noise."""
    study = read_study(draw((), 0.3, 3, tmp_path).study)
    fitted = LikelihoodModels(nominal_model(study), study.trials, []).nominal()
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


def test_folds_take_the_end_of_what_moved_together_for_an_end(tmp_path):
    """Slopes for gains as they are still lead on there: by 15 to 56 below where fits to the other trials end."""
    fitted = friction_fitted(tmp_path)
    every = sum(len(p.residual) for p in fitted.parts)
    for held in folds_of(fitted.trials):
        others = as_random_as_in_all(fitted, [t for i, t in enumerate(fitted.trials) if i not in held])
        many = every / sum(len(p.residual) for p in others.parts)
        cost = LeftOut(fitted).cost(held)
        assert cost == pytest.approx(many * others.sse, abs=PARAMETER_PENALTY)
