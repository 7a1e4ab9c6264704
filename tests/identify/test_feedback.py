"""Whether an effort answers what is read: rigs under feedback and efforts that were chosen beforehand."""

import numpy as np
import pytest

from fes_pin.data.study import read_study
from fes_pin.data.trial import Trial
from fes_pin.identify import feedback
from fes_pin.identify.feedback import is_fed_back, is_stimulus_fed_back
from fes_pin.models.nominal import nominal_model
from fes_pin.models.rigs import Joint, Muscle

RIG = Joint(constants={"inertia": 0.05, "gravity_cos": 0.0, "gravity_sin": 1.0, "revolute": 1.0}, damping=0.05)
DT = 0.005


def steps(rng: np.random.Generator, n: int) -> np.ndarray:
    return np.repeat(rng.normal(size=-(-n // 60)), 60)[:n] + np.sin(2.0 * np.arange(n) * DT)


def chirp(rng: np.random.Generator, n: int) -> np.ndarray:
    """From rest to 4 Hz, beginning after a second and ending before the trial does."""
    time = np.arange(n) * DT - 1.0
    sweep = np.sin(2.0 * np.pi * (0.2 * time + 0.5 * 4.0 / (n * DT) * time**2))
    return np.where((time > 0.0) & (time < 0.5 * n * DT), rng.uniform(0.5, 1.5) * sweep, 0.0)


def trial(seed: int, feedback: float, count: float = 0.0, n: int = 1500, noise: float = 3e-4, choose=steps) -> Trial:
    rng = np.random.default_rng(seed)
    q = v = 0.0
    chosen = choose(rng, n)
    effort, position = np.empty(n), np.empty(n)
    for k in range(n):
        reading = q + noise * rng.normal()
        position[k] = np.round(reading / count) * count if count else reading
        effort[k] = 0.5 * chosen[k] - feedback * position[k]
        for _ in range(5):
            v += DT / 5 * (effort[k] - 0.05 * v - np.sin(q)) / 0.05
            q += DT / 5 * v
    return Trial(f"t{seed}", "motion", {"effort": effort, "position": position}, np.arange(n) * DT)


@pytest.mark.parametrize("count", [0.0, 1e-3])
def test_a_controller_is_seen(count):
    assert is_fed_back(RIG, [trial(k, 2.0, count) for k in range(2)])


def test_a_controller_of_an_encoder_that_mostly_stands_is_seen():
    """Without noise most differences of coarse counts are zero; what is left of them comes back."""
    trials = [trial(k, 2.0, 8e-2, noise=0.0) for k in range(2)]
    assert all(np.median(np.abs(np.diff(t["position"], 2))) == 0.0 for t in trials)
    assert is_fed_back(RIG, trials)


def test_efforts_that_were_chosen_beforehand_are_not_taken_for_answers():
    """The level is 1e-9: in forty rigs there is none, however the rig answers its effort."""
    assert not any(is_fed_back(RIG, [trial(20 * k + j, 0.0) for j in range(2)]) for k in range(20))
    assert not any(is_fed_back(RIG, [trial(900 + 20 * k + j, 0.0, 1e-3) for j in range(2)]) for k in range(20))


def test_chirps_are_not_taken_for_answers():
    """A chirp is not predicted exactly by its past, and readings of the motion that it makes help."""
    assert not any(
        is_fed_back(RIG, [trial(40 * k + j, 0.0, noise=3e-5, choose=chirp) for j in range(2)]) for k in range(20)
    )
    assert is_fed_back(RIG, [trial(k, 2.0, noise=3e-5, choose=chirp) for k in range(2)])


def test_free_motion_has_no_effort_that_could_answer():
    assert not is_fed_back(RIG, [trial(1, 2.0).without("effort")])


@pytest.mark.shared
def test_no_stimulus_that_a_script_wrote_seems_to_answer(shared):
    """It follows the motion that it made: by the p-value alone nearly all of these ankles' would.

    Readings tell 0.01 of it beyond its past in the median, and 0.10 at most.
    """
    studies = [read_study(one) for one in sorted((shared / "practice").glob("*/study.toml"))]
    assert len(studies) == 36
    assert not any(is_stimulus_fed_back(nominal_model(one).rig, one.trials) for one in studies)
    shares = [
        share
        for one in studies
        for _, share in feedback._answers(nominal_model(one).rig, one.trials, feedback.OF_STIMULUS)
    ]
    assert (round(float(np.median(shares)), 2), round(max(shares), 2)) == (0.01, 0.10)


@pytest.mark.parametrize("every", [40, 1000])
def test_pulses_of_one_sample_are_not_taken_for_answers(every):
    """Readings without noise say how long ago a pulse was, but a muscle that was stimulated chooses none."""
    stim = (np.arange(750) % every == 54 % every).astype(float)
    force = np.zeros(750)
    for k in range(749):
        force[k + 1] = 0.95 * force[k] + stim[k]
    rig = Muscle(gain=1.0, time_constant_s=0.05)
    trials = [Trial("a", "isometric", {"stim": stim, "force_n": force}, np.arange(750) * 0.002)]
    assert not is_stimulus_fed_back(rig, trials)
