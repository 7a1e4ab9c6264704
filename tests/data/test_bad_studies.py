# ruff: noqa: E501  (tables, one case a line)
"""Every kind of bad input: one line that names the file, the row and the column or key."""

import re

import pytest
from data import studies

from fes_pin.data.errors import InputError
from fes_pin.data.study import read_study

HUGE = "1" + "0" * 400
DIGITS = "1" + "0" * 5000
LONG = "a" * 300
MIMIC = (
    studies.URDF[studies.URDF.index('  <link name="arm">') : studies.URDF.index("  <joint")].replace("arm", "toe")
    + '<joint name="toe_joint" type="continuous"><parent link="arm"/><child link="toe"/><mimic joint="pivot"/></joint></robot>'
)

TOML = {  # old text, new text, row, key, words
    "not_toml": ("[rig]\n", "[rig\n", 5, None, "not TOML"),
    "unfinished": ('angle_rad = 1.9\n', 'angle_rad = "', 33, None, "not TOML"),
    "no_study": ('[study]\nname = "small"\nrig = "ankle"\n', "", None, "study", "missing"),
    "no_name": ('name = "small"\n', "", 1, "study.name", "missing"),
    "name_of_two_lines": ('"small"', '"a\\nb"', 2, "study.name", "one line"),
    "no_rig_name": ('rig = "ankle"\n', "", 1, "study.rig", "missing"),
    "unknown_rig": ('"ankle"', '"knee"', 3, "study.rig", "ankle, joint, muscle, body"),
    "rig_is_a_number": ('"ankle"', "3", 3, "study.rig", "expected one of"),
    "unknown_key": ("foot_mass_kg = 0.1", "foot_mass_kg = 0.1\nfoot_mas_kg = 1", 7, "rig.foot_mas_kg", "foot_mass_kg"),
    "unknown_table": ("[start]", "[strat]", 18, "strat", "start"),
    "unit_of_a_key": ("foot_mass_kg = 0.1", "foot_mass_g = 100", 6, "rig.foot_mass_g", "expected foot_mass_kg"),
    "key_without_unit": ("threshold_us", "threshold", 10, "rig.threshold", "expected threshold_us"),
    "missing_key": ("moment_arm_m = 0.04\n", "", 5, "rig.moment_arm_m", "missing"),
    "missing_passive": ("f1_per_rad = 2.2\n", "", 13, "rig.passive.f1_per_rad", "missing"),
    "no_rig_table": (studies.ANKLE[studies.ANKLE.index("[rig]") : studies.ANKLE.index("[start]")], "", None, "rig.foot_mass_kg", "missing"),
    "passive_is_a_number": ("[rig.passive]\nf0_n = 4.0\nf1_per_rad = 2.2\ntheta_r_rad = 1.3\n", "passive = 3\n", 13, "rig.passive", "table"),
    "negative_mass": ("foot_mass_kg = 0.1", "foot_mass_kg = -0.1", 6, "rig.foot_mass_kg", "above 0"),
    "zero_mass": ("foot_mass_kg = 0.1", "foot_mass_kg = 0", 6, "rig.foot_mass_kg", "above 0"),
    "zero_force_scale": ("force_scale_n = 56.0", "force_scale_n = 0.0", 9, "rig.force_scale_n", "above 0"),
    "negative_inertia": ("inertia_kgm2 = 0.001", "inertia_kgm2 = -1e-3", 21, "start.inertia_kgm2", "above 0"),
    "negative_damping": ("damping_nms = 0.06", "damping_nms = -0.06", 22, "start.damping_nms", "at least 0"),
    "start_in_rig": ("foot_mass_kg = 0.1", "foot_mass_kg = 0.1\ngain = 1", 7, "rig.gain", "unknown"),
    "saturation": ("saturation_us = 1000.0", "saturation_us = 180.0", 11, "rig.saturation_us", "above the threshold"),
    "nan": ("com_distance_m = 0.08", "com_distance_m = nan", 7, "rig.com_distance_m", "finite"),
    "infinity": ("com_distance_m = 0.08", "com_distance_m = inf", 7, "rig.com_distance_m", "finite"),
    "text_for_a_number": ("gain = 0.65", 'gain = "0.65"', 19, "start.gain", "the text '0.65'"),
    "boolean": ("gain = 0.65", "gain = true", 19, "start.gain", "expected a number, found true"),
    "list": ("gain = 0.65", "gain = [1]", 19, "start.gain", "a list"),
    "date": ("gain = 0.65", "gain = 2020-01-01", 19, "start.gain", "a date"),
    "huge_integer": ("gain = 0.65", f"gain = {HUGE}", 19, "start.gain", "finite"),
    "integer_of_5000_digits": ("gain = 0.65", f"gain = {DIGITS}", None, None, "not TOML"),
    "key_twice": ("gain = 0.65", "gain = 0.65\ngain = 0.7", 20, None, "not TOML"),
    "deep": ("gain = 0.65", "gain = " + "[" * 5000 + "]" * 5000, None, None, "nested too deeply"),
    "no_trials": (studies.ANKLE[studies.ANKLE.index("[[trial]]") :], "", None, "trial", "at least one"),
    "trial_is_a_table": (studies.ANKLE[studies.ANKLE.index("[[trial]]") :], '[trial]\nfile = "trials/00.csv"', 24, "trial", r"[[trial]]"),
    "no_file": ('file = "trials/00.csv"\n', "", 24, "trial[0].file", "missing"),
    "file_not_there": ("trials/10.csv", "trials/11.csv", 31, "trial[1].file", "nothing"),
    "file_of_a_long_name": ("trials/10.csv", LONG, 31, "trial[1].file", "no file can have"),
    "path_of_a_long_name": ("trials/10.csv", "a/" * 3000, 31, "trial[1].file", "no file can have"),
    "rig_is_a_table": ('"ankle"', "{}", 3, "study.rig", "found a table"),
    "file_is_a_folder": ("trials/10.csv", "trials", 31, "trial[1].file", "a folder"),
    "file_is_a_number": ('"trials/10.csv"', "10", 31, "trial[1].file", "as text"),
    "file_twice": ("trials/10.csv", "trials/00.csv", 31, "trial[1].file", "same file as trial[0].file"),
    "file_twice_by_another_name": ("trials/10.csv", "trials/./00.csv", 31, "trial[1].file", "same file"),
    "absolute": ("trials/10.csv", "/etc/passwd", 31, "trial[1].file", "leaves the study's folder"),
    "above": ("trials/10.csv", "../10.csv", 31, "trial[1].file", "leaves the study's folder"),
    "above_and_back": ("trials/10.csv", "trials/../trials/10.csv", 31, "trial[1].file", "leaves the study's folder"),
    "drive": ("trials/10.csv", "C:/10.csv", 31, "trial[1].file", "leaves the study's folder"),
    "a_link_to_nothing": ("trials/10.csv", "link.csv", 31, "trial[1].file", "a link to nowhere.csv, which is not there"),
    "through_a_linked_folder": ("trials/10.csv", "out/10.csv", 31, "trial[1].file", "through a link"),
    "fifo": ("trials/10.csv", "pipe", 31, "trial[1].file", "special file"),
    "unknown_kind": ('"isometric"', '"isotonic"', 32, "trial[1].kind", "motion, isometric"),
    "unknown_role": ('"fit"', '"test"', 28, "trial[0].role", "fit, held_out"),
    "group_is_a_number": ('role = "fit"', "group = 1", 28, "trial[0].group", "expected a label"),
    "group_is_empty": ('role = "fit"', 'group = " "', 28, "trial[0].group", "expected a label"),
    "no_load": ("load_kg = 1.0\n", "", 24, "trial[0].load_kg", "missing"),
    "load_in_gram": ("load_kg = 1.0", "load_g = 1000", 27, "trial[0].load_g", "expected load_kg"),
    "negative_load": ("load_kg = 1.0", "load_kg = -1", 27, "trial[0].load_kg", "at least 0"),
    "no_angle": ("angle_rad = 1.9", "", 30, "trial[1].angle_rad", "missing"),
    "angle_in_degrees": ("angle_rad = 1.9", "angle_deg = 109", 33, "trial[1].angle_deg", "expected angle_rad"),
    "angle_of_a_motion": ("load_kg = 1.0", "load_kg = 1.0\nangle_rad = 1", 28, "trial[0].angle_rad", "isometric trials only"),
    "unknown_condition": ("load_kg = 1.0", "load_kg = 1.0\nstart = 1", 28, "trial[0].start", "expected start_s"),
}  # fmt: skip


