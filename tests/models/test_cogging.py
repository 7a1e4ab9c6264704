"""Waves of a torque that is periodic in the angle."""

import numpy as np

from fes_pin.models.effects import Cogging
from fes_pin.models.maths import TURN


def test_of_a_joint_that_turns_round_whole_waves_a_turn_are_tried():
    turned = Cogging.grids({"position": np.linspace(0.0, 3.0 * TURN, 400)})["waves"]
    assert {1.0, 2.0, 12.0, 36.0} <= set(turned)
    assert not {1.0, 2.0} & set(Cogging.grids({"position": np.linspace(0.0, 1.0, 400)})["waves"])
