"""The load of a swinging joint's bearing, and dry friction that grows with it."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from cases import JOINT

from fes_pin.data.trial import Trial
from fes_pin.identify.likelihood import LikelihoodProblem
from fes_pin.identify.likelihood_fit import maximise
from fes_pin.identify.problem import measured_columns
from fes_pin.models.effects.coulomb_friction import CoulombFriction
from fes_pin.models.model import Model
from fes_pin.models.predictor import StateSpaceNoise
from fes_pin.models.rigs import Joint
from fes_pin.models.simulate import simulate
from fes_pin.models.stage import Signals
from fes_pin.search.likelihood_forms import refined_form

HERTZ = 4.0 / 3.0
TORQUE = 0.01
TIME = np.arange(0.0, 5.0, 5e-3)


def swing(model, amplitude):
    """A swing that is let go at an angle from hanging."""
    down = math.atan2(-JOINT["gravity_cos"], JOINT["gravity_sin"])
    hanging = down if math.cos(down) * JOINT["gravity_sin"] > 0.0 else down + math.pi
    start = {"position0": hanging + amplitude, "velocity0": 0.0}
    return simulate(model, Trial("swing", "motion", {}, TIME, start))


def friction(position, velocity, exponent, **constants):
    """Friction torque at one state in motion, through the rig's own rates."""
    known = {**JOINT, **constants}

    def torque(effects):
        s = Signals(effects, x=SimpleNamespace(q=position, v=velocity), u=SimpleNamespace(), step=5e-4, kind="motion")
        s.c = SimpleNamespace(**known)
        Joint(1.0, 0.0, 1.0, constants=known).rates(s)
        return s.torque

    return torque(()) - torque((CoulombFriction(TORQUE, load_exponent=exponent),))


@pytest.mark.parametrize("angle", [-2.0, -0.4, 0.0, 1.1])
@pytest.mark.parametrize("speed", [-3.0, 5.0])
def test_load_of_a_simple_pendulum(angle, speed):
    """A point mass m on an arm l pulls with m g cos(angle) + m l v^2."""
    m, length, g = 0.7, 0.3, 9.81
    known = {"inertia": m * length**2, "gravity_cos": 0.0, "gravity_sin": m * g * length}
    pull = m * g * math.cos(angle) + m * length * speed**2
    expected = math.copysign(TORQUE * abs(pull / (m * g)) ** HERTZ, speed)
    assert friction(angle, speed, HERTZ, **known) == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize("constants", [{"gravity_cos": 0.0, "gravity_sin": 0.0}, {"revolute": 0.0}])
def test_where_gravity_does_not_swing_the_load_is_constant(constants):
    assert friction(0.3, 4.0, HERTZ, **constants) == pytest.approx(friction(0.3, 4.0, 0.0, **constants), rel=1e-5)


@pytest.mark.parametrize("exponent", [0.0, 1.0, HERTZ, 1.5])
def test_the_load_is_told_from_swings(exponent):
    """Of large and small swings together, the form that made them fits, and is what a refinement proposes."""
    nominal = Model(Joint(1.0, 0.005, 1.0, constants=JOINT, fitted=("damping", "gravity_scale")))
    true = nominal + CoulombFriction(TORQUE, load_exponent=exponent)
    rng = np.random.default_rng(1)
    trials = []
    for amplitude in (1.6, 1.0, 0.5):
        clean = swing(true, amplitude)
        measured = clean["position"] + 1e-3 * rng.standard_normal(len(TIME))
        trials.append(Trial("swing", "motion", {"position": measured}, TIME, clean.conditions))
    start = nominal + CoulombFriction(0.8 * TORQUE)
    base = maximise(LikelihoodProblem(start, trials, StateSpaceNoise({"position": 1e-3})))
    refined = refined_form(base, measured_columns(nominal, trials))
    if exponent:
        assert refined.values["coulomb_friction.load_exponent"] == exponent
        assert refined.values["coulomb_friction.torque_nm"] == pytest.approx(TORQUE, rel=0.03)
        assert refined.free == base.free and base.sse - refined.sse > 100.0
        assert refined.noise.white["position"] == pytest.approx(1e-3, rel=0.05)
    else:
        assert refined is None or refined.sse > base.sse - 10.0