@pytest.mark.parametrize("case", TOML, ids=str)
def test_bad_toml(tmp_path, case):
    old, new, row, key, words = TOML[case]
    folder = studies.ankle(tmp_path / "study")
    (tmp_path / "10.csv").write_text(studies.MOTION)
    (folder / "link.csv").symlink_to("nowhere.csv")
    (folder / "out").symlink_to(tmp_path)
    make_fifo(folder / "pipe")
    spoil(folder / "study.toml", old, new)
    check(folder, folder / "study.toml", row, key, words)


CSV = {  # old text, new text, row, column, words
    "empty_file": (studies.MOTION, "", 1, None, "header"),
    "header_only": (studies.MOTION[studies.MOTION.index("\n") + 1 :], "", 1, "time_s", "at least 3 rows"),
    "two_rows": (studies.MOTION[studies.MOTION.index("0.010") :], "", 3, "time_s", "at least 3 rows"),
    "no_angle": ("angle_rad", "shank", 1, "angle_rad", "missing"),
    "no_stimulus": ("pulse_width_us", "current", 1, "pulse_width_us", "missing"),
    "degrees": ("angle_rad", "angle_deg", 1, "angle_deg", "expected angle_rad"),
    "no_unit": ("angle_rad", "angle", 1, "angle", "expected angle_rad"),
    "milliseconds": ("pulse_width_us", "pulse_width_ms", 1, "pulse_width_ms", "expected pulse_width_us"),
    "time_in_ms": ("time_s", "time_ms", 1, "time_s", "found 'time_ms'"),
    "time_not_first": ("time_s,pulse_width_us", "pulse_width_us,time_s", 1, "time_s", "first column"),
    "typo": ("pulse_width_us", "puls_width_us", 1, "puls_width_us", "did you mean pulse_width_us"),
    "semicolons": ("time_s,pulse_width_us,angle_rad", "time_s;pulse_width_us;angle_rad", 2, None, "expected 1 values"),
    "column_twice": ("angle_rad", "pulse_width_us", 1, "pulse_width_us", "twice"),
    "nameless": ("angle_rad", "", 1, "#3", "column name"),
    "ragged_short": ("0.010,300.0,1.82", "0.010,300.0", 4, "angle_rad", "expected 3 values"),
    "ragged_long": ("0.010,300.0,1.82", "0.010,300.0,1.82,1", 4, "angle_rad", "found 4"),
    "all_ragged": (studies.MOTION, studies.MOTION.replace(".8", ".8,"), 2, "angle_rad", "found 4"),
    "empty_row": ("0.010,300.0,1.82", "", 4, "time_s", "empty row"),
    "empty_cell": ("0.010,300.0,1.82", "0.010,,1.82", 4, "pulse_width_us", "found nothing"),
    "text": ("1.82", "NA", 4, "angle_rad", "'NA'"),
    "decimal_comma": ("1.82", "1;82", 4, "angle_rad", "'1;82'"),
    "underscore": ("300.0", "3_00.0", 4, "pulse_width_us", "'3_00.0'"),
    "nan": ("1.82", "nan", 4, "angle_rad", "finite"),
    "infinity": ("1.82", "-inf", 4, "angle_rad", "finite"),
    "too_large": ("1.82", "1e999", 4, "angle_rad", "finite"),
    "negative_width": ("300.0", "-300.0", 4, "pulse_width_us", "at least 0"),
    "time_stands": ("0.010,", "0.005,", 4, "time_s", "increase"),
    "time_falls": ("0.015,", "0.004,", 5, "time_s", "increase"),
    "step": ("0.015,0.0,1.83\n0.020", "0.016,0.0,1.83\n0.021", 5, "time_s", "fixed step"),
    "one_late": ("0.015,", "0.0155,", 5, "time_s", "fixed step"),
    "just_over_one_percent": ("0.015,", "0.01506,", 5, "time_s", "fixed step"),
    "gap": ("0.010,300.0,1.82\n", "", 4, "time_s", "fixed step"),
}  # fmt: skip


