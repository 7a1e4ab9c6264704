"""The derivative of the equation that a controller takes from the oracle."""

import pytest
from paper_ankle.constants import paper_twin

from fes_pin.paper.equation_1 import static_stiffness_nm, static_torque_nm


@pytest.mark.parametrize("angle_rad", [1.2, 1.7, 1.9, 2.3])  # below and above theta_r
@pytest.mark.parametrize(("force_n", "load_kg"), [(0.0, 0.0), (40.0, 1.0)])
def test_the_stiffness_is_the_torques_derivative(angle_rad, force_n, load_kg):
    known, h = vars(paper_twin("4-24")), 1e-5
    up, down = (static_torque_nm(known, angle_rad + s * h, force_n, load_kg) for s in (1.0, -1.0))
    stiffness = static_stiffness_nm(known, angle_rad, force_n, load_kg)
    assert stiffness == pytest.approx((up - down) / (2.0 * h), rel=1e-6, abs=1e-8)
