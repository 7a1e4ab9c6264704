"""Stored answers know the code that made them."""

import importlib
import shutil
from dataclasses import replace

import pytest

from fes_pin.cohort import one
from fes_pin.cohort.one import Work
from fes_pin.data.sources import PACKAGE, code_hash


@pytest.fixture
def package(tmp_path):
    shutil.copytree(PACKAGE / "data", tmp_path / "fes_pin/data", ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copytree(PACKAGE.parent / "urdf", tmp_path / "urdf")
    return tmp_path / "fes_pin"


@pytest.mark.parametrize("name", ["data/numbers.py", "data/datasets.json", "../urdf/ankle_rig.urdf"])
def test_a_changed_source_gives_another_hash(package, name):
    before = code_hash(package)
    with (package / name).open("a") as file:
        file.write("\n")
    code_hash.cache_clear()
    assert code_hash(package) != before


def test_a_new_source_gives_another_hash_and_what_is_no_source_does_not(package):
    before = code_hash(package)
    (package / "data/__pycache__").mkdir()
    (package / "data/__pycache__/numbers.cpython-311.pyc").write_bytes(b"0")
    code_hash.cache_clear()
    assert code_hash(package) == before
    (package / "data/another.py").write_text("")
    code_hash.cache_clear()
    assert code_hash(package) != before


def test_a_cohort_does_not_serve_answers_of_other_code(tmp_path, monkeypatch):
    (tmp_path / "study.toml").write_text('[study]\nname = "s"\n')
    work = Work("s", str(tmp_path))
    before = work.key()
    assert replace(work, command="fes-pin cohort").key() == before
    monkeypatch.setattr(one, "code_hash", lambda: "other code")
    assert work.key() != before


def test_stored_results_of_other_code_are_not_served(tmp_path, monkeypatch):
    """As the scripts of accuracy keep them, one line a study: a run goes on with what its own code made alone."""
    monkeypatch.syspath_prepend(PACKAGE.parent / "scripts")
    going_on, results, made = importlib.import_module("going_on"), tmp_path / "results.jsonl", []

    def judged(piece, seed):
        made.append(piece)
        return {"seed": seed}

    for _ in range(2):
        assert [r["seed"] for r in going_on.results_of("ab", 5, judged, results)] == [5, 6]
    assert made == ["a", "b"]
    monkeypatch.setattr(going_on, "code_hash", lambda: "other code")
    assert [r["seed"] for r in going_on.results_of("ab", 5, judged, results)] == [5, 6]
    assert made == ["a", "b", "a", "b"]
    assert len(going_on.rows_of(results)) == 2 and len(going_on.rows_of(results, whatever_code=True)) == 4
