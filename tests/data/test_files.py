"""Outputs are written whole or not at all."""

import os
import stat

import pytest

from fes_pin.data.datasets import DATASETS, fetch
from fes_pin.data.errors import InputError
from fes_pin.data.files import check_folder, write_files, write_text


def test_write_replaces_whole(tmp_path):
    path = tmp_path / "a.txt"
    write_text(path, "one")
    write_text(path, "two")
    assert path.read_text() == "two" and os.listdir(tmp_path) == ["a.txt"]
    mask = os.umask(0o022)
    os.umask(mask)
    assert stat.S_IMODE(path.stat().st_mode) == 0o666 & ~mask


def test_a_failed_write_leaves_the_old_file(tmp_path, monkeypatch):
    path = tmp_path / "a.txt"
    write_text(path, "old")
    monkeypatch.setattr(os, "fsync", fail)
    with pytest.raises(InputError, match="cannot be written: full"):
        write_text(path, "new")
    with pytest.raises(InputError, match="cannot be written: full"):
        write_files(tmp_path / "deep" / "er", {"b.txt": "b"})
    assert path.read_text() == "old" and os.listdir(tmp_path) == ["a.txt"]


def test_a_set_of_files_is_written_or_none(tmp_path, monkeypatch):
    write_files(tmp_path / "out", {"a": "old a", "c": "old c", "sub/b": b"old b"})
    replace, count = os.replace, []

    def fail_late(source, target):
        count.append(target)
        if len(count) == 4:
            fail()
        replace(source, target)

    monkeypatch.setattr(os, "replace", fail_late)
    with pytest.raises(InputError, match="cannot be written"):
        write_files(tmp_path / "out", {"new": "n", "a": "new a", "sub/b": "new b", "c": "new c"})
    found = {str(p.relative_to(tmp_path / "out")): p.read_text() for p in (tmp_path / "out").rglob("*") if p.is_file()}
    assert found == {"a": "old a", "c": "old c", "sub/b": "old b"}


def test_what_cannot_be_written(tmp_path):
    with pytest.raises(InputError, match="found a folder"):
        write_text(tmp_path, "x")
    with pytest.raises(InputError, match="does not exist"):
        write_text(tmp_path / "no" / "a.txt", "x")
    (tmp_path / "file").write_text("x")
    with pytest.raises(InputError, match="cannot be written"):
        write_files(tmp_path / "file", {"a": "x"})
    with pytest.raises(InputError, match="inside the folder"):
        write_files(tmp_path, {"../a": "x"})


@pytest.mark.parametrize("below", ["", "/a/b"])
def test_a_folder_that_cannot_be_is_said_before_the_work(tmp_path, monkeypatch, below):
    check_folder(tmp_path)
    check_folder(tmp_path / "new" / "newer")
    assert list(tmp_path.iterdir()) == []
    file = tmp_path / "file"
    file.write_text("kept")
    with pytest.raises(InputError, match="is a file; expected a folder"):
        check_folder(f"{file}{below}")
    monkeypatch.setattr(os, "access", lambda _path, _mode: False)
    with pytest.raises(InputError, match="cannot be written"):
        check_folder(f"{tmp_path}{below}")
    assert file.read_text() == "kept"


def test_fetch(tmp_path, monkeypatch):
    monkeypatch.delenv("FES_PIN_DATA", raising=False)
    with pytest.raises(InputError, match=r"FES_PIN_DATA.*MultiArm-Pendulum"):
        fetch("free_pendulum")
    with pytest.raises(InputError, match="did you mean free_pendulum"):
        fetch("free_pendulums")
    monkeypatch.setenv("FES_PIN_DATA", str(tmp_path))
    with pytest.raises(InputError, match="no biceps_fes"):
        fetch("biceps_fes")
    for name, folder in zip(DATASETS, (tmp_path / "data", tmp_path), strict=True):
        (folder / name).mkdir(parents=True)
        (folder / name / "study.toml").write_text("")
        assert fetch(name) == folder / name


def fail(*_):
    raise OSError(28, "full")