@pytest.mark.parametrize("case", CSV, ids=str)
def test_bad_csv(tmp_path, case):
    old, new, row, column, words = CSV[case]
    folder = studies.ankle(tmp_path)
    spoil(folder / "trials/00.csv", old, new)
    check(folder, folder / "trials/00.csv", row, column, words)


def test_bad_bytes(tmp_path):
    folder = studies.ankle(tmp_path)
    content = (folder / "trials/00.csv").read_bytes()
    (folder / "trials/00.csv").write_bytes(content.replace(b"1.82", b"\xff\xfe"))
    check(folder, folder / "trials/00.csv", 4, None, "UTF-8")
    (folder / "study.toml").write_bytes(b'[study]\nname = "\xe9"\n')
    check(folder, folder / "study.toml", 2, None, "UTF-8")


def test_nothing_there(tmp_path):
    check(tmp_path / "none", tmp_path / "none", None, None, "no such study")
    check(tmp_path, tmp_path / "study.toml", None, None, "no such file")
    with pytest.raises(InputError, match="cannot be read"):
        read_study("a" * 5000)
    with pytest.raises(InputError, match=r"no such study|cannot be read"):
        read_study("a\0b")


@pytest.mark.parametrize(
    ("column", "words"),
    [
        ("torque_nm", "did you mean effort?"),
        ("motor_current_a", "did you mean effort?"),
        ("angle_encoder", "did you mean position?"),
        ("emg", "this rig reads time_s, effort, position, velocity"),
    ],
)
def test_a_column_that_the_rig_does_not_read_is_refused(tmp_path, column, words):
    """A torque passed over in silence is a missing input: the model then is wrong, and nothing tells why."""
    folder = studies.joint(tmp_path)
    lines = (folder / "b.csv").read_text().splitlines()
    (folder / "b.csv").write_text("\n".join([f"{lines[0]},{column}", *(f"{line},0.1" for line in lines[1:])]) + "\n")
    check(folder, folder / "b.csv", 1, column, words)


