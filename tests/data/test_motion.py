# ruff: noqa: E501  (tables, one case a line)
"""Walking trials: CSV, .mot and .sto."""

import shutil

import numpy as np
import pytest

from fes_pin.data.errors import InputError
from fes_pin.data.motion import (
    GROUND_REACTION,
    OPTIONAL,
    REQUIRED,
    TRANSLATIONS,
    read_coordinates,
    read_ground_reaction,
)
from fes_pin.data.study import read_study, write_study
from fes_pin.data.trial_files import read_trial

ROWS = 7
TOML = """[study]
name = "walk"
rig = "body"
[rig]
mass_kg = 72.6
height_m = 1.8
[[trial]]
coordinates = "coords.mot"
ground_reaction = "grf.csv"
belt_speed_mps = 1.135
"""
OPENSIM = [
    f"{before}ground_{what}_{kind}{axis}"
    for before in ("", "1_")
    for what, kind in (("force", "v"), ("force", "p"), ("torque", ""))
    for axis in "xyz"
]


def storage(labels, values, header="inDegrees=yes"):
    rows = ["\t".join(f"{value:.9g}" for value in row) for row in values]
    return "\n".join(["walk", "version=1", f"nRows={len(rows)}", header, "", "endheader", "\t".join(labels), *rows, ""])


@pytest.fixture
def folder(tmp_path):
    time = np.arange(ROWS) / 60
    angles = np.random.default_rng(1).normal(scale=20, size=(ROWS, len(REQUIRED)))
    (tmp_path / "coords.mot").write_text(storage(["time", *REQUIRED], np.column_stack([time, angles])))
    finer = np.arange(10 * ROWS) / 600
    forces = finer[:, None] * np.arange(1, 19)
    header = ",".join(["time", *GROUND_REACTION])
    np.savetxt(tmp_path / "grf.csv", np.column_stack([finer, forces]), delimiter=",", header=header, comments="")
    (tmp_path / "grf.mot").write_text(storage(["time", *OPENSIM], np.column_stack([finer, forces]), "datacolumns 19"))
    (tmp_path / "study.toml").write_text(TOML)
    return tmp_path


def test_body_study(folder, tmp_path):
    study = read_study(folder)
    trial = study.trials[0]
    assert (trial.name, trial.kind, dict(trial.conditions)) == ("coords", "motion", {"belt_speed_mps": 1.135})
    assert [*trial.columns] == [*(f"q_{name}" for name in REQUIRED), *GROUND_REACTION]
    np.testing.assert_allclose(trial["l_Tz"], 18 * trial.time, atol=1e-8)
    assert set(study.inputs()) == {"study.toml", "coords.mot", "grf.csv"} and not study.files
    write_study(study, tmp_path / "copy")
    again = read_study(tmp_path / "copy").trials[0]
    for name in trial.columns:
        np.testing.assert_array_equal(again[name], trial[name])


def test_degrees_become_radians_and_metres_stay(folder):
    _, degrees = read_coordinates(folder / "coords.mot")
    text = (folder / "coords.mot").read_text()
    (folder / "coords.sto").write_text(text.replace("inDegrees=yes", "inDegrees=no"))
    _, radians = read_coordinates(folder / "coords.sto")
    for name in REQUIRED:
        factor = 1.0 if name in TRANSLATIONS else np.pi / 180
        np.testing.assert_allclose(degrees[f"q_{name}"], radians[f"q_{name}"] * factor, rtol=1e-15)


def test_opensim_names_of_the_ground_reaction(folder):
    csv, mot = read_ground_reaction(folder / "grf.csv"), read_ground_reaction(folder / "grf.mot")
    for name in GROUND_REACTION:
        np.testing.assert_allclose(mot[1][name], csv[1][name], rtol=1e-8)
    text = (folder / "grf.mot").read_text()
    text = text.replace("\t1_ground_force_", "\tground_force_l_").replace("\tground_force_v", "\tground_force_r_v")
    (folder / "other.mot").write_text(text)
    np.testing.assert_array_equal(read_ground_reaction(folder / "other.mot")[1]["r_Fy"], mot[1]["r_Fy"])


def test_paths_of_a_states_file(folder):
    text = (folder / "coords.mot").read_text().replace("\tknee_angle_r\t", "\t/jointset/knee_r/knee_angle_r/value\t")
    (folder / "states.sto").write_text(text)
    np.testing.assert_array_equal(
        read_coordinates(folder / "states.sto")[1]["q_knee_angle_r"],
        read_coordinates(folder / "coords.mot")[1]["q_knee_angle_r"],
    )


OTHER_NAMES = {
    "lenhart": {"hip_flexion": "hip_flex", "hip_adduction": "hip_add", "hip_rotation": "hip_rot", "knee_angle": "knee_flex"},
    "flexion": {"knee_angle": "knee_flexion", "ankle_angle": "ankle_dorsiflexion", "pelvis_rotation": "pelvis_rot"},
}  # fmt: skip


@pytest.mark.parametrize("case", OTHER_NAMES)
def test_other_names_of_coordinates_are_taken_and_said(folder, case):
    text = (folder / "coords.mot").read_text()
    usual = read_study(folder).trials[0]
    for name, other in OTHER_NAMES[case].items():
        text = text.replace(f"\t{name}", f"\t{other}")
    (folder / "coords.mot").write_text(text)
    found = read_study(folder).trials[0]
    for name in REQUIRED:
        np.testing.assert_array_equal(found[f"q_{name}"], usual[f"q_{name}"])
    (said,) = set(found.remarks) - set(usual.remarks)
    assert all(f"{other}_r as {name}_r" in said for name, other in OTHER_NAMES[case].items() if "pelvis" not in name)


