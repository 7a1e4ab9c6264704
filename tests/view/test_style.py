"""Curves drawn with few points: every extreme stays, in order, and both ends."""

import numpy as np
import pytest

from fes_pin.view.chart import Panel
from fes_pin.view.style import thin_curve


@pytest.mark.parametrize("n", [1, 5, 699, 700, 701, 1000, 12345])
def test_extremes_and_ends_stay(n):
    rng = np.random.default_rng(n)
    time, values = np.arange(n) * 1e-3, rng.standard_normal(n)
    t, y = thin_curve(time, values)
    assert len(t) == len(y) <= 702 and (np.diff(t) > 0).all()
    assert (y.min(), y.max(), y[0], y[-1]) == (values.min(), values.max(), values[0], values[-1])
    assert (values[np.round(t / 1e-3).astype(int)] == y).all()


@pytest.mark.parametrize("limit", [0.049, 1.1, 4.9, 9.0, 180.0])
def test_an_axis_of_few_ticks_has_two_at_least(limit):
    panel = Panel(0.0, 0.0, 100.0, 76.0, (0.0, 1.0), (-limit, limit))
    panel.y_axis("residual")
    assert sum('class="tick"' in part for part in panel.parts) >= 2
