"""Nerves by name as inputs of a body."""

import numpy as np
import pytest

from fes_pin.body.build import Body
from fes_pin.body.linearize import linearize
from fes_pin.data.errors import InputError
from fes_pin.muscles.nerve_inputs import controllability, subject_nerves
from fes_pin.muscles.nerves import Nerves


def test_names_stand_for_both_sides_and_scale_with_the_body():
    small, large = (Body.from_subject(mass_kg=m, height_m=h) for m, h in ((50.0, 1.6), (100.0, 1.9)))
    nerves = subject_nerves(small, ["femoral", "right_tibial", "left_femoral"])
    assert nerves.names == ("left_femoral", "right_femoral", "right_tibial")
    ours, everyones = subject_nerves(small), Nerves()
    assert ours.assumed_strength == everyones.assumed_strength and ours.strength_band == everyones.strength_band
    weak, strong = (subject_nerves(b, ["femoral"]).torque_matrix() for b in (small, large))
    assert np.allclose(strong, weak * 2.0 * 1.9 / 1.6)


def test_controllability_takes_names():
    linear = linearize(Body.from_subject(mass_kg=72.6, height_m=1.80), "mid_stance", slope=(0.05, 0.0))
    result = controllability(linear, ["femoral", "tibial", "superior_gluteal"])
    assert result.inputs.n == 6
    assert controllability(linear, ["left_knee_flexion"]).inputs.names == ("left_knee_flexion",)
    assert controllability(linear, "tibial").inputs.n == 2
    assert controllability(linear, subject_nerves(linear.body)).controls_falls
    for names in ({"femoral"}, (n for n in ["femoral"]), np.array(["femoral"])):
        assert controllability(linear, names).inputs.names == ("left_femoral", "right_femoral")
    assert controllability(linear, {"left_knee_flexion"}).inputs.names == ("left_knee_flexion",)
    for wrong in (["vagus"], ["left_knee_flexion", "femoral"], [], (n for n in ())):
        with pytest.raises(InputError):
            controllability(linear, wrong)


def test_a_body_with_no_nerve_named_is_refused_and_none_means_all():
    body = Body.from_subject(mass_kg=70.0, height_m=1.8)
    assert subject_nerves(body).names == Nerves().names
    with pytest.raises(InputError, match="none is named"):
        subject_nerves(body, [])
