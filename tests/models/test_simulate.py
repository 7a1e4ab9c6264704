"""Simulation against closed forms: what is held between samples, where it jumps, and how late it comes."""

import math

import numpy as np
import pytest
from models.cases import MUSCLE, RIGS, pulses, trial

from fes_pin.data.study import Study
from fes_pin.data.trial import Trial
from fes_pin.models.effects.electromechanical_delay import ElectromechanicalDelay
from fes_pin.models.effects.sensor_gain import SensorGain
from fes_pin.models.effects.sensor_nonlinearity import SensorNonlinearity
from fes_pin.models.effects.sensor_offset import SensorOffset
from fes_pin.models.model import Model
from fes_pin.models.nominal import nominal_model
from fes_pin.models.rigs import Joint
from fes_pin.models.simulate import MAX_STEP_S, STABLE, Simulator, max_step, simulate, substeps

GAIN, TAU = RIGS["muscle"].gain, RIGS["muscle"].time_constant_s
LOW, HIGH = MUSCLE["threshold_us"], MUSCLE["saturation_us"]


def muscle_trial(width, dt=5e-3):
    return Trial("muscle", "isometric", {"pulse_width_us": width}, np.arange(len(width)) * dt)


def exact_force(width, dt, delay=0.0, tau=TAU):
    """Sum of the answers a' = (r - a) / tau to each jump of the recruitment."""
    time = np.arange(len(width)) * dt
    r = np.clip((width - LOW) / (HIGH - LOW), 0.0, 1.0)
    force = np.zeros(len(width))
    for k, jump in enumerate(np.diff(r, prepend=0.0)):
        since = time - k * dt - delay
        force += jump * np.where(since > 0.0, 1.0 - np.exp(-np.maximum(since, 0.0) / tau), 0.0)
    return GAIN * force


def test_a_held_stimulus_is_exact():
    """RK4 errs by (h / tau)^5 / 120 of a jump in each step: 4e-7 N here."""
    width = pulses(np.random.default_rng(0), 400, 50.0, 600.0)
    force = simulate(Model(RIGS["muscle"]), muscle_trial(width))["force_n"]
    assert np.abs(force - exact_force(width, 5e-3)).max() <= 2e-6 * GAIN


def test_where_the_steps_fall_does_not_matter():
    width = pulses(np.random.default_rng(1), 400, 50.0, 600.0)
    exact = exact_force(width, 5e-3)
    for steps in (2, 3, 5, 7):
        simulator = Simulator(Model(RIGS["muscle"]), [muscle_trial(width)], max_step_s=5e-3 / steps)
        (answer,) = simulator.run(Model(RIGS["muscle"]).parameters())
        order = (2.0 / steps) ** 4
        assert np.abs(answer.readings[:, 0] - exact).max() <= 2e-6 * GAIN * order + 1e-12


def test_an_edge_on_a_sample_acts_from_there():
    width = np.zeros(60)
    width[20:] = 400.0
    force = simulate(Model(RIGS["muscle"]), muscle_trial(width))["force_n"]
    assert np.array_equal(force[:21], np.zeros(21))
    assert force[21] == pytest.approx(GAIN * 0.75 * (1.0 - math.exp(-5e-3 / TAU)), rel=1e-6)


def test_one_pulse_of_one_sample_is_felt():
    width = np.zeros(40)
    width[10] = 500.0
    force = simulate(Model(RIGS["muscle"]), muscle_trial(width))["force_n"]
    assert np.abs(force - exact_force(width, 5e-3)).max() <= 1e-6 * GAIN
    assert force[11] > 0.0


@pytest.mark.parametrize("delay", [0.0, 1e-5, 0.0024, 0.0025, 0.0026, 0.00499, 0.005, 0.0117, 0.02, 0.0433])
@pytest.mark.parametrize("steps", [1, 2, 3, 8])
def test_a_delay_is_exact(delay, steps):
    """At any share of a sample, for any number of steps, with its sensitivity."""
    width = pulses(np.random.default_rng(2), 300, 50.0, 600.0)
    model = Model(RIGS["muscle"]) + ElectromechanicalDelay(delay)
    simulator = Simulator(model, [muscle_trial(width)], ("electromechanical_delay.delay_s",), max_step_s=5e-3 / steps)
    (answer,) = simulator.run(model.parameters())
    error = 4e-5 if steps == 1 else 2e-6
    assert np.abs(answer.readings[:, 0] - exact_force(width, 5e-3, delay)).max() <= error * GAIN
    by = 1e-7
    slope = (exact_force(width, 5e-3, delay + by) - exact_force(width, 5e-3, delay)) / by
    on_an_edge = math.isclose(delay / 5e-3, round(delay / 5e-3))
    if not on_an_edge:  # a reading at the very jump has two slopes
        assert np.abs(answer.sensitivities[:, 0, 0] - slope).max() <= (error + 2e-5) * np.abs(slope).max()


