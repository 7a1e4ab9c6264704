"""The remainder: what is outside the library is seen and located, and noise of every family is not."""

import math
from types import SimpleNamespace

import numpy as np
import oracle.rigs
import pytest
import scipy.signal
from diagnosis.hidden import study_of
from identify.rigs import trials_of

from fes_pin.data.trial import Trial
from fes_pin.identify.fit import under_own_noise
from fes_pin.infer.levels import CLAIM_LEVEL, FULL_NOISE
from fes_pin.infer.noise import Noise, estimate_noise
from fes_pin.infer.projection import Projection
from fes_pin.models.nominal import nominal_model
from fes_pin.models.predict import predict
from fes_pin.remainder import lack_of_fit as tests_of_fit
from fes_pin.remainder import open_set
from fes_pin.remainder.bursts import burst_p_value
from fes_pin.remainder.heteroscedastic import heteroscedastic_p_value
from fes_pin.remainder.innovations import channels
from fes_pin.remainder.lack_of_fit import lack_of_fit
from fes_pin.remainder.lines import line_p_value
from fes_pin.remainder.play import play_p_value
from fes_pin.remainder.repeated import repeated_p_value
from fes_pin.remainder.slips import slip_p_value
from fes_pin.search.fit import fit
from fes_pin.search.likelihood_fits import LikelihoodFits

DT = 0.005
WHITE = Noise(1.0, (), 1.0)
TREMBLING = Noise(1.0, (1.6, -0.64), 5.0)
"""An autoregression with both poles at 0.8."""


def left_in(study):
    return lack_of_fit(likeliest(nominal_model(study), study.trials))


def likeliest(model, trials):
    """The fit of a model without causes by the likelihood."""
    return LikelihoodFits(model, trials, (), answered=False).nominal()


def forces(rng, bend=lambda t, force: force, colour=0.0):
    """Trials of a muscle with a change of its force and autoregressive noise, and the fit of its nominal model."""
    model, trials = trials_of("muscle", rng, count=6, n=1000)
    made = []
    for trial in trials:
        force = bend(trial.time, predict(model, trial)["force_n"])
        noise = scipy.signal.lfilter([math.sqrt(1.0 - colour**2)], [1.0, -colour], rng.standard_normal(1000))
        made.append(trial.with_columns(force_n=force + 0.2 * noise))
    return likeliest(model, made)


@pytest.mark.parametrize("noise", ["white", "ar1", "process"])
@pytest.mark.parametrize("rig", ["ankle", "joint"])
def test_nothing_is_left_of_noise(rig, noise):
    left = left_in(study_of(rig, noise=noise, seed=40, n_motion=3, duration_s=4.0))
    assert not left.unexplained and left.where is None
    assert CLAIM_LEVEL <= left.p_value <= 1.0


@pytest.mark.parametrize("colour", [0.0, 0.6, 0.9])
def test_nothing_is_left_of_a_muscles_noise(colour):
    """At a level of 1 %, 2 of 6 have a probability of 1.5e-3."""
    rng = np.random.default_rng(41)
    assert sum(lack_of_fit(forces(rng, colour=colour)).unexplained for _ in range(6)) <= 1


def test_tests_together_keep_the_level(monkeypatch):
    """Uniform p-values, of two channels where a test looks at each: 20 000 remainders, with a deviation of 0.07 %."""
    rng = np.random.default_rng(43)
    one = [SimpleNamespace(values=None, noise=WHITE, dt=DT)]
    for name in ("burst", "detent", "repeated", "heteroscedastic", "slip", "play"):
        monkeypatch.setattr(open_set, f"{name}_p_value", lambda *_: rng.uniform())
    monkeypatch.setattr(open_set, "line_p_value", lambda _: (rng.uniform(), "time"))
    monkeypatch.setattr(open_set, "channels", lambda _: [one, one])
    monkeypatch.setattr(open_set, "driven", lambda _: 0.0)
    monkeypatch.setattr(open_set, "Projection", lambda _: None)
    monkeypatch.setattr(open_set, "under_own_noise", lambda *_: SimpleNamespace(parts=()))

    monkeypatch.setattr(tests_of_fit, "is_rounding", lambda _: False)
    monkeypatch.setattr(tests_of_fit, "rough_fit", lambda *_: SimpleNamespace(sse=1.0))
    monkeypatch.setattr(tests_of_fit, "under_own_noise", lambda one, **_: one)
    monkeypatch.setattr(tests_of_fit, "_features_left", lambda *_: (rng.uniform(), "phase"))
    fitted = SimpleNamespace(model=None, trials=(), level=CLAIM_LEVEL, noise=SimpleNamespace(ar={"force_n": ()}))
    share = np.mean([lack_of_fit(fitted).unexplained for _ in range(20_000)])
    assert share == pytest.approx(CLAIM_LEVEL, abs=0.002)


