"""The load's inertia in its two forms."""

import dataclasses

import numpy as np
from models.cases import RIGS, trial

from fes_pin.models.effects import effect_named
from fes_pin.models.model import Model
from fes_pin.models.simulate import Simulator


def test_on_a_wheel_the_load_is_inertia_of_the_joint():
    made = trial("ankle", "motion", np.random.default_rng(5), 400, 5e-3, load_kg=1.2)
    ankle = RIGS["ankle"]
    moved = 0.4 * made.conditions["load_kg"] * ankle.constants["com_distance_m"] ** 2
    heavier = dataclasses.replace(ankle, inertia_kgm2=ankle.inertia_kgm2 + moved)
    wheel = reading(Model(ankle) + effect_named("load_inertia")(share=0.4, wheel=1.0), made)
    np.testing.assert_allclose(wheel, reading(Model(heavier), made), atol=1e-6)
    assert np.abs(wheel - reading(Model(ankle) + effect_named("load_inertia")(share=0.4), made)).max() > 1e-3


def reading(model, one):
    (simulated,) = Simulator(model, [one]).run(model.parameters())
    return simulated.readings[:, 0]