JOINT = {  # file, old text, new text, blamed file, row, key, words
    "no_urdf": ("study.toml", 'urdf = "rig.urdf"\n', "", "study.toml", 4, "rig.urdf", "missing"),
    "urdf_not_there": ("study.toml", '"rig.urdf"', '"r.urdf"', "study.toml", 5, "rig.urdf", "nothing"),
    "urdf_outside": ("study.toml", '"rig.urdf"', '"../rig.urdf"', "study.toml", 5, "rig.urdf", "leaves"),
    "known_and_fitted": ("study.toml", "[start]", "damping = 1.0\n[start]", "study.toml", 9, "start.damping", "also in [rig]"),
    "no_damping": ("study.toml", "damping = 1e-3\n", "", "study.toml", 6, "start.damping", "missing"),
    "negative_scale": ("study.toml", "inertia_scale = 1.0", "inertia_scale = -1.0", "study.toml", 7, "start.inertia_scale", "above 0"),
    "isometric": ("study.toml", '"a.csv"', '"a.csv"\nkind = "isometric"', "study.toml", 11, "trial[0].kind", "motion, imposed for rig joint"),
    "load": ("study.toml", '"a.csv"', '"a.csv"\nload_kg = 1', "study.toml", 11, "trial[0].load_kg", "unknown"),
    "no_position": ("a.csv", "position", "height", "a.csv", 1, "position", "missing"),
    "position_unit": ("a.csv", "position", "position_deg", "a.csv", 1, "position_deg", "expected position"),
    "velocity_typo": ("a.csv", "velocity", "velocty", "a.csv", 1, "velocty", "velocity"),
    "one_with_effort": ("b.csv", "velocity", "effort", "study.toml", 12, "trial[1].file", "all or none"),
    "fixed": ("rig.urdf", "continuous", "fixed", "rig.urdf", None, "joint", "found none"),
    "floating": ("rig.urdf", "continuous", "floating", "rig.urdf", None, "pivot", "found floating"),
    "unknown_type": ("rig.urdf", "continuous", "hinge", "rig.urdf", 11, "pivot", "found hinge"),
    "cut": ("rig.urdf", "</robot>\n", "", "rig.urdf", 14, None, "not XML"),
    "other_root": ("rig.urdf", "robot", "sdf", "rig.urdf", 1, None, "<robot>"),
    "negative_mass": ("rig.urdf", '<mass value="0.15"/>', '<mass value="-0.15"/>', "rig.urdf", 4, "arm", "above 0 kg"),
    "zero_mass": ("rig.urdf", '<mass value="0.15"/>', '<mass value="0"/>', "rig.urdf", 4, "arm", "above 0 kg"),
    "no_mass": ("rig.urdf", '<mass value="0.15"/>', "", "rig.urdf", 4, "arm", "found none"),
    "mass_is_text": ("rig.urdf", '"0.15"/>\n      <in', '"heavy"/>\n      <in', "rig.urdf", 4, "arm", "'heavy'"),
    "mass_is_nan": ("rig.urdf", '"0.15"/>\n      <in', '"nan"/>\n      <in', "rig.urdf", 4, "arm", "finite"),
    "negative_inertia": ("rig.urdf", 'ixx="1e-4"', 'ixx="-1e-4"', "rig.urdf", 4, "arm", "positive"),
    "inertia_off_diagonal": ("rig.urdf", 'ixy="0"', 'ixy="5e-4"', "rig.urdf", 4, "arm", "positive"),
    "nothing_to_move": ("rig.urdf", studies.URDF[studies.URDF.index("    <inertial>") : studies.URDF.index("  </link>")], "", "rig.urdf", None, "pivot", "mass"),
    "no_axis": ("rig.urdf", "0 1 0", "0 0 0", "rig.urdf", 11, "pivot", "axis"),
    "axis_of_no_length": ("rig.urdf", "0 1 0", "0 1e-200 0", "rig.urdf", 11, "pivot", "<axis> of length 1"),
    "axis_without_end": ("rig.urdf", "0 1 0", "0 1e200 0", "rig.urdf", 11, "pivot", "xyz of <axis> below"),
    "number_with_an_underscore": ("rig.urdf", "0 1 0", "0 1_0 0", "rig.urdf", 11, "pivot", "3 finite numbers"),
    "no_limit": ("rig.urdf", "continuous", "revolute", "rig.urdf", 11, "pivot", "expected a <limit>"),
    "limit_is_text": ("rig.urdf", "</joint>", '<limit lower="low" effort="1" velocity="1"/></joint>', "rig.urdf", 11, "pivot", "lower of <limit>"),
    "limit_without_effort": ("rig.urdf", "</joint>", '<limit velocity="1"/></joint>', "rig.urdf", 11, "pivot", "effort of <limit>"),
    "mass_that_mimics": ("rig.urdf", "</robot>", MIMIC, "rig.urdf", 21, "toe_joint", "<mimic>"),
    "mimics_nothing": ("rig.urdf", "</joint>", '<mimic joint="no"/></joint>', "rig.urdf", 11, "pivot", "found 'no'"),
    "mass_of_a_star": ("rig.urdf", '<mass value="0.15"/>', '<mass value="2e30"/>', "rig.urdf", 4, "arm", "below 1e+06"),
    "mass_of_an_atom": ("rig.urdf", '<mass value="0.15"/>', '<mass value="2e-26"/>', "rig.urdf", 4, "arm", "between 1e-09"),
    "urdf_is_a_table": ("study.toml", '"rig.urdf"', "{}", "study.toml", 5, "rig.urdf", "as text"),
    "urdf_of_a_long_name": ("study.toml", '"rig.urdf"', f'"{LONG}"', "study.toml", 5, "rig.urdf", "no file can have"),
    "short_axis": ("rig.urdf", "0 1 0", "0 1", "rig.urdf", 11, "pivot", "3 finite numbers"),
    "unknown_link": ("rig.urdf", 'child link="arm"', 'child link="leg"', "rig.urdf", 11, "pivot", "'leg'"),
    "link_twice": ("rig.urdf", '<link name="base"/>', '<link name="base"/><link name="base"/>', "rig.urdf", 3, "base", "twice"),
    "two_roots": ("rig.urdf", '<link name="base"/>', '<link name="base"/><link name="loose"/>', "rig.urdf", None, "link", "one root"),
    "loop": ("rig.urdf", 'parent link="base"', 'parent link="arm"', "rig.urdf", 11, "pivot", "tree"),
    "two_joints": ("rig.urdf", "</robot>", '<link name="toe"/><joint name="mtp" type="continuous"><parent link="arm"/><child link="toe"/></joint></robot>', "rig.urdf", None, "joint", "found 2: pivot, mtp"),
    "entities": ("rig.urdf", "<robot", '<!DOCTYPE r [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;&a;&a;">]><robot', "rig.urdf", None, None, "entities"),
    "external_entity": ("rig.urdf", "<robot", '<!DOCTYPE r SYSTEM "file:///etc/passwd"><robot', "rig.urdf", None, None, "document type"),
}  # fmt: skip


