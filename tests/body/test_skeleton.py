"""Subjects, tables of segments, and the URDFs written from them."""

import json
import re
import subprocess
import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fes_pin.body import build, urdf
from fes_pin.body.anthropometry import Subject, combined, skeleton_of_subject
from fes_pin.body.build import Body
from fes_pin.body.joints import JOINT_NAMES, SEGMENT_NAMES, axis_of, joint_limits, mirrored
from fes_pin.body.skeleton import Segment, read_segments
from fes_pin.data.errors import InputError

REPOSITORY = Path(__file__).parents[2]

people = st.tuples(st.floats(20.0, 250.0), st.floats(1.0, 2.4), st.sampled_from(["male", "female"]))


@settings(max_examples=25, deadline=None)
@given(people, st.sampled_from(["left", "right"]))
def test_mass_and_height_are_the_subjects(person, stance):
    mass, height, sex = person
    body = Body.from_subject(mass_kg=mass, height_m=height, sex=sex, stance=stance)
    links = [float(e.get("value")) for e in ET.fromstring(body.urdf).iter("mass")]
    assert len(links) == 10
    assert abs(sum(links) - mass) < 1e-9
    assert abs(body.mass_kg - mass) < 1e-9
    assert abs(body.placement("vertex", np.zeros(19))[1][2] - height) < 1e-9
    free = pin.buildModelFromXML(body.urdf, pin.JointModelFreeFlyer())
    assert abs(pin.computeTotalMass(free) - mass) < 1e-9
    assert body.joint_names == tuple(body.model.names[1:])
    assert set(body.joint_names) == set(JOINT_NAMES)


@pytest.mark.parametrize("number", [np.float64, np.float32, np.int64, int, np.array])
def test_a_subject_in_numbers_of_any_type_is_the_same_body(number):
    body = Body.from_subject(number(70), number(2))
    assert body == Body.from_subject(70.0, 2.0)
    assert abs(body.mass_kg - 70.0) < 1e-9
    assert abs(body.placement("vertex", "neutral")[1][2] - 2.0) < 1e-9


def test_the_numbers_of_a_segment_may_be_of_any_type():
    skeleton = skeleton_of_subject(Subject(70.0, 1.8))
    same = {n: Segment(np.float64(s.mass), s.com, s.inertia) for n, s in skeleton.segments.items()}
    assert Body.from_segments(replace(skeleton, segments=same)) == Body.from_segments(skeleton)


@pytest.mark.parametrize("spoiled", ["mass", "xyz"])
def test_a_body_that_is_not_as_asked_for_is_refused(monkeypatch, spoiled):
    """Whatever writes the URDF wrongly: the built body is compared with the subject."""
    right = urdf.write_urdf

    def wrong(*given):
        text = right(*given)
        return (
            text.replace('<mass value="', '<mass value="1', 1) if spoiled == "mass" else text.replace("0.", "0.0", 99)
        )

    monkeypatch.setattr(build, "write_urdf", wrong)
    with pytest.raises(InputError, match="not what was asked for"):
        Body.from_subject(70.0, 1.8)


def test_the_centre_of_mass_is_that_of_all_ten_segments():
    skeleton = skeleton_of_subject(Subject(70.0, 1.8))
    whole, body = combined(list(skeleton.segments.values())), Body.from_subject(70.0, 1.8, stance="left")
    origin = skeleton.centres["left_mtp"] * [1.0, 1.0, 0.0]
    assert np.allclose(body.centre_of_mass("neutral"), whole.com - origin, atol=1e-12)


@pytest.mark.parametrize(
    ("text", "stance", "says"),
    [
        ("<robot", "right", "cannot be read as a URDF"),
        (3, "right", "cannot be read as a URDF"),
        (None, "left", "rooted at the other foot"),
        (None, "both", "stance: must be 'left' or 'right'"),
        (None, ["right"], "stance: must be 'left' or 'right'"),
    ],
)
def test_a_body_checks_its_urdf_when_it_is_built(body, text, stance, says):
    with pytest.raises(InputError, match=says):
        Body(body.urdf if text is None else text, stance)


@settings(max_examples=25, deadline=None)
@given(people)
def test_left_and_right_mirror_each_other(person):
    skeleton = skeleton_of_subject(Subject(*person))
    flip = np.array([1.0, -1.0, 1.0])
    for name in SEGMENT_NAMES:
        one, other = skeleton.segments[name], skeleton.segments[mirrored(name)]
        assert one.mass == other.mass
        assert np.allclose(one.com * flip, other.com, atol=1e-15)
        assert np.allclose(one.inertia, other.inertia, atol=1e-15)


