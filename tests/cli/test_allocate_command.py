"""`fes-pin allocate` through typer."""

import json

import pytest
from typer.testing import CliRunner

from fes_pin.body.measured_walk import data_folder
from fes_pin.cli.main import app
from fes_pin.data.errors import InputError


def run(*words):
    return CliRunner().invoke(app, ["allocate", *words])


def test_a_torque_becomes_a_pulse_width_and_a_reason():
    result = run("left_ankle_dorsiflexion=-400", "--nerve", "left_tibial", "--angle", "left_knee_flexion=20")
    assert result.exit_code == 0
    assert "left tibial 1000 us" in result.output and "left tibial saturated" in result.output


def test_threshold_and_saturation_are_kept():
    words = ("left_ankle_dorsiflexion=-40", "--nerve", "left_tibial", "--threshold-us", "90", "--saturation-us", "91")
    assert any(f"left tibial {w} us" in run(*words).output for w in (90, 91))


def test_a_recruitment_curve_in_ms_is_refused_by_its_option():
    result = run("left_knee_flexion=-40", "--threshold-us", "0.18", "--saturation-us", "1")
    assert result.exit_code == 2 and "--saturation-us: must lie between 10 and 5000, got 1" in result.stderr


def test_nerves_are_listed():
    assert "left_femoral" in run("--nerves").output


@pytest.mark.parametrize(
    "words",
    [
        (),
        ("left_knee_flexion",),
        ("left_knee_flexion=much",),
        ("toe=1",),
        ("--walk", "nowhere"),
        ("--walk", "nowhere", "--passive", "-1"),
        ("left_knee_flexion=-40", "--angle", "left_knee_flexion=900"),
        ("left_knee_flexion=-40", "--angle", "left_knee=10"),
        ("--nerve", "x", "toe=1"),
        ("left_knee_flexion=nan",),
        ("left_knee_flexion=1e300",),
        ("left_knee_flexion=-40", "left_knee_flexion=-50"),
        ("left_knee_flexion=-40", "--angle", "left_knee_flexion=1", "--angle", "left_knee_flexion=2"),
        ("left_knee_flexion=-40", "--rate", "left_knee_flexion=inf"),
        ("left_knee_flexion=-40", "--angle", "left_hip_flexion=100"),
        ("left_knee_flexion=-40", "--strength", "1e300"),
        ("left_knee_flexion=-40", "--strength", "nan"),
        ("left_knee_flexion=-40", "--strength", "-1"),
        ("left_knee_flexion=-40", "--least", "2"),
        ("left_knee_flexion=-40", "--threshold-us", "inf"),
        ("left_knee_flexion=-40", "--threshold-us", "2000"),
        ("left_knee_flexion=-40", "--passive", "1"),
        ("left_knee_flexion=-40", "--nerves"),
        ("left_knee_flexion=-40", "--walk", "nowhere"),
        ("--nerves", "--json"),
        ("left_knee_flexion=-40", "--nerve", "left_femoral", "--nerve", "left_femoral"),
    ],
)
def test_bad_input_is_one_line_before_anything_is_printed(words):
    result = run(*words)
    assert result.exit_code == 2 and result.stderr.count("\n") == 1
    assert result.stdout == ""


def test_a_moving_joint_and_a_posture_at_the_edge_are_taken_into_account():
    words = ("left_knee_flexion=-40", "--nerve", "left_femoral", "--angle", "left_knee_flexion=60", "--json")
    still, moving = (json.loads(run(*words, *more).output) for more in ((), ("--rate", "left_knee_flexion=-120")))
    assert still["recruitment"]["left_femoral"] < moving["recruitment"]["left_femoral"]
    knee = still["torque_nm"]["left_knee_flexion"]
    assert knee["band"] == pytest.approx([1.4 * knee["achieved"], 0.6 * knee["achieved"]]) and still["held"] == []
    weak, strong = still["strength_band"]
    assert (weak, strong) == (0.6, 1.4) and f"with {weak:.2g} to {strong:.2g} of the strength assumed" in run(
        *words[:-1]
    ).output
    edge = json.loads(run("left_knee_flexion=-40", "--angle", "left_knee_flexion=115", "--json").output)
    assert edge["held"] == ["moment arms at left knee flexion 115 degrees are not known: those at 110 are used"]


