"""The table's sums, and a slice of the matrix from end to end."""

import json
from pathlib import Path

import pytest
from confusion_matrix import check, picture, plan, runner, stimuli, table
from confusion_matrix.plan import Item
from scipy.stats import binom


def record(name, sets, verdict="causes_found", **more):
    item = Item.parse(name)
    known = {"id": name, "kind": item.kind, "rig": item.rig, "causes": list(item.causes), "form": item.form}
    rest = {"noise": item.noise, "target": item.distance, "d": [float(item.distance)] * len(item.causes), "size": [1.0]}
    answer = {"sets": sets, "verdict": verdict, "unexplained": False, "where": None, "orthogonal": None}
    return {**known, **rest, **answer, "parameters": [], "share": 0.95, "wall_s": 5.0, **more}


RECORDS = [
    record(
        "ankle-fatigue-same-d40-white-1", [["fatigue"]], parameters=[["gain", 1.0, 1.01, 0.01], ["gain", 1, 2, 0.1]]
    ),
    record("ankle-fatigue-ding-d40-white-1", [["potentiation", "fatigue"]]),
    record("ankle-load_error-same-d150-ar1-1", [["base_tilt"]], share=-0.2),
    record("ankle-none-null-d0-ar1-1", [], "adequate", share=None),
    record("ankle-none-null-d0-ar1-2", [["fatigue"]], share=None),
    record("ankle-fatigue+load_error-pair-d100-white-1", [["fatigue"], ["load_error", "base_tilt"]]),
    record("ankle-fatigue+load_error-pair-d100-white-2", [["fatigue", "load_error"]]),
    record("ankle-spasms-outside-d60-white-2", [], "unexplained", orthogonal=30.0, unexplained=True),
]


def row(text, label):
    (line,) = (line for line in text.splitlines() if line.startswith(label))
    return line


def test_table_counts():
    text = table.table(RECORDS)
    assert text.startswith("8 studies")
    assert "50.0 %" in row(text, "false alarms, nulls, ar1") and row(text, "false alarms, nulls, ar1").endswith(" 2")
    assert "100.0 %" in row(text, "true cause in the first set, d = 40")
    assert "0.0 %" in row(text, "true cause in the first set, d = 150")
    assert "100.0 %" in row(text, "named exactly, the engine's form, d = 40")
    assert " 0.0 %" in row(text, "named exactly, another form, d = 40")
    assert "1.50" in row(text, "mean size of the first set, d = 40")
    assert "50.0 %" in row(text, "both of two causes")
    assert "50.0 %" in row(text, "95 % intervals cover, all parameters, any")
    assert "100.0 %" in row(text, "outside the library, 15 beside")
    assert " wrong name (1)" in text and " false alarm, ar1 noise (1)" in text and " not both of two causes (1)" in text
    assert "fatigue (ding)" in text and "-> potentiation|fatigue" in text


def test_wilson():
    assert table.wilson(9, 10) == pytest.approx((0.5958, 0.9821), abs=1e-4)
    assert table.wilson(0, 0) == (0.0, 1.0)


def test_picture(tmp_path):
    picture.draw(RECORDS, tmp_path / "matrix.png")
    assert (tmp_path / "matrix.png").stat().st_size > 10_000


def test_any_beginning_is_a_slice():
    groups = runner.plan(25, seed=1)
    assert sum(len(g) for g in groups) == 25
    assert groups[:3] == runner.plan(50, seed=1)[:3]
    assert plan.DISTANCES == (15, 40, 150)


GOLDEN = Path(__file__).parents[1] / "golden/confusion.txt"


def counted(label):
    """Hits and studies of the rows of the committed table that begin with a label."""
    rows = [line.split() for line in GOLDEN.read_text().splitlines() if line.startswith(label)]
    studies = [int(row[-1]) for row in rows]
    percent = [float(row[[k for k, word in enumerate(row) if word == "%"][1] - 1]) for row in rows]
    return round(sum(p * n / 100.0 for p, n in zip(percent, studies, strict=True))), sum(studies)


def test_the_check_passes_what_the_table_holds_and_notices_what_is_worse():
    alarms, blanks = counted("false alarms")
    assert blanks > 200
    assert binom.cdf(check.MOST_ALARMS, check.BLANKS, alarms / blanks) > 0.98
    assert binom.sf(check.MOST_ALARMS, check.BLANKS, 0.15) > 0.95
    rows = [counted(f"true cause in the first set, d = {d}") for d in (40, 150)]
    found, hidden = map(sum, zip(*rows, strict=True))
    assert binom.cdf(check.MOST_MISSED, check.HIDDEN, 1.0 - found / hidden) > 0.98
    assert binom.sf(check.MOST_MISSED, check.HIDDEN, 0.25) > 0.95


def test_the_check_is_fifty_that_hide_nothing_and_thirty_causes():
    items = [item for group in check.slice_of(0) for item in group]
    assert [sum(map(check.hides_nothing, items)), len(items)] == [50, 80]
    assert {item.rig for item in items} == {"ankle", "joint", "muscle"}
    assert all(item.distance >= 40 for item in items if not check.hides_nothing(item))


def test_the_check_complains():
    right = [
        record("ankle-fatigue-same-d40-white-1", [["fatigue"]]),
        record("ankle-none-null-d0-ar1-1", [], "adequate"),
    ]
    assert check.complaints(right * 15) == []
    alarm = record("ankle-none-null-d0-ar1-2", [["fatigue"]])
    missed = record("ankle-load_error-same-d150-ar1-1", [["base_tilt"]])
    assert check.complaints([alarm] * 3) == [] and check.complaints([missed] * 3) == []
    assert "4 false alarms" in check.complaints([alarm] * 4)[0]
    assert "4 causes missed" in check.complaints([missed] * 4)[0]
    assert "no answer: E: x" in check.complaints([{**alarm, "error": "E: x"}])[0]


def test_slice_from_end_to_end_and_again(tmp_path, monkeypatch):
    monkeypatch.setenv("FES_PIN_THREADS", "1")
    monkeypatch.setattr(stimuli, "DURATION_S", 4.0)
    wanted = [[Item("ankle", ("load_inertia",), "pulley", 150, "ar1", 5)], [Item("muscle", (), "null", 0, "white", 5)]]
    results = tmp_path / "results.jsonl"
    hidden, none = runner.run(wanted, results)
    assert "error" not in hidden and "error" not in none
    assert table.first(hidden) and table.claims(hidden)
    assert none["verdict"] == "adequate"
    lines = results.read_text().splitlines()
    assert [json.loads(line)["id"] for line in lines] == [g[0].name for g in wanted]
    assert runner.run(wanted, results) == [hidden, none]
    assert results.read_text().splitlines() == lines
