"""Gain and time constant by Kalman filter: accuracy, consistency, online use, agreement with the batch fit."""

import numpy as np
import pytest
from paper_ankle.consistency import chi2_band, nees
from paper_ankle.constants import FORCE_NOISE_N, HELD_AT_RAD, isometric_stimulus, paper_study, paper_trial, paper_twin
from paper_ankle.regression import RegressionFilter
from paper_ankle.twin import record

from fes_pin.data.errors import InputError
from fes_pin.infer.noise import Noise
from fes_pin.models.nominal import nominal_model
from fes_pin.paper.kalman import GainFilter, StraightRecruitment, history_of, track_gain
from fes_pin.search.fit import fit

TWIN = paper_twin("3-23")
CONSTANTS = TWIN.constants()
CHECKS = (112, 225, 450, 1125)
"""Samples at 0.5, 1, 2 and 5 s."""
RUNS = 60


def isometric(seed, noise=FORCE_NOISE_N, seconds=8.0):
    return record(TWIN, isometric_stimulus(seconds), "held", held_at_rad=HELD_AT_RAD, noise_std=noise, seed=seed)


@pytest.fixture(scope="module")
def runs():
    """NEES at the checks, shape (runs, checks), and NIS, shape (runs, samples)."""
    squares, innovations = [], []
    for seed in range(RUNS):
        trial = isometric(2000 + seed, seconds=5.25)
        tracker = GainFilter(trial.dt, StraightRecruitment.of(CONSTANTS), FORCE_NOISE_N)
        at, nis = [], []
        for k, (force, width) in enumerate(zip(trial["force_n"], trial["pulse_width_us"], strict=True)):
            tracker.step(force, width)
            nis.append(tracker.nis)
            if k in CHECKS:
                at.append(nees(tracker, TWIN.gain, TWIN.time_constant_s))
        squares.append(at)
        innovations.append(nis)
    return np.array(squares), np.array(innovations)


@pytest.mark.parametrize("seed", range(5))
def test_within_two_percent_after_five_seconds(seed):
    gain, tau = track_gain(isometric(seed), CONSTANTS, FORCE_NOISE_N).at(5.0)
    assert gain == pytest.approx(0.65, rel=0.02) and tau == pytest.approx(0.05, rel=0.02)


