"""Nerves by name as inputs of a body."""

from dataclasses import replace

import numpy as np
import pytest
from yardsticks.strength import ANDERSON_2007

from fes_pin.body.build import Body
from fes_pin.body.linearize import linearize
from fes_pin.data.errors import InputError
from fes_pin.muscles.nerve_inputs import PEAKS_2007, YEARS, controllability, subject_nerves, whose_strength
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


@pytest.mark.parametrize("years", YEARS)
@pytest.mark.parametrize("sex", ["male", "female"])
def test_strength_is_that_of_the_sex_and_the_years(sex, years):
    """Mean peak torque over six actions, per weight and height, as measured: Anderson et al. 2007."""
    body = Body.from_subject(60.0, 1.65, sex)
    assert body.sex == sex
    young_man = subject_nerves(Body.from_subject(60.0, 1.65), ["femoral"]).torque_matrix()
    found = subject_nerves(body, ["femoral"], years=years).torque_matrix()
    who = {"male": "man", "female": "woman"}[sex]
    peaks, of_men = (np.array(PEAKS_2007[group]) for group in ((who, years), ("man", YEARS[0])))
    assert np.allclose(found, np.mean(peaks / of_men) * young_man, rtol=1e-12)
    assert (sex == "male" and years == YEARS[0]) == np.array_equal(found, young_man)
    said = whose_strength(body, years)
    assert said == f"a healthy {who} {'' if years == 'over 65' else 'of '}{years} years, 60 kg and 1.65 m"


def test_peaks_of_young_men_are_those_of_the_curves():
    assert PEAKS_2007["man", "18 to 25"] == tuple(curve.peak for curve in ANDERSON_2007.values())


def test_a_body_of_unknown_sex_and_height_says_what_is_assumed(body):
    unknown = replace(body, sex=None, height_m=None)
    assert whose_strength(unknown) == "a healthy man of 18 to 25 years, 73 kg and 1.80 m (assumed)"
    assert subject_nerves(unknown).size == subject_nerves(body).size
