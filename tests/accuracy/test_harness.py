"""The harness: plans, judging, counting, going on, and two codes compared; its generators by their own tests."""

import json
from collections import Counter
from dataclasses import asdict
from itertools import islice
from types import SimpleNamespace

import harness.__main__
import pytest
import typer
from harness import run as runs
from harness.__main__ import main
from harness.compare import compared
from harness.generator import Item, Truth
from harness.generators import GENERATORS, generator_of
from harness.row import Row, judged
from harness.run import answered, rows_of, run
from harness.table import counts, interval, lines_of, notes, worse, wrong
from typer.testing import CliRunner


def row(key="a", hidden=("fatigue",), sets=(("fatigue",),), **more):
    known = {"part": "", "outside": False, "code": "x", "verdict": "causes_found", "cpu_s": 2.0}
    return Row(key, hidden, **{**known, "sets": sets, **more})


@pytest.mark.parametrize(
    ("hidden", "sets", "right", "first", "alone"),
    [
        ((), (), True, True, True),
        ((), (("fatigue",),), False, False, False),
        (("fatigue",), (("fatigue",),), True, True, True),
        (("fatigue",), (("load_error", "fatigue"),), True, False, False),
        (("fatigue",), (("load_error",), ("fatigue",)), False, False, False),
        (("fatigue", "cogging"), (("cogging",), ("fatigue",)), True, True, True),
        (("fatigue", "cogging"), (("cogging", "fatigue"),), False, False, False),
        (("fatigue", "cogging"), (("cogging", "fatigue"), ("load_error", "fatigue")), True, False, False),
    ],
)
def test_who_is_right(hidden, sets, right, first, alone):
    one = row(hidden=hidden, sets=sets)
    assert (one.right, one.first, one.alone) == (right, first, alone)


def test_what_no_library_has_is_answered_by_what_is_left():
    assert row(outside=True, sets=(), left=True).right and not row(outside=True).right


NEAREST = ("coulomb_friction", "effort_offset")


@pytest.mark.parametrize(
    ("hidden", "nearest", "names", "right", "misnamed", "near"),
    [
        (("uneven",), NEAREST, [], False, False, False),
        (("uneven",), NEAREST, ["effort_offset"], True, False, True),
        (("uneven",), NEAREST, ["effort_offset", "coulomb_friction"], True, False, True),
        (("uneven",), NEAREST, ["effort_offset", "cogging"], True, False, True),
        (("uneven",), NEAREST, ["effort_offset", "joint_stop"], False, True, True),
        (("bursts",), (), [], True, False, True),
        (("bursts",), (), ["cogging"], True, False, True),
        (("bursts",), (), ["joint_stop"], False, True, True),
        ((), (), [], True, False, True),
        ((), (), ["joint_stop"], False, True, True),
    ],
)
def test_of_no_form_a_nearest_cause_is_right_and_another_is_wrong(hidden, nearest, names, right, misnamed, near):
    causes = [{"name": name, "equivalents": []} for name in names]
    truth = Truth(beside=("cogging",), part="".join(hidden), nearest=nearest)
    one = judged(Item("k", 1, hidden), truth, {**RECORD, "causes": causes}, code="x")
    assert (one.right, one.misnamed, one.near) == (right, misnamed, near)
    assert one.kind == ("no form" if hidden else "nothing") and Row.of(json.loads(json.dumps(asdict(one)))) == one


def test_a_set_that_holds_a_nearest_cause_counts_whatever_else_could_be_it():
    causes = [{"name": "cogging", "equivalents": ["effort_offset"]}]
    truth = Truth(beside=("cogging",), nearest=NEAREST)
    assert judged(Item("k", 1, ("uneven",)), truth, {**RECORD, "causes": causes}, code="x").near


def test_studies_of_no_form_are_counted_by_themselves():
    rows = [
        row("a", hidden=("uneven",), nearest=NEAREST, sets=(("effort_offset",),)),
        row("b", hidden=("uneven",), nearest=NEAREST, sets=(("joint_stop",),)),
        row("c", hidden=("bursts",), nearest=(), sets=(), verdict="unexplained"),
        row("d", hidden=(), nearest=(), sets=(), verdict="adequate"),
        row("e", hidden=(), sets=(), verdict="unexplained"),
    ]
    found = counts(rows)
    assert found["no_form"] == {
        "no wrong name": [3, 4],
        "one of the nearest causes is named": [1, 2],
        "adequate where nothing is hidden": [1, 1],
        "adequate where nothing is near": [0, 1],
    }
    assert found["rows"]["no form"][:2] == [3, 2] and "no_form" not in counts(rows[4:])
    assert f"no wrong name: {interval(3, 4)}" in notes(found) and "b: uneven" in wrong(rows)[0]


