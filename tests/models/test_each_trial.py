"""Effects whose amplitudes can be each trial's own; the tests find them by themselves."""

import numpy as np
import pytest
from models.cases import CASES, RIGS, name_of, trial

from fes_pin.data.errors import InputError
from fes_pin.data.trial import Trial
from fes_pin.identify.likelihood import LikelihoodProblem
from fes_pin.identify.likelihood_fit import fit_of
from fes_pin.identify.per_trial import amplitude, predictions
from fes_pin.infer.noise import Noise
from fes_pin.infer.optimum import minimise
from fes_pin.models.effects import EFFECTS
from fes_pin.models.model import Model
from fes_pin.models.predict import predict
from fes_pin.models.predictor import StateSpaceNoise
from fes_pin.models.simulate import Simulator, max_step
from fes_pin.models.store import load_model, model_toml

VARYING = pytest.mark.parametrize(("one", "rig", "kind"), [c for c in CASES if c[0].varies], ids=name_of)
COUNT = 3
SAMPLES = {"ankle": 1200, "joint": 520, "muscle": 1200}
"""A joint from a start 5 % off is out of step with its data after some swings; it holds one period of 0.4 Hz."""


def trials_of(rig, kind, seed):
    rng = np.random.default_rng(seed)
    return [trial(rig, kind, rng, SAMPLES[rig]) for _ in range(COUNT)]


def own_values(one, seed):
    """Amplitudes of each trial, of the effect's own size and any sign."""
    rng = np.random.default_rng(seed)
    info = one.parameters()
    return [
        {f"{one.name}.{n}": 4.0 * info[n].scale * rng.uniform(-1, 1) for n in one.amplitudes()} for _ in range(COUNT)
    ]


def with_own(model, trials, own):
    return [{**model.initial_unknowns(t), **values} for t, values in zip(trials, own, strict=True)]


def test_hum_and_breathing_need_not_begin_with_the_trial():
    assert {e.name for e in EFFECTS if e.varies} == {"mains_hum", "periodic_torque"}


@VARYING
def test_each_trial_has_its_own_and_the_null_is_the_nominal_model(one, rig, kind):
    """A trial with its own amplitudes answers as the common form with those; without any, as the nominal model."""
    trials, own = trials_of(rig, kind, 1), own_values(one, 2)
    model = Model(RIGS[rig]) + one.of_each_trial()
    step = max_step(model)
    answers = Simulator(model, trials, max_step_s=step).run(model.parameters(), with_own(model, trials, own))
    common = Model(RIGS[rig]) + one()
    for t, answer, values in zip(trials, answers, own, strict=True):
        (alone,) = Simulator(common, [t], max_step_s=step).run({**common.parameters(), **values})
        assert np.abs(answer.readings - alone.readings).max() <= 1e-12
    nominal = Simulator(Model(RIGS[rig]), trials, max_step_s=step).run(Model(RIGS[rig]).parameters())
    for answer, without in zip(Simulator(model, trials, max_step_s=step).run(model.parameters()), nominal, strict=True):
        assert np.abs(answer.readings - without.readings).max() <= 1e-12


@VARYING
def test_each_trial_recovers_its_own(one, rig, kind):
    """From noiseless data and wrong nominal parameters, with the size of all together."""
    trials, own = trials_of(rig, kind, 3), own_values(one, 4)
    model = Model(RIGS[rig]) + one.of_each_trial()
    answers = Simulator(model, trials).run(model.parameters(), with_own(model, trials, own))
    names = RIGS[rig].outputs(kind)[:1]
    measured = [t.with_columns(**{n: a.readings[:, 0] for n in names}) for t, a in zip(trials, answers, strict=True)]
    noise = StateSpaceNoise({names[0]: 0.2 if names[0] == "force_n" else 2e-3})
    values = {n: (0.95 * v if "." not in n else v) for n, v in model.parameters().items()}
    problem = LikelihoodProblem(model, measured, noise)
    fitted = fit_of(problem, minimise(problem, values))
    assert fitted.converged and sum(float(p.residual @ p.residual) for p in fitted.parts) < 0.05
    for got, true in zip(fitted.unknowns, own, strict=True):
        for n, v in true.items():
            assert got[n] == pytest.approx(v, abs=0.05 * max(map(abs, true.values())))
    size, std = amplitude(fitted, fitted.model.effects[0])
    true_size = np.sqrt(np.mean([sum(v**2 for v in values.values()) for values in own]))
    assert abs(size - true_size) < 3.0 * std + 0.02 * true_size
    assert fitted.degrees == len(fitted.free) + COUNT * len(one.amplitudes())


