"""A twin of one model ranks that model first, equal models do not differ significantly, bad questions are errors."""

import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import twins
from data import studies

import fes_pin as fp
from fes_pin.cli import main
from fes_pin.comparison.held_out import own_part
from fes_pin.comparison.literature import LITERATURE, published_model
from fes_pin.comparison.result import apart_from
from fes_pin.data.errors import InputError
from fes_pin.diagnosis.errors_ahead import free_errors
from fes_pin.identify.ahead import forecast, free_residuals
from fes_pin.identify.fit import noise_of, rough_noise

DEMO = Path(__file__).parents[2] / "analysis/studies/ankle_demo"


@pytest.mark.filterwarnings("ignore:force_n stays at 0:fes_pin.InputWarning")
def test_ding_is_the_published_equations():
    """Against the sums over pulses written out, by another integrator."""
    study = twins.study("ding", 1, noise=0.0, scatter=0.0)
    model = published_model("ding2003").model(fp.nominal_model(study), study.trials)
    values = {"gain": 1500.0 * 0.050957, "ding2003.half_saturation": 0.3}
    model = model.with_parameters({**values, "ding2003.tau_1_s": 0.04, "ding2003.tau_2_s": 0.08})
    for trial in study.trials[:4]:
        apart = trial.residual(fp.simulate(model, trial), "force_n")
        step = np.gradient(trial["force_n"], trial.dt)  # a pulse is held for a sample: half a sample late
        assert np.abs(apart - 0.5 * trial.dt * step).max() < 5e-3 * trial["force_n"].max()


def test_a_twin_of_one_model_ranks_it_first():
    found = fp.compare(twins.study("ding", 2), ["nominal", "hill", "bobet_stein", "ding2003"])
    assert found.models[0].name == "ding2003"
    assert found.best() == ("ding2003",)
    assert all(m.apart["free"].told for m in found.models[1:])
    fitted = found.models[0].fit.values
    assert fitted["ding2003.tau_1_s"] == pytest.approx(0.04, rel=0.1)
    assert "ding2003 predicts 12 held-out trials best" in str(found)


def test_equal_models_are_not_told_apart():
    """Each of them holds the truth, a single lag, as a special case."""
    found = fp.compare(twins.study("lag", 3), ["nominal", "second_order", "hill"])
    assert set(found.best()) == {"nominal", "second_order", "hill"}
    assert "do not distinguish" in str(found)


def test_trials_that_the_study_holds_out_are_the_judges():
    study = twins.study("lag", 4, count=8)
    trials = [replace(t, role="held_out" if k > 4 else "fit") for k, t in enumerate(study.trials)]
    found = fp.compare(replace(study, trials=tuple(trials)), ["nominal"])
    assert (found.by, found.held_out) == ("role", ("05", "06", "07"))


def test_the_error_is_that_of_a_diagnosis(tmp_path):
    """E of eq. (2), free and over the horizon, as a diagnosis calculates it for the same fit and trials."""
    study = twins.study("lag", 4, count=8)
    trials = [replace(t, role="held_out" if k > 4 else "fit") for k, t in enumerate(study.trials)]
    (found,) = fp.compare(replace(study, trials=tuple(trials)), ["nominal"], horizon_s=0.2).models
    held, floor = trials[5:], rough_noise(found.fit.model, trials)
    assert found.percent["free"] == pytest.approx(free_errors(found.fit.model, held, floor).error_percent())
    left = [(t, free_residuals(found.fit.model, t, floor)["force_n"]) for t in held]
    noise = noise_of(found.fit)["force_n"]
    ahead = sum(np.sum((x - forecast(x, noise, t.dt, 0.2)) ** 2) for t, x in left)
    around = sum(np.sum((t["force_n"] - t["force_n"].mean()) ** 2) for t in held)
    assert found.percent["horizon"] == pytest.approx(100.0 * ahead / around)
    for kind, squares in found.squares.items():
        assert squares.mean() == pytest.approx(found.percent[kind])


def test_columns_count_in_the_error_by_their_noise(tmp_path):
    """An ankle's angle and force together: E of the demonstration as its diagnosis calculates it."""
    study = fp.read_study(DEMO)
    (found,) = fp.compare(study, ["nominal"]).models
    floor = rough_noise(found.fit.model, study.trials)
    whole = free_errors(found.fit.model, study.trials, floor).error_percent()
    assert {"angle_rad", "force_n"} == set(found.rmse)
    assert whole < found.percent["free"] < 1.5 * whole  # by fits without the trials