def test_muscles_are_paralysed_unless_a_strength_is_given():
    words = ("left_knee_flexion=-400", "--nerve", "left_femoral", "--json")
    torque = [
        json.loads(run(*words, *more).output)["torque_nm"]["left_knee_flexion"]["achieved"]
        for more in ((), ("--strength", "0.5"), ("--strength", "1"))
    ]
    assert torque[0] == torque[1] == pytest.approx(torque[2] / 2)


@pytest.fixture
def walk(tmp_path):
    """A folder of three samples that can be read."""
    angles = ["time", *(f"q_{c}" for c in COORDINATES)]
    torques = ["time", "phase", *(f"ID_{c}_moment" for c in COORDINATES)]
    (tmp_path / "reference").mkdir()
    for file, names in (("coords_mtpfree.csv", angles), ("reference/grf_id_mtpfree.csv", torques)):
        rows = [[f"{0.1 * k:.1f}", *["double" if n == "phase" else "0.1" for n in names[1:]]] for k in range(3)]
        (tmp_path / file).write_text("\n".join(map(",".join, [names, *rows])) + "\n")
    return tmp_path


COORDINATES = [
    *(f"{c}_{side}" for side in "rl" for c in ("hip_flexion", "hip_adduction", "hip_rotation", "knee_angle")),
    *(f"{c}_{side}" for side in "rl" for c in ("ankle_angle", "subtalar_angle", "mtp_angle")),
    *("lumbar_extension", "lumbar_bending", "lumbar_rotation"),
]


def test_a_small_walk_is_tabled(walk):
    assert "3 samples" in run("--walk", str(walk)).output


@pytest.mark.parametrize("file", ["coords_mtpfree.csv", "reference/grf_id_mtpfree.csv"])
@pytest.mark.parametrize(
    ("spoil", "says"),
    [
        (lambda text: b"", "row 1"),
        (lambda text: text[: text.index(b"\n") + 30], "row 2"),
        (lambda text: text[:-9], "row 4"),
        (lambda text: text.split(b"\n")[0], "row 1"),
        (lambda text: text.replace(b"0.2,", b"0.2,7,"), "row 4"),
        (lambda text: text.replace(b"0.1,0.1\n", b"0.1,much\n"), "row 2"),
        (lambda text: text.replace(b"0.1,0.1\n", b"0.1,nan\n"), "row 2"),
        (lambda text: text.replace(b"knee_angle_l", b"knee_l"), "knee_angle_l"),
        (lambda text: text.replace(b"0.2,", b"0.9,"), "step"),
        (lambda text: bytes(range(256)) * 40, ""),
    ],
)
def test_a_spoilt_walk_is_one_line_that_says_where(walk, file, spoil, says):
    path = walk / file
    path.write_bytes(spoil(path.read_bytes()))
    result = run("--walk", str(walk))
    assert result.exit_code == 2 and result.stdout == ""
    (line,) = result.stderr.splitlines()
    assert path.name in line
    assert says in line


def test_two_files_of_other_times_are_refused(walk):
    path = walk / "reference/grf_id_mtpfree.csv"
    path.write_text(
        path.read_text().replace("0.0,", "0.3,", 1).replace("0.1,double", "0.4,double").replace("0.2,", "0.5,")
    )
    assert "times of coords_mtpfree.csv" in run("--walk", str(walk)).stderr


@pytest.mark.shared
def test_the_walk_is_tabled():
    try:
        folder = data_folder()
    except InputError:
        pytest.skip("the measured walk is not here")
    result = run("--walk", str(folder))
    assert result.exit_code == 0 and "right_knee_flexion" in result.output and "157 samples" in result.output
