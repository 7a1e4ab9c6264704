"""Spikes are found, and nothing else is taken for one."""

import numpy as np
import pytest
from oracle import TYPICAL, make_study

from fes_pin.data.spikes import FAR, despiked, without_spikes
from fes_pin.data.trial import Trial

TIME = np.arange(2000) * 5e-3
OUTPUTS = ("angle_rad", "force_n", "position")


def smooth(seed):
    rng = np.random.default_rng(seed)
    return 0.3 * np.sin(2.0 * TIME) + 2e-3 * rng.standard_normal(len(TIME))


@pytest.mark.parametrize("height", [20.0, 100.0])
def test_one_in_a_hundred(height):
    """All are found, of either sign, also side by side and at the ends; what replaces them is as good as a sample."""
    rng = np.random.default_rng(1)
    clean = smooth(2)
    hit = rng.random(len(clean)) < 0.01
    hit[[0, -1, 500, 501]] = True
    signs = rng.choice([-1.0, 1.0], len(clean))
    signs[500:502] = 1.0
    out, mask = despiked(clean + np.where(hit, 2e-3 * height * signs, 0.0))
    assert mask[hit].mean() > 0.9  # some share their neighbours with others
    assert (mask & ~hit).sum() <= 2
    assert np.abs(out - 0.3 * np.sin(2.0 * TIME))[mask & hit].max() < 12 * 2e-3
    assert np.array_equal(out[~mask], clean[~mask])


def test_what_stays():
    """At 15 deviations nearly all are found, at 8 few: the README says so."""
    shares = []
    for height in (8.0, 15.0):
        rng, found, there = np.random.default_rng(7), 0, 0
        for seed in range(10):
            hit = rng.random(len(TIME)) < 0.01
            _, mask = despiked(smooth(seed) + np.where(hit, 2e-3 * height * rng.choice([-1.0, 1.0], len(TIME)), 0.0))
            found, there = found + int((mask & hit).sum()), there + int(hit.sum())
        shares.append(found / there)
    assert shares[0] < 0.5 and shares[1] > 0.95


STEEP = {
    "step": np.where(TIME > 4.0, 1.0, 0.0),
    "onset": np.maximum(TIME - 4.0, 0.0) * 50.0,
    "contact": np.abs(TIME - 4.0013) * 5.0,
    "bounces": np.abs(np.sin(3.0 * TIME)),
    "hum": 0.2 * np.sin(2 * np.pi * 50.0 * TIME + 0.3),
    "burst of vibration": 0.2
    * np.sin(2 * np.pi * 31.0 * TIME)
    * np.exp(-8.0 * np.maximum(TIME - 5.0, 0))
    * (TIME > 5.0),
    "one twitch": np.select([TIME > 4.0, TIME == 4.0], [np.exp(-7.0 * (TIME - 4.005)), 0.56]),
    "begins to fall at the end": 1.8 - 400.0 * np.maximum(TIME - TIME[-5], 0.0) ** 2,
    "twitches": np.exp(-(TIME % 0.125) / 0.03),
    "at rest": np.zeros_like(TIME),
}


@pytest.mark.parametrize("noise", [0.0, 2e-3])
@pytest.mark.parametrize("what", STEEP)
def test_what_is_steep_is_no_spike(what, noise):
    values = STEEP[what] + noise * np.random.default_rng(3).standard_normal(len(TIME))
    _, mask = despiked(values)
    assert not mask.any()


@pytest.mark.parametrize("digits", [2, 3])
def test_the_steps_of_an_encoder_are_no_spikes(digits):
    assert not despiked(np.round(smooth(4), digits))[1].any()


@pytest.mark.parametrize("rig", ["ankle", "joint", "muscle"])
def test_a_clean_study_is_left_alone(rig):
    """Every cause of typical size, by the independent simulator; the trial is the same object."""
    for seed, (cause, values) in enumerate(TYPICAL.items()):
        if rig != "ankle" and cause not in ("mains_hum", "fatigue", "joint_stop", "coulomb_friction"):
            continue
        noise = ("white", "ar1", "process")[seed % 3]
        here = {**values, "angle_rad": 0.4} if (rig, cause) == ("joint", "joint_stop") else values
        hidden = {} if (rig, cause) in (("joint", "fatigue"), ("muscle", "joint_stop")) else {cause: here}
        hidden = {} if (rig, cause) == ("muscle", "coulomb_friction") else hidden
        study = make_study(np.random.default_rng(seed), rig, hidden, noise, 2, 1, duration_s=4.0)
        for trial in study.trials:
            same, found = without_spikes(trial, OUTPUTS)
            assert same is trial and found == {}, (cause, trial.name, found)


def test_too_many_belong_to_the_signal():
    values = smooth(5)
    values[::15] += 1.0
    assert not despiked(values)[1].any()


def test_only_the_columns_asked_for():
    values = smooth(6)
    values[700] += 2.0 * FAR * 2e-3
    trial = Trial("a", "motion", {"position": values, "effort": values}, TIME)
    clean, found = without_spikes(trial, ("position", "velocity"))
    assert found == {"position": (700,)}
    assert np.array_equal(clean["effort"], values) and abs(clean["position"][700] - values[700]) > 0.02