@pytest.mark.parametrize("noise", [WHITE, TREMBLING], ids=["white", "coloured"])
def test_bursts_keep_their_level(noise):
    """At 5 %, more than 9 of 80 have a probability of 0.008."""
    rng = np.random.default_rng(42)
    p_values = [burst_p_value(list(rng.standard_normal((5, 600))), noise, DT) for _ in range(80)]
    assert sum(p < 0.05 for p in p_values) <= 9
    assert all(0.0 < p <= 1.0 for p in p_values)


COLOURED = [(1.0,), (1.0, -0.8), (1.0, -1.6, 0.64)]
"""Denominators of noise that is white, that is slow, and that is slower; a short noise model leaves the like."""


@pytest.mark.parametrize("poles", COLOURED, ids=["white", "slow", "slower"])
def test_tests_that_need_no_white_noise_keep_their_level(poles):
    """At 5 %, more than 9 of 80 have a probability of 0.008."""
    rng = np.random.default_rng(50)
    driver = [np.abs(np.sin(np.arange(600) / (40.0 + 10.0 * k))) for k in range(5)]
    p_values = []
    for _ in range(80):
        e = scipy.signal.lfilter([1.0], poles, rng.standard_normal((5, 700)))[:, 100:]
        p_values.append(
            (burst_p_value(list(e), WHITE, DT), repeated_p_value(e, DT), heteroscedastic_p_value(e, driver, DT))
        )
    assert (np.sum(np.array(p_values) < 0.05, axis=0) <= 9).all()


def test_heavy_tails_are_no_bursts():
    """Student's t of 4 degrees: at 5 %, more than 6 of 40 have a probability of 0.003."""
    rng = np.random.default_rng(51)
    assert sum(burst_p_value(list(rng.standard_t(4, (5, 600))), WHITE, DT) < 0.05 for _ in range(40)) <= 6


def test_what_comes_again_in_every_trial_is_told_by_how_trials_differ():
    """A rising tone of a fifth of the noise, d = 10, in noise that a model of order 2 has not whitened."""
    rng = np.random.default_rng(52)
    t = np.arange(1000) * DT
    e = scipy.signal.lfilter([1.0], [1.0, -0.5, 0.2], rng.standard_normal((5, 1000)))
    tone = 0.2 * np.sin(2.0 * math.pi * (0.7 + 0.25 * t) * t)
    assert repeated_p_value(e, DT) > 1e-3 > repeated_p_value(e + tone, DT)
    assert repeated_p_value(e[:2] + tone, DT) == 1.0, "two trials do not tell how trials differ"


def test_a_strength_that_wanders_is_larger_while_the_muscle_is_active():
    """Of each trial's own phase, so that no feature is coherent."""
    rng = np.random.default_rng(53)
    left = lack_of_fit(forces(rng, lambda t, f: f * (1.0 + 0.03 * np.sin(2.5 * t + rng.uniform(0.0, 7.0))), colour=0.6))
    assert left.unexplained, left


def test_single_bad_samples_are_no_bursts():
    rng = np.random.default_rng(43)
    e = rng.standard_normal((6, 1000))
    e[rng.random(e.shape) < 0.01] *= 10.0
    assert burst_p_value(list(e), WHITE, DT) > 1e-3


@pytest.mark.parametrize("noise", [WHITE, TREMBLING], ids=["white", "coloured"])
def test_humps_at_random_times_are_bursts(noise):
    """Three in each trial, each 7 standard deviations of its own amplitude."""
    rng = np.random.default_rng(44)
    hump = np.sin(np.pi * (np.arange(60) + 0.5) / 60) ** 2
    shape = np.convolve(hump, np.r_[1.0, -np.array(noise.ar)])
    e = rng.standard_normal((6, 1000))
    for trial in e:
        for at in rng.integers(0, 1000 - len(shape), 3):
            trial[at : at + len(shape)] += 7.0 * shape / np.linalg.norm(shape)
    assert burst_p_value(list(e), noise, DT) < 1e-4


@pytest.mark.parametrize("hz", [12.5, 40.0])
def test_ripple_of_the_force_goes_with_the_stimulus(hz):
    """0.06 N on a noise of 0.2 N: d = 15."""
    rng = np.random.default_rng(45)
    left = lack_of_fit(forces(rng, lambda t, f: f + 0.06 * f / np.abs(f).mean() * np.sin(2.0 * math.pi * hz * t)))
    assert left.unexplained and left.where == "stimulus", left


def test_a_line_of_any_phase_is_a_matter_of_time():
    rng = np.random.default_rng(46)
    left = lack_of_fit(forces(rng, lambda t, f: f + 0.08 * np.sin(2.0 * math.pi * 31.0 * t + rng.uniform(0.0, 7.0))))
    assert left.unexplained and left.where == "time", left


