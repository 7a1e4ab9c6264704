"""A model with effects that the controller leaves out: tuned for where that helps, else refused with the reason."""

import math
from dataclasses import replace

import numpy as np
import pytest
from paper_ankle.constants import paper_twin
from paper_ankle.ratios import ankle_of
from paper_ankle.twin import RunningTwin

import fes_pin as fp
from fes_pin.control.control import PositionController
from fes_pin.control.dynamics import PULSE_S, AnkleDynamics, JointObserver
from fes_pin.control.faults import Status
from fes_pin.control.given import GivenAnkle, RunningAnkle
from fes_pin.control.loop import sine, track
from fes_pin.control.margins import margins
from fes_pin.control.tuning import Loop, loop_at, plant, swinging, tune
from fes_pin.data.errors import InputError
from fes_pin.models.catalogue import shipped

TWIN = replace(paper_twin("3-23"), load_kg=0.5)
LOW = TWIN.rest_angle() + math.radians(1.0)
FRAME = fp.effects.FrameVibration(coupling=1.3, frequency_hz=4.5, damping_ratio=0.03)


def given(*effects):
    model = ankle_of(TWIN)
    for effect in effects:
        model = model + effect
    return GivenAnkle(model, AnkleDynamics.of(model, TWIN.load_kg))


@pytest.mark.parametrize("q", [1.7, 1.9, 2.0])
def test_what_moves_without_effects_is_equation_1_and_with_a_frame_the_frames(q):
    """Derivatives of the compiled equations by CasADi against those written out by hand."""
    plain, framed = given(), given(FRAME)
    a, b, see = next(plain.moved(q))
    own, into, _ = plant(plain.dynamics, q)
    np.testing.assert_allclose(a[:3, :3], own[:3, :3], atol=1e-9)
    np.testing.assert_allclose(b[:3], into[:3], atol=1e-9)
    a, b, see = next(framed.moved(q))
    own, into = swinging(framed.dynamics, q)
    np.testing.assert_allclose(a[:5, :5], own, atol=1e-9)
    np.testing.assert_allclose(b[:5], into, atol=1e-9)
    assert see.tolist() == [0.0, 1.0, 0.0, 0.0, 0.0, 0.0]


@pytest.mark.parametrize(
    "effects",
    [
        [fp.effects.ElectromechanicalDelay(delay_s=0.013)],
        [fp.effects.ElectromechanicalDelay(delay_s=2.4 * PULSE_S)],
        [fp.effects.ElectromechanicalDelay(delay_s=2.0 * PULSE_S)],
        [fp.effects.SensorLag(lag_s=0.03), fp.effects.SecondOrderActivation(second_s=0.02)],
    ],
    ids=["part", "pulses and a part", "pulses", "lags"],
)
def test_what_moves_is_the_change_of_the_running_model(effects):
    """A little more recruitment for one pulse, at a steady state: 12 pulses of the answer, linear against running."""
    of, q = given(*effects), 1.8
    a, b, see = next(of.moved(q))
    width, answers = 180.0 + 820.0 * of.dynamics.activation_for(q), []
    for more in (0.0, 0.82e-2):
        joint, seen = RunningAnkle(of), []
        for k in range(200):
            seen.append(joint.step(width + more * (k == 180), PULSE_S))
        answers.append(seen[180:192])
    x, linear = 1e-5 * b, []
    for _ in range(12):
        linear.append(see @ x)
        x = a @ x
    np.testing.assert_allclose(np.subtract(*answers[::-1]), linear, atol=2e-3 * np.abs(linear).max())


def test_a_delay_of_whole_pulses_takes_the_margin_that_is_stated():
    """As states that hold past pulses: unstable exactly where the loop's own delay margin is passed."""
    plain, observer = given(), JointObserver(given().dynamics)
    gains = tune(plain.dynamics, observer)
    believed = plant(plain.dynamics, 1.8), np.array(gains.at(1.8)), observer.steady_gain(plant(plain.dynamics, 1.8)[0])

    def radius(pulses):
        late = given(fp.effects.ElectromechanicalDelay(delay_s=pulses * PULSE_S)) if pulses else plain
        return Loop.of(next(late.moved(1.8)), *believed).radius()

    assert radius(0) == pytest.approx(loop_at(plain.dynamics, observer, gains, 1.8).radius(), abs=1e-9)
    stated = margins(loop_at(plain.dynamics, observer, gains, 1.8)).delay_s / PULSE_S
    assert radius(math.floor(stated)) < 1.0 < radius(math.ceil(stated))


