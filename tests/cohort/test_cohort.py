"""A cohort: every study once, whatever fails or is killed; nothing done twice when it goes on."""

import csv
import html
import io
import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path
from urllib.parse import unquote

import pytest
from cohort.fakes import calls, quick, record, studies

from fes_pin.cohort.one import Kept
from fes_pin.cohort.run import HEADS, Cohort, find_studies, run_cohort
from fes_pin.cohort.tables import cohort_html, tables_of
from fes_pin.data.errors import InputError

DEMO = Path(__file__).parents[2] / "analysis/studies/ankle_demo"


def rows(path):
    with path.open() as stream:
        return list(csv.DictReader(stream))


def test_one_bad_study_and_one_that_kills_its_process_stop_no_other(tmp_path):
    names = ["a0", "bad", "f1", "f2", "killer", "z9"]
    places, told = studies(tmp_path / "in", names), []

    def tell(share, words):
        told.append((share, words.split(", ")))

    made = run_cohort([places], tmp_path / "out", workers=2, progress=tell, run=quick)
    assert [r["study"] for r in made.studies] == names
    assert {r["study"]: r["error"] for r in made.failed} == {
        "bad": "study.toml, rig: expected a rig",
        "killer": "the process that diagnosed it died: out of memory, or killed",
    }
    assert [share for share, _ in told] == [k / 6 for k in range(1, 7)]
    assert [words[0] for _, words in told] == [f"{k} of 6" for k in range(1, 7)]
    assert told[-1][1][1:3] == ["2 failed", "0 s left"] and sorted(words[3] for _, words in told) == names
    assert [(r["cause"], r["studies"], r["alone"]) for r in made.prevalence] == [("coulomb_friction", 2, 2)]
    by_parameter = {r["parameter"]: r for r in made.pooled}
    assert by_parameter["torque_nm"]["studies"] == 2 and by_parameter["gain"]["studies"] == 4
    assert all(n in rows(tmp_path / "out/studies.csv")[0] for n in HEADS["studies"])
    page = (tmp_path / "out/cohort.html").read_text()
    assert "6 studies: 2 explained, 2 adequate, 2 failed" in page and "coulomb friction in 2 of 4" in page
    assert 'href="studies/f1/report.html"' in page


def test_a_cohort_says_which_causes_tie_which_studies_lack_something_and_what_to_do():
    """A cause of a study where the data cannot distinguish it is said with its equivalents, wherever it is counted."""
    kept = [Kept(n, record(n, 1.0 + k)) for k, n in enumerate(("f1", "f2", "f3", "a4"))]
    kept[0].record["causes"][0]["equivalents"] = ["load_error", "fatigue"]
    kept[1].record["remainder"]["unexplained"] = True
    kept[3].record["absorbed"] = ["fatigue"]
    tables = tables_of(kept, 30)
    made, page = Cohort(**tables), cohort_html(tables, 0)
    assert repr(made) == "4 studies: 2 explained, 1 partly explained, 1 adequate"
    assert made.as_table()[2] == [("coulomb_friction", "3 of 4 (ties with fatigue and load_error in 1)", "75 %")]
    advice = "record the trial that separates equivalent causes in f1; read which sensor or condition is missed most"
    assert advice in page and advice in str(made)
    (pooled,) = (r for r in made.pooled if r["parameter"] == "torque_nm")
    forest, heat = (behind(page, n) for n in ("coulomb_friction_torque_nm", "studies_by_causes"))
    assert [r["name"] for r in forest] == ["f1", "f2", "f3", "pooled  3 studies"]
    assert [float(r["low"]) for r in forest[:3]] == pytest.approx([k - 0.196 for k in (1, 2, 3)], abs=1e-4)
    assert [float(forest[3][n]) for n in ("low", "high")] == pytest.approx([pooled["low"], pooled["high"]], rel=1e-5)
    assert {(r["study"], r["cause"]): r["percent"] for r in heat} == {
        **{(n, "coulomb_friction"): "79" for n in ("f1", "f2", "f3")},
        **{("f1", n): "equivalent" for n in ("load_error", "fatigue")},
        ("a4", "fatigue"): "not testable",
    }


def behind(page, name):
    """Rows of the data behind a figure."""
    data = re.search(f'download="{name}.csv" href="data:text/csv,([^"]*)"', page)[1]
    return list(csv.DictReader(io.StringIO(unquote(html.unescape(data)))))


def test_nothing_is_said_of_what_was_not_computed(tmp_path):
    """A study that failed has no remainder, no causes and no errors: not false, not none, not zero."""
    made = run_cohort([studies(tmp_path / "in", ["bad", "f1"])], tmp_path / "out", run=quick)
    failed, good = made.studies
    assert failed["unexplained"] is None and failed["causes"] is None and good["unexplained"] is False
    csv_row = rows(tmp_path / "out/studies.csv")[0]
    assert {n for n, cell in csv_row.items() if cell} == {"study", "verdict", "error"}
    assert csv_row["verdict"] == "failed"


def test_tables_and_page_say_the_errors_that_the_record_says(tmp_path):
    """One name, one quantity: a column is called as the key of `diagnosis.json` that it holds."""
    run_cohort([studies(tmp_path / "in", ["f1"])], tmp_path / "out", run=quick)
    record = json.loads((tmp_path / "out/studies/f1/diagnosis.json").read_text())
    (row,) = rows(tmp_path / "out/studies.csv")
    for model in ("nominal", "extended"):
        for name in ("fit", "held_out"):
            assert float(row[f"{model}_{name}_percent"]) == record[model]["error_percent"][name]
        assert row[f"{model}_horizon_percent"] == ""  # this record has none
    assert "10 % \u2192 3 %" in (tmp_path / "out/cohort.html").read_text()


