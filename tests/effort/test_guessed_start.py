"""Start values where none are given: what a nominal model fits follows from the rig and from what was recorded."""

import pytest
from driven_rigs.draw import Base, urdf

from fes_pin.models.nominal import guess_start
from fes_pin.models.rigs.joint import Joint


@pytest.mark.parametrize(
    ("base", "columns", "fitted"),
    [
        (Base("arm", 0.08, 0.05, 1.2, 0.3, 3.0), ("position", "effort"), True),
        (Base("arm", 0.08, 0.05, 1.2, 0.3, 3.0), ("position",), False),
        (Base("rotor", 0.08, 0.05, 0.0, 0.3, 3.0), ("position", "effort"), False),
        (Base("slide", 95.0, 200.0, 0.0, 0.3, 3.0), ("position", "effort"), False),
    ],
)
def test_the_weight_of_a_joint_that_turns_is_fitted_where_an_effort_was_recorded(base, columns, fitted, tmp_path):
    (tmp_path / "rig.urdf").write_text(urdf(base))
    start = guess_start(Joint, {}, tmp_path / "rig.urdf", columns)
    assert ("gravity_scale" in start) is fitted and {"inertia_scale", "damping"} <= {*start}
