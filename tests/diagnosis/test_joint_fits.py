"""What a set is without one of its causes, fitted from the set's own values too: where its rivals begin."""

import numpy as np
import pytest
from identify.rigs import WHITE, measured
from models.cases import RIGS, trial

from fes_pin.diagnosis.search.simulation_fits import ANOTHER_MINIMUM, SimulationFits
from fes_pin.identify.fit import fit_problem
from fes_pin.models.effects.coulomb_friction import CoulombFriction
from fes_pin.models.effects.sensor_offset import SensorOffset
from fes_pin.models.model import Model

FRICTION, OFFSET = ("coulomb_friction",), ("sensor_offset",)
BOTH = (*FRICTION, *OFFSET)


@pytest.fixture
def sets():
    """Fits of a joint with friction and an offset; friction alone was left where it is absent."""
    rng = np.random.default_rng(0)
    true = Model(RIGS["joint"]) + CoulombFriction(0.05) + SensorOffset(0.05)
    trials = [measured(true, trial("joint", "motion", rng, 600), rng) for _ in range(3)]
    sets = SimulationFits(Model(RIGS["joint"]), trials)
    sets.set_noise(WHITE)
    sets.fits[BOTH] = sets.fitter.fit_from([true], None)
    sets.fits[OFFSET] = sets.fitter.fit_from([Model(RIGS["joint"]) + SensorOffset(0.05)], None, 60)
    absent = Model(RIGS["joint"]) + CoulombFriction(0.0)
    sets.fits[FRICTION] = fit_problem(sets.fitter.problem(absent), absent.parameters(), None, max_iterations=0)
    sets.finish = lambda names: None  # what ended at another minimum has converged
    return sets


def test_a_subset_at_another_minimum_is_found_again(sets):
    stuck, sound = sets.fits[FRICTION], sets.fits[OFFSET]
    assert sets.better_bases(BOTH) == [FRICTION]
    assert sets.fits[OFFSET] is sound
    found = sets.fits[FRICTION]
    assert found.sse < stuck.sse - ANOTHER_MINIMUM
    assert found.values["coulomb_friction.torque_nm"] == pytest.approx(0.05, rel=0.3)
    assert sets.better_bases(BOTH) == []


def test_a_worse_fit_never_takes_the_place_of_a_better_one(sets):
    best, worse = sets.fits[BOTH], sets.fits[FRICTION]
    sets.add({BOTH: lambda: worse})
    assert sets.fits[BOTH] is best