RECORD = {
    "verdict": "causes_found",
    "causes": [
        {"name": "fatigue", "equivalents": ["load_error"], "site": "", "parameters": {}},
        {"name": "cogging", "equivalents": []},
    ],
    "remainder": {"unexplained": True},
    "nominal": {"parameters": {"gain": {"value": 2.0, "std": 0.1}}, "error_percent": {"held_out": 4.0, "fit": 1.0}},
    "extended": {
        "parameters": {"gain": {"value": 1.1, "std": 0.1}, "fatigue.rate_per_s": {"value": 0.3, "std": 0.0}},
        "error_percent": {"held_out": 3.0, "fit": 1.0},
    },
}


def test_an_answer_is_judged_by_its_record():
    item, truth = Item("k", 1, ("fatigue",)), Truth({"gain": 1.0, "fatigue.rate_per_s": 0.2}, ("cogging",), "d = 40")
    found = judged(item, truth, RECORD, code="x")
    assert found.sets == (("fatigue", "load_error"),) and found.right and found.left and found.part == "d = 40"
    assert found.estimates == (("gain", 1.0, 2.0, 1.1, 0.1),)
    assert found.errors == {"held_out": (4.0, 3.0)}


def test_a_cause_has_its_value_at_its_site():
    cause = {"name": "segment_mass", "equivalents": [], "site": "trunk"}
    cause["parameters"] = {"share": {"value": 0.2, "std": 0.01}}
    record = {**RECORD, "causes": [cause]}
    found = judged(Item("k", 1, ("segment_mass",)), Truth({"segment_mass at trunk": 0.21}), record, code="x")
    assert found.estimates == (("segment_mass at trunk", 0.21, None, 0.2, 0.01),)
    elsewhere = judged(Item("k", 1, ("segment_mass",)), Truth({"segment_mass at pelvis": 0.21}), record, code="x")
    assert elsewhere.estimates == ()


ROWS = [
    row("a", part="d = 40", estimates=(("gain", 1.0, 1.4, 1.01, 0.01),), errors={"held_out": (5.0, 1.0)}),
    row("b", part="d = 15", sets=(), verdict="adequate", estimates=(("gain", 1.0, 1.2, 1.2, 0.01),), cpu_s=4.0),
    row("c", part="d = 40", estimates=(("gain", 1.0, 1.4, 1.03, 0.01),)),
    row("d", hidden=(), sets=(), verdict="adequate"),
    row("e", hidden=(), cpu_s=6.0),
    row("f", hidden=("fatigue", "cogging"), sets=(("fatigue",), ("cogging", "load_error"), ("base_tilt",))),
    row("g", hidden=("spasms",), part="d = 40", outside=True, sets=(), left=True),
    row("h", error="E: x"),
]


def test_what_is_counted():
    found = counts(ROWS)
    assert found["unanswered"] == 1 and found["cpu_s"] == 2.0
    assert found["rows"] == {
        "nothing": [2, 1, 1, 1, 1, 0],
        "one": [3, 2, 2, 2, 0, 0],
        "one: d = 15": [1, 0, 0, 0, 0, 0],
        "one: d = 40": [2, 2, 2, 2, 0, 0],
        "two": [1, 1, 1, 0, 1, 0],
        "outside": [1, 1, 0, 0, 0, 1],
    }
    assert found["intervals"] == [1, 2]  # where the causes are right alone
    assert found["off"] == {"gain": [40.0, 3.0]} and found["errors"] == {"held_out": [5.0, 1.0]}
    assert lines_of(found)[2] == ["one, d = 15", interval(0, 1), 0, 0, 0, 0]
    assert "hold the truth: 1 of 2" in notes(found)[0] and "4" not in notes(found)[-1]
    assert [line.split()[0] for line in wrong(ROWS)] == ["b:", "e:", "f:", "h:"]
    assert json.loads(json.dumps(found)) == found


def test_intervals_are_wilsons():
    assert interval(9, 10) == "9 of 10: 90.0 % (59.6 to 98.2)"


def test_worse_is_told_where_chance_is_no_reason():
    before = {"rows": {"one": [100, 97, 0, 0, 0, 0], "two": [10, 9, 0, 0, 0, 0]}}
    assert worse({"rows": {"one": [30, 28, 0, 0, 0, 0], "two": [4, 3, 0, 0, 0, 0]}}, before) == []
    assert len(worse({"rows": {"one": [30, 20, 0, 0, 0, 0], "outside": [4, 0, 0, 0, 0, 0]}}, before)) == 1


