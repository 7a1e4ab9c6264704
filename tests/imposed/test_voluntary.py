"""Effort of a subject who does not relax: it differs between equal cycles, and no passive limb's does."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import lfilter

import fes_pin as fp
from fes_pin.data.plausibility import implausible
from fes_pin.data.repeats import effort_of_repeats
from fes_pin.data.schema import schema_of
from fes_pin.data.templates import rod, wheel
from fes_pin.diagnosis.by_trial import _likeliest
from fes_pin.diagnosis.restate import StudyConditions
from fes_pin.infer.levels import CONFIDENCE_95
from fes_pin.models.effects import EffortGain, EffortOffset, PeriodicTorque
from fes_pin.models.nominal import nominal_model
from fes_pin.remainder.unrepeated import over_voluntary, voluntary_effort
from fes_pin.search.fit import fitted_alone

DT = 0.005
JOINT = schema_of("joint")


def wandering(rng, count, time_constant, size):
    """A first-order random effort of a time constant, s, and a standard deviation."""
    pole = np.exp(-DT / time_constant)
    return size * lfilter([np.sqrt(1.0 - pole**2)], [1.0, -pole], rng.standard_normal(count + 2000))[2000:]


def moved(rng, voluntary=0.0):
    """A limb that a dynamometer moves to and fro; its effort, and an irregular one of so much of its deviation."""
    seconds, hz = rng.uniform(10.0, 30.0), rng.uniform(0.3, 1.5)
    t = DT * np.arange(round(max(seconds, 8.0 / hz) / DT))
    w, second, phase = 2.0 * np.pi * hz, rng.uniform(0.0, 0.3), rng.uniform(0.0, 6.0)
    reach, wave = rng.uniform(0.1, 0.6), [(1.0, 0.0), (second, phase)]
    q = reach * sum(a * np.sin((k + 1) * w * t + p) for k, (a, p) in enumerate(wave))
    v, bend = np.gradient(q, DT), np.gradient(np.gradient(q, DT), DT)
    parts = [
        rng.uniform(0.0, 2.0) * q / np.std(q) + rng.uniform(0.0, 1.0) * (q / np.std(q)) ** 3 / 3.0,
        rng.uniform(0.1, 1.0) * v / np.std(v),
        rng.uniform(0.0, 1.0) * bend / np.std(bend),
        rng.uniform(0.0, 1.0) * np.tanh(v / (0.05 * np.std(v))),
    ]
    memory = lfilter([0.02], [1.0, -0.98], q - q[0])  # a spring that relaxes
    passive = sum(parts) + rng.uniform(0.0, 1.0) * (q - memory) / np.std(q)
    passive = passive / np.std(passive)
    drift = rng.uniform(-0.3, 0.3) * t / t[-1] + 0.05 * rng.random() * np.sin(2.0 * np.pi * 50.0 * t)
    noise = rng.uniform(0.002, 0.1) * rng.standard_normal(len(t)) + wandering(rng, len(t), 0.2, rng.uniform(0.0, 0.02))
    own = wandering(rng, len(t), rng.uniform(0.2, 1.5), voluntary) + 1.5 * voluntary
    size = rng.uniform(0.5, 30.0)
    columns = {
        "position": q + reach * 1e-4 * rng.standard_normal(len(t)),
        "effort": size * (passive + drift + noise + own),
    }
    return fp.Trial("a", "imposed", columns, t)


@pytest.mark.parametrize("seed", range(60))
def test_a_passive_limb_repeats_itself(seed):
    found = effort_of_repeats(moved(np.random.default_rng(seed)), JOINT)
    assert found is not None
    assert not found.is_no_mechanism


def test_voluntary_effort_is_found():
    found = [effort_of_repeats(moved(np.random.default_rng([7, k]), 0.4), JOINT) for k in range(30)]
    assert np.mean([one is not None and one.is_no_mechanism for one in found]) >= 0.95
    weak = [effort_of_repeats(moved(np.random.default_rng([8, k]), 0.05), JOINT) for k in range(15)]
    assert not any(one is not None and one.is_no_mechanism for one in weak)  # less than passive limbs may differ by


def test_a_motion_that_never_repeats_is_not_judged():
    rng = np.random.default_rng(3)
    t = DT * np.arange(4000)
    q = wandering(rng, len(t), 0.5, 0.2)
    q = np.convolve(q, np.hanning(101) / 50.0, "same")
    trial = fp.Trial("a", "imposed", {"position": q, "effort": rng.standard_normal(len(t))}, t)
    assert effort_of_repeats(trial, JOINT) is None


def test_a_check_says_it(tmp_path):
    (tmp_path / "rod.urdf").write_text(rod(0.4, 1.0, False))
    for voluntary, says in ((0.0, False), (0.5, True)):
        trials = [fp.Trial(f"t{k}", *astuple(moved(np.random.default_rng([9, k]), voluntary))) for k in range(2)]
        study = fp.Study(
            "a", "joint", {}, {"inertia_scale": 1.0, "damping": 0.1}, trials, files={"urdf": tmp_path / "rod.urdf"}
        )
        assert any("voluntary effort" in line for line in implausible(study)) == says


def astuple(trial):
    """Kind, columns and time."""
    return trial.kind, trial.columns, trial.time


def turned(rng, own, sways=0.2):
    """A weightless limb that a dynamometer moves, with damping, and a torque of its own at a frequency of its own."""
    t, w, turns = DT * np.arange(4000), 2.0 * np.pi * rng.uniform(0.5, 0.8), rng.uniform(0.0, 6.0)
    q = 0.4 * np.sin(w * t)
    effort = 0.3 * 0.4 * w * np.cos(w * t) - 0.02 * 0.4 * w * w * np.sin(w * t) + 0.002 * rng.standard_normal(len(t))
    effort += sways * np.sin(0.37 * w * t + turns) + own
    columns = {"position": q + 1e-5 * rng.standard_normal(len(t)), "effort": effort}
    return columns, t, 0.37 * w


@pytest.mark.parametrize("seed", range(3))
def test_what_a_cause_explains_is_not_voluntary(tmp_path, seed):
    """A torque with a frequency of its own does not repeat with the motion; what a model with it leaves does."""
    (tmp_path / "wheel.urdf").write_text(wheel(0.02))
    for size in (0.0, 0.12):
        rng = np.random.default_rng([seed, 5])
        columns, time, rate = turned(rng, wandering(rng, 4000, 0.8, size) + size)
        study = fp.Study(
            "a",
            "joint",
            {},
            {"inertia_scale": 1.0, "damping": 0.3},
            [fp.Trial("a", "imposed", columns, time)],
            files={"urdf": tmp_path / "wheel.urdf"},
        )
        plain = nominal_model(study)
        torque = PeriodicTorque(in_phase=0.05, quadrature=0.05, frequency_hz=rate / (2.0 * np.pi))
        without, best = (fitted_alone(model, study.trials) for model in (plain, plain + torque))
        assert voluntary_effort(without) is not None
        assert (voluntary_effort(best) is not None) == (size > 0.0)
        if size:
            own = voluntary_effort(best)
            assert "voluntary effort is likely" in own.words
            held = fitted_alone(plain + torque + EffortOffset(offset=0.1), study.trials)
            over = over_voluntary(voluntary_effort(held), held)
            assert over["effort_offset"] < CONFIDENCE_95 < over["periodic_torque"]  # a hold explains the offset


@pytest.mark.parametrize("size", [0.0, 0.15])
def test_a_fault_of_some_trials_is_not_told_from_voluntary_effort(tmp_path, monkeypatch, size):
    """A relaxed limb with another amplifier in each trial has it found; of a subject who holds it is not asked.

    Nor is a trial taken for one whose condition was misread.
    """
    (tmp_path / "wheel.urdf").write_text(wheel(0.02))
    rng, trials = np.random.default_rng(21), []
    for k, scale in enumerate((1.0, 1.4, 0.7)):
        columns, time, _ = turned(rng, wandering(rng, 4000, 0.8, size) + size, 0.0)
        trials.append(fp.Trial(f"{k}", "imposed", columns | {"effort": scale * columns["effort"]}, time))
    start, files = {"inertia_scale": 1.0, "damping": 0.3}, {"urdf": tmp_path / "wheel.urdf"}
    fitted = fitted_alone(nominal_model(fp.Study("a", "joint", {}, start, trials, files=files)), trials)
    search = SimpleNamespace(was_stopped=False)
    found = SimpleNamespace(best=fitted, nominal=fitted, without={})
    asked = _likeliest((search, found, None), [EffortGain])
    assert asked == (EffortGain if size == 0.0 else None)
    monkeypatch.setattr("fes_pin.diagnosis.restate.find_misread", lambda *_: "an outlier")
    misread = StudyConditions(fitted.model, None).misread(trials, found)
    assert misread == ("an outlier" if size == 0.0 else None)
