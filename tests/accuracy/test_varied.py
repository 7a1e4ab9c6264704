"""Studies asked about from other starts and at other rates: what is asked, what counts as the same, going on."""

import json
from types import SimpleNamespace

import harness.__main__
import numpy as np
import pytest
import typer
from harness import varied
from harness.generator import Item, Truth
from harness.varied import (
    PLAIN,
    RATES,
    STARTS,
    TWICE,
    Answer,
    Asked,
    decimated,
    is_held,
    is_same,
    moved,
    planned,
    shown,
    started,
)
from typer.testing import CliRunner

import fes_pin as fp

TIME = np.arange(60) * 0.001


def study(**columns):
    trial = fp.Trial("one", "isometric", columns or {"stim": np.eye(60)[13], "force_n": TIME}, TIME)
    known = {"threshold_us": 180.0, "saturation_us": 1000.0}
    return fp.Study("m", "muscle", known, {"gain": 30.0, "time_constant_s": 0.05}, (trial,))


def answer(sets=(("fatigue",),), verdict="causes_found", **more):
    return Answer("k", "c", verdict, sets, **more)


def test_starts_are_drawn_about_what_is_true_and_by_their_number():
    many = [started(study(), Truth({"gain": 10.0}), np.random.default_rng(k)).start for k in range(300)]
    gains, times = (np.array([one[n] for one in many]) for n in ("gain", "time_constant_s"))
    assert 5.0 <= gains.min() < 6.0 and 18.0 < gains.max() <= 20.0
    assert 0.025 <= times.min() < 0.03 and 0.09 < times.max() <= 0.1
    joint = SimpleNamespace(start={"damping": 1.0})
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(varied, "replace", lambda one, start: start["damping"])
        drawn = [started(joint, Truth(), np.random.default_rng(k)) for k in range(300)]
    assert 0.01 <= min(drawn) < 0.02 and 7.0 < max(drawn) <= 10.0


def test_the_stimulus_is_the_same_at_a_lower_rate():
    def trial(**columns):
        return study(**columns, force_n=TIME).trials[0]

    assert [is_held(trial(stim=np.eye(60)[n]), 2) for n in (13, 14)] == [False, True]
    assert [is_held(trial(pulse_width_us=np.repeat(TIME[::n], n)), 3) for n in (1, 2, 3, 6)] == [
        False,
        False,
        True,
        True,
    ]
    half = decimated(trial(stim=np.eye(60)[14]), 2)
    assert np.flatnonzero(half["stim"]).tolist() == [7] and np.array_equal(half["force_n"], TIME[::2])


def test_no_impulse_of_an_effort_is_lost_between_samples():
    moved_by = fp.Trial("j", "motion", {"effort": np.sin(90.0 * TIME[:59]), "position": TIME[:59]}, TIME[:59])
    slow = decimated(moved_by, 3)
    lengths = np.append(np.full(19, 3), 2)
    assert np.sum(slow["effort"] * lengths) == pytest.approx(np.sum(moved_by["effort"]))
    imposed = fp.Trial("i", "imposed", dict(moved_by.columns), moved_by.time)
    assert np.array_equal(decimated(imposed, 3)["effort"], moved_by["effort"][::3])


def test_what_is_the_same():
    one = answer((("a", "b"), ("c",)))
    assert is_same(one, answer((("c",), ("b", "a")))) and is_same(one, answer((("a", "b", "d"), ("c",))))
    assert not is_same(one, answer((("a", "b"),))) and not is_same(one, answer((("b",), ("c",))))
    assert not is_same(one, answer(one.sets, "unexplained")) and not is_same(one, answer(error="E"))
    assert not is_same(answer(error="E"), answer(error="E"))


def test_values_move_by_their_deviations():
    one, other = answer(values={"gain": (1.0, 0.1), "b": (2.0, 0.1)}), answer(values={"gain": (1.05, 0.3), "c": (0, 1)})
    assert len(moved(one, other, STARTS)) == 1 and moved(one, other, RATES) == []
    assert moved(one, answer(values={"gain": (1.7, 0.3)}), RATES)


def test_a_strength_is_compared_whatever_the_time_between_pulses():
    record = {"extended": {"parameters": {"gain": {"value": 2.0, "std": 0.1}, "x": {"value": 1.0, "std": None}}}}
    assert varied.values_of(record, study()) == {"gain": (pytest.approx(0.002), pytest.approx(0.0001))}
    width = study(pulse_width_us=1e3 * TIME, force_n=TIME)
    assert varied.values_of(record, width) == {"gain": (2.0, 0.1)}
    change = {"gain": {"before": {"value": 1.0, "std": 0.1}, "after": {"value": 2.0, "std": 0.1}}}
    groups = varied.values_of({"changes": [{"parameters": change}]}, width)
    assert groups == {"gain before": (1.0, 0.1), "gain after": (2.0, 0.1)}


