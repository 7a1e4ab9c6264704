"""How long trials rest is known of readings with noise and in counts, and nothing is said of what moves."""

import numpy as np
import pytest

import fes_pin as fp
from fes_pin.data.by_itself import resting
from fes_pin.data.plausibility import implausible
from fes_pin.data.rests import MATTERS, rest_share
from fes_pin.data.study import Study
from fes_pin.data.templates import rod
from fes_pin.data.trial import Trial

STEP, SAMPLES = 0.005, 8000
READINGS = {
    "exact": lambda y, rng: y,
    "noisy": lambda y, rng: y + rng.normal(0.0, 0.003, len(y)),
    "very noisy": lambda y, rng: y + rng.normal(0.0, 0.01, len(y)),
    "in counts": lambda y, rng: 0.002 * np.round(y / 0.002),
    "in coarse counts": lambda y, rng: 0.02 * np.round(y / 0.02),
    "in counts with noise": lambda y, rng: 0.005 * np.round((y + rng.normal(0.0, 0.003, len(y))) / 0.005),
}


def swung(share, pieces, rng):
    """A driven motion, and its effort, that rests for a share of the time, in some pieces."""
    n = SAMPLES // pieces
    moving = round(n * (1.0 - share))
    phase = np.zeros(n)
    phase[:moving] = np.linspace(0.0, 2.0 * np.pi * rng.integers(1, 5), moving)
    phase[moving:] = phase[moving - 1] if moving else 0.0
    one = rng.uniform(0.3, 1.5) * (1.0 - np.cos(phase))
    return np.tile(one, pieces), np.tile(3.0 * np.sin(phase), pieces)


def share_of(position, effort):
    time = STEP * np.arange(len(position))
    trial = Trial("a", "driven", {"position": position, "effort": effort}, time, {})
    return rest_share([(trial, ["position"], ["effort"])])


@pytest.mark.parametrize("share", [0.0, 0.3, 0.6, 0.9])
@pytest.mark.parametrize("reading", READINGS)
@pytest.mark.parametrize("seed", range(6))
def test_the_share_of_rest_is_found(reading, share, seed):
    rng = np.random.default_rng([seed, int(10 * share)])
    position, effort = swung(share, int(rng.integers(1, 4)), rng)
    noisy = effort + rng.normal(0.0, 0.02, len(effort)) * (seed % 2)
    found = share_of(READINGS[reading](position, rng), noisy)
    assert abs(found - share) < 0.13, found
    assert (found > MATTERS) == (share > MATTERS)


@pytest.mark.parametrize("seed", range(8))
def test_what_moves_slowly_dies_away_or_hides_in_noise_does_not_rest(seed):
    rng = np.random.default_rng(seed)
    time = STEP * np.arange(SAMPLES)
    noise = rng.normal(0.0, 10.0 ** rng.uniform(-5, -1), SAMPLES)
    nothing = np.zeros(SAMPLES)
    slow = np.sin(2.0 * np.pi * time / rng.uniform(5.0, 60.0))
    fast = np.sin(2.0 * np.pi * time * rng.uniform(0.5, 10.0))
    dying = np.exp(-time / rng.uniform(8.0, 20.0)) * np.cos(2.0 * np.pi * time * rng.uniform(0.5, 2.0))
    for position in (slow, fast, dying):
        assert share_of(position + noise, nothing) < 0.35
    assert share_of(noise, nothing) == 0.0


def test_an_input_that_goes_on_is_no_rest():
    rng = np.random.default_rng(0)
    position, _ = swung(0.9, 1, rng)
    assert share_of(position, np.sin(np.arange(SAMPLES) / 50.0)) < 0.1


def test_an_imposed_motion_is_no_rest_where_its_effort_is_constant(tmp_path):
    time = np.arange(0.0, 8.0, 0.01)
    effort = 0.3 * np.sign(np.cos(1.5 * time)) + 0.01 * np.random.default_rng(0).standard_normal(len(time))
    columns = {"position": np.sin(1.5 * time), "effort": effort}
    (tmp_path / "rod.urdf").write_text(rod(0.4, 1.0))
    known = {"name": "a", "rig": "joint", "constants": {}, "files": {"urdf": tmp_path / "rod.urdf"}}
    start = {"inertia_scale": 1.0, "damping": 0.1}
    study = Study(trials=(Trial("a", "imposed", columns, time),), start=start, **known)
    assert not any("rest for" in said for said in implausible(study))


@pytest.mark.parametrize("count", [3, 9])
def test_a_trial_of_fewer_than_ten_samples_shows_no_rest(count):
    columns = {"position": np.linspace(0.0, 0.1, count), "effort": np.ones(count)}
    trial = fp.Trial("short", "motion", columns, 0.01 * np.arange(count))
    assert resting(trial, "effort", slice(count // 10)) is None