def test_predictions_do_not_see_what_they_predict():
    """A change in one piece of a trial changes no prediction there."""
    one = next(e for e in EFFECTS if e.name == "mains_hum")
    (bare,) = trials_of("muscle", "isometric", 5)[:1]
    model, noise = Model(RIGS["muscle"]) + one.of_each_trial(), {"force_n": Noise(0.2, (), 0.2)}
    rng = np.random.default_rng(6)
    (quiet,) = Simulator(Model(RIGS["muscle"]), [bare]).run(Model(RIGS["muscle"]).parameters())
    hum = 0.5 * np.sin(2 * np.pi * 50.0 * bare.time + 1.0)
    force = quiet.readings[:, 0] + hum + 0.2 * rng.standard_normal(len(bare))
    measured = bare.with_columns(force_n=force)
    told = predictions(model, measured, noise)
    assert np.std(told[:, 0] - quiet.readings[:, 0] - hum) < 0.05
    changed = force.copy()
    changed[: len(force) // 4] += 3.0 * np.sin(2 * np.pi * 50.0 * bare.time[: len(force) // 4])
    again = predictions(model, bare.with_columns(force_n=changed), noise)
    assert np.array_equal(again[: len(force) // 4], told[: len(force) // 4])
    assert not np.array_equal(again[len(force) // 4 :], told[len(force) // 4 :])


def test_a_start_that_is_forgotten_does_not_run_away_with_what_is_each_trials_own():
    """Half a minute of a heavily damped pendulum tells nothing of its start; all that is missed would be laid to it."""
    one = next(e for e in EFFECTS if e.name == "periodic_torque")
    model = Model(RIGS["joint"]).with_parameters({"damping": 0.4}) + one(frequency_hz=0.7).of_each_trial()
    (bare,) = trials_of("joint", "motion", 8)[:1]
    time = np.arange(6000) * bare.dt
    bare = Trial("long", "motion", {"effort": 0.3 * np.sin(1.1 * time)}, time, bare.conditions)
    own = {"periodic_torque.in_phase": 0.02, "periodic_torque.quadrature": -0.03}
    (answer,) = Simulator(model, [bare]).run(model.parameters(), with_own(model, [bare], [own]))
    missed = 0.05 * np.sin(0.45 * time) + 0.02 * np.sin(1.7 * time + 0.3)
    measured = bare.with_columns(position=answer.readings[:, 0] + missed)
    told = predictions(model, measured, {"position": Noise(1e-5)})
    assert np.std(measured["position"] - told[:, 0]) < 1.1 * np.std(missed)


@VARYING
def test_a_saved_model_keeps_the_form_and_predicts_without_it(one, rig, kind, tmp_path):
    model = Model(RIGS[rig]) + one.of_each_trial()
    path = tmp_path / "model.toml"
    path.write_text(model_toml(model))
    assert load_model(path).effects == model.effects
    (bare,) = trials_of(rig, kind, 7)[:1]
    told, without = predict(model, bare), predict(Model(RIGS[rig]), bare)
    for name, values in without.columns.items():
        assert np.abs(told[name] - values).max() <= 1e-6 * max(1.0, np.abs(values).max())
    common = Model(RIGS[rig]) + one()
    path.write_text(model_toml(common))
    assert load_model(path).effects == common.effects


@pytest.mark.parametrize(("name", "value"), [("coulomb_friction", "true"), ("mains_hum", "1")])
def test_only_what_varies_can_be_each_trials_own(name, value, tmp_path):
    one = next(e for e in EFFECTS if e.name == name)
    path = tmp_path / "model.toml"
    text = model_toml(Model(RIGS["ankle"]) + one())
    path.write_text(text.replace(f"[effects.{name}]\n", f"[effects.{name}]\neach_trial = {value}\n"))
    with pytest.raises(InputError, match="each_trial"):
        load_model(path)
