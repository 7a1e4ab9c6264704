"""The commands modes, nerves and view."""

import pytest
from typer.testing import CliRunner

from fes_pin.cli.body import app

BRACES = ("corset", "left_ankle_foot_orthosis", "right_ankle_foot_orthosis", "left_foot_plate", "right_foot_plate")


def run(*arguments):
    return CliRunner().invoke(app, list(arguments))


def test_modes_in_words():
    result = run("modes", "--posture", "mid_stance", "--slope", "0.05", "0.0", "--mass", "60", "--sex", "female")
    assert result.exit_code == 0
    assert "60.0 kg" in result.output
    assert "fall sideways about the stance ankle" in result.output
    assert len(result.output.splitlines()) == 22


def test_modes_of_a_urdf(body, tmp_path):
    body.write(tmp_path / "body.urdf")
    assert run("modes", "--urdf", str(tmp_path / "body.urdf")).output.count("\n") == run("modes").output.count("\n")


def test_nerves_with_braces_and_the_fewest(tmp_path):
    braces = [x for b in BRACES for x in ("--brace", b)]
    some = [f"right_{n}" for n in ("superior_gluteal", "hamstrings", "femoral", "iliopsoas", "obturator")]
    some += [f"left_{n}" for n in ("obturator", "sacral_rotators", "tibial")]
    result = run("nerves", *some, *braces, "--fewest", "--lean", "0.2", "--map", str(tmp_path / "map.png"))
    assert result.exit_code == 0, result.output
    assert "8 joints" in result.output
    assert "7 nerves" in result.output
    assert (tmp_path / "map.png").stat().st_size > 10_000
    nobody = run("nerves", "right_tibial", "--fewest")
    assert "brace more joints" in nobody.output


def test_goniometers_and_influence():
    assert "goniometers: " in run("modes", "--goniometers").output
    output = run("nerves", "femoral", "--influence", "joints").output
    assert "1 left_femoral, 2 right_femoral" in output
    assert run("nerves", "femoral", "--influence", "bones").exit_code == 2


def test_view_writes_pages(tmp_path):
    for arguments in ((), ("--mode", "3"), ("--nerve", "right_tibial")):
        page = tmp_path / "page.html"
        assert run("view", str(page), *arguments).exit_code == 0
        assert page.stat().st_size > 500_000


@pytest.mark.shared
def test_view_plays_the_measured_walk(walk, tmp_path):
    assert run("view", str(tmp_path / "w.html"), "--walk", str(walk / "coords_mtpfree.csv")).exit_code == 0


@pytest.mark.shared
@pytest.mark.parametrize(
    ("spoil", "says"),
    [
        (lambda lines: lines[:2], "two or more samples"),
        (lambda lines: [*lines[:3], lines[3].replace(lines[3].split(",")[7], "nan"), *lines[4:9]], "finite"),
        (lambda lines: [*lines[:3], lines[3].replace(lines[3].split(",")[7], "abc"), *lines[4:9]], "finite"),
        (lambda lines: [lines[0], *lines[9:3:-1]], "times that rise"),
        (lambda lines: [lines[0].replace("q_hip_flexion_r", "q_hip_r"), *lines[1:9]], "q_hip_flexion_r"),
        (lambda lines: [lines[0].replace("time", "when"), *lines[1:9]], "time_s"),
    ],
)
def test_a_spoilt_walk_is_one_line_and_no_page(walk, tmp_path, spoil, says):
    lines = (walk / "coords_mtpfree.csv").read_text().splitlines()
    (tmp_path / "walk.csv").write_text("\n".join(spoil(lines)) + "\n")
    page = tmp_path / "page.html"
    result = run("view", str(page), "--walk", str(tmp_path / "walk.csv"))
    assert result.exit_code == 2 and says in result.output and "walk.csv" in result.output
    assert len(result.output.strip().splitlines()) == 1 and not page.exists()


def test_a_map_that_cannot_be_written_is_one_line(tmp_path):
    for path in (tmp_path / "none" / "map.png", tmp_path / "map.unknown"):
        result = run("nerves", "right_femoral", "--map", str(path))
        assert result.exit_code == 2 and "cannot be written" in result.output.splitlines()[-1]


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("modes", "--posture", "sitting"), "unknown posture"),
        (("modes", "--mass", "7"), "mass_kg"),
        (("modes", "--stance", "both"), "stance"),
        (("modes", "--slope", "1", "1"), "slope"),
        (("modes", "--brace", "plaster"), "cannot brace 'plaster'"),
        (("modes", "--urdf", "none.urdf"), "none.urdf"),
        (("nerves", "right_vagus"), "unknown nerve"),
        (("view",), "--live"),
        (("view", "a.html", "--mode", "99"), "--mode"),
        (("view", "a.html", "--mode", "1", "--nerve", "right_tibial"), "choose one"),
        (("view", "a.html", "--walk", "none.csv"), "none.csv"),
    ],
)
def test_mistakes_are_one_line_and_exit_code_2(arguments, says):
    result = run(*arguments)
    assert result.exit_code == 2
    assert says in result.output
    assert len(result.output.strip().splitlines()) == 1
