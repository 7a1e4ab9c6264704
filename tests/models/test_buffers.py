"""What machine code reads and writes stays allocated while it runs: other threads allocate meanwhile."""

import ctypes

import numpy as np
from models.cases import RIGS, trial

from fes_pin.models.compile.equations import derive
from fes_pin.models.compile.layout import WIDTH, make_layout
from fes_pin.models.compile.machine import MachineCode
from fes_pin.models.compile.native import NativeProgram, compile_equations
from fes_pin.models.model import Model


def test_the_start_of_the_equilibrium_is_kept_until_the_code_returns(monkeypatch):
    model, bare = Model(RIGS["ankle"]), trial("ankle", "motion", np.random.default_rng(0), 20)
    layout = make_layout(model, "motion", model.rig.input_columns(bare), ())
    seen = []

    def run(n, substeps, u, p, c, z, y, scratch):
        taken = [np.full(WIDTH, np.nan) for _ in range(50)]  # whoever freed 4 numbers sees them here
        seen.append(list((ctypes.c_double * WIDTH).from_address(z)))
        assert len(taken) == 50

    monkeypatch.setattr(MachineCode, "function", lambda *_: run)
    program, guess = NativeProgram(layout, compile_equations(derive(model, layout))), np.linspace(1.0, 2.0, WIDTH)
    inputs, values, constants = (np.zeros((k, WIDTH)) for k in (20, len(layout.values), len(layout.constants)))
    program.run(inputs[:, None], values, constants, guess, 1)
    assert seen == [list(guess)]
