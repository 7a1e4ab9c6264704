"""Stored answers know the code that made them."""

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
