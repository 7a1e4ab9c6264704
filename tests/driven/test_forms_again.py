"""A form that stood for another cause is dropped once that is found."""

from driven_rigs.draw import draw

from fes_pin.data.study import read_study
from fes_pin.identify.likelihood import LikelihoodProblem
from fes_pin.identify.likelihood_fit import maximise
from fes_pin.models.effects import CoulombFriction, QuadraticDamping
from fes_pin.models.nominal import nominal_model
from fes_pin.search.likelihood_fits import LikelihoodFits
from fes_pin.search.likelihood_forms import simplified_form

PAIR = ("coulomb_friction", "quadratic_damping")


def test_friction_that_grew_with_the_load_is_plain_beside_another_damping(tmp_path):
    study = read_study(draw(PAIR, 0.3, 1108031, tmp_path).study)
    sets = LikelihoodFits(nominal_model(study), study.trials)
    model = sets.nominal().model + CoulombFriction(0.1, load_exponent=1.5) + QuadraticDamping(0.05)
    problem = LikelihoodProblem(model, study.trials, sets.fits[()].noise)
    sets.fits[PAIR] = stood = maximise(problem)
    simpler = simplified_form(sets.fits[PAIR])
    assert simpler.criterion < stood.criterion - 100.0
    assert simpler.values["coulomb_friction.load_exponent"] == 0.0
    sets.fits[PAIR] = simpler
    assert simplified_form(sets.fits[PAIR]) is None
