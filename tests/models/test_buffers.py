"""What machine code reads and writes stays allocated while it runs: other threads allocate meanwhile."""

import ctypes

import numpy as np
from models.cases import RIGS, trial

from fes_pin.models.compile.layout import WIDTH
from fes_pin.models.model import Model
from fes_pin.models.simulate import Simulator


def test_the_start_of_the_equilibrium_is_kept_until_the_code_returns(monkeypatch):
    model = Model(RIGS["ankle"])
    bare = trial("ankle", "motion", np.random.default_rng(0), 20)
    simulator = Simulator(model, [bare])
    (block,) = simulator._blocks
    seen = []

    def run(n, substeps, u, p, c, z, y, scratch):
        taken = [np.full(WIDTH, np.nan) for _ in range(50)]  # whoever freed 4 numbers sees them here
        seen.append(list((ctypes.c_double * WIDTH).from_address(z)))
        assert len(taken) == 50

    monkeypatch.setattr(block.program, "_run", run)
    simulator.run(model.parameters())
    assert seen == [[model.rig.guess(bare)] * WIDTH]
