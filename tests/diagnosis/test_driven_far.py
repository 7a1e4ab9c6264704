"""Joints that are driven over the top, and muscles whose pulse trains differ in rate: the causes are still told."""

import math

import numpy as np
import pytest
import scipy.signal
from diagnosis.hidden import named
from oracle import TYPICAL, simulate
from oracle.studies import joint_rig, pendulum_urdf

from fes_pin.data.study import Study
from fes_pin.data.trial import Trial
from fes_pin.diagnosis.diagnosis import diagnose_joint
from fes_pin.identify.ahead import free_residuals
from fes_pin.infer.noise import Noise
from fes_pin.models.nominal import nominal_model
from fes_pin.models.simulate import Simulator

DT = 5e-3


def far_driven(seed, causes, folder, trials=4, seconds=6.0):
    """A pendulum that a square wave near its own rate drives over the top, believed 40 % heavier and less damped."""
    rng, time = np.random.default_rng(seed), np.arange(round(seconds / DT)) * DT
    constants, true, _ = joint_rig(rng)
    weight, made = math.hypot(constants["gravity_cos"], constants["gravity_sin"]), []
    rate = math.sqrt(weight / (true["inertia_scale"] * constants["inertia"]))
    for number, phase in enumerate(rng.uniform(0.0, 2.0 * math.pi, trials)):
        effort = 0.6 * weight * np.sign(np.sin(0.8 * rate * time + phase))
        bare = Trial(str(number), "motion", {"effort": effort}, time, {"position0": 0.3, "velocity0": 0.0})
        position = simulate(constants, true, causes, bare)["position"] + 2e-3 * rng.standard_normal(len(time))
        made.append(Trial(bare.name, "motion", {"effort": effort, "position": position}, time))
    (folder / "rig.urdf").write_text(pendulum_urdf(constants))
    start = {"inertia_scale": 1.4 * true["inertia_scale"], "damping": 0.6 * true["damping"]}
    return Study("far", "joint", {}, start, tuple(made), files={"urdf": folder / "rig.urdf"})


@pytest.mark.parametrize("cause", [None, "quadratic_damping", "mains_hum", "sensor_gain"])
def test_a_joint_driven_over_the_top(cause, tmp_path):
    """A gain of 6 % leaves nothing of the nominal model; a small drag lets the joint swing far enough."""
    size = {"quadratic_damping": {"coefficient": 0.003}}.get(cause, TYPICAL.get(cause))
    study = far_driven(71, {cause: dict(size)} if cause else {}, tmp_path)
    assert max(np.ptp(t["position"]) for t in study.trials) > 3.0
    assert named(diagnose_joint(study)) == ([{cause}] if cause else [])


def test_a_twin_is_found_where_a_fit_from_far_off_does_not_arrive(tmp_path):
    """On a joint that tumbles an offset of the sensor is a tilt of the base: the same motion, read the same."""
    study = far_driven(86, {"sensor_offset": TYPICAL["sensor_offset"]}, tmp_path)
    assert named(diagnose_joint(study)) == [{"sensor_offset", "base_tilt"}]


def test_a_free_simulation_of_a_joint_that_tumbles_starts_where_its_trial_says(tmp_path):
    """From the first reading, 0.1 degrees off, a simulation of the true model errs by turns."""
    study = far_driven(86, {}, tmp_path)
    start = study.start
    model = nominal_model(study).with_parameters(
        {"inertia_scale": start["inertia_scale"] / 1.4, "damping": start["damping"] / 0.6}
    )
    read, missed = Simulator(model, study.trials), []
    for trial, run in zip(study.trials, read.run(model.parameters(), read.start(model.parameters())), strict=True):
        (residual,) = free_residuals(model, trial, {"position": Noise(2e-3, (), 2e-3)}).values()
        assert np.std(residual) == pytest.approx(2e-3, rel=0.1)
        missed.append(np.abs(trial["position"] - run.readings[:, 0]).max())
    assert max(missed) > 1.0


def trains(seed, late=0, dt=1e-3, seconds=4.0):
    """Isometric trains with a pause, each trial of other rates; the force is the lag's exact answer to held pulses."""
    rng, time = np.random.default_rng(seed), np.arange(round(seconds / dt)) * dt
    area, decay, made = 0.05, math.exp(-dt / 0.055), []
    for number in range(5):
        stim = np.zeros(len(time))
        for begin in (0.3, 2.2):
            pulses = np.arange(begin, begin + 1.2, 1.0 / rng.uniform(12.0, 36.0))
            stim[np.round(pulses / dt).astype(int)] = 1.0
        felt = np.r_[np.zeros(late), stim[: len(stim) - late]] * area / dt
        act = scipy.signal.lfilter([0.0, 1.0 - decay], [1.0, -decay], felt)
        force = 38.0 * act + 0.15 * rng.standard_normal(len(time))
        made.append(Trial(str(number), "isometric", {"stim": stim, "force_n": force}, time))
    return Study("trains", "muscle", {}, {"gain": 50.0, "time_constant_s": 0.04}, tuple(made))


@pytest.mark.parametrize("late", [0, 12])
def test_trains_of_other_rates_are_one_muscle(late):
    """On the muscle a delay is told from lags by its edge."""
    diagnosis = diagnose_joint(trains(72, late))
    assert named(diagnosis) == ([{"electromechanical_delay"}] if late else []), str(diagnosis)
    assert not diagnosis.remainder.unexplained
