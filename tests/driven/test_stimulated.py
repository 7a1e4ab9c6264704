"""An ankle whose stimulator answers its angle: a position controller that keeps the foot on a wave.

Made by the independent rig, sample by sample; the pulse width is held over each.
"""

from dataclasses import replace

import numpy as np
import pytest
from diagnosis.hidden import study_of
from oracle.rigs import Ankle
from oracle.studies import ANGLE_NOISE_RAD, PROCESS_TORQUE_NM, RATE_HZ, SATURATION_US, THRESHOLD_US, ankle_rig
from scipy.integrate import odeint

from fes_pin.diagnosis.diagnosis import diagnose_joint
from fes_pin.identify.feedback import is_stimulus_fed_back
from fes_pin.models.nominal import nominal_model

SEED = 4
WIDEST = 700.0
"""Widest pulse that the controller gives, us: below saturation."""
KP, KI = 600.0, 500.0
"""Of the controller, us per rad and us per rad s."""


def controlled(trial, constants, nominal, causes, rng, hum=0.0, spasm=0.0, slip=0.0):
    """The trial again, its foot kept on a wave about where a pulse of middle width holds it.

    The angle is read with a hum, rad, of a phase of the trial's own, and spasms of a quarter of a second, N m, come in
    between, three in a trial. Its sensor slips by so much, rad, at a time of the trial's own.
    """
    rig, n, dt = Ankle(constants, nominal, causes, trial), len(trial), 1.0 / RATE_HZ
    x, gathered = np.array(rig.rest(), dtype=float), 0.0
    where = rig.names.index("q")
    sign = -1.0 if trial["angle_rad"].mean() < x[where] else 1.0
    slow, fast, phase = rng.uniform(0.25, 0.4), rng.uniform(0.7, 1.1), rng.uniform(0.0, 6.28, 3)
    width, angle, push = np.zeros(n), np.zeros(n), np.zeros(n)
    length = round(0.25 * RATE_HZ)
    for begin in rng.integers(0, n - length, 3) if spasm else ():
        push[begin : begin + length] += spasm * np.sin(np.pi * np.arange(length) / length) ** 2
    slips_at = (0.3 + 0.4 * phase[2] / 6.28) * n * dt
    for k in range(n):
        t = k * dt
        angle[k] = x[where] + ANGLE_NOISE_RAD * rng.normal() + hum * np.sin(2.0 * np.pi * 60.0 * t + phase[2])
        angle[k] += slip * (t > slips_at)
        wanted = rig.rest()[where] + sign * (0.15 + 0.06 * np.sin(6.28 * slow * t + phase[0]))
        wanted += 0.03 * np.sin(6.28 * fast * t + phase[1])
        error = sign * (wanted - angle[k])
        gathered += KI * error * dt
        width[k] = np.clip(THRESHOLD_US + 100.0 + KP * error + gathered, 0.0, WIDEST) if k else 0.0
        share = np.clip((width[k] - THRESHOLD_US) / (SATURATION_US - THRESHOLD_US), 0.0, 1.0)
        held = {"r": float(share), "disturbance": PROCESS_TORQUE_NM * rng.normal() + push[k]}
        x = odeint(rig.rates, x, [t, t + dt], args=(held,), tfirst=True, rtol=1e-9, atol=1e-11)[-1]
    return trial.with_columns(pulse_width_us=width, angle_rad=angle)


def stimulated(causes, hum=0.0, spasm=0.0, slip=0.0):
    """A study of such trials, beside isometric ones that a script has stimulated."""
    study = study_of("ankle", causes, "process", SEED)
    constants, nominal, _ = ankle_rig(np.random.default_rng(SEED))
    rng = np.random.default_rng([SEED, 1])
    hidden = (constants, nominal, causes, rng, hum, spasm, slip)
    return replace(study, trials=tuple(controlled(t, *hidden) if t.kind == "motion" else t for t in study.trials))


@pytest.mark.parametrize("causes", [{}, {"coulomb_friction": {"torque_nm": 0.04}}], ids=["nothing", "dry friction"])
def test_what_hides_in_an_ankle_under_position_control_is_named(causes):
    """Judged by free simulation friction had been 0.0388 +- 0.0001 N m beside something that is left.

    It is seen also where pulse widths are whole microseconds, tens of them, and held until the next pulse.
    """
    study = stimulated(causes)
    rig = nominal_model(study).rig
    assert is_stimulus_fed_back(rig, study.trials)
    for step in (1.0, 10.0):
        given = [t.with_columns(pulse_width_us=step * np.round(t["pulse_width_us"] / step)) for t in study.trials]
        assert is_stimulus_fed_back(rig, given)
    assert not is_stimulus_fed_back(rig, study_of("ankle", causes, "process", SEED).trials)
    found = diagnose_joint(study)
    assert found.is_driven
    assert [c.name for c in found.causes] == list(causes), str(found)
    assert not found.remainder.unexplained
    if causes:
        (friction,) = found.causes
        assert friction.parameters["torque_nm"].value == pytest.approx(0.04, rel=0.1)


def test_a_hum_whose_phase_is_each_trials_own_is_named():
    """Forecasts had left out what is each trial's own: the hum gained nothing, and was refused."""
    found = diagnose_joint(stimulated({}, hum=2e-3))
    assert [c.name for c in found.causes] == ["mains_hum"], str(found)
    (hum,), (effect,) = found.causes, found.model.effects
    assert effect.each_trial
    assert hum.gain_held_out.low > 50.0
    assert hum.parameters["amplitude"].value == pytest.approx(2e-3, rel=0.1)
    assert not found.remainder.unexplained


def test_spasms_are_left_beside_a_random_effort():
    """An effort of a small share stands for their mean power; when they come, the innovations tell."""
    found = diagnose_joint(stimulated({}, spasm=0.04))
    assert found.verdict == "unexplained" and found.remainder.where == "time", str(found)
    assert max(r.share for r in found.random) < 0.1


def test_a_sensor_that_slips_is_left_beside_a_random_effort():
    """A filter follows a new zero by the effort; what free simulation leaves keeps it until the trial ends."""
    found = diagnose_joint(stimulated({}, slip=4e-3))
    assert found.random and max(r.share for r in found.random) < 0.1
    assert found.remainder.unexplained, str(found)