def test_a_delay_of_two_pulses_is_refused_with_the_reason():
    """With unchanged gains the loop was at fault in 4 of 4."""
    with pytest.raises(
        InputError, match=r"with electromechanical_delay, which .* leave out, the loop fails on .* far from"
    ):
        PositionController(ankle_of(TWIN) + fp.effects.ElectromechanicalDelay(delay_s=2 / 45), TWIN.load_kg)


def test_a_short_delay_is_tuned_for():
    plain = PositionController(ankle_of(TWIN), TWIN.load_kg)
    late = PositionController(ankle_of(TWIN) + fp.effects.ElectromechanicalDelay(delay_s=0.012), TWIN.load_kg)
    assert late.gains.boldness < plain.gains.boldness and late.gains.radius < 0.98
    run = track(
        late, RunningAnkle(given(fp.effects.ElectromechanicalDelay(delay_s=0.012))), sine(LOW, 15.0, 0.5, 6.0), seed=3
    )
    assert late.status is Status.RUNNING and late.calm == 1.0 and run.rms_error_deg(2.0) < 0.3


@pytest.mark.parametrize(
    ("effect", "why"),
    [
        (fp.effects.SensorLag(lag_s=0.1), "the loop fails on this model itself"),
        (fp.effects.SecondOrderActivation(second_s=0.1), "the loop fails on this model itself"),
        (fp.effects.CoulombFriction(torque_nm=0.5), "the loop fails on this model itself"),
        (fp.effects.StretchReflex(gain_nms=1.0), "no gains hold this ankle with stretch_reflex"),
        (fp.effects.SensorOffset(offset=0.4), "waiting for valid readings of a joint at rest"),
        (fp.effects.LoadError(error=5.0), "waiting for valid readings of a joint at rest|rests nowhere"),
    ],
)
def test_a_loop_that_fails_on_the_model_as_given_is_refused(effect, why):
    with pytest.raises(InputError, match=why) as refused:
        PositionController(ankle_of(TWIN) + effect, TWIN.load_kg)
    assert effect.name in str(refused.value) and "\n" not in str(refused.value)


@pytest.mark.parametrize(
    "effect",
    [
        fp.effects.ForceVelocity(slope_s_per_rad=1000.0, bend=20.0),
        fp.effects.ForceLength(slope_per_rad=1000.0, curvature_per_rad2=-1000.0),
        fp.effects.PassiveRelaxation(stiffness_nm_per_rad=828.0, relaxation_s=0.02),
    ],
    ids=lambda e: e.name,
)
def test_a_model_whose_numbers_overflow_is_refused_in_one_line(effect):
    with pytest.raises(InputError, match=effect.name):
        PositionController(ankle_of(TWIN) + effect, TWIN.load_kg)


ANKLES = [e for e in shipped().effects if "ankle" in e.rigs]


@pytest.mark.parametrize("effect", ANKLES, ids=lambda e: e.name)
def test_with_every_effect_an_ankle_is_held_or_refused_by_its_name(effect):
    model = ankle_of(TWIN) + effect()
    try:
        controller = PositionController(model, TWIN.load_kg)
    except InputError as refused:
        assert effect.name in str(refused)
        return
    run = track(controller, RunningAnkle(given(effect())), sine(LOW, 10.0, 0.5, 3.0), seed=5)
    assert controller.status is Status.RUNNING and controller.gains.radius < 1.0
    assert np.isfinite(run.pulse_width_us).all() and run.pulse_width_us.max() <= 1000.0


def test_friction_that_gives_before_it_slips_is_taken_as_friction():
    model = ankle_of(TWIN) + fp.effects.CoulombFriction(torque_nm=0.02, presliding=0.05)
    assert PositionController(model, TWIN.load_kg).gains.radius < 1.0


def test_the_rehearsal_leaves_no_trace():
    controller = PositionController(ankle_of(TWIN) + fp.effects.SensorOffset(offset=0.01), TWIN.load_kg)
    assert (
        controller.status is Status.WAITING and controller.trajectory == [] and controller.pulse.limiter.last_us == 0.0
    )
    assert controller.paused_s == 0.0 and controller.warning == ""
    joint = RunningTwin(TWIN)
    joint.step(controller.step(joint.angle_rad), PULSE_S)