@pytest.mark.parametrize(("sex", "mass", "com", "radius"), [("male", 1.37, 44.15, 25.7), ("female", 1.29, 40.14, 29.9)])
def test_the_two_parts_of_the_foot_are_de_levas_foot(sex, mass, com, radius):
    height = 1.741 if sex == "male" else 1.735
    length = 0.2581 if sex == "male" else 0.2283
    skeleton = skeleton_of_subject(Subject(70.0, height, sex))
    foot = combined([skeleton.segments["right_hindfoot"], skeleton.segments["right_forefoot"]])
    total = 100.0 if sex == "male" else 99.99
    assert foot.mass == pytest.approx(70.0 * mass / total, rel=1e-12)
    assert foot.com[0] - skeleton.points["right_heel"][0] == pytest.approx(length * com / 100.0, rel=1e-9)
    # about the vertical: exactly the table's; the parts' heights add nothing to it
    assert foot.inertia[2, 2] == pytest.approx(foot.mass * (radius / 100.0 * length) ** 2, rel=1e-9)


def test_centre_of_mass_lies_where_people_have_it():
    """Standing centre of mass at 55 to 57 % of height, men's higher (Zatsiorsky's subjects and many others)."""
    for sex, low, high in (("male", 0.55, 0.585), ("female", 0.54, 0.575)):
        skeleton = skeleton_of_subject(Subject(70.0, 1.75, sex))
        whole = combined(list(skeleton.segments.values()))
        assert low < whole.com[2] / 1.75 < high


def test_measured_subject_is_near_the_table_of_people(walk):
    """Two sources for one man: segment masses within 40 %, leg joints within 5 cm."""
    measured = read_segments(walk / "reference/subject01_model.json")
    table = skeleton_of_subject(Subject(72.6, 1.80, "male"))
    for name in ("trunk", "pelvis", "left_thigh", "left_shank", "left_hindfoot"):
        assert table.segments[name].mass == pytest.approx(measured.segments[name].mass, rel=0.4)
    for name in ("left_hip", "left_knee", "left_ankle"):
        assert abs(table.centres[name][2] - measured.centres[name][2]) < 0.05


@pytest.mark.parametrize("stance", ["left", "right"])
def test_shipped_urdfs_are_what_the_generator_writes(stance):
    body = Body.from_subject(mass_kg=72.6, height_m=1.80, sex="male", stance=stance)
    path = REPOSITORY / f"urdf/body_{stance}_stance.urdf"
    assert path.read_text() == body.urdf
    read = Body.from_urdf(path)
    assert read.stance == stance
    assert read.height_m == pytest.approx(1.80, abs=1e-9)
    assert "de Leva" in path.read_text()


def test_generator_script_parses():
    subprocess.run(["bash", "-n", str(REPOSITORY / "scripts/generate_urdf")], check=True)


@pytest.mark.parametrize("stance", ["left", "right"])
def test_joints_turn_as_named_whichever_foot_stands(stance):
    body = Body.from_subject(mass_kg=70.0, height_m=1.75, stance=stance)

    def moved(frame, towards, joint):
        """Rotation of `frame` in `towards` when the joint grows by 0.1 rad."""
        R, _ = body.placement(frame, {joint: 0.1})
        S, _ = body.placement(towards, {joint: 0.1})
        return pin.log3(S.T @ R) / 0.1

    pairs = {"hip": ("thigh", "pelvis"), "knee": ("shank", "thigh"), "ankle": ("hindfoot", "shank")}
    pairs["mtp"] = ("forefoot", "hindfoot")
    for joint in JOINT_NAMES:
        side, _, rest = joint.partition("_")
        outer, inner = ("trunk", "pelvis") if side == "lumbar" else pairs[rest.split("_")[0]]
        frames = (outer, inner) if side == "lumbar" or inner == "pelvis" else (f"{side}_{outer}", f"{side}_{inner}")
        frames = (f"{side}_{outer}", inner) if inner == "pelvis" and side != "lumbar" else frames
        assert np.allclose(moved(*frames, joint), axis_of(joint), atol=1e-9), joint


def test_directions_are_the_anatomists():
    """Where a point of the outer segment goes: knee flexion takes the swing foot back, adduction to the midline, ..."""
    body = Body.from_subject(mass_kg=70.0, height_m=1.75, stance="right")
    rest = {f: body.placement(f, {})[1] for f in ("left_hindfoot", "left_forefoot", "vertex")}

    def shift(frame, joint):
        return body.placement(frame, {joint: 0.2})[1] - rest[frame]

    assert shift("left_hindfoot", "left_hip_flexion")[0] > 0.1
    assert shift("left_hindfoot", "left_knee_flexion")[0] < -0.05
    assert shift("left_hindfoot", "left_hip_adduction")[1] < -0.1  # the left foot goes right
    assert shift("left_forefoot", "left_hip_rotation")[1] < -0.01  # toes in
    assert shift("left_forefoot", "left_ankle_dorsiflexion")[2] > 0.01
    assert shift("vertex", "lumbar_extension")[0] < -0.1
    assert shift("vertex", "lumbar_bending")[1] < -0.1  # right
    assert shift("vertex", "right_ankle_dorsiflexion")[0] > 0.1  # the body goes forward over the stance foot
    back, _, up = shift("vertex", "right_knee_flexion")
    assert back < -0.1 and up < 0.0  # the thigh leans back over the shank


