"""The commands modes, nerves and view."""

import re

import pytest
from typer.testing import CliRunner

from fes_pin.body.joints import JOINT_NAMES
from fes_pin.body.linearize import linearize
from fes_pin.body.minimal_sets import minimal_sets
from fes_pin.cli.body import app
from fes_pin.muscles.nerves import Nerves

BRACES = ("corset", "left_ankle_foot_orthosis", "right_ankle_foot_orthosis", "left_foot_plate", "right_foot_plate")


def run(*arguments):
    return CliRunner().invoke(app, list(arguments))


def words(output):
    """Printed lines as one text."""
    return " ".join(output.split())


def test_modes_in_words():
    result = run("modes", "--posture", "mid_stance", "--slope", "0.05", "0.0", "--mass", "60", "--sex", "female")
    assert result.exit_code == 0
    assert "60.0 kg" in result.output
    assert "fall sideways about the stance ankle" in result.output
    assert len(re.findall(r"^ [ \d]\d  ", result.output, re.MULTILINE)) == 19
    assert "mid_stance is an instant of a walk" in result.output


def test_modes_of_a_urdf(body, tmp_path):
    body.write(tmp_path / "body.urdf")
    assert run("modes", "--urdf", str(tmp_path / "body.urdf")).output.count("\n") == run("modes").output.count("\n")


def test_nerves_with_braces_and_the_fewest(tmp_path):
    braces = [x for b in BRACES for x in ("--brace", b)]
    some = ["left_superior_gluteal", *(f"right_{n}" for n in ("superior_gluteal", "femoral", "iliopsoas", "tibial"))]
    some += ["right_biceps_short_head", "right_inferior_gluteal"]
    common = ("nerves", *some, *braces, "--posture", "one_leg", "--fewest", "--strength", "1")
    result = run(*common, "--map", str(tmp_path / "map.png"))
    assert result.exit_code == 0, result.output
    assert "8 joints" in result.output and "11 joints locked" in result.output
    assert " 5 nerves (" in result.output and "catches a lean" in result.output
    assert "1 deg, s" in result.output  # a price has a unit
    assert (tmp_path / "map.png").stat().st_size > 10_000
    constant = run(*common, "--constant").output
    assert " 6 nerves (" in constant and "holds a lean" in constant
    assert "brace more joints" in run(*common[:-2]).output  # paralysed
    assert "brace more joints" in run("nerves", "right_tibial", "--fewest").output


@pytest.mark.parametrize("stimulation", ["constant", "over_time"])
def test_what_does_not_fall_must_still_be_held(body, stimulation):
    """A bent knee that hangs falls nowhere; without its nerves it hangs elsewhere, and the set is not empty."""
    leg = linearize(body, "mid_stance").brace([j for j in JOINT_NAMES if j != "left_knee_flexion"])
    nerves = Nerves(("left_hamstrings", "left_femoral"), strength=1.0)
    found = minimal_sets(leg, nerves, stimulation=stimulation, settle_deg=5.0, balance=False)
    assert [s.inputs for s in found] == [("left_hamstrings",)]
    assert "the posture is held" in str(found[0]) and "inf" not in str(found[0])


def test_strength_settling_and_passive_legs_are_options():
    braces = [x for b in BRACES for x in ("--brace", b)]
    some = ("right_superior_gluteal", "right_femoral", "right_iliopsoas", "right_tibial", "left_superior_gluteal")
    common = ("nerves", *some, "right_biceps_short_head", *braces, "--posture", "one_leg")
    options = ((), ("--settle", "5"), ("--passive", "1"))
    outputs = {run(*common, "--strength", "1", *more).output for more in options}
    outputs.add(run(*common, "--strength", "0.7").output)
    assert len(outputs) == 4


def test_without_a_strength_muscle_is_paralysed_and_that_is_said():
    """The default of allocation: 0.5 of a healthy adult's, 0.3 to 0.7."""
    common = ("nerves", "femoral", "tibial", "--posture", "standing")
    output = words(run(*common).output)
    assert (
        "At 0.5 of the strength of a healthy man of 18 to 25 years, 73 kg and 1.80 m (paralysed, stimulated muscle)"
        in output
    )
    assert "It may be 0.3 to 0.7" in output
    assert "At 1 of the strength of a healthy man of 18 to 25 years, 73 kg and 1.80 m" in words(
        run(*common, "--strength", "1").output
    )


def test_standing_on_both_feet():
    output = run("modes", "--posture", "standing", "--brace", "left_foot_plate", "--brace", "right_foot_plate").output
    assert "both feet on the ground" in output and "inside the edge of the left foot and right foot" in output
    assert "11 modes" in output


def test_goniometers_and_influence():
    braces = [x for b in BRACES for x in ("--brace", b)]
    assert "goniometers: " in run("modes", *braces, "--goniometers").output
    output = run("nerves", "femoral", "--influence", "joints").output
    assert "1 left_femoral, 2 right_femoral" in output
    assert run("nerves", "femoral", "--influence", "bones").exit_code == 2


