"""A spring that rests outside of the part of its range through which a dynamometer turns a passive joint."""

import numpy as np
import pytest

import fes_pin as fp
from fes_pin.data.templates import pendulum
from fes_pin.diagnosis.likelihood_models import LikelihoodModels
from fes_pin.identify.likelihood_fit import LikelihoodFit
from fes_pin.models.effects import EffortOffset, ParallelStiffness
from fes_pin.models.nominal import nominal_model

STIFFNESS, TORQUE, WEIGHT = 14.5, 13.0, 0.08 * 9.81
"""Of an ankle, N m/rad and N m where the angle is 0; and the weight of the foot by its URDF, N m."""


def ramps(folder):
    """Return a study of two slow ramps of 0.7 rad about the angle of 0."""
    (folder / "foot.urdf").write_text(pendulum(0.08, 1.0))
    rng, time = np.random.default_rng(0), np.arange(0.0, 10.0, 0.05)
    trials = []
    for name, sign in (("up", 1.0), ("down", -1.0)):
        angle = sign * 0.35 * np.clip((time - 5.0) / 3.0, -1.0, 1.0) + 1e-4 * rng.standard_normal(len(time))
        effort = STIFFNESS * angle - TORQUE + 0.2 * rng.standard_normal(len(time))
        trials.append(fp.Trial(name, "imposed", {"position": angle, "effort": effort}, time))
    rig, stated = {"inertia_scale": 1.0}, {"damping": 0.1, "gravity_scale": 1.0}
    return fp.Study("ramps", "joint", rig, stated, tuple(trials), folder, {"urdf": folder / "foot.urdf"})


def spring(shown) -> LikelihoodFit:
    sets = LikelihoodModels(nominal_model(shown), shown.trials, [ParallelStiffness, EffortOffset], answered=False)
    sets.nominal()
    sets.extend(())
    sets.converge_these([("parallel_stiffness",)])
    return sets.fits["parallel_stiffness",]


def test_a_spring_rests_outside_of_what_the_joint_is_turned_through(tmp_path):
    found = spring(ramps(tmp_path))
    assert "parallel_stiffness.rest_angle_rad" not in found.at_bound
    value = found.values
    stiffness, rest = (value[f"parallel_stiffness.{n}"] for n in ("stiffness_nm_per_rad", "rest_angle_rad"))
    weight = WEIGHT * value["gravity_scale"]
    assert stiffness + weight == pytest.approx(STIFFNESS, rel=0.02)
    assert stiffness * rest == pytest.approx(TORQUE, rel=0.02)
