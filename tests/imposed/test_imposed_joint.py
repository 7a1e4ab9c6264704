"""A joint whose motion is imposed: the effort that it takes, its noise, and what hides in it."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from imposed_rigs import joint
from imposed_rigs.motion import drawn

from fes_pin.data.imposed import imposed_motion
from fes_pin.data.study import read_study, write_study
from fes_pin.data.trial import Trial
from fes_pin.data.trial_files import read_trial, write_trial
from fes_pin.diagnosis import logged
from fes_pin.diagnosis.diagnosis import diagnose_joint
from fes_pin.identify.likelihood import LikelihoodProblem
from fes_pin.identify.process_noise import first_guess
from fes_pin.models.catalogue import Catalogue, shipped
from fes_pin.models.effects import CoulombFriction, EffortGain, EffortOffset, PassiveRelaxation, SensorGain
from fes_pin.models.model import Model
from fes_pin.models.nominal import nominal_model
from fes_pin.models.predict import predict
from fes_pin.models.rigs.rigid import load_urdf
from fes_pin.models.simulate import simulate
from fes_pin.models.store import load_model, save_model
from fes_pin.view.missing import missing_input

COLUMNS = ("position", "velocity")


def moved(seed=0, n=2000, dt=2e-3):
    motion = drawn(0.1, 0.6, 0.3, 1.5, np.random.default_rng(seed))
    time = np.arange(n) * dt
    return motion, Trial("moved", "imposed", {"position": motion.at(time)}, time)


def arm(tmp_path, **hidden):
    made = joint.study(tuple(hidden), hidden.get(next(iter(hidden), ""), 0.0), np.random.default_rng(3), tmp_path)
    return made, nominal_model(made)


def test_the_effort_is_that_of_inverse_dynamics(tmp_path):
    """Of Pinocchio's RNEA, on the motion itself."""
    made, model = arm(tmp_path)
    body, (motion, trial) = load_urdf(made.urdf), moved()
    data = body.createData()
    q, v, a = (motion.at(trial.time, k) for k in range(3))
    model = model.with_parameters({"inertia_scale": 1.0, "damping": 0.2})
    wanted = [pin.rnea(body, data, *(np.array([x[k]]) for x in (q, v, a)))[0] + 0.2 * v[k] for k in range(len(q))]
    missed = simulate(model, trial)["effort"] - wanted
    assert np.abs(missed).max() < 1e-3 * np.ptp(wanted)


def test_a_measured_velocity_stands_for_that_of_the_position():
    motion, trial = moved()
    measured = trial.with_columns(velocity=motion.at(trial.time, 1) + 0.5)
    assert np.abs(imposed_motion(measured, COLUMNS).values[1] - measured["velocity"]).max() < 1e-4
    assert np.abs(imposed_motion(trial, COLUMNS).values[1] - motion.at(trial.time, 1)).max() < 1e-4


@pytest.mark.parametrize("effect", [EffortGain(error=0.05), SensorGain(error=0.05)], ids=lambda e: e.name)
def test_a_scale_of_the_effort_has_the_slope_of_its_cost(tmp_path, effect):
    """Beneath a large random effort a filter takes up all that it reads, and its gains go with the scale."""
    made, model = arm(tmp_path, coulomb_friction=0.3)
    trials, path = made.trials[:2], f"{effect.name}.error"
    guess = first_guess(model, trials)
    noise = replace(guess, std={n: 300.0 * v for n, v in guess.std.items()})
    problem = LikelihoodProblem(model + effect, trials, noise)
    values, unknowns = (model + effect).parameters(), problem.start_unknowns()
    parts, at = problem.linearize(values, unknowns), problem.free.index(path)
    deviation = sum(float(p.jacobian[:, at] @ p.jacobian[:, at]) for p in parts) ** -0.5
    slope = -sum(float(p.jacobian[:, at] @ p.residual) for p in parts)
    ends = [problem.cost({**values, path: values[path] + h * deviation}, unknowns) for h in (0.05, -0.05)]
    assert slope * deviation == pytest.approx((ends[0] - ends[1]) / 0.2, abs=0.1)


def test_a_motion_that_is_moved_as_a_whole_has_the_same_rates(tmp_path):
    """As smoothed anew."""
    (_, model), (_, trial) = arm(tmp_path), moved()
    there = float(imposed_motion(trial, COLUMNS).values[0, 0]) + 0.3
    further = model.rig.restated(trial, "position", there)
    anew = further.with_columns()
    assert further["position"][0] == pytest.approx(there, abs=1e-4)
    for one, other in zip(imposed_motion(further, COLUMNS).values, imposed_motion(anew, COLUMNS).values, strict=True):
        assert np.abs(one - other).max() < 1e-9 * np.ptp(other)


@pytest.mark.parametrize("seed", range(4))
def test_the_ends_of_an_imposed_motion_are_not_judged(seed, tmp_path):
    """There the acceleration is more than three times as wrong as within, where it is as its doubt says."""
    (_, model), (motion, trial) = arm(tmp_path), moved(seed)
    noise = 1e-3 * np.random.default_rng(seed).standard_normal(len(trial))
    trial = trial.with_columns(position=trial["position"] + noise)
    judged, found = model.rig.follows(trial), imposed_motion(trial, COLUMNS)
    wrong = (found.values[2] - motion.at(trial.time, 2)) / found.std[2]
    within, ends = (np.sqrt(np.mean(wrong[rows] ** 2)) for rows in (judged, ~judged))
    assert 0.8 < np.mean(judged) < 1.0
    assert within < 2.5 and ends > 3.0 * within


