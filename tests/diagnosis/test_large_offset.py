"""Constants may be larger than what was commanded or read: an effort that belief lacks, an encoder without a zero."""

import numpy as np
import pytest
from diagnosis.hidden import study_of
from oracle import simulate
from oracle.studies import joint_rig, pendulum_urdf

from fes_pin.data.study import Study
from fes_pin.data.trial import Trial
from fes_pin.diagnosis.diagnosis import diagnose_joint
from fes_pin.models.effects import SensorDrift
from fes_pin.models.maths import TURN


def hides(offset):
    """A pendulum with a constant effort."""
    return study_of("joint", lambda *_: {"effort_offset": {"offset": offset}}, seed=4)


@pytest.mark.parametrize("times", [1.5, -2.5])
def test_an_offset_larger_than_the_largest_command_is_found(times):
    offset = times * max(float(np.abs(t["effort"]).max()) for t in hides(0.0).trials)
    (cause,) = diagnose_joint(hides(offset)).causes
    low, high = cause.parameters["offset"].interval
    assert cause.name == "effort_offset"
    assert low < offset < high


def small_swings(offset, folder):
    """A free pendulum with amplitudes of 0.1 to 0.16 rad; its encoder has a constant offset, rad."""
    rng, time, made = np.random.default_rng(5), np.arange(600) / 100, []
    constants, true, _ = joint_rig(rng)
    for k, size in enumerate((0.1, -0.13, 0.16)):
        bare = Trial(str(k), "motion", {}, time, {"position0": size - constants["turned"], "velocity0": 0.0})
        position = simulate(constants, true, {}, bare)["position"]
        made.append(Trial(bare.name, "motion", {"position": position + offset + 1e-4 * rng.normal(size=600)}, time))
    (folder / "rig.urdf").write_text(pendulum_urdf(constants))
    return Study("small", "joint", {}, true, tuple(made), files={"urdf": folder / "rig.urdf"})


def test_an_encoder_may_be_off_by_more_than_the_joint_swings(tmp_path):
    """It is the same as a tilt of the base, and so each is an equivalent of the other."""
    (cause,) = diagnose_joint(small_swings(0.5, tmp_path)).causes
    assert {cause.name, *cause.equivalents} >= {"base_tilt", "sensor_offset"}
    assert abs(next(iter(cause.parameters.values())).value) == pytest.approx(0.5, abs=1e-3)


def test_an_angle_drifts_by_a_turn_at_most():
    measured = {"time": np.array([0.0, 4.0]), "reading": np.array([0.0, 160.0])}
    drift = SensorDrift()
    assert drift.limits(measured)["rate_per_s"] == (-40.0, 40.0)
    assert drift.limits({**measured, "position": measured["reading"]})["rate_per_s"] == (-TURN / 4, TURN / 4)