def test_a_cohort_goes_on_where_it_was(tmp_path):
    places = studies(tmp_path / "in", ["a0", "bad", "killer"])
    first = run_cohort([places], tmp_path / "out", run=quick)
    before = calls(places)
    studies(tmp_path / "in", ["f5"])
    (places / "a0/study.toml").write_text('[study]\nname = "changed"\n')
    again = run_cohort([places], tmp_path / "out", run=quick)
    new = {n: k - before.get(n, 0) for n, k in calls(places).items()}
    assert new["bad"] == 0 and new["a0"] == new["f5"] == 1 and new["killer"] >= 1  # what died may live another time
    assert len(again.studies) == len(first.studies) + 1
    run_cohort([places], tmp_path / "out", seed=1, run=quick)
    assert calls(places)["bad"] == before["bad"] + 1  # another seed is another question


@pytest.mark.parametrize("gone", ["report.html", "diagnosis.json"])
def test_an_answer_that_lacks_a_file_is_made_again_and_no_other(tmp_path, gone):
    """The page of the cohort linked a report that was not there."""
    places, out = studies(tmp_path / "in", ["bad", "f1", "f2"]), tmp_path / "out"
    first = run_cohort([places], out, run=quick)
    before = calls(places)
    (out / "studies/f1" / gone).unlink()
    again = run_cohort([places], out, run=quick)
    assert (out / "studies/f1" / gone).is_file() and again.studies == first.studies
    assert {n: k - before[n] for n, k in calls(places).items()} == {"bad": 0, "f1": 1, "f2": 0}


def test_parquet_says_what_the_csv_says(tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet")
    run_cohort([studies(tmp_path / "in", ["bad", "f1", "f2"])], tmp_path / "out", run=quick)
    for name, head in HEADS.items():
        table = parquet.read_table(tmp_path / f"out/{name}.parquet")
        assert tuple(table.column_names) == head
        assert table.num_rows == len(rows(tmp_path / f"out/{name}.csv")) > 0
    table = parquet.read_table(tmp_path / "out/studies.parquet")
    assert table["ceiling_percent"].to_pylist() == [None, 1.5, 1.5]
    assert table["unexplained"].to_pylist() == [None, False, False]


def test_studies_of_one_name_are_told_apart(tmp_path):
    for person in ("anna", "ben"):
        studies(tmp_path / person, ["knee"])
    studies(tmp_path / "carl", ["hip"])
    assert list(find_studies([tmp_path])) == ["anna-knee", "ben-knee", "hip"]
    assert list(find_studies([tmp_path / "carl/hip/study.toml"])) == ["hip"]
    with pytest.raises(InputError, match="no such folder"):
        find_studies([tmp_path / "none"])
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match=r"no study\.toml"):
        find_studies([tmp_path / "empty"])


def test_a_cohort_of_nothing_but_bad_studies_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"none of 1 studies could be diagnosed; the first: study\.toml, rig"):
        run_cohort([studies(tmp_path / "in", ["bad"])], tmp_path / "out", run=quick)
    assert not (tmp_path / "out").exists()


def test_a_run_that_is_killed_leaves_whole_answers_and_goes_on(tmp_path):
    places = studies(tmp_path / "in", [f"f{k}" for k in range(8)])
    here = Path(__file__).parents[1]
    code = (
        "from pathlib import Path; from cohort.fakes import quick; from fes_pin.cohort.run import run_cohort\n"
        f"if __name__ == '__main__': run_cohort([Path({str(places)!r})], Path({str(tmp_path / 'out')!r}), run=quick)"
    )
    (tmp_path / "go.py").write_text(code)
    known = {**os.environ, "PYTHONPATH": os.pathsep.join([str(here), str(here.parent)])}
    with subprocess.Popen([sys.executable, str(tmp_path / "go.py")], env=known) as process:
        until = time.monotonic() + 60.0
        while len(list((tmp_path / "out").glob("studies/*/state.json"))) < 2 and time.monotonic() < until:
            time.sleep(0.01)
        process.send_signal(signal.SIGKILL)
    there = {p.parent.name for p in (tmp_path / "out").glob("studies/*/state.json")}
    assert 2 <= len(there) < 8
    before = calls(places)
    made = run_cohort([places], tmp_path / "out", run=quick)
    assert len(made.studies) == 8 and not made.failed
    after = calls(places)
    assert all(after[n] == before[n] for n in there)
    assert not list((tmp_path / "out").rglob(".fes_pin-*"))


def test_the_command_diagnoses_a_study_and_says_what_failed(tmp_path):
    broken = studies(tmp_path / "in", ["broken"])
    words = [sys.executable, "-m", "fes_pin.cli.main", "cohort", str(DEMO), str(broken)]
    done = subprocess.run(
        [*words, "--out", str(tmp_path / "out"), "--workers", "2", "--limit", "0"],
        capture_output=True,
        text=True,
        check=True,
    )
    assert "2 studies: 1 stopped, 1 failed" in done.stdout
    assert "next: correct the files of broken; diagnose again" in " ".join(done.stdout.split())
    assert "failed: broken: " in done.stderr and "study.toml" in done.stderr
    assert {p.name for p in (tmp_path / "out/studies/ankle_demo").iterdir()} == {
        *("diagnosis.json", "model.toml", "report.html", "state.json", ".fes_pin.json")
    }
    record = json.loads((tmp_path / "out/studies/ankle_demo/diagnosis.json").read_text())
    for told in (record["provenance"]["command"], (tmp_path / "out/cohort.html").read_text()):
        assert "fes-pin cohort" in told and "--limit 0" in told
