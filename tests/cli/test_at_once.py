"""Two commands for one folder at once: the second is refused before its work; a lock ends with its process."""

import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from cli.test_outputs import DEMO

from fes_pin.data import outputs
from fes_pin.data.errors import InputError
from fes_pin.data.outputs import BUSY, Outputs, claims_held


def started(folder, *words):
    known = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])}
    command = [sys.executable, "-m", "fes_pin", *words]
    return subprocess.Popen(command, cwd=folder, env=known, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def until(true):
    end = time.monotonic() + 120.0
    while not true():
        assert time.monotonic() < end
        time.sleep(0.02)


@pytest.mark.parametrize("before", ["no folder", "an empty folder"])
def test_the_second_of_two_commands_is_refused_and_the_next_after_one_that_was_killed_runs(tmp_path, before):
    shutil.copytree(DEMO, tmp_path / "study")
    if before == "an empty folder":
        (tmp_path / "answer").mkdir()
    words = ("diagnose", "study", "--out", "answer")
    with started(tmp_path, *words) as first:
        until((tmp_path / "answer" / BUSY).exists)
        second = started(tmp_path, "contrast", "study", "study", "--out", "answer")
        out, err = second.communicate()
        assert (second.returncode, out) == (2, "")
        assert err == "fes-pin: answer: another fes-pin writes here now; expected another place\n"
        assert first.poll() is None and os.listdir(tmp_path / "answer") == [BUSY]
        first.send_signal(signal.SIGKILL)
        first.communicate()
    third = started(tmp_path, *words, "--limit", "0")
    _, err = third.communicate()
    assert (third.returncode, err) == (0, "") and (tmp_path / "answer/report.html").exists()
    assert BUSY not in os.listdir(tmp_path / "answer")


def test_a_folder_that_was_made_for_a_lock_goes_with_it(tmp_path):
    with claims_held():
        Outputs("a").claim(tmp_path / "one/two", ["x"])
        Outputs("a").claim(tmp_path / "one/two", ["x"])  # the same command may
        assert (tmp_path / "one/two" / BUSY).exists()
    assert os.listdir(tmp_path) == []
    with claims_held():
        Outputs("a").claim(tmp_path / "one", ["x"])
        Outputs("a").write(tmp_path / "one", {"x": "1"})
    assert sorted(os.listdir(tmp_path / "one")) == [outputs.RECORD, "x"]


def test_one_file_is_locked_alone(tmp_path):
    with claims_held():
        Outputs("predict").check_file(tmp_path / "a.csv")
        with claims_held():
            Outputs("predict").check_file(tmp_path / "b.csv")
            Outputs("predict").claim(tmp_path, ["c"])
            with pytest.raises(InputError, match=r"a\.csv: another fes-pin writes here now"):
                Outputs("pulses").check_file(tmp_path / "a.csv")
    assert os.listdir(tmp_path) == []


def test_a_disk_without_locks_is_written_to(tmp_path, monkeypatch):
    def without_locks(*_):
        raise OSError(95, "not supported")

    monkeypatch.setattr(outputs.fcntl, "flock", without_locks)
    for _ in range(2):
        with claims_held(), claims_held():
            Outputs("a").claim(tmp_path / "one", ["x"])
            Outputs("a").write(tmp_path / "one", {"x": "1"})
    assert (tmp_path / "one/x").read_text() == "1"