def test_what_acts_on_the_effort_is_undone(tmp_path):
    """The reading is the effort that was commanded: what acts is -1 times what was, and 0.3 more."""
    (_, model), (_, trial) = arm(tmp_path), moved()
    plain = simulate(model, trial)["effort"]
    turned = simulate(model + EffortGain(error=-2.0) + EffortOffset(offset=0.3), trial)["effort"]
    acts = min((-turned + 0.3, -(turned + 0.3)), key=lambda x: np.abs(plain - x).max())  # as the path orders them
    assert np.abs(plain - acts).max() < 1e-9 * np.abs(plain).max()


def test_friction_follows_the_velocity_and_builds_up_over_a_way(tmp_path):
    (_, model), (motion, trial) = arm(tmp_path), moved()
    v, plain = motion.at(trial.time, 1), simulate(model, trial)["effort"]
    sharp = simulate(model + CoulombFriction(torque_nm=0.5), trial)["effort"] - plain
    fast = np.abs(v) > 0.05
    assert np.abs(sharp[fast] - 0.5 * np.sign(v[fast])).max() < 2e-3
    soft = simulate(model + CoulombFriction(torque_nm=0.5, presliding=0.05), trial)["effort"] - plain
    turn = int(np.flatnonzero(np.diff(np.sign(v)))[1]) + 1
    way = np.abs(motion.at(trial.time[turn:]) - motion.at(trial.time[turn]))
    after = int(np.argmax(way > 0.05))  # 1 - 2 / e of the way from one sign to the other
    assert soft[turn + after] / (0.5 * np.sign(v[turn + after])) == pytest.approx(1.0 - 2.0 / np.e, abs=0.05)


@pytest.mark.parametrize("cause", ["coulomb_friction", "passive_relaxation"])
def test_a_hidden_cause_is_named_and_predicted(tmp_path, cause):
    """Through files: study, diagnosis, model, and a held-out trial from its inputs alone."""
    write_study(joint.study((cause,), 0.3, np.random.default_rng(7), tmp_path / "made"), tmp_path / "study")
    study = read_study(tmp_path / "study")
    found = diagnose_joint(study)
    assert [c.name for c in found.causes][:1] == [cause] or cause in found.causes[0].equivalents
    assert found.extended_error[1] < 0.2 * found.nominal_error[1]
    save_model(found.model, tmp_path / "model.toml")
    inputs = study.trials[0].without("effort")
    write_trial(inputs, tmp_path / "one.csv")
    again = read_trial(tmp_path / "one.csv", rig="joint", kind="imposed", inputs_only=True)
    predicted = predict(load_model(tmp_path / "model.toml"), again)["effort"]
    assert np.abs(predicted - simulate(found.model, study.trials[0])["effort"]).max() < 1e-9


def test_nothing_hidden_is_adequate(tmp_path, monkeypatch):
    """And the effort, which is what is read here, is never moved."""
    made = joint.study((), 0.0, np.random.default_rng(11), tmp_path)
    for owner, asked in ((logged, "lateness_of"), (logged.LogFaults, "of")):
        monkeypatch.setattr(owner, asked, lambda *_: pytest.fail("the effort of an imposed motion was doubted"))
    assert diagnose_joint(made).verdict == "adequate"


def test_a_spring_and_damper_in_series_begin_relaxed(tmp_path):
    (_, model), (_, trial) = arm(tmp_path), moved()
    with_it = simulate(model + PassiveRelaxation(stiffness_nm_per_rad=2.0, relaxation_s=0.3), trial)["effort"]
    assert abs(with_it[0] - simulate(model, trial)["effort"][0]) < 1e-6
    assert isinstance(model, Model)


def test_the_missing_effort_of_an_imposed_motion_is_the_friction_that_hides_in_it(tmp_path):
    made, model = arm(tmp_path)
    measured = simulate(model + CoulombFriction(torque_nm=0.5), made.trials[0])
    found = missing_input(model.rig, measured, simulate(model, made.trials[0]))
    assert (found.kind, found.unit) == ("effort", "N m") and set(found.against) == {"angle", "rate", "time_s"}
    fast = np.abs(found.against["rate"]) > 0.2 * np.abs(found.against["rate"]).max()
    assert np.median(found.value[fast] * np.sign(found.against["rate"][fast])) == pytest.approx(0.5, abs=0.05)


def test_a_further_form_that_foretells_nothing_more_is_no_cause(tmp_path):
    """Friction of another form than the library's: a lag earns likelihood beside it, and helps no prediction."""
    made = joint.study(("coulomb_friction",), 0.3, np.random.default_rng(992000), tmp_path)
    known = shipped()
    two = Catalogue((CoulombFriction, known.effect("sensor_lag")), known.rigs)
    found = diagnose_joint(made, library=two)
    assert [c.name for c in found.causes] == ["coulomb_friction"]
    assert found.remainder.unexplained
