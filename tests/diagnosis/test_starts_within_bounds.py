"""Wherever a search begins, it begins within the bounds of the parameters."""

import numpy as np
import pytest

from fes_pin.models.effects import EFFECTS, CoulombFriction
from fes_pin.search.starts import started


@pytest.mark.parametrize("estimate", [-1e3, 1e12])
@pytest.mark.parametrize("effect", EFFECTS, ids=lambda e: e.name)
def test_an_estimate_beyond_a_bound_starts_at_it(effect, estimate):
    begun = started(effect.absent(), dict.fromkeys(effect.amplitudes(), estimate))
    for name, info in effect.parameters().items():
        assert info.lower <= getattr(begun, name) <= info.upper


@pytest.mark.parametrize("speed", [1e-6, 0.3, 30.0, 3e3])
def test_speeds_of_friction_are_tried_within_their_bounds(speed):
    time = np.arange(2000) * 1e-3
    measured = {"time": time, "position": speed / 7.0 * np.sin(7.0 * time), "reading": np.sin(time)}
    for name, values in CoulombFriction.grids(measured).items():
        info = CoulombFriction.parameters()[name]
        assert all(info.lower <= v <= info.upper for v in values)
        assert all(getattr(CoulombFriction(**{name: v}), name) == v for v in values)