def test_two_codes_are_compared_on_the_same_files_alone():
    before = {r.key: r for r in ROWS[:6]}
    before["b"] = row("b")
    before["c"] = row("c", study="another file")
    before["d"] = row("d", hidden=(), sets=(), cpu_s=4.0)
    text = compared(ROWS, before)
    assert text[0].startswith("5 of 8")
    assert "| all | 5 | 3 | 0 | 1 | 1 | 1 |" in text[1] and "| one | 2 | 1 | 0 | 1 | 0 | 1 |" in text[1]
    assert "median: 1.00" in text[2] and [line.split()[:2] for line in text[-2:]] == [["before", "b:"], ["now", "b:"]]
    assert any(line.startswith("now: 95 % intervals") for line in text)


@pytest.mark.parametrize("name", sorted(GENERATORS.keys() - {"halved"}))  # which has as many as there are studies
def test_a_plan_holds_some_of_each_and_goes_on(name):
    items = list(islice(generator_of(name).plan(7), 120))
    assert len({item.key for item in items}) == 120
    assert items[:20] == list(islice(generator_of(name).plan(7), 20))
    hidden = Counter(min(len(item.hidden), 2) for item in items)
    assert hidden[0] >= 6 and hidden[1] + hidden[2] >= 60


class Fake:
    """Answers that nothing took: studies of one number."""

    made = 0

    def plan(self, seed):
        return iter(())

    def make(self, item, folder):
        Fake.made += 1
        import numpy as np

        import fes_pin as fp

        time = np.arange(50) * 0.01
        trial = fp.Trial("one", "isometric", {"pulse_width_us": 0.0 * time, "force_n": time}, time)
        start = {"gain": 30.0, "time_constant_s": 0.05}
        known = {"threshold_us": 180.0, "saturation_us": 1000.0}
        return fp.Study("fake", "muscle", known, start, (trial,)), Truth({"gain": 1.0})

    def ask(self, study):
        if study.trials[0]["force_n"][1] != 0.01:
            raise ValueError("not as it was made")
        return self

    def to_json(self):
        return json.dumps(RECORD)


@pytest.fixture
def fake(monkeypatch):
    Fake.made = 0
    monkeypatch.setattr(runs, "generator_of", lambda name: Fake())


ITEMS = [Item("a", 1, ("fatigue",)), Item("b", 2)]


def test_a_run_that_was_broken_off_goes_on_and_other_code_begins_again(fake, tmp_path, monkeypatch):
    store = tmp_path / "store/fake.jsonl"
    first = run("fake", ITEMS[:1], store, None, 1)
    both = run("fake", ITEMS, store, None, 1)
    assert both[0] == first[0] and Fake.made == 2 and [r.key for r in both] == ["a", "b"]
    assert [r.right for r in both] == [True, False]
    monkeypatch.setattr(runs, "code_hash", lambda: "other code")
    again = run("fake", ITEMS, store, None, 1)
    assert Fake.made == 4 and {r.code for r in again} == {"other code"}
    assert rows_of(store, None) == {r.key: r for r in again} and len(store.read_text().splitlines()) == 4


def test_studies_that_are_kept_are_not_made_again(fake, tmp_path):
    one, other = (answered("fake", ITEMS[0], tmp_path) for _ in range(2))
    assert Fake.made == 1 and one.study == other.study and one.error is None
    file = tmp_path / "fake/a/trials/one.csv"
    file.write_text(file.read_text().replace("0.01,0.0,0.01", "0.01,0.0,0.02"))
    changed = answered("fake", ITEMS[0], tmp_path)
    assert changed.study != one.study and changed.error == "ValueError: not as it was made"


def test_the_command_line_says_what_it_does_not_know_and_reads_a_store(fake, tmp_path, monkeypatch):
    command = CliRunner()
    app = typer.Typer()
    app.command()(main)
    odd = command.invoke(app, ["nonsense", "--count", "1"])
    assert odd.exit_code == 2 and "nonsense" in odd.output
    (tmp_path / "mine/answers").mkdir(parents=True)
    monkeypatch.setattr(harness.__main__, "generator_of", lambda name: SimpleNamespace(plan=lambda seed: iter(ITEMS)))
    asked = [str(tmp_path / "mine"), "--store", str(tmp_path / "now"), "--workers", "1"]
    first = command.invoke(app, asked)
    assert first.exit_code == 0 and "| one | 1 of 1" in first.output and Fake.made == 2
    again = command.invoke(app, [*asked, "--stored", "--compare", str(tmp_path / "now"), "--hidden", "0"])
    assert again.exit_code == 0 and Fake.made == 2
    assert "1 of 1 studies were answered by both" in again.output and "b: nothing -> causes_found" in again.output
    assert command.invoke(app, [*asked, "--check"]).output.endswith("no worse than docs/accuracy.md\n")