def test_a_delay_is_continuous_across_samples():
    width = pulses(np.random.default_rng(3), 300, 50.0, 600.0)
    model, key = Model(RIGS["muscle"]) + ElectromechanicalDelay(0.0), "electromechanical_delay.delay_s"
    simulator = Simulator(model, [muscle_trial(width)], (key,))
    for whole in (1, 2, 7):
        before, on, after = (
            simulator.run({**model.parameters(), key: whole * 5e-3 + by})[0] for by in (-1e-10, 0.0, 1e-10)
        )
        assert np.abs(before.readings - on.readings).max() <= 2e-6 * GAIN
        assert np.abs(after.readings - on.readings).max() <= 2e-6 * GAIN


def test_the_integration_step_follows_the_model():
    plain, late = Model(RIGS["muscle"]), Model(RIGS["muscle"]) + ElectromechanicalDelay(0.01)
    assert [substeps(plain, dt, 2.5e-3) for dt in (1e-3, 2.5e-3, 5e-3, 1e-2)] == [1, 1, 2, 4]
    assert [substeps(late, dt, 2.5e-3) for dt in (1e-3, 2.5e-3, 5e-3, 1e-2)] == [2, 2, 3, 5]


def test_the_time_of_a_trial_counts_from_its_first_sample():
    model = Model(RIGS["ankle"])
    one = trial("ankle", "motion", np.random.default_rng(4))
    later = Trial(one.name, one.kind, one.columns, one.time + 1000.0, one.conditions)
    assert np.abs(simulate(model, one)["angle_rad"] - simulate(model, later)["angle_rad"]).max() <= 1e-9


def test_a_free_pendulum_swings_with_its_period():
    """Small oscillations about the rest, damped: closed form."""
    constants = {"inertia": 0.02, "gravity_cos": 0.0, "gravity_sin": 0.6, "revolute": 1.0}
    model = Model(Joint(1.0, 0.01, 1.0, constants=constants))
    time = np.arange(2000) * 1e-3
    start = 1e-5
    swing = Trial("swing", "motion", {}, time, {"position0": start, "velocity0": 0.0})
    decay, omega = 0.25, math.sqrt(0.6 / 0.02 - 0.25**2)
    exact = start * np.exp(-decay * time) * (np.cos(omega * time) + decay / omega * np.sin(omega * time))
    assert np.abs(simulate(model, swing)["position"] - exact).max() <= 1e-6 * start


def test_a_slide_falls_freely():
    constants = {"inertia": 1.7, "gravity_cos": 1.7 * 9.81, "gravity_sin": 0.0, "revolute": 0.0}
    time = np.arange(500) * 2e-3
    fall = Trial("fall", "motion", {}, time, {"position0": 0.2, "velocity0": 1.0})
    position = simulate(Model(Joint(1.0, 0.0, 1.0, constants=constants)), fall)["position"]
    assert np.abs(position - (0.2 + time - 0.5 * 9.81 * time**2)).max() <= 1e-12


def test_recorded_pulses_carry_the_same_mean_at_any_rate():
    """`stim`: a train settles at the gain, whatever the sample rate."""
    for dt in (1e-3, 5e-4):
        time = np.arange(round(2.0 / dt)) * dt
        stim = np.zeros(len(time))
        stim[round(0.1 / dt) :: round(0.05 / dt)] = 1.0
        force = simulate(Model(RIGS["muscle"]), Trial("train", "isometric", {"stim": stim}, time))["force_n"]
        period = round(0.05 / dt)
        assert force[-10 * period :].mean() == pytest.approx(GAIN, rel=2e-3)


