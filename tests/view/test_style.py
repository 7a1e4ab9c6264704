"""Curves drawn with few points: every extreme stays, in order, and both ends."""

import numpy as np
import pytest

from fes_pin.view.style import thin_curve


@pytest.mark.parametrize("n", [1, 5, 699, 700, 701, 1000, 12345])
def test_extremes_and_ends_stay(n):
    rng = np.random.default_rng(n)
    time, values = np.arange(n) * 1e-3, rng.standard_normal(n)
    t, y = thin_curve(time, values)
    assert len(t) == len(y) <= 702 and (np.diff(t) > 0).all()
    assert (y.min(), y.max(), y[0], y[-1]) == (values.min(), values.max(), values[0], values[-1])
    assert (values[np.round(t / 1e-3).astype(int)] == y).all()