def test_the_filter_does_the_sums_of_a_kalman_filter():
    """Against matrices: the correction in Joseph's form, the prediction with the product's exact moments."""
    trial, noise = isometric(11, seconds=2.0), FORCE_NOISE_N
    tracker = GainFilter(trial.dt, StraightRecruitment.of(CONSTANTS), noise, wander=0.05)
    x, p = tracker.x, tracker.p
    for force, width in zip(trial["force_n"], trial["pulse_width_us"], strict=True):
        tracker.step(float(force), float(width))
        gain = p[:, 0] / (p[0, 0] + noise**2)
        keep = np.eye(3) - np.outer(gain, [1.0, 0.0, 0.0])
        x, p = x + gain * (force - x[0]), keep @ p @ keep.T + noise**2 * np.outer(gain, gain)
        moves = np.array([[x[1], x[0], tracker.recruitment(width)], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
        product = p[0, 0] * p[1, 1] + p[0, 1] ** 2
        x = np.array([x[1] * x[0] + p[0, 1] + tracker.recruitment(width) * x[2], x[1], x[2]])
        p = moves @ p @ moves.T + np.diag([product, 0.0, (0.05 * x[2]) ** 2 * trial.dt])
        np.testing.assert_allclose(tracker.x, x, rtol=1e-9)
        np.testing.assert_allclose(tracker.p, p, rtol=1e-6, atol=1e-12)


def test_nees_lies_in_its_band(runs):
    squares, _ = runs
    assert squares.shape == (RUNS, len(CHECKS))
    low, high = chi2_band(2, RUNS)
    assert low < squares.mean(axis=0)[-1] < high  # the 95 % band after 5 s
    low, high = chi2_band(2, RUNS, 0.95 ** (1 / len(CHECKS)))
    assert ((squares.mean(axis=0) > low) & (squares.mean(axis=0) < high)).all()


def test_nis_lies_in_its_band(runs):
    _, innovations = runs
    low, high = chi2_band(1, innovations[:, 225:].size)
    assert low < innovations[:, 225:].mean() < high


def test_plain_regression_is_biased_by_noise_and_the_filter_is_not():
    trial = isometric(3, noise=1.0)
    plain = history_of(RegressionFilter(trial.dt, StraightRecruitment.of(CONSTANTS), 1.0), trial).at(8.0)
    good = track_gain(isometric(3, noise=1.0), CONSTANTS, 1.0).at(8.0)
    assert plain[1] < 0.045 and good[1] == pytest.approx(0.05, rel=0.03)


def test_agrees_with_the_batch_fit_of_the_same_trial():
    trial, study = isometric(7), paper_study("3-23")
    history = track_gain(trial, CONSTANTS, FORCE_NOISE_N)
    batch = fit(nominal_model(study), [trial], {"force_n": Noise(FORCE_NOISE_N)})
    for name, value, std in (
        ("gain", history.gain[-1], history.gain_std[-1]),
        ("time_constant_s", history.time_constant_s[-1], history.time_constant_std_s[-1]),
    ):
        assert abs(value - batch.values[name]) < 0.5 * batch.std(name)
        assert std == pytest.approx(batch.std(name), rel=0.1)


def test_missing_samples_are_bridged():
    trial, missing = isometric(9), np.random.default_rng(0).random(1792) < 0.3
    tracker = GainFilter(trial.dt, StraightRecruitment.of(CONSTANTS), FORCE_NOISE_N)
    for force, width in zip(np.where(missing, np.nan, trial["force_n"]), trial["pulse_width_us"], strict=True):
        tracker.step(force, width)
    gain, tau = tracker.gain_and_time_constant()
    assert gain == pytest.approx(0.65, rel=0.02) and tau == pytest.approx(0.05, rel=0.02)
    assert tracker.skipped == missing.sum()


def test_a_wandering_gain_is_followed():
    trial = isometric(4)
    fading = trial.with_columns(force_n=trial["force_n"] * np.linspace(1.0, 0.7, len(trial)))
    moving = track_gain(fading, CONSTANTS, FORCE_NOISE_N, wander=0.05).gain[-1]
    assert moving == pytest.approx(0.7 * 0.65, rel=0.04)
    assert track_gain(fading, CONSTANTS, FORCE_NOISE_N).gain[-1] > 1.08 * 0.7 * 0.65


@pytest.mark.parametrize("time", [-1.0, np.nan, np.inf, "1"])
def test_a_history_knows_nothing_before_its_first_sample(time):
    history = track_gain(isometric(0, seconds=1.0), CONSTANTS, FORCE_NOISE_N)
    with pytest.raises(InputError, match=r"^time: "):
        history.at(time)
    assert history.at(0.0) == (history.gain[0], history.time_constant_s[0])


@pytest.mark.parametrize("kind", [GainFilter, RegressionFilter])
@pytest.mark.parametrize("force", [np.nan, np.inf, -np.inf])
def test_a_force_that_is_none_is_skipped_and_counted_and_the_filter_goes_on(kind, force):
    trial = isometric(5, seconds=4.0)
    one, other = (kind(trial.dt, StraightRecruitment.of(CONSTANTS), FORCE_NOISE_N) for _ in range(2))
    for k, (f, w) in enumerate(zip(trial["force_n"], trial["pulse_width_us"], strict=True)):
        one.step(force if k == 100 else float(f), float(w))
        other.step(float(f), float(w))
    assert one.skipped == 1 and other.skipped == 0
    assert one.gain_and_time_constant() == pytest.approx(other.gain_and_time_constant(), rel=0.02)


@pytest.mark.parametrize("kind", [GainFilter, RegressionFilter])
@pytest.mark.parametrize("width", [np.nan, np.inf, -np.inf])
def test_a_pulse_width_that_is_none_is_refused_and_the_filter_stays_as_it_was(kind, width):
    tracker = kind(0.005, StraightRecruitment.of(CONSTANTS), FORCE_NOISE_N)
    for k in range(50):
        tracker.step(0.1 * k, 600.0)
    before = tracker.gain_and_time_constant(), tracker.stds()
    with pytest.raises(InputError, match=r"^pulse_width_us: expected a finite number"):
        tracker.step(3.0, width)
    assert (tracker.gain_and_time_constant(), tracker.stds()) == before


def test_constants_without_the_muscles_are_refused():
    """With none at all the gain was 39 in place of 0.65."""
    for missing in ("threshold_us", "saturation_us", "force_scale_n"):
        with pytest.raises(InputError, match=f"constants: expected the rig's {missing}"):
            track_gain(isometric(0), {n: v for n, v in CONSTANTS.items() if n != missing}, 0.2)
    with pytest.raises(InputError, match="threshold_us, saturation_us, force_scale_n"):
        track_gain(isometric(0), {}, 0.2)


@pytest.mark.parametrize(
    "numbers", [(180.0, 180.0, 60.0), (-1.0, 1000.0, 60.0), (180.0, np.nan, 60.0), (180.0, 1e3, 0.0)]
)
def test_a_recruitment_that_is_none_is_refused(numbers):
    with pytest.raises(InputError):
        StraightRecruitment(*numbers)


def test_bad_input_is_one_line():
    with pytest.raises(InputError, match="no column force_n"):
        track_gain(paper_trial("3-23"), CONSTANTS, FORCE_NOISE_N)
    for wrong in ((0.0, 0.2), (0.005, np.nan), (0.005, 0.2, -1.0), (0.005, 0.2, 2.0, np.nan)):
        with pytest.raises(InputError):
            GainFilter(wrong[0], StraightRecruitment(), *wrong[1:])
