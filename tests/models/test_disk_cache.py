"""The cache of machine code: nobody else's is executed, and where it cannot be used it only costs time."""

import logging
import os
import shutil
import stat
from pathlib import Path

import pytest

from fes_pin.models.compile.program import read_cached, say_unsafe, write_cached


@pytest.fixture
def folder(monkeypatch, tmp_path):
    """A cache that does not exist yet."""
    monkeypatch.setenv("FES_PIN_CACHE", str(tmp_path / "deep" / "cache"))
    say_unsafe.cache_clear()
    return tmp_path / "deep" / "cache"


@pytest.fixture
def entry(folder):
    """The file of one entry."""
    write_cached("key", b"code")
    assert read_cached("key") == b"code"
    (path,) = folder.iterdir()
    return path


def test_it_is_this_users_alone_whatever_the_mask(folder):
    mask = os.umask(0)
    try:
        write_cached("key", b"code")
    finally:
        os.umask(mask)
    (path,) = folder.iterdir()
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    assert stat.S_IMODE(path.stat().st_mode) == 0o600


@pytest.mark.parametrize("mode", [0o720, 0o702, 0o777, 0o1777])
@pytest.mark.parametrize("which", ["folder", "entry"])
def test_what_others_can_write_is_not_executed_and_said_once(folder, entry, mode, which, caplog):
    (folder if which == "folder" else entry).chmod(mode)
    with caplog.at_level(logging.WARNING):
        assert read_cached("key") is None
        assert read_cached("key") is None
    assert len(caplog.messages) == 1 and "not this user's alone" in caplog.messages[0]
    before = entry.read_bytes()
    write_cached("key", b"other")
    if which == "folder":
        assert entry.read_bytes() == before
    else:  # the file is replaced by one of this user's alone
        assert read_cached("key") == b"other"


def test_what_another_user_owns_is_not_executed(entry, monkeypatch):
    monkeypatch.setattr(os, "geteuid", lambda: entry.stat().st_uid + 1)
    assert read_cached("key") is None


def test_others_may_look_at_it(folder, entry):
    folder.chmod(0o755)
    entry.chmod(0o644)
    assert read_cached("key") == b"code"


def damaged(entry, how):
    content = entry.read_bytes()
    entry.unlink()
    if how == "folder":
        entry.mkdir()
    elif how == "link":
        (entry.parent / "elsewhere").write_bytes(content)
        entry.symlink_to(entry.parent / "elsewhere")
    elif how == "pipe":
        os.mkfifo(entry)
    else:
        entry.write_bytes({"empty": b"", "cut": content[:-1], "text": b"no"}[how])


@pytest.mark.parametrize("how", ["folder", "link", "pipe", "empty", "cut", "text"])
def test_an_entry_that_is_none_only_costs_time(entry, how):
    damaged(entry, how)
    assert read_cached("key") is None
    write_cached("key", b"again")
    assert read_cached("key") == (None if how in ("folder", "link", "pipe") else b"again")


def test_a_cache_that_is_a_file_gone_or_homeless_only_costs_time(folder, entry, monkeypatch):
    shutil.rmtree(folder)
    assert read_cached("key") is None
    folder.write_text("a file")
    write_cached("key", b"code")
    assert read_cached("key") is None and folder.read_text() == "a file"
    monkeypatch.delenv("FES_PIN_CACHE")
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)

    def homeless():
        raise RuntimeError("no home")

    monkeypatch.setattr(Path, "home", homeless)
    write_cached("key", b"code")
    assert read_cached("key") is None


@pytest.mark.parametrize("call", ["mkdir", "open", "fsync", "replace"])
@pytest.mark.parametrize("number", [28, 30, 122])
def test_a_full_or_read_only_disk_only_costs_time(folder, entry, monkeypatch, call, number):
    """No space left, read-only file system, quota exceeded: whichever call meets it."""

    def refuse(*_, **__):
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(os, call, refuse)
    write_cached("other", b"code")
    monkeypatch.undo()
    assert [path.name for path in folder.iterdir()] == [entry.name]


def test_what_a_killed_run_left_in_it_is_removed(folder, entry):
    (folder / ".fes_pin-killed").mkdir()
    write_cached("key", b"again")
    assert [path.name for path in folder.iterdir()] == [entry.name]
