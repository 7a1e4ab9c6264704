"""A part of a trial is fitted by itself, and causes that depend on time act in it as in the trial."""

import warnings

import numpy as np
import pytest

import fes_pin as fp
from fes_pin.data.trial import Trial
from fes_pin.identify.likelihood import LikelihoodProblem
from fes_pin.identify.likelihood_fit import maximise
from fes_pin.identify.problem import measured_columns
from fes_pin.identify.process_noise import first_guess
from fes_pin.models.effects import PeriodicTorque, SensorDrift
from fes_pin.models.model import Model
from fes_pin.models.rigs import Joint
from fes_pin.prepare.long_records import in_parts

RIG = Joint(constants={"inertia": 0.05, "gravity_cos": 0.0, "gravity_sin": 0.9, "revolute": 1.0}, damping=0.1)
CAUSES = [PeriodicTorque(in_phase=0.1, quadrature=0.05, frequency_hz=0.31), SensorDrift(rate_per_s=0.02)]


def swung(model: Model, begins_s: float = 0.0) -> Trial:
    """A joint under an effort that was chosen beforehand, as the model moves it, and read with noise."""
    rng, time = np.random.default_rng(4), np.arange(3000) * 0.004
    effort = np.repeat(0.2 * rng.standard_normal(30), 100)
    wanted = Trial("a", "motion", {"effort": effort}, begins_s + time, {"position0": 0.1})
    with warnings.catch_warnings(action="ignore"):
        reading = fp.simulate(model, wanted)["position"] + 1e-4 * rng.standard_normal(len(time))
    return Trial("a", "motion", {"effort": effort, "position": reading}, begins_s + time)


def cost(model: Model, trials: list[Trial]) -> float:
    """Twice the negative log-likelihood of a model, but for its damping at its values."""
    return maximise(LikelihoodProblem(model, trials, first_guess(model, trials), free=("damping",))).sse


@pytest.mark.parametrize("begins_s", [0.0, 7.3])
@pytest.mark.parametrize("cause", CAUSES, ids=lambda one: one.name)
def test_causes_of_a_part_act_from_the_beginning_of_its_trial(cause, begins_s):
    trial = swung(Model(RIG) + cause, begins_s)
    parts = in_parts(RIG, [trial])
    assert len(parts) > 1 and parts[1].time[0] > begins_s and parts[1].origin_s == begins_s
    np.testing.assert_allclose(np.concatenate([p.since_origin for p in parts]), trial.since_origin, atol=1e-12)
    whole, cut = (measured_columns(Model(RIG), one) for one in ([trial], parts))
    np.testing.assert_allclose(cut["time"], whole["time"], atol=1e-12)
    model = Model(RIG) + cause
    assert abs(cost(model, parts) - cost(model, [trial])) < 0.1 * abs(cost(Model(RIG), parts) - cost(model, parts))


def test_a_stretch_that_a_user_cuts_is_a_trial_of_its_own():
    trial = swung(Model(RIG))
    assert trial.between(2.0, 5.0).origin_s is None and trial.between(2.0, 5.0).since_origin[0] == 0.0
    late = trial.part(slice(500, 900))
    assert late.between(2.0, 9.0).origin_s is None
    late = late.part(slice(100, 300))
    assert late.origin_s == 0.0 and late.since_origin[0] == pytest.approx(2.4)


def test_an_origin_is_a_number():
    with pytest.raises(fp.InputError, match=r"origin_s: expected a number"):
        Trial("a", "motion", {"position": np.zeros(5)}, np.arange(5.0), origin_s="a")