def test_view_writes_pages(tmp_path):
    for arguments in ((), ("--mode", "3"), ("--nerve", "right_tibial"), ("--nerve", "femoral")):
        page = tmp_path / "page.html"
        assert run("view", "--out", str(page), *arguments).exit_code == 0
        assert page.stat().st_size > 500_000


@pytest.mark.shared
def test_view_plays_the_measured_walk(walk, tmp_path):
    assert run("view", "--out", str(tmp_path / "w.html"), "--walk", str(walk / "coords_mtpfree.csv")).exit_code == 0


@pytest.mark.shared
@pytest.mark.parametrize(
    ("spoil", "says"),
    [
        (lambda lines: lines[:2], "at least 3 rows"),
        (lambda lines: [*lines[:3], lines[3].replace(lines[3].split(",")[7], "nan"), *lines[4:9]], "finite"),
        (lambda lines: [*lines[:3], lines[3].replace(lines[3].split(",")[7], "abc"), *lines[4:9]], "row 4"),
        (lambda lines: [lines[0], *lines[9:3:-1]], "time"),
        (lambda lines: [lines[0].replace("q_hip_flexion_r", "q_hip_r"), *lines[1:9]], "q_hip_flexion_r"),
        (lambda lines: [lines[0].replace("time", "when"), *lines[1:9]], "time_s"),
    ],
)
def test_a_spoilt_walk_is_one_line_and_no_page(walk, tmp_path, spoil, says):
    lines = (walk / "coords_mtpfree.csv").read_text().splitlines()
    (tmp_path / "walk.csv").write_text("\n".join(spoil(lines)) + "\n")
    page = tmp_path / "page.html"
    result = run("view", "--out", str(page), "--walk", str(tmp_path / "walk.csv"))
    assert result.exit_code == 2 and says in result.output and "walk.csv" in result.output
    assert len(result.output.strip().splitlines()) == 1 and not page.exists()


@pytest.mark.parametrize("content", [b"", b"\n", bytes(range(128, 255)), b"time,q_hip_flexion_r\n0,1\n1\n", b"a"])
def test_a_walk_that_is_no_table_is_one_line(tmp_path, content):
    (tmp_path / "walk.csv").write_bytes(content)
    result = run("view", "--out", str(tmp_path / "page.html"), "--walk", str(tmp_path / "walk.csv"))
    assert result.exit_code == 2 and "walk.csv" in result.output and not (tmp_path / "page.html").exists()
    assert len(result.output.strip().splitlines()) == 1


def test_a_map_that_cannot_be_written_is_one_line(tmp_path):
    for path, says in ((tmp_path / "none" / "map.png", "does not exist"), (tmp_path / "map.unknown", "ends in one of")):
        result = run("nerves", "right_femoral", "--map", str(path))
        assert result.exit_code == 2 and says in result.output
        assert len(result.output.splitlines()) == 1 and not path.parent.joinpath("map.png").exists()
    assert (
        run("view", "--out", str(tmp_path / "none" / "page.html")).exit_code == 2 and not (tmp_path / "none").exists()
    )


def test_nothing_is_written_or_printed_where_an_option_is_wrong(tmp_path):
    for wrong in (("--lean", "inf"), ("--influence", "bones"), ("--max-braces", "-1"), ("--settle", "nan")):
        result = run("nerves", "right_femoral", "--fewest", "--map", str(tmp_path / "map.png"), *wrong)
        assert result.exit_code == 2 and len(result.output.splitlines()) == 1, result.output
        assert not (tmp_path / "map.png").exists()


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("modes", "--posture", "sitting"), "unknown posture"),
        (("modes", "--mass", "7"), "--mass: "),
        (("modes", "--stance", "both"), "stance"),
        (("modes", "--slope", "1", "1"), "slope"),
        (("modes", "--brace", "plaster"), "cannot brace 'plaster'"),
        (("modes", "--urdf", "none.urdf"), "none.urdf"),
        (("modes", "--urdf", "a.urdf", "--stance", "left"), "--stance: does not go with --urdf"),
        (("modes", "--urdf", "a.urdf", "--sex", "female"), "--sex: does not go with --urdf"),
        (("modes", "--segments", "a.json", "--mass", "70"), "--mass: does not go with --segments"),
        (("modes", "--passive", "-1"), "--passive"),
        (("nerves", "--lean", "inf"), "--lean"),
        (("nerves", "--strength", "1e300"), "--strength"),
        (("nerves", "right_vagus"), "unknown nerve"),
        (("view",), "--live"),
        (("view", "--out", "a.html", "--mode", "99"), "--mode"),
        (("view", "--out", "a.html", "--mode", "1", "--nerve", "right_tibial"), "choose one"),
        (("view", "--out", "a.html", "--walk", "none.csv"), "none.csv"),
        (("view", "--out", "a.html", "--walk", "/dev/null"), "/dev/null"),
    ],
)
def test_mistakes_are_one_line_and_exit_code_2(arguments, says):
    result = run(*arguments)
    assert result.exit_code == 2
    assert says in result.output
    assert len(result.output.strip().splitlines()) == 1