def test_limits_hold_zero_and_are_in_the_urdf(body):
    for joint in JOINT_NAMES:
        low, high = joint_limits(joint)
        assert low < 0.0 < high
        i = body.joint_names.index(joint)
        assert (body.limits[0][i], body.limits[1][i]) == (low, high)


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ((0.0, 1.8), "mass_kg: must lie between 20 and 250"),
        ((float("nan"), 1.8), "mass_kg"),
        ((72.6, 180.0), "height_m: must lie between 1 and 2.4"),
        (("heavy", 1.8), "mass_kg"),
        ((True, 1.8), "mass_kg"),
        ((72.6, 1.8, "robot"), "sex: must be 'male' or 'female'"),
        ((72.6, 1.8, ["male"]), "sex: must be 'male' or 'female'"),
        ((72.6, np.array([1.8])), "height_m: must be a number"),
        ((72.6, 1.8, "male", ["left"]), "stance: must be 'left' or 'right'"),
        ((72.6, 1.8, "male", "both"), "stance: must be 'left' or 'right'"),
    ],
)
def test_subjects_that_no_one_is(arguments, says):
    with pytest.raises(InputError) as error:
        Body.from_subject(*arguments)
    assert says in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("path", ["none/body.urdf", ".", 3])
def test_a_body_that_cannot_be_written_says_so(body, tmp_path, monkeypatch, path):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match=r"cannot be written|expected a path"):
        body.write(path)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda t: t["ten_segments"].pop("trunk"), "ten_segments.trunk"),
        (lambda t: t["ten_segments"]["pelvis"].update(mass=-1.0), "must be positive"),
        (lambda t: t["ten_segments"]["pelvis"].pop("inertia_com"), "pelvis.inertia_com"),
        (
            lambda t: t["ten_segments"]["pelvis"].update(inertia_com=[[1, 0, 0], [0, 1, 0], [0, 0, 9]]),
            "principal moments",
        ),
        (lambda t: t["ten_segments"]["pelvis"].update(com_ground_neutral="here"), "must be numbers"),
        (lambda t: t["joints"].pop("knee_l"), "joints.knee_l"),
        (lambda t: t["joints"]["knee_l"].update(centre_neutral_ground=[0.0, float("nan"), 0.0]), "finite numbers"),
    ],
)
def test_tables_that_are_wrong_say_where(walk, tmp_path, change, says):
    table = json.loads((walk / "reference/subject01_model.json").read_text())
    change(table)
    path = tmp_path / "segments.json"
    path.write_text(json.dumps(table))
    with pytest.raises(InputError) as error:
        Body.from_segments(path)
    assert says in str(error.value)
    assert "segments.json" in str(error.value)


def test_files_that_are_none(tmp_path):
    (tmp_path / "a.json").write_text("{")
    (tmp_path / "a.urdf").write_text("<robot name='a'><link name='b'/></robot>")
    for read, name in (
        (Body.from_segments, "a.json"),
        (Body.from_segments, "none.json"),
        (Body.from_urdf, "a.urdf"),
        (Body.from_urdf, "none.urdf"),
    ):
        with pytest.raises(InputError, match=name):
            read(tmp_path / name)


@pytest.mark.parametrize(
    ("spoil", "says"),
    [
        (lambda text: re.sub(r'<mass value="[0-9.]+"', '<mass value="-1.0"', text, count=2), "mass above 0"),
        (lambda text: re.sub(r"<inertial>.*?</inertial>", "", text, count=1, flags=re.S), "no mass"),
        (lambda text: re.sub(r'(link name="trunk">).*?</inertial>', r"\1", text, flags=re.S), "lumbar"),
        (lambda text: turned(text, "right_knee_flexion", -1.0), "right_knee_flexion: the joint turns the other way"),
        (lambda text: text.replace('type="revolute"', 'type="prismatic"'), "about another axis"),
    ],
    ids=["negative mass", "foot without mass", "trunk without mass", "reversed axis", "slides"],
)
def test_a_urdf_of_no_body_is_refused(tmp_path, body, spoil, says):
    path = tmp_path / "body.urdf"
    path.write_text(spoil(body.urdf))
    with pytest.raises(InputError, match=says):
        Body.from_urdf(path)


def turned(text, joint, factor):
    """The URDF with a joint's axis times a factor."""
    head, tail = text.split(f'<joint name="{joint}"', 1)
    axis = re.search(r'<axis xyz="([^"]*)"', tail)
    numbers = " ".join(repr(factor * float(x) + 0.0) for x in axis.group(1).split())
    return f'{head}<joint name="{joint}"{tail[: axis.start(1)]}{numbers}{tail[axis.end(1) :]}'
