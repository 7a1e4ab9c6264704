"""The proposed trial: admissible, worth what is expected of it, and through the command line to a set of one."""

import json
import sys
from dataclasses import replace

import numpy as np
import pytest
from diagnosis.hidden import shortened, study_of
from identify.rigs import WHITE, as_likely, off
from oracle import make_study, simulate
from oracle.studies import ankle_rig

from fes_pin.cli import main
from fes_pin.data.study import write_study
from fes_pin.data.trial_files import read_trial, trial_csv
from fes_pin.diagnosis.experiment import ROOM, candidates, discriminations, near_measured, next_experiment
from fes_pin.identify.problem import measured_columns
from fes_pin.models.effects import effect_named
from fes_pin.models.nominal import nominal_model
from fes_pin.models.predict import predict
from fes_pin.search.fit import fit

DELAY, LAG = "electromechanical_delay", "second_order_activation"


def run(monkeypatch, *words):
    monkeypatch.setattr(sys, "argv", ["fes-pin", *map(str, words)])
    with pytest.raises(SystemExit) as ended:
        main.main()
    return ended.value.code or 0


def test_a_set_of_two_is_resolved_by_the_trial_that_the_command_writes(monkeypatch, tmp_path):
    hidden, drawn = {DELAY: {"delay_s": 0.004}}, 0
    study = make_study(np.random.default_rng(drawn), "ankle", hidden, n_motion=3, n_isometric=1, duration_s=4.0)
    write_study(study, tmp_path / "study")
    assert run(monkeypatch, "diagnose", tmp_path / "study", "--out", tmp_path / "one") == 0
    record = json.loads((tmp_path / "one/diagnosis.json").read_text())
    (cause,) = record["causes"]
    assert {cause["name"], *cause["equivalents"]} == {DELAY, LAG}
    plan = record["next_experiment"]
    assert set(plan["separates"]) == {DELAY, LAG}

    file = tmp_path / "one" / plan["trial"]["file"]
    conditions = {n: v for n, v in plan["trial"].items() if n not in ("file", "kind")}
    given = read_trial(file, rig="ankle", kind=plan["trial"]["kind"], conditions=conditions, inputs_only=True)
    width = given["pulse_width_us"]
    on = width[width > 0]
    assert on.min() >= study.constants["threshold_us"] and on.max() <= study.constants["saturation_us"]
    settings = [f"--set={n}={v}" for n, v in plan["trial"].items() if n != "file"]
    out = tmp_path / "predicted.csv"
    assert run(monkeypatch, "predict", tmp_path / "one/model.toml", file, *settings, "--out", out) == 0
    predicted = np.genfromtxt(out, delimiter=",", names=True)
    assert len(predicted) == len(given)

    constants, true, _ = ankle_rig(np.random.default_rng(drawn))  # the first that make_study draws
    ((column, y),) = simulate(constants, true, hidden, given).items()
    assert np.abs(predicted[column] - y).max() < 0.1 * np.ptp(y)
    noise = {"angle_rad": 2e-3, "force_n": 0.2}[column] * np.random.default_rng(1).standard_normal(len(y))
    more = replace(study, trials=(*study.trials, given.with_columns(**{column: y + noise})))
    write_study(more, tmp_path / "more")
    assert run(monkeypatch, "diagnose", tmp_path / "more", "--out", tmp_path / "two") == 0
    (cause,) = json.loads((tmp_path / "two/diagnosis.json").read_text())["causes"]
    assert (cause["name"], cause["equivalents"]) == (DELAY, [])


def fitted_rivals(study, model):
    both = model + effect_named("coulomb_friction")(), model + effect_named("quadratic_damping")(0.01)
    return [as_likely(fit(one, study.trials, WHITE)) for one in both]


@pytest.fixture(scope="module")
def rivals():
    study = study_of("ankle", ("coulomb_friction",), seed=5, n_motion=3, n_isometric=1, duration_s=3.0)
    model = nominal_model(study)
    return study, *fitted_rivals(study, model)


@pytest.mark.filterwarnings("ignore:angle_rad is cut off:fes_pin.InputWarning")
def test_what_is_expected_is_what_a_refit_cannot_take_up(rivals):
    """D against fits to the same data and the noiseless trial: linear theory, so for a trial that tells little."""
    study, best, rival = rivals
    near = near_measured(best, list(candidates(study)), study)
    expected = discriminations(best, rival, near)
    kept = [(p, t) for p, (t, _) in zip(expected, near, strict=True) if p.worth > 1.0]
    told, trial = sorted(kept, key=lambda pair: pair[0].worth)[len(kept) // 2]
    for way, (one, other) in enumerate(((best, rival), (rival, best))):
        column = one.model.rig.outputs(trial.kind)[0]
        answered = trial.with_columns(**{column: predict(one.model, trial)[column]})
        again = fit(other.model, [*study.trials, answered], WHITE)
        assert again.sse - other.sse == pytest.approx(told.distance(way), rel=0.1)
        assert told.distance(way, 4) <= 4 * told.distance(way) * (1 + 1e-6)
        assert told.distance(way, 4) >= told.distance(way)


def test_a_proposed_trial_stays_near_what_was_measured(rivals):
    study, best, rival = rivals
    plan = next_experiment(best, {"quadratic_damping": rival}, "coulomb_friction", study)
    (column,) = best.model.rig.outputs(plan.trial.kind)
    seen, y = measured_columns(best.model, study.trials)[column], predict(best.model, plan.trial)[column]
    room = ROOM * np.ptp(seen)
    assert seen.min() - room <= y.min() and y.max() <= seen.max() + room
    fixed = [p.worth for p in discriminations(best, rival, near_measured(best, list(candidates(study)), study))]
    assert min(plan.expected) >= max(fixed)  # refined from the best of them
    with pytest.warns(DeprecationWarning, match="expected now"):
        assert plan.promised == plan.expected


def test_the_next_experiment_can_be_read_back_and_predicted(tmp_path):
    study = shortened(study_of("ankle", ("coulomb_friction",), seed=5, duration_s=3.0), ("motion",))
    model = nominal_model(study)
    best, rival = fitted_rivals(study, model)
    plan = next_experiment(best, {"quadratic_damping": rival}, "coulomb_friction", study)
    assert plan.trial is not None and plan.separates == ("coulomb_friction", "quadratic_damping")
    assert "squared noise units" in plan.why
    (tmp_path / "next.csv").write_text(trial_csv(plan.trial))
    back = read_trial(
        tmp_path / "next.csv", rig="ankle", kind=plan.trial.kind, conditions=plan.trial.conditions, inputs_only=True
    )
    one, other = predict(best.model, back), predict(rival.model, back)
    assert np.abs(one["angle_rad"] - other["angle_rad"]).max() > 1e-3
    width = back["pulse_width_us"]
    assert width.min() >= 0.0 and width.max() <= study.constants["saturation_us"] + 1e-9
    assert back.conditions["load_kg"] <= 1.5 * max(t.conditions["load_kg"] for t in study.trials)


def test_what_no_input_separates_says_so():
    study = study_of("muscle", n_isometric=2, duration_s=2.0)
    same = as_likely(fit(off(nominal_model(study)), study.trials, WHITE))
    plan = next_experiment(same, {"other": same}, "one", study)
    assert plan.trial is None and "separates one and other: the models differ by nothing" in plan.why
    assert "the same force with another sensor" in plan.why  # a muscle held still has no base to turn