def test_a_sensor_that_slips_is_seen():
    rng = np.random.default_rng(47)
    left = lack_of_fit(forces(rng, lambda t, f: f + 0.5 * (t - t[0] > rng.uniform(1.0, 4.0))))
    assert left.unexplained, left


def long_noise(rng, deviation=lambda y, t: 0.0 * y, poles=(1.0,), trials=8):
    """A fit, under noise of one order, of a muscle's force with a deviation and noise of this denominator."""
    model, made = trials_of("muscle", rng, count=trials, n=1000)
    out = []
    for trial in made:
        true = predict(model, trial)["force_n"]
        e = scipy.signal.lfilter([1.0], poles, rng.standard_normal(1500))[500:]
        out.append(trial.with_columns(force_n=true + deviation(true, trial.time - trial.time[0]) + 0.2 * e))
    full = under_own_noise(fit(model, out), FULL_NOISE, FULL_NOISE)
    return full, Projection(full.parts)


@pytest.mark.filterwarnings("ignore:the force is:fes_pin.InputWarning")
@pytest.mark.parametrize("poles", COLOURED, ids=["white", "slow", "slower"])
def test_slips_and_play_keep_their_level(poles):
    """At 5 %, more than 5 of 24 have a probability of 0.001 each."""
    rng = np.random.default_rng(60)
    made = [long_noise(rng, poles=poles) for _ in range(24)]
    assert sum(slip_p_value(*one) < 0.05 for one in made) <= 5
    assert sum(play_p_value(*one) < 0.05 for one in made) <= 5


@pytest.mark.parametrize(("poles", "jump"), [((1.0,), 0.3), ((1.0, -0.8), 0.5)], ids=["white", "slow"])
def test_a_jump_in_each_trial_is_told_from_slow_noise(poles, jump):
    """Of one and a half standard deviations, at a time of each trial's own; of 60 other studies each, all pass."""
    rng = np.random.default_rng(61)
    made = [long_noise(rng, lambda y, t: jump * (t > rng.uniform(1.2, 3.8)), poles) for _ in range(4)]
    assert max(slip_p_value(*one) for one in made) < 1e-3


@pytest.mark.parametrize("poles", COLOURED[:2], ids=["white", "slow"])
def test_a_reading_that_lags_where_the_motion_turns_is_play(poles):
    """Half a standard deviation of white noise wide, beside what the fit takes up of it."""
    rng = np.random.default_rng(63)

    def lag(y, _):
        out, follower = np.empty_like(y), 0.0
        for i, now in enumerate(y):
            follower = out[i] = min(max(follower, now - 0.1), now + 0.1)
        return out - y

    assert play_p_value(*long_noise(rng, lag, poles)) < 1e-6


def test_noise_of_a_given_order_has_it():
    rng = np.random.default_rng(64)
    e = [rng.standard_normal(1000) for _ in range(2)]
    assert [len(estimate_noise(e, longest=k, least=k).ar) for k in (0, 2, 24)] == [0, 2, 24]
    assert len(estimate_noise([one[:70] for one in e], longest=24, least=24).ar) == 6, "a tenth of the trial, at most"


@pytest.mark.parametrize("rig", ["ankle", "joint"])
def test_detents_are_seen_in_the_angle(rig, monkeypatch):
    """A joint that prefers every tenth of its range."""
    usual = oracle.rigs.joint_torque

    def torque(x, q, v, t, causes):
        return usual(x, q, v, t, causes) - 0.03 * math.sin(2.0 * math.pi * q / 0.15)

    monkeypatch.setattr(oracle.rigs, "joint_torque", torque)
    left = left_in(study_of(rig, seed=48))
    assert left.unexplained, left


def test_innovations_are_what_the_fit_was_whitened_to():
    study = study_of("ankle", seed=49)
    own = under_own_noise(fit(nominal_model(study), study.trials))
    pieces = [e.values for group in channels(own) for e in group]
    assert {len(group) for group in channels(own)} == {4, 2}
    assert sum(len(e) for e in pieces) == sum(len(p.residual) for p in own.parts)
    assert np.concatenate(pieces).std() == pytest.approx(1.0, abs=0.03)


def test_a_trial_of_which_noise_of_a_long_order_leaves_nothing_has_no_lines():
    time = np.arange(8) * DT
    trial = Trial("short", "motion", {"effort": np.ones(8), "position": time}, time)
    assert line_p_value([SimpleNamespace(trial=trial, values=np.empty(0), dt=DT, inputs=("effort",))]) == (1.0, "time")


def test_innovations_that_are_constant_are_no_burst():
    """A sensor that was stuck in every trial made 0 / 0 of the test."""
    assert burst_p_value([np.zeros(400), np.zeros(300)], Noise(1.0), 0.01) == 1.0