@pytest.mark.parametrize("other", ["ankle_plantarflexion_r", "ankle_moment_r", "ankle_angle_x_r"])
def test_names_that_may_mean_another_sign_or_thing_are_no_coordinates(folder, other):
    text = (folder / "coords.mot").read_text()
    (folder / "coords.mot").write_text(text.replace("\tankle_angle_r", f"\t{other}"))
    with pytest.raises(InputError, match=f"missing; found {other}, which is another name or unit"):
        read_study(folder)


def test_a_coordinate_by_its_own_name_leaves_a_column_of_another_one_alone(folder):
    text = (folder / "coords.mot").read_text()
    usual = read_study(folder).trials[0]
    (folder / "coords.mot").write_text(text.replace("\thip_flexion_r", "\tknee_flex_r\thip_flexion_r"))
    lines = (folder / "coords.mot").read_text().splitlines()
    place = lines[6].split("\t").index("knee_flex_r")
    rows = [row.split("\t") for row in lines[7:] if row]
    lines[7:] = ["\t".join([*row[:place], "5.5", *row[place:]]) for row in rows]
    (folder / "coords.mot").write_text("\n".join([*lines, ""]))
    found = read_study(folder).trials[0]
    np.testing.assert_array_equal(found["q_knee_angle_r"], usual["q_knee_angle_r"])
    assert found.remarks == usual.remarks


BAD = {  # file, old, new, blamed, row, key, words
    "no_endheader": ("coords.mot", "endheader", "end", "coords.mot", 15, None, "endheader"),
    "no_unit": ("coords.mot", "inDegrees=yes", "inRadians=no", "coords.mot", 1, None, "inDegrees=yes"),
    "no_coordinate": ("coords.mot", "pelvis_tilt", "spine", "coords.mot", 7, "pelvis_tilt", "missing"),
    "coordinate_typo": ("coords.mot", "knee_angle_r", "knee_angel_r", "coords.mot", 7, "knee_angle_r", "knee_angel_r"),
    "text": ("coords.mot", "0.0166666667", "x", "coords.mot", 9, "time", "'x'"),
    "no_time": ("coords.mot", "time", "frame", "coords.mot", 7, "time_s", "first column"),
    "no_force": ("grf.csv", "l_Fx", "l_F", "grf.csv", 1, "l_Fx", "missing"),
    "no_mass": ("study.toml", "mass_kg = 72.6\n", "", "study.toml", 4, "rig.mass_kg", "or segments, or urdf"),
    "height_in_cm": ("study.toml", "height_m = 1.8", "height_cm = 180", "study.toml", 6, "rig.height_cm", "expected height_m"),
    "start": ("study.toml", "[[trial]]", "[start]\ngain = 1\n[[trial]]", "study.toml", 8, "start.gain", "unknown"),
    "no_grf": ("study.toml", 'ground_reaction = "grf.csv"\n', "", "study.toml", 7, "trial[0].ground_reaction", "missing"),
    "segments": ("study.toml", "height_m = 1.8", 'segments = "study.toml"', "study.toml", 1, None, "expected JSON"),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD, ids=str)
def test_bad_walking(folder, case):
    file, old, new, blamed, row, key, words = BAD[case]
    text = (folder / file).read_text()
    assert old in text
    (folder / file).write_text(text.replace(old, new))
    with pytest.raises(InputError) as caught:
        read_study(folder)
    message = str(caught.value)
    assert "\n" not in message and message.startswith(str(folder / blamed)) and words in message
    assert caught.value.row == row and (key is None or caught.value.column == key), message


def test_not_recorded_at_the_same_time(folder):
    text = (folder / "coords.mot").read_text().split("\n")
    moved = [f"{i + 5}{line[line.index(chr(9)) :]}" for i, line in enumerate(text[7:14])]
    (folder / "coords.mot").write_text("\n".join([*text[:7], *moved]))
    with pytest.raises(InputError, match=r"grf.csv, row 2, column time: expected at least 3 samples"):
        read_study(folder)


@pytest.mark.shared
def test_real_walking(shared, tmp_path):
    source = shared / "data" / "walking_subject01"
    for name in ("coords_locked.csv", "grf_raw_600hz.csv"):
        shutil.copy(source / name, tmp_path)
    toml = TOML.replace("coords.mot", "coords_locked.csv").replace("grf.csv", "grf_raw_600hz.csv")
    (tmp_path / "study.toml").write_text(toml)
    trial = read_study(tmp_path).trials[0]
    assert trial.dt == pytest.approx(0.016)
    assert {f"q_{name}" for name in (*REQUIRED, *OPTIONAL)} <= set(trial.columns)
    assert set(GROUND_REACTION) <= set(trial.columns) and "qdd_knee_angle_r" in trial
    total = (trial["r_Fy"] + trial["l_Fy"]).mean()
    assert total == pytest.approx(72.6 * 9.80665, rel=0.03)
    time, forces = read_ground_reaction(source / "grf_raw_600hz.csv")
    assert len(time) == 1501 and len(forces) == 18
    alone = read_trial(source / "coords_mtpfree.csv", rig="body", inputs_only=True)
    assert "r_Fx" not in alone and "q_mtp_angle_l" in alone
