"""What all commands share: one line for bad input, nothing printed before it, the version, completion."""

import io
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from fes_pin.cli.group import Commands, Held, release_output
from fes_pin.cli.main import app
from fes_pin.data.errors import InputError

NEEDS = {  # words of the command line, what its one line must say
    "no_command": ((), "expected one of allocate, "),
    "no_command_of_a_group": (("body",), "expected one of modes, nerves, view"),
    "unknown_command": (("diagnos",), "Did you mean 'diagnose'"),
    "unknown_command_of_a_group": (("body", "modez"), "Did you mean 'modes'"),
    "unknown_option": (("--bogus",), "--bogus"),
    "unknown_option_of_a_command": (("diagnose", "x", "--ot", "y"), "--out"),
    "missing_argument": (("diagnose",), "missing argument"),
    "missing_option": (("diagnose", "x"), "missing option '--out'"),
    "extra_argument": (("effects", "all"), "extra argument"),
    "not_an_integer": (("diagnose", "x", "--out", "y", "--seed", "1.5"), "--seed"),
    "negative_seed": (("diagnose", "x", "--out", "y", "--seed", "-1"), "--seed"),
    "not_a_number": (("body", "modes", "--mass", "heavy"), "--mass"),
    "one_of_two": (("body", "modes", "--slope", "1"), "--slope"),
    "refused_by_us": (("diagnose", "nowhere", "--out", "y"), "nowhere: no such study"),
    "refused_by_us_in_a_group": (("body", "modes", "--mass", "7"), "--mass: "),
}


@pytest.mark.parametrize("case", NEEDS)
def test_a_command_that_cannot_be_read_is_one_line(case):
    words, says = NEEDS[case]
    result = CliRunner().invoke(app, list(words), prog_name="fes-pin")
    assert result.exit_code == 2
    assert result.stdout == ""
    (line,) = result.stderr.splitlines()
    assert line.startswith("fes-pin") and says in line


SETTINGS = {
    "FES_PIN_THREADS": ("two", "0", "-1", "1.5", "²", "1e3", "99999"),
    "FES_PIN_ENGINE": ("abacus",),
    "FES_PIN_CPU": ("486", "NATIVE"),
}


@pytest.mark.parametrize(("name", "value"), [(n, v) for n, values in SETTINGS.items() for v in values])
def test_a_wrong_setting_of_the_environment_is_said_first(monkeypatch, name, value):
    monkeypatch.setenv(name, value)
    result = CliRunner().invoke(app, ["effects"])
    assert result.exit_code == 2 and result.stdout == ""
    assert result.stderr == f"fes-pin: {name}: {result.stderr.split(': ', 2)[2]}" and repr(value) in result.stderr


def refusing(*, late: bool):
    """An application whose command prints, and then refuses."""
    one = typer.Typer(cls=Commands)

    @one.command()
    def talk():
        typer.echo("half an answer")
        if late:
            release_output()
        raise InputError("not this one", file="a.csv", row=3)

    @one.command()
    def answer():
        typer.echo("whole")

    return one


def test_nothing_is_printed_before_a_refusal():
    result = CliRunner().invoke(refusing(late=False), ["talk"])
    assert (result.exit_code, result.stdout, result.stderr) == (2, "", "fes-pin: a.csv, row 3: not this one\n")
    result = CliRunner().invoke(refusing(late=False), ["answer"])
    assert (result.exit_code, result.stdout, result.stderr) == (0, "whole\n", "")


def test_a_command_that_waits_for_a_person_prints_at_once():
    assert CliRunner().invoke(refusing(late=True), ["talk"]).stdout == "half an answer\n"


def test_what_breaks_is_not_hidden():
    one = typer.Typer(cls=Commands)

    @one.command()
    def broken():
        typer.echo("so far")
        raise ZeroDivisionError

    @one.command()
    def other():
        pass

    result = CliRunner().invoke(one, ["broken"])
    assert isinstance(result.exception, ZeroDivisionError) and result.stdout == "so far\n"


def test_a_full_disk_behind_standard_output_is_one_line():
    class Full(io.StringIO):
        def flush(self):
            raise OSError(28, "No space left on device")

    with pytest.raises(InputError, match="standard output cannot be written: No space left"):
        Held(Full()).release()


def test_a_reader_that_goes_away_is_no_traceback():
    command = f"{sys.executable} -c 'from fes_pin.cli.main import main; main()' effects | true"
    ended = subprocess.run(
        command, check=False, shell=True, capture_output=True, text=True, cwd=Path(__file__).parents[2]
    )
    assert ended.stderr == ""


def test_the_version_is_that_of_the_package():
    result = CliRunner().invoke(app, ["--version"])
    assert (result.exit_code, result.stdout) == (0, f"fes-pin {version('fes-pin')}\n")


def test_shells_complete_its_words():
    """What a shell asks for after `fes-pin di` and `fes-pin body mo`."""
    for typed, expected in (("fes-pin di", "diagnose"), ("fes-pin body mo", "modes")):
        asked = {"_FES_PIN_COMPLETE": "complete_bash", "COMP_WORDS": typed, "COMP_CWORD": str(typed.count(" "))}
        result = CliRunner().invoke(app, [], env=asked, prog_name="fes-pin")
        assert result.stdout.split() == [expected]
