"""What all options keep to: their help is printed whole, none is ignored, -h, -q and -v are everywhere."""

import re

import pytest
import typer
from typer.testing import CliRunner

from fes_pin.cli.group import VOICE, App, needs, python_names, remark
from fes_pin.cli.main import app
from fes_pin.cli.progress import progress
from fes_pin.data.errors import InputError


def run(*words):
    return CliRunner().invoke(app, list(map(str, words)), prog_name="fes-pin", env={"COLUMNS": "400"})


def leaves(command=None, path=()):
    """Every command of the tree with its words."""
    command = command or typer.main.get_command(app)
    below = getattr(command, "commands", None)
    if below is None:
        yield path, command
        return
    for name, one in below.items():
        yield from leaves(one, (*path, name))


COMMANDS = dict(leaves())


@pytest.mark.parametrize("words", COMMANDS, ids=" ".join)
def test_help_is_printed_with_its_brackets(words):
    command = COMMANDS[words]
    result = run(*words, "-h")
    assert result.exit_code == 0 and result.stdout == run(*words, "--help").stdout
    printed = re.sub(r"[\s│]+", " ", result.stdout)
    for one in command.params:
        text = re.sub(r"\s+", " ", getattr(one, "help", None) or "").replace("\\[", "[")
        assert text in printed, text
    assert {"-q", "-v", "--quiet", "--verbose"} <= {word for one in command.params for word in one.opts}


IGNORED = {  # words of the command line, the option that would be ignored, what it lacks or meets
    "doubt_without_goniometers": ("body modes --doubt 1", "--doubt", "--goniometers"),
    "lean_without_fewest": ("body nerves --lean 1", "--lean", "--fewest"),
    "constant_without_fewest": ("body nerves --constant", "--constant", "--fewest"),
    "braces_without_fewest": ("body nerves --max-braces 0", "--max-braces", "--fewest"),
    "posture_of_a_walk": ("body view --live --walk a.csv --posture standing", "--posture", "--walk"),
    "slope_of_a_walk": ("body view --live --walk a.csv --slope 0 0", "--slope", "--walk"),
    "brace_of_a_posture": ("body view --live --brace corset", "--brace", "--mode"),
    "passive_of_a_nerve": ("body view --live --nerve femoral --passive 1", "--passive", "--mode"),
    "mass_of_a_urdf": ("body modes --urdf a.urdf --mass 72.6", "--mass", "--urdf"),
    "segments_of_a_urdf": ("body modes --urdf a.urdf --segments a.json", "--segments", "--urdf"),
    "angle_without_a_torque": ("allocate --nerves --angle left_knee_flexion=1", "--angle", "TORQUE"),
    "json_of_a_walk": ("allocate --walk w --json", "--json", "TORQUE"),
    "threshold_of_a_walk": ("allocate --walk w --threshold-us 180", "--threshold-us", "TORQUE"),
    "saturation_of_a_list": ("allocate --nerves --saturation-us 1000", "--saturation-us", "TORQUE"),
    "passive_of_a_torque": ("allocate left_knee_flexion=1 --passive 0", "--passive", "--walk"),
    "workers_of_a_cluster": ("cohort a --out b --workers 2 --scheduler tcp://a:1", "--workers", "--scheduler"),
    "by_of_two_studies": ("contrast a b --out c --by group", "--by", "AFTER"),
    "out_of_a_list": ("datasets --out a", "--out", "NAMES"),
    "force_of_a_list": ("datasets --force", "--force", "NAMES"),
    "unverified_of_a_list": ("datasets --unverified", "--unverified", "NAMES"),
    "set_without_recordings": ("new-study --pendulum 1 1 --set a=1", "--set", "FILES"),
    "column_without_recordings": ("new-study --pendulum 1 1 --column a=b", "--column", "FILES"),
    "name_without_recordings": ("new-study --pendulum 1 1 --name a", "--name", "FILES"),
    "rig_without_recordings": ("new-study --pendulum 1 1 --rig joint", "--rig", "FILES"),
    "fill_without_recordings": ("new-study --pendulum 1 1 --fill", "--fill", "FILES"),
    "resample_without_recordings": ("new-study --pendulum 1 1 --resample 9", "--resample", "FILES"),
    "upright_of_a_slide": ("new-study --slide 1 --upright", "--upright", "--pendulum or --rod"),
    "quiet_and_verbose": ("effects -q -v", "--quiet", "--verbose"),
}  # fmt: skip


@pytest.mark.parametrize("case", IGNORED)
def test_an_option_that_would_be_ignored_is_refused(case):
    words, option, other = IGNORED[case]
    result = run(*words.split())
    assert result.exit_code == 2 and result.stdout == ""
    (line,) = result.stderr.splitlines()
    assert line.startswith(f"fes-pin: {option}: ") and other in line


@pytest.fixture
def talking(monkeypatch):
    """An application with a command that remarks, answers, and may refuse in Python's words."""
    one = App()

    @one.command()
    @needs(strong="loud")
    @python_names(level_db="--loud")
    def talk(loud: float = 1.0, strong: bool = False, out: str | None = None, wrong: bool = False) -> None:
        remark("a remark")
        typer.echo("the answer")
        if wrong:
            raise InputError("expected level_db above 0", column="level_db")

    @one.command()
    def other() -> None:
        pass

    return one


def test_quiet_leaves_the_answer_and_with_out_nothing(talking):
    def said(*words):
        result = CliRunner().invoke(talking, ["talk", *words])
        return result.exit_code, result.stdout, result.stderr

    assert said() == (0, "the answer\n", "a remark\n")
    assert said("-q") == (0, "the answer\n", "")
    assert said("--quiet", "--out", "file") == (0, "", "")
    assert said("-q", "--out", "-") == (0, "the answer\n", "")


def test_verbose_says_its_progress_in_lines_where_nobody_watches(capsys):
    """In a test no person watches standard error."""
    for voice, lines in ((0, ""), (1, "fes-pin:  50% fitting\n"), (-1, "")):
        token = VOICE.set(voice)
        with progress() as tell:
            tell(0.5, "fitting")
        VOICE.reset(token)
        assert capsys.readouterr().err == lines


def test_an_error_of_python_names_the_option_that_was_given(talking):
    result = CliRunner().invoke(talking, ["talk", "--loud", "2", "--strong", "--wrong", "-q"])
    assert (result.exit_code, result.stdout) == (2, "")
    assert result.stderr == "fes-pin: --loud: expected --loud above 0\n"
