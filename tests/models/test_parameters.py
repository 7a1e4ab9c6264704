"""Bounds of parameters: what lies beyond one by rounding is at it, what lies farther is refused."""

import numpy as np
import pytest

import fes_pin as fp


@pytest.mark.parametrize("bound", ["lower", "upper"])
def test_a_value_beyond_a_bound_by_rounding_is_at_it(bound):
    limit = getattr(fp.effects.CoulombFriction.parameters()["softness"], bound)
    away = 0.0 if bound == "lower" else np.inf
    assert fp.effects.CoulombFriction(torque_nm=0.1, softness=float(np.nextafter(limit, away)))
    with pytest.raises(fp.InputError, match="softness"):
        fp.effects.CoulombFriction(torque_nm=0.1, softness=limit * (1.0 - 1e-6 if bound == "lower" else 1.0 + 1e-6))
