"""Causes that are the same in all that a rig can show: what no data can tell apart is said, not guessed."""

from dataclasses import replace

import numpy as np
import pytest
from models.cases import RIGS, trial

from fes_pin.models.effects import effect_named
from fes_pin.models.model import Model
from fes_pin.models.simulate import Simulator

TWINS = [
    ("muscle", "isometric", ("second_order_activation", {"second_s": 0.02}), ("sensor_lag", {"lag_s": 0.02})),
    ("joint", "motion", ("base_tilt", {"tilt_rad": 0.03}), ("sensor_offset", {"offset": -0.03})),
]
"""A muscle held still is linear behind its recruitment: a lag before the sensor is a lag in the sensor. A joint under
gravity that was turned with its base is the joint, read from another zero."""


@pytest.mark.parametrize(("rig", "kind", "one", "other"), TWINS, ids=["lags", "tilt"])
def test_twins_read_alike(rig, kind, one, other):
    made = [trial(rig, kind, np.random.default_rng(k), 400, 5e-3) for k in range(2)]
    for a, b, bare in zip(readings(rig, made, one), readings(rig, made, other), readings(rig, made), strict=True):
        assert np.abs(a - bare).max() > 1e-3
        np.testing.assert_allclose(a, b, atol=1e-7 * np.abs(a).max())


def test_friction_that_differs_by_the_direction_is_friction_beside_an_offset():
    """Both ways of a slow and a fast motion, and at rest: why a joint's friction has no asymmetry of its own."""
    made = [trial("joint", "motion", np.random.default_rng(k), 600, 2e-3) for k in range(3)]
    one_way = readings("joint", made, ("coulomb_friction", {"torque_nm": 0.05, "asymmetry": 0.3}))
    beside = readings(
        "joint", made, ("coulomb_friction", {"torque_nm": 0.05}), ("effort_offset", {"offset": -0.3 * 0.05}), zero=0.0
    )
    for a, b, bare in zip(one_way, beside, readings("joint", made), strict=True):
        assert np.abs(a - bare).max() > 0.05
        assert np.abs(a - b).max() < 2e-3


def test_a_gain_of_the_effort_is_a_lighter_body():
    """Where inertia, damping and gravity are all unknown."""
    made = [trial("joint", "motion", np.random.default_rng(4), 400, 5e-3)]
    rig = RIGS["joint"]
    smaller = replace(rig, **{n: getattr(rig, n) / 1.25 for n in rig.parameters()})
    ((stronger,), (lighter,)) = (
        [s.readings for s in Simulator(model, made).run(model.parameters())]
        for model in (Model(rig) + effect_named("effort_gain")(error=0.25), Model(smaller))
    )
    np.testing.assert_allclose(stronger, lighter, atol=1e-9)


@pytest.mark.parametrize(("rig", "kind"), [("ankle", "motion"), ("ankle", "isometric"), ("muscle", "isometric")])
def test_a_clock_that_is_late_is_a_delay(rig, kind):
    """What begins at rest and is driven by a stimulus alone has no other clock than the stimulus."""
    made, late, dt = [trial(rig, kind, np.random.default_rng(2), 400, 5e-3)], 5, 5e-3
    (prompt,), (delayed,) = (
        readings(rig, made),
        readings(rig, made, ("electromechanical_delay", {"delay_s": late * dt})),
    )
    read_late = np.concatenate([np.repeat(prompt[:1], late, axis=0), prompt[:-late]])
    assert np.abs(delayed - prompt).max() > 1e-3
    np.testing.assert_allclose(delayed, read_late, atol=1e-7 * np.abs(prompt).max())


def readings(rig, trials, *causes, zero=None):
    """From the same first reading of a joint, whatever its zero."""
    model = Model(RIGS[rig])
    for name, values in causes:
        model = model + effect_named(name)(**values)
    zero = sum(values.get("offset", 0.0) for _, values in causes) if zero is None else zero
    begun = [replace(t, conditions={n: v - zero * (n == "position0") for n, v in t.conditions.items()}) for t in trials]
    return [s.readings for s in Simulator(model, begun).run(model.parameters())]
