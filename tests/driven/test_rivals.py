"""Sets of causes of a driven rig are compared in forms alike, and what cannot be told from a cause is said."""

from driven.bristles import believed, trial
from driven_rigs.draw import draw

from fes_pin.data.study import read_study
from fes_pin.diagnosis.diagnosis import diagnose_joint
from fes_pin.models.effects import CoulombFriction, EffortOffset, ParallelStiffness
from fes_pin.search.likelihood_fits import LikelihoodFits
from fes_pin.search.likelihood_forms import refined_form

FRICTION, BOTH = ("coulomb_friction",), ("coulomb_friction", "effort_offset")


def test_a_set_is_fitted_again_beside_a_cause_whose_form_has_changed():
    """An offset beside friction had been told from a spring beside it by what friction's form is worth."""
    sets = LikelihoodFits(believed(), [trial(1), trial(2)], [CoulombFriction, EffortOffset])
    sets.nominal()
    plain = sets.nominal().model + CoulombFriction()
    sets.fits[FRICTION] = sets._maximum(plain, sets.nominal().noise)
    sets.extend(FRICTION)
    first = sets.fits[BOTH]
    sets.extend(FRICTION)
    assert sets.fits[BOTH] is first
    sets.fits[FRICTION] = refined_form(sets.fits[FRICTION], sets.library.measured)
    (form,) = (e.refined() for e in sets.fits[FRICTION].model.effects)
    assert form and not first.model.effects[0].refined()
    sets.extend(FRICTION)
    assert sets.fits[BOTH].model.effects[0].refined() == form
    assert sets.fits[BOTH].criterion < first.criterion - 10.0


def test_a_rival_begins_in_the_form_that_friction_has_beside_the_cause():
    """Else a spring with one form of friction would be compared with an offset with another form of it."""
    sets = LikelihoodFits(believed(), [trial(1), trial(2)], [CoulombFriction, EffortOffset, ParallelStiffness])
    plain = sets.nominal().model + CoulombFriction()
    sets.fits[FRICTION] = sets._maximum(plain, sets.nominal().noise)
    sets.extend(FRICTION)
    sets.fits[BOTH] = better = refined_form(sets.fits[BOTH], sets.library.measured)
    rival = ("coulomb_friction", "parallel_stiffness")
    before, form = sets.fits[rival], better.model.effects[0].refined()
    assert form and not before.model.effects[0].refined()
    assert sets.in_other_forms(better, [rival, FRICTION]) == [rival, FRICTION]
    sets.converge_rivals(BOTH, "effort_offset")
    assert sets.in_other_forms(better, [rival, BOTH]) == []
    after = sets.fits[rival]
    assert after.model.effects[0].refined() == form and after.criterion < before.criterion - 10.0


def test_a_spring_that_gravity_and_a_constant_torque_stand_for_is_among_their_rivals(tmp_path):
    """Its fit had ended on the way, 37 in twice the log-likelihood short of what it is worth."""
    drawn = draw(("coulomb_friction", "parallel_stiffness"), 0.3, 6200018, tmp_path, recorded=True)
    found = diagnose_joint(read_study(drawn.study))
    sets = [{c.name, *c.equivalents} for c in found.causes]
    assert all(any(name in one for one in sets) for name in drawn.causes), str(found)
