"""What is wrong is said in one line before any work, whatever the number, the environment or the stream."""

import io
import os
import subprocess
import sys
import time
from pathlib import Path

import pytest
from cli.test_main import fails, run
from cli.test_outputs import DEMO, PULSES, hashes, sandbox  # noqa: F401
from typer.testing import CliRunner

from fes_pin.cli.main import app

PREDICT = ("predict", "model.toml", "study/a.csv", "--out", "new.csv")
NEW = ("new-study", "study/a.csv", "--out", "made")
NUMBERS = {  # words before the option, the option, values that it refuses
    "predict ahead": ((*PREDICT, "--horizon"), "--horizon", ("inf", "nan", "-1")),
    "resample": ((*NEW, "--rod", "0.4", "1.2", "--resample"), "", ("0", "inf", "1e9", "1e18", "1e-300", "-1")),
    "a rod's mass": ((*NEW, "--rod", "0.4"), "mass", ("0", "-1", "1e300", "1e-300")),
    "a rod": ((*NEW, "--rod", "0.4"), "--rod", ("inf", "nan")),
    "a slide": ((*NEW, "--slide"), "--slide", ("inf", "nan")),
    "pulses a second": (("pulses", "pulses.csv", "--out", "new.csv", *PULSES[:-1]), "", ("0", "inf", "1e9", "1e18")),
    "a current": (("pulses", "pulses.csv", "--out", "new.csv", *PULSES, "--current"), "", ("0", "inf", "1e9", "-1")),
    "seconds of search": (("diagnose", "study", "--out", "new", "--limit"), "--limit", ("inf", "nan", "-1")),
    "seconds of a cohort": (("cohort", "study", "--out", "new", "--limit"), "--limit", ("inf", "nan", "-1")),
    "processes": (("cohort", "study", "--out", "new", "--workers"), "--workers", ("0", "-1", "inf")),
    "compare ahead": (("compare", str(DEMO), "--out", "new", "--horizon"), "--horizon", ("0", "inf", "nan", "1e300")),
    "compare from": (("compare", str(DEMO), "--out", "new", "--given"), "--given", ("0", "inf", "nan", "1e300")),
    "a slope": (("body", "modes", "--slope", "0"), "slope", ("1e300", "inf", "nan", "1")),
    "a nerve's horizon": (("body", "nerves", "femoral", "--horizon"), "horizon", ("0", "1e300", "1e-300", "inf")),
    "a body's mass": (("body", "view", "--out", "new.html", "--mass"), "mass", ("0", "inf", "nan", "1e300", "-1")),
}


@pytest.mark.parametrize(("name", "value"), [(n, v) for n, (_, _, values) in NUMBERS.items() for v in values])
def test_a_number_that_cannot_be_is_one_line(sandbox, monkeypatch, capsys, name, value):  # noqa: F811
    words, says, _ = NUMBERS[name]
    before, began = hashes(sandbox), time.monotonic()
    assert says in fails(monkeypatch, capsys, *words, value)
    assert time.monotonic() - began < 10.0 and hashes(sandbox) == before


@pytest.mark.parametrize("words", [("--pendulum", "0.3", "0.5"), ("study/b.csv", "--pendulum", "0.3", "0.5")])
@pytest.mark.parametrize("out", ["study/a.csv", "study/a.csv/below"])
def test_a_file_in_the_way_of_a_folder_is_named(sandbox, monkeypatch, capsys, words, out):  # noqa: F811
    before = hashes(sandbox)
    line = fails(monkeypatch, capsys, "new-study", *words, "--out", out)
    assert line == "fes-pin: study/a.csv: is a file; expected a folder".replace(
        "study/a.csv", str(sandbox / "study/a.csv")
    )
    assert hashes(sandbox) == before


@pytest.mark.parametrize("value", ["abc", "-1", "1.5", "²", "1" * 12, "9" * 30])
def test_a_date_that_is_none_is_said_first(sandbox, monkeypatch, capsys, value):  # noqa: F811
    monkeypatch.setenv("SOURCE_DATE_EPOCH", value)
    monkeypatch.setattr("fes_pin.diagnosis.diagnosis.diagnose_joint", None)
    line = fails(monkeypatch, capsys, "diagnose", "study", "--out", "new")
    assert line.startswith("fes-pin: SOURCE_DATE_EPOCH: expected whole seconds") and not Path("new").exists()


@pytest.mark.parametrize("address", ["foo", "tcp://foo", "foo:port", "", "no-such-host.invalid:8786"])
def test_a_scheduler_that_cannot_be_is_said_at_once(sandbox, monkeypatch, capsys, address):  # noqa: F811
    pytest.importorskip("distributed")
    began = time.monotonic()
    line = fails(monkeypatch, capsys, "cohort", "study", "--out", "new", "--scheduler", address)
    assert ("--scheduler: expected the address" in line) != ("no Dask scheduler answers at no-such-host" in line)
    assert time.monotonic() - began < 15.0 and not Path("new").exists()


def process(words, **given):
    known = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[2]), **given}
    return subprocess.run(["sh", "-c", words], env=known, capture_output=True, text=True, errors="replace", check=False)


def test_the_package_is_the_command_line():
    made = process(f"{sys.executable} -m fes_pin --version")
    assert (made.returncode, made.stdout[:8], made.stderr) == (0, "fes-pin ", "")
    assert "fes-pin: error" not in process(f"{sys.executable} -m fes_pin diagnose").stderr


@pytest.mark.parametrize("stream", [">&-", "| head -1", "<&- >&- 2>&-"])
def test_a_closed_stream_is_no_traceback(stream):
    made = process(f"{sys.executable} -m fes_pin effects {stream}")
    assert (made.returncode, made.stderr) == (0, "")


@pytest.mark.parametrize("name", ["stdin", "stdout", "stderr"])
def test_without_a_stream_the_work_is_done(sandbox, monkeypatch, name):  # noqa: F811
    for words, code in ((PREDICT, 0), (("check", "study"), 0), (("diagnose", "nowhere", "--out", "new"), 2)):
        monkeypatch.setattr(sys, name, None)
        assert run(monkeypatch, *words) == code
        getattr(sys, name).close()
    assert (sandbox / "new.csv").read_text().startswith("time_s,")


@pytest.mark.parametrize("encoding", ["cp1252", "ascii"])
def test_a_console_that_lacks_signs_is_no_traceback(sandbox, monkeypatch, encoding):  # noqa: F811
    (sandbox / "study").rename(sandbox / "Ω³")
    for words in (("effects",), ("check", "Ω³"), ("body", "modes"), ("predict", "-h"), ("new-study", "Ω³/a.csv")):
        console = io.TextIOWrapper(io.BytesIO(), encoding)
        monkeypatch.setattr(sys, "stdout", console)
        assert run(monkeypatch, *words) == 2 * (words[0] == "new-study")
        console.flush()
        assert words[0] == "new-study" or console.buffer.getvalue()
    made = process(f"{sys.executable} -m fes_pin diagnose Ω³/no --out new", PYTHONIOENCODING=encoding)
    assert made.returncode == 2 and made.stderr.count("\n") == 1


def test_zero_and_absence_differ(sandbox, monkeypatch):  # noqa: F811
    """A rate that is as recorded, and no rate, are both a study; the widest search is none."""
    assert run(monkeypatch, *NEW, "--rod", "0.4", "1.2", "--resample", "50") == 0
    assert "resample_hz = 50.0" in Path("made/study.toml").read_text()
    assert CliRunner().invoke(app, ["predict", *PREDICT[1:], "--horizon", "0"]).exit_code == 2  # [random] is not there
