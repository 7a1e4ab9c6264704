"""A form that stood for another cause is dropped once that is found, and several forms are begun anew together."""

import pytest
from driven_rigs.draw import draw

from fes_pin.data.study import read_study
from fes_pin.diagnosis.search.likelihood_fits import LikelihoodFits
from fes_pin.identify.likelihood import LikelihoodProblem
from fes_pin.identify.likelihood_fit import maximise
from fes_pin.models.effects import CoulombFriction, QuadraticDamping, SensorLag
from fes_pin.models.nominal import nominal_model

PAIR = ("coulomb_friction", "quadratic_damping")


def test_friction_that_grew_with_the_load_is_plain_beside_another_damping(tmp_path):
    study = read_study(draw(PAIR, 0.3, 1108031, tmp_path).study)
    sets = LikelihoodFits(nominal_model(study), study.trials)
    model = sets.nominal().model + CoulombFriction(0.1, load_exponent=1.5) + QuadraticDamping(0.05)
    problem = LikelihoodProblem(model, study.trials, sets.fits[()].noise)
    sets.fits[PAIR] = stood = maximise(problem, model.parameters())
    simpler = sets.forms.simplified(sets.fits[PAIR])
    assert simpler.criterion < stood.criterion - 100.0
    assert simpler.values["coulomb_friction.load_exponent"] == 0.0
    sets.fits[PAIR] = simpler
    assert sets.forms.simplified(sets.fits[PAIR]) is None


def test_forms_that_bent_one_to_the_other_are_begun_anew(tmp_path):
    """Stiction was fitted before the friction's width was told: it is a tenth of that, and damping came out low."""
    drawn = draw(("coulomb_friction", "sensor_lag"), 0.3, 1108016, tmp_path)
    study, names = read_study(drawn.study), ("coulomb_friction", "sensor_lag")
    sets = LikelihoodFits(nominal_model(study), study.trials)
    friction = CoulombFriction(0.387, stiction=3.13, stribeck_speed=0.0747, creep_speed=0.132)
    model = sets.nominal().model + friction + SensorLag(0.0094)
    problem = LikelihoodProblem(model, study.trials, sets.fits[()].noise)
    sets.fits[names] = bent = maximise(problem, model.parameters())
    anew = sets.forms.reformed(sets.fits[names])
    assert anew.criterion < bent.criterion - 50.0
    damping = drawn.truth["damping"]
    assert abs(anew.values["damping"] - damping) < 0.3 * abs(bent.values["damping"] - damping)


def test_a_form_that_led_nowhere_is_grown_again_without_what_it_began_with(tmp_path):
    """Friction that falls with speed had taken half of what is dry, and four times the damping."""
    drawn = draw(PAIR, 0.3, 1430012, tmp_path, recorded=True)
    study = read_study(drawn.study)
    sets = LikelihoodFits(nominal_model(study), study.trials)
    friction = CoulombFriction(0.0269, stiction=0.962, stribeck_speed=0.3787, creep_speed=0.0008)
    nominal = sets.nominal()
    led = nominal.model.with_parameters({"inertia_scale": 1.0071, "damping": 0.0879, "gravity_scale": 0.9945})
    noise = nominal.noise.with_values({"white.position": 2.9e-4, "std.effort": 1.9e-3, "time.effort": 0.084})
    model = led + friction + QuadraticDamping(0.3269)
    stuck = maximise(LikelihoodProblem(model, study.trials, noise), model.parameters())
    assert stuck.values["coulomb_friction.stiction"] > 0.5
    found, damping = sets.forms.otherwise(stuck), drawn.truth["damping"]
    assert found.criterion < stuck.criterion - 100.0
    assert abs(found.values["damping"] - damping) < 0.2 * abs(stuck.values["damping"] - damping)
    assert found.values["coulomb_friction.torque_nm"] == pytest.approx(drawn.truth["coulomb_friction"], rel=0.1)