def test_a_plan_has_studies_of_every_source_and_ways_of_each(monkeypatch, tmp_path):
    monkeypatch.setattr(varied, "shared", lambda: tmp_path)
    plan = planned(STARTS, 8, 3, ())
    assert [ways[0].source for ways in plan] == ["large", "free", "driven", "imposed"] * 2
    assert {len(ways) for ways in plan} == {varied.DRAWS} and len({w.key for ways in plan for w in ways}) == 8 * 20
    rates = planned(RATES, 4, 3, ())
    assert [w.way for w in rates[0]] == [PLAIN, "half", "third", TWICE]
    assert all(ways[0].way == PLAIN and len(ways) > 1 for ways in rates) and len(rates) == 4
    assert len(planned(RATES, 4, 3, [rates[0][0].item.key])) == 1
    place = tmp_path / "practice/answers/one/answer.json"
    place.parent.mkdir(parents=True)
    place.write_text('{"causes": []}')
    assert [ways[0].study for ways in planned(STARTS, 10, 3, ())][4::5] == ["practice one"] * 2


ASKED = [[Asked("large", Item("a", 1, ("fatigue",)), way) for way in (PLAIN, "half", "third")]]


def test_counts_and_what_differs():
    known = {one.key: answer(values={"gain": (1.0, 0.1)}) for one in ASKED[0]}
    known[ASKED[0][2].key] = answer((("fatigue", "load_error"),), values={"gain": (1.1, 0.1)})
    text = shown(RATES, ASKED, known)
    assert "1 studies, 3 answers" in text and text.count("1 of 1") == 3
    assert text.count("equivalents: 1; with values") == 1 and text.count("equivalents: 0; with values") == 2
    known[ASKED[0][1].key] = answer((), "adequate")
    text = shown(RATES, ASKED, known)
    assert "half: adequate: nothing" in text and "at every rate the verdict is the same: 0 of 1" in text
    starts = shown(STARTS, ASKED, known)
    assert "from all starts the verdict is the same: 0 of 1" in starts
    assert shown(RATES, ASKED, {}) == "no study has all of its answers"


class Fake:
    """Names fatigue where the strength that is stated is below 30."""

    asked = 0

    def make(self, item, folder):
        return study(), Truth({"gain": 30.0})

    def ask(self, given):
        Fake.asked += 1
        causes = [{"name": "fatigue", "equivalents": [], "parameters": {}}] if given.start["gain"] < 30.0 else []
        record = {"verdict": "causes_found" if causes else "adequate", "causes": causes, "extended": {}}
        return SimpleNamespace(to_json=lambda: json.dumps(record))


def test_starts_that_matter_are_seen_and_a_run_goes_on(monkeypatch, tmp_path):
    monkeypatch.setattr(varied, "generator_of", lambda name: Fake())
    monkeypatch.setattr(varied, "planned", lambda *_: [[Asked("x", Item("a", 1), f"{n:02d}") for n in range(6)]])
    app, command = typer.Typer(), CliRunner()
    app.command()(harness.__main__.main)
    asked = ["starts", "--store", str(tmp_path), "--workers", "1"]
    found = command.invoke(app, asked)
    assert found.exit_code == 0 and Fake.asked == 6, found.output
    assert "from all starts the verdict is the same: 0 of 1" in found.output
    lines = (tmp_path / "starts.jsonl").read_text().splitlines()
    (tmp_path / "starts.jsonl").write_text("\n".join(lines[:4]) + "\n")
    assert command.invoke(app, asked).exit_code == 0 and Fake.asked == 8
    assert len((tmp_path / "starts.jsonl").read_text().splitlines()) == 6


def test_a_study_at_another_rate_is_asked_about(monkeypatch):
    monkeypatch.setattr(varied, "generator_of", lambda name: Fake())
    seen = []
    monkeypatch.setattr(Fake, "ask", lambda self, given: seen.append(given) or (_ for _ in ()).throw(ValueError("no")))
    varied._study.cache_clear()
    for way in (PLAIN, "third"):
        assert varied.answered(RATES, Asked("x", Item("a", 1), way)).error == "ValueError: no"
    assert [len(s.trials[0]) for s in seen] == [60, 20]
    varied._study.cache_clear()
