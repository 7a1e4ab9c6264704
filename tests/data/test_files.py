"""Outputs are written whole or not at all."""

import os
import stat
import subprocess
import sys
import time

import numpy as np
import pytest

from fes_pin.data import files
from fes_pin.data.errors import InputError
from fes_pin.data.files import check_folder, write_files, write_text
from fes_pin.data.outputs import Outputs


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


def litter(folder):
    return [path.name for path in folder.iterdir() if path.name.startswith(".fes_pin-")]


def test_a_run_removes_what_killed_ones_left(tmp_path):
    (tmp_path / ".fes_pin-killed").mkdir()
    (tmp_path / ".fes_pin-killed" / "old-0").write_text("half")
    (tmp_path / ".fes_pin-file").write_text("of an older version")
    (tmp_path / ".fes_pin-link").symlink_to(tmp_path / "kept")
    (tmp_path / "kept").mkdir()
    (tmp_path / "kept" / "a").write_text("kept")
    write_text(tmp_path / "b", "new")
    assert litter(tmp_path) == [".fes_pin-link"]  # not made by any run, and what it names is not ours
    assert (tmp_path / "kept" / "a").read_text() == "kept"


def test_a_run_leaves_alone_what_another_works_on(tmp_path):
    with files.scratch_folder(tmp_path) as one, files.scratch_folder(tmp_path) as other:
        (one / "half").write_text("")
        write_files(tmp_path, {"a": "a"})
        write_text(tmp_path / "b", "b")
        assert sorted(litter(tmp_path)) == sorted([one.name, other.name]) and (one / "half").exists()
    assert litter(tmp_path) == []


def test_on_a_disk_without_locks_files_are_written_and_nothing_is_taken_for_litter(tmp_path, monkeypatch):
    def without_locks(*_):
        raise OSError(95, "not supported")

    monkeypatch.setattr(files.fcntl, "flock", without_locks)
    (tmp_path / ".fes_pin-perhaps").mkdir()
    write_files(tmp_path, {"a": "a"})
    assert (tmp_path / "a").read_text() == "a" and litter(tmp_path) == [".fes_pin-perhaps"]


WRITER = """
import os, sys
from fes_pin.data.files import write_files

folder, last = sys.argv[1], int(sys.argv[2])
replace, count = os.replace, 0

def killed_at_last(source, target):
    global count
    count += 1
    if count == last:
        os.kill(os.getpid(), 9)
    replace(source, target)

os.replace = killed_at_last
print("ready", flush=True)
for k in range(10**9):
    names = ("a", "b", "sub/c") if k % 2 == 0 else ("a", "b")
    write_files(folder, {name: f"{k} " * 20_000 for name in names}, without={"sub/c"} - set(names))
"""


def run_until_killed(folder, rename=0, pause=None):
    """Write sets of files over and over, killed (signal 9) before a rename or after a pause; the names left."""
    with subprocess.Popen([sys.executable, "-c", WRITER, str(folder), str(rename)], stdout=subprocess.PIPE) as run:
        run.stdout.readline()
        if pause is not None:
            time.sleep(pause)
            run.kill()
    assert run.returncode == -9
    found = {p.name: p.read_text().split() for p in folder.rglob("[abc]") if not p.parent.name.startswith(".")}
    assert all(len(words) == 20_000 and len(set(words)) == 1 for words in found.values()), "a file is not whole"
    assert len({words[0] for words in found.values()}) <= 1, "files of two runs stand side by side"
    write_files(folder, {"d": "the next run"})
    assert litter(folder) == []
    return frozenset(found)


def test_a_run_killed_before_any_rename_leaves_whole_files_of_one_run_or_none(tmp_path):
    """The first set is three renames; the second takes three old files away, then places two."""
    left = []
    for k in range(1, 10):
        (tmp_path / str(k)).mkdir()
        left.append(run_until_killed(tmp_path / str(k), rename=k))
    assert left == list(map(frozenset, ("", "a", "ab", "abc", "ac", "a", "a", "ab", "a")))


def test_a_command_that_was_killed_writes_over_what_it_left(tmp_path):
    """Before any rename: what stands is of the command, and the file of another one stays noted."""
    code = WRITER.replace("files import write_files", "outputs import Outputs")
    code = code.replace("    write_files(", "    Outputs('one').write(")
    for rename in range(2, 12):
        folder = tmp_path / str(rename)
        Outputs("other").write(folder, {"other": "x"})
        run = subprocess.run([sys.executable, "-c", code, str(folder), str(rename)], check=False, capture_output=True)
        assert run.returncode == -9
        Outputs("other").check(folder, ["other"])
        Outputs("one").write(folder, {"a": "a", "b": "b", "sub/c": "c"})


def test_a_run_killed_at_any_moment_leaves_whole_files_of_one_run_or_none(tmp_path):
    for pause in np.random.default_rng(0).uniform(0.0, 0.03, 8):
        run_until_killed(tmp_path, pause=pause)


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


def fail(*_):
    raise OSError(28, "full")
