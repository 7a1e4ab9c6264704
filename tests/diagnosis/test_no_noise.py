"""Records without noise: their tests of lack of fit are defined."""

import numpy as np
import pytest

from fes_pin.remainder.innovations import autocorrelation
from fes_pin.remainder.repeated import repeated_p_value


def test_a_channel_of_zeros_is_taken_for_white():
    found = autocorrelation([np.zeros(400), np.zeros(400)])
    assert found[len(found) // 2] == 1.0 and np.count_nonzero(found) == 1


@pytest.mark.parametrize("size", [0.0, 1e-200])
def test_equal_trials_of_nothing_repeat_nothing(size):
    assert repeated_p_value([size * np.ones(4000)] * 4, 0.01) == pytest.approx(1.0)