def test_the_beginning_of_a_trial_tells_its_rest():
    """Where strength differs between trials the beginning says by how much; where it does not, it says nothing."""
    differing = fp.compare(twins.study("lag", 5, scatter=0.3), ["nominal"], given_s=0.3).models[0].percent
    assert differing["begun"] < 0.3 * differing["free_rest"]
    same = fp.compare(twins.study("lag", 5, scatter=0.0), ["nominal"], given_s=0.3).models[0].percent
    assert same["begun"] < 1.1 * same["free_rest"]


def test_few_trials_do_not_tell_how_much_they_differ():
    assert own_part([(np.ones(9), np.ones((9, 1)))] * 3, [3] * 3) is None
    study = twins.study("lag", 5, count=3)
    found = fp.compare(study, ["nominal"], given_s=0.3)
    assert "begun" not in found.models[0].percent
    assert found.warnings


def test_a_difference_by_chance_is_told_in_one_of_twenty():
    rng = np.random.default_rng(0)
    pairs = rng.standard_normal((2000, 2, 10)) ** 2
    told = [apart_from(a, b, 1, 1).told for a, b in pairs]
    assert np.mean(told) < 0.035  # one side of a 95 % interval
    assert apart_from(np.zeros(10), np.linspace(0.9, 1.1, 10), 1, 5).told
    assert not apart_from(np.zeros(1), np.ones(1), 1, 1).told


@pytest.mark.parametrize("one", LITERATURE[1:], ids=lambda m: m.name)
def test_every_model_has_a_source_and_starts_within_its_bounds(one):
    assert any(c.isdigit() for c in one.source)
    study = twins.study("lag", 6, count=2)
    model = one.model(fp.nominal_model(study), study.trials)
    info = model.parameter_info()
    assert all(info[n].lower <= v <= info[n].upper for n, v in model.parameters().items())


def _run(monkeypatch, *words):
    monkeypatch.setattr(sys, "argv", ["fes-pin", "compare", *map(str, words)])
    with pytest.raises(SystemExit) as ended:
        main.main()
    return ended.value.code or 0


def test_the_command_writes_its_answer(tmp_path, monkeypatch):
    fp.write_study(twins.study("lag", 7, count=5), tmp_path / "study")
    own = tmp_path / "model.toml"
    nominal = fp.nominal_model(fp.read_study(tmp_path / "study"))
    fp.save_model(nominal + fp.effects.SecondOrderActivation(), own)
    out, asked = tmp_path / "out", ("--models", "nominal,hill", "--model", own, "--given", "0.3")
    assert _run(monkeypatch, tmp_path / "study", *asked, "--out", out) == 0
    record = json.loads((out / "compare.json").read_text())
    assert {m["name"] for m in record["models"]} == {"nominal", "hill", str(own)}
    assert len(record["models"][0]["of_each_trial"]["free"]) == 5
    assert set(record["best"]) == {"free", "horizon"}


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--models", "dong2003"), "no model 'dong2003'; expected some of nominal"),
        (("--models", ","), "at least one model"),
        (("--models", "ding2003"), "column stim"),
        (("--horizon", "99"), "--horizon"),
        (("--given", "-1"), "--given"),
        (("--model", "nowhere.toml"), "nowhere.toml"),
    ],
)
def test_bad_questions_are_one_line(tmp_path, monkeypatch, capsys, words, said):
    out = tmp_path / "out"
    assert _run(monkeypatch, studies.ankle(tmp_path / "s"), *words, "--out", out) == 2
    printed = capsys.readouterr()
    assert printed.out == "" and printed.err.count("\n") == 1
    assert said in printed.err
    assert not out.exists()


def test_another_rig_is_refused(tmp_path):
    with pytest.raises(InputError, match="muscle or ankle"):
        fp.compare(fp.read_study(studies.joint(tmp_path / "s")))


def test_a_comparison_is_held_to_the_guards_of_a_check():
    study = twins.study("lag", 3)
    trials = [replace(t, columns={**t.columns, "force_n": -t["force_n"]}) for t in study.trials]
    found = fp.compare(replace(study, trials=tuple(trials)), ["nominal"])
    assert any("is its sign turned round" in words for words in found.warnings)
    still = [
        t.with_columns(pulse_width_us=0.0 * t.time) if "pulse_width_us" in t else t.with_columns(stim=0.0 * t.time)
        for t in study.trials
    ]
    with pytest.raises(fp.InputError, match="never stimulated"):
        fp.compare(replace(study, trials=tuple(still)), ["nominal"])
