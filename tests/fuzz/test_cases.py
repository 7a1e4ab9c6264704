"""A slice of `scripts/fuzz`: odd and spoilt input gets an answer or one line, and its checks see what they look for."""

import pytest
from fuzz_inputs.cases import KINDS, run_case

from fes_pin.models.compile.machine import cache_folder


@pytest.mark.parametrize("number", range(len(KINDS) * 3))
def test_a_slice(tmp_path, number):
    if KINDS[number % len(KINDS)] == "study":
        pytest.skip("diagnoses take seconds: scripts/fuzz runs them")
    result = run_case(number, 1, tmp_path / "case", cache_folder())
    assert not result.faults, str(result)
