"""Numbers of callers: one rule for every room, one line where they are none."""

import math
import tomllib

import numpy as np
import pytest

from fes_pin.allocation.allocator import Allocator
from fes_pin.allocation.horizon import Horizon, StrengthFatigue
from fes_pin.control.pulse import StimulationLimits
from fes_pin.data.errors import InputError
from fes_pin.data.numbers import as_number, between, in_full, number, positive_number, whole
from fes_pin.data.study_text import toml_value
from fes_pin.muscles.nerves import Nerves

NONE = ["5", b"5", True, None, [1.0], np.array([1.0]), 1j, np.bool_(True)]


@pytest.mark.parametrize("value", NONE)
@pytest.mark.parametrize(
    "ask",
    [
        lambda v: number(v, "x"),
        lambda v: positive_number(v, "x"),
        lambda v: whole(v, "x"),
        lambda v: between(v, 0.0, 9.0, "x"),
        lambda v: Allocator(np.eye(2), change=v),
        lambda v: Allocator(np.eye(2), rate=v),
        lambda v: Horizon(Allocator(np.eye(2)), steps=v),
        lambda v: StrengthFatigue(fatigue_s=v),
        lambda v: StimulationLimits(pulse_width_us=v),
        lambda v: Nerves(("left_tibial",), length=v),
    ],
)
def test_what_is_no_number_is_refused_in_one_line_everywhere(value, ask):
    with pytest.raises(InputError, match="must be a number") as caught:
        ask(value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("value", [3, 3.0, np.float32(3.0), np.int64(3), np.array(3.0)])
def test_every_kind_of_number_is_one(value):
    assert as_number(value) == 3.0 and type(as_number(value)) is float


def test_a_number_too_large_is_infinite():
    assert as_number(10**400) == math.inf
    with pytest.raises(InputError, match="finite"):
        number(10**400, "x")


@pytest.mark.parametrize(("value", "most"), [(2.5, 9), (-1, 9), (10, 9), (math.nan, 9)])
def test_whole_numbers_have_ends(value, most):
    with pytest.raises(InputError, match="x: must be"):
        whole(value, "x", 0, most)


@pytest.mark.parametrize("value", [0.1, 1e-300, -2.5, np.float64(0.1), np.float32(0.5), np.array(0.3), np.int8(3), 7])
def test_a_number_in_a_file_gives_itself_back(value):
    assert float(in_full(value)) == float(value)
    assert tomllib.loads(f"x = {toml_value(value)}") == {"x": float(value)}