@pytest.mark.filterwarnings("ignore:force_n is cut off:fes_pin.InputWarning")
def test_a_faster_train_makes_more_force():
    """Pulses add up, whatever the rate: the area of one is the study's, not the trial's."""
    time, trains = np.arange(4000) * 1e-3, []
    for number, period in enumerate((50, 50, 25)):
        stim = np.zeros(len(time))
        stim[100:1600:period] = stim[2100:3600:period] = 1.0
        trains.append(Trial(str(number), "isometric", {"stim": stim, "force_n": stim}, time))
    model = nominal_model(Study("trains", "muscle", {}, {"gain": GAIN, "time_constant_s": TAU}, tuple(trains)))
    slow, again, fast = (simulate(model, t)["force_n"][1550:1600].mean() for t in trains)
    assert (slow, again, fast) == pytest.approx((GAIN, GAIN, 2.0 * GAIN), rel=2e-3)


def test_a_rate_that_was_not_measured_is_estimated_with_the_model():
    """Noise of 2 mrad at 200 Hz: a parabola through 50 ms errs by 0.2 rad/s, the model through 0.2 s by 0.02."""
    rng, time = np.random.default_rng(3), np.arange(400) * 5e-3
    model, position, missed = Model(RIGS["joint"]), 0.4, []
    for rate in rng.uniform(-2.0, 2.0, 20):
        known = Trial("swing", "motion", {}, time, {"position0": position, "velocity0": rate})
        noisy = simulate(model, known)["position"] + 2e-3 * rng.standard_normal(len(time))
        (start,) = Simulator(model, [Trial("swing", "motion", {"position": noisy}, time)]).start(model.parameters())
        assert start["initial_position"] == noisy[0]
        missed.append(start["initial_velocity"] - rate)
    assert np.sqrt(np.mean(np.square(missed))) < 0.02


def test_a_measured_rate_is_taken_as_it_is():
    time = np.arange(400) * 5e-3
    wrong = {"position": np.cos(time), "velocity": np.full(400, 3.0)}
    (start,) = Simulator(Model(RIGS["joint"]), [Trial("swing", "motion", wrong, time)]).start(
        RIGS["joint"].parameters()
    )
    assert (start["initial_position"], start["initial_velocity"]) == (1.0, 3.0)


@pytest.mark.parametrize("of_sensor", [SensorOffset(0.2), SensorGain(0.1, 1.0), SensorNonlinearity(0.1, 2.0)])
def test_a_prediction_starts_where_the_sensor_reads_the_first_sample(of_sensor):
    """Not where the reading would be if it were the angle."""
    model, time = Model(RIGS["joint"]) + of_sensor, np.arange(400) * 5e-3
    known = Trial("swing", "motion", {}, time, {"position0": 0.4, "velocity0": 0.0})
    reading = simulate(model, known)["position"]
    (start,) = Simulator(model, [Trial("swing", "motion", {"position": reading}, time)]).start(model.parameters())
    assert abs(reading[0] - 0.4) > 5e-3
    assert start["initial_position"] == pytest.approx(0.4, abs=1e-9)
    assert start["initial_velocity"] == pytest.approx(0.0, abs=1e-6)
    (told,) = Simulator(model, [known]).start(model.parameters())
    assert (told["initial_position"], told["initial_velocity"]) == (0.4, 0.0), "told as the angle, not as read"


@pytest.mark.parametrize("damping", [2.0, 20.0, 200.0])
def test_a_decay_of_any_time_constant_is_stable(damping):
    """A joint without gravity comes to rest v0 time constants from where it began."""
    joint = Joint(1.0, damping, 0.0, constants=RIGS["joint"].constants)
    moving = Trial("decay", "motion", {}, np.arange(100) * 1e-2, {"position0": 0.3, "velocity0": 1.0})
    (run,) = Simulator(Model(joint), [moving]).run(Model(joint).parameters())
    angle = run.readings[:, 0]
    assert joint.decay_s() == pytest.approx(0.02 / damping)
    assert angle[-1] - 0.3 == pytest.approx(joint.decay_s(), rel=1e-9)


def test_only_a_stiff_model_has_shorter_steps():
    slack = Joint(1.0, 10.0, 0.0, constants=RIGS["joint"].constants)
    stiff = Joint(1.0, 200.0, 0.0, constants=RIGS["joint"].constants)
    free = Joint(1.0, 0.0, 0.0, constants=RIGS["joint"].constants)
    assert [max_step(Model(j)) for j in (free, slack, stiff)] == [MAX_STEP_S, MAX_STEP_S, STABLE * stiff.decay_s()]
    assert [max_step(Model(RIGS[name])) for name in RIGS] == [MAX_STEP_S] * 3
