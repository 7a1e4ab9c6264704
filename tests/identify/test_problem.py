"""Trials whitened side by side: each as if it were alone, whatever its length, rate and channels."""

import numpy as np
import pytest
from identify.rigs import measured
from models.cases import RIGS, trial
from scipy.linalg import solve_triangular, toeplitz
from scipy.signal import lfilter

from fes_pin.identify.problem import Problem
from fes_pin.infer.noise import Noise, thin
from fes_pin.models.effects import effect_named
from fes_pin.models.model import Model
from fes_pin.models.simulate import Simulator

NOISE = {"position": Noise(2e-3, (0.5, 0.2), 3e-3, 4e-3), "velocity": Noise(2e-2, (0.3,), 3e-2, 4e-3)}


def mixed(rng):
    """Five trials: long and short, at 2 and 4 ms, with and without a velocity."""
    model = Model(RIGS["joint"])
    made = []
    for n, dt, velocity in (
        (300, 4e-3, True),
        (120, 4e-3, False),
        (301, 2e-3, True),
        (97, 2e-3, False),
        (5, 4e-3, True),
    ):
        bare = trial("joint", "motion", rng, n, dt)
        made.append(measured(model, bare, rng, velocity=velocity))
    return model, made


@pytest.mark.parametrize("name", ["coulomb_friction", "sensor_lag"])
def test_each_is_as_if_it_were_alone(name):
    model, trials = mixed(np.random.default_rng(0))
    model = model + effect_named(name)()
    problem = Problem(model, trials, NOISE)
    unknowns = problem.start_unknowns()
    together = problem.linearize(model.parameters(), unknowns)
    for one, own, part in zip(trials, unknowns, together, strict=True):
        alone = Problem(model, [one], NOISE)
        (expected,) = alone.linearize(model.parameters(), [own])
        assert len(part.residual) == len(expected.residual)
        for got, wanted in ((part.residual, expected.residual), (part.jacobian, expected.jacobian)):
            assert got == pytest.approx(wanted, rel=1e-9, abs=1e-9)
        assert part.local == pytest.approx(expected.local, rel=1e-9, abs=1e-9)


def whitened(noise, x):
    """Noise of unit variance, by the factor of the covariance of as many samples of the autoregression."""
    shape = lfilter([1.0], [1.0, *(-a for a in noise.ar)], np.eye(1, 4000)[0])
    covariance = toeplitz([shape[k:] @ shape[: 4000 - k] for k in range(len(x))])
    return solve_triangular(np.linalg.cholesky(covariance), x, lower=True) / noise.innovation_std


def test_a_residual_is_what_its_own_samples_whiten_to():
    model, trials = mixed(np.random.default_rng(1))
    problem = Problem(model, trials, NOISE)
    unknowns = problem.start_unknowns()
    parts = problem.linearize(model.parameters(), unknowns)
    simulated = Simulator(model, trials).run(model.parameters(), unknowns)
    for one, run, part in zip(trials, simulated, parts, strict=True):
        names = [n for n in ("position", "velocity") if n in one]
        left = [thin(one[n] - run.readings[:, k], round(4e-3 / one.dt)) for k, n in enumerate(names)]
        expected = np.stack([whitened(NOISE[n], x) for n, x in zip(names, left, strict=True)], axis=1)
        assert part.residual == pytest.approx(expected.ravel(), rel=1e-6, abs=1e-6)