@pytest.mark.parametrize("case", JOINT, ids=str)
def test_bad_joint(tmp_path, case):
    file, old, new, blamed, row, key, words = JOINT[case]
    folder = studies.joint(tmp_path)
    spoil(folder / file, old, new)
    check(folder, folder / blamed, row, key, words)


MUSCLE = {
    "no_threshold": ("study.toml", "threshold_us = 100\n", "", "study.toml", 4, "rig.threshold_us", "go together"),
    "neither": ("study.toml", "threshold_us = 100\nsaturation_us = 400\n", "", "study.toml", 4, "rig.threshold_us", "need threshold"),
    "motion": ("study.toml", "start_s", 'kind = "motion"\nstart_s', "study.toml", 12, "trial[0].kind", "isometric"),
    "stim_and_width": ("a.csv", "force_n", "stim", "a.csv", 1, "stim", "found both"),
    "stim_of_two": ("a.csv", "pulse_width_us", "stim", "a.csv", 2, "stim", "0 or 1"),
    "no_force": ("a.csv", "force_n", "grip", "a.csv", 1, "force_n", "missing"),
    "force_in_kn": ("a.csv", "force_n", "force_kn", "a.csv", 1, "force_kn", "expected force_n"),
    "no_stimulus": ("a.csv", "pulse_width_us", "current", "a.csv", 1, "pulse_width_us", "or stim"),
}  # fmt: skip


@pytest.mark.parametrize("case", MUSCLE, ids=str)
def test_bad_muscle(tmp_path, case):
    file, old, new, blamed, row, key, words = MUSCLE[case]
    folder = studies.muscle(tmp_path)
    spoil(folder / file, old, new)
    check(folder, folder / blamed, row, key, words)


def spoil(path, old, new):
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))


def check(folder, file, row, column, words):
    with pytest.raises(InputError) as caught:
        read_study(folder)
    message = str(caught.value)
    assert "\n" not in message
    assert len(message) < 400
    assert message.startswith(str(file))
    assert words in message
    assert caught.value.row == row, message
    if column is not None:
        assert caught.value.column == column, message
        assert re.search(rf"[ ,]{re.escape(column)}:", message)


def make_fifo(path):
    import os

    if hasattr(os, "mkfifo"):
        os.mkfifo(path)
