"""What cannot be told from a cause of a driven rig is said."""

from driven_rigs.draw import draw

from fes_pin.data.study import read_study
from fes_pin.diagnose.diagnosis import diagnose_joint


def test_a_spring_that_gravity_and_a_constant_torque_stand_for_is_among_their_rivals(tmp_path):
    """Its fit had ended on the way, 37 in twice the log-likelihood short of what it is worth."""
    drawn = draw(("coulomb_friction", "parallel_stiffness"), 0.3, 6200018, tmp_path, recorded=True)
    found = diagnose_joint(read_study(drawn.study))
    sets = [{c.name, *c.equivalents} for c in found.causes]
    assert all(any(name in one for one in sets) for name in drawn.causes), str(found)
