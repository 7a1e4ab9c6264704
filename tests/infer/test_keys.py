"""Names of candidates are written and read in one form."""

import pytest

from fes_pin.infer.keys import Key


@pytest.mark.parametrize("text", ["friction", "friction@knee", "gain:after", "friction@left knee, along x:day 2"])
def test_a_text_is_read_back(text):
    assert str(Key.of(text)) == text


def test_the_parts_of_a_key():
    assert Key.of("friction@knee:after") == ("friction", "knee", "after")
    assert Key.of("gain:after") == ("gain", "", "after")
    assert Key.of("coulomb_friction.torque_nm:b").name == "coulomb_friction.torque_nm"
