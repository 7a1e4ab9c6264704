"""Torques, postures and answers by name: one order of joints cannot be mistaken for another."""

import json

import numpy as np
import pytest

import fes_pin as fp
from fes_pin.allocation.walk import allocate_walk
from fes_pin.body.joints import JOINT_NAMES
from fes_pin.data.errors import InputError
from fes_pin.data.named import NamedArray

NERVES = fp.Nerves(["left_tibial", "left_superior_gluteal", "left_femoral", "left_hamstrings"])
WANTED = {"left_ankle_dorsiflexion": -30.0, "left_hip_adduction": -20.0, "left_knee_flexion": -15.0}


@pytest.fixture(scope="module")
def body():
    return fp.Body.from_subject(mass_kg=72.6, height_m=1.80)


def in_order_of(names, values):
    return NamedArray([values.get(name, 0.0) for name in names], names)


def test_torques_and_postures_in_a_bodys_order_mean_what_they_mean_by_name(body):
    assert body.joint_names[0] != JOINT_NAMES[0] == NERVES.joints[0]  # two orders of the same length
    q = body.angles("mid_stance")
    named = fp.allocate(WANTED, NERVES, dict(q))
    ordered = fp.allocate(in_order_of(body.joint_names, WANTED), NERVES, q)
    assert ordered.pulse_widths_us == named.pulse_widths_us
    stated = np.array([WANTED.get(name, 0.0) for name in NERVES.joints])  # the one order of arrays without names
    assert fp.allocate(stated, NERVES, dict(q)).pulse_widths_us == named.pulse_widths_us


def test_torques_without_names_beside_a_posture_in_another_order_are_refused(body):
    q, stated = body.angles("mid_stance"), np.array([WANTED.get(name, 0.0) for name in NERVES.joints])
    program = fp.Allocator(NERVES, q)
    motion = NamedArray([q, q], q.names)
    for ask in (
        lambda: fp.allocate(stated, NERVES, q),
        lambda: program(list(stated)),
        lambda: program.sequence([stated]),
        lambda: fp.Horizon(program, steps=1).plan([stated]),
        lambda: fp.allocate_walk([stated] * 2, NERVES, motion),
    ):
        with pytest.raises(InputError, match=r"posture begins at right_mtp.*that of arrays without names at left_hip"):
            ask()
    in_that_order = q.arranged(NERVES.joints)
    assert fp.allocate(stated, NERVES, in_that_order).recruitment.any()


def test_the_cache_tells_two_orders_of_equal_numbers_apart(body):
    numbers = np.linspace(0.0, 0.3, len(JOINT_NAMES))
    one, other = NamedArray(numbers, body.joint_names), NamedArray(numbers, JOINT_NAMES)
    found = [fp.allocate(WANTED, NERVES, q).recruitment for q in (one, other)]
    alone = [fp.Allocator(NERVES, q)(WANTED).recruitment for q in (one, other)]
    np.testing.assert_array_equal(found, alone)
    assert not np.allclose(*found)


def test_torques_over_time_are_taken_by_name(body):
    pandas = pytest.importorskip("pandas")
    program, count = fp.Allocator(NERVES), 5
    rows = np.linspace(0.2, 1.0, count)[:, None] * in_order_of(body.joint_names, WANTED)
    plain = program.sequence([[w * row[n] for n, w in zip(JOINT_NAMES, [1.0] * 19, strict=True)] for row in rows])
    some = {name: np.linspace(0.2, 1.0, count) * value for name, value in WANTED.items()}
    for torques in (
        rows,
        pandas.DataFrame(np.asarray(rows), columns=list(body.joint_names)),
        some,
        pandas.DataFrame(some),
    ):
        np.testing.assert_array_equal(program.sequence(torques).recruitment, plain.recruitment)
    plan = fp.Horizon(program, steps=count)
    np.testing.assert_array_equal(plan.plan(some).recruitment, plan.plan(plain.wanted).recruitment)
    for bad in (
        {"left_kneee": [1.0, 2.0]},
        {"left_knee_flexion": [[1.0]]},
        pandas.DataFrame({"left_knee_flexion": ["x"]}),
    ):
        with pytest.raises(InputError):
            program.sequence(bad)


def test_a_motion_in_a_bodys_order_is_the_same_motion(body):
    rng = np.random.default_rng(0)
    q, v = (0.3 * rng.uniform(-1, 1, (6, 19)) for _ in range(2))
    torque = 20.0 * rng.normal(size=(6, 19))
    plain = allocate_walk(torque, NERVES, q, v)
    there = [NamedArray(x, JOINT_NAMES).arranged(body.joint_names) for x in (torque, q, v)]
    named = allocate_walk(there[0], NERVES, *there[1:])
    np.testing.assert_allclose(named.recruitment, plain.recruitment, atol=1e-12)
    np.testing.assert_array_equal(named.problem.matrix, plain.problem.matrix)
    assert named.problem.held == plain.problem.held


def test_one_number_is_refused_where_there_are_several_joints():
    for torque in (-40, np.float64(-40.0), np.array(-40.0)):
        with pytest.raises(InputError, match="one torque for 19 joints: name its joint"):
            fp.allocate(torque, NERVES)
    assert fp.allocate(15.0, [[30.0]]).achieved == pytest.approx(15.0, rel=1e-3)


def test_a_matrix_without_names_has_numbered_joints_and_one_with_names_keeps_them():
    pandas = pytest.importorskip("pandas")
    matrix = NERVES.torque_matrix()
    plain = fp.Allocator(matrix)
    assert plain.joints[0] == "joint_1" and plain.names[0] == "channel_1"
    with pytest.raises(InputError, match="left_ankle_dorsiflexion"):
        plain(WANTED)
    table = pandas.DataFrame(matrix, index=list(NERVES.joints), columns=list(NERVES.names))
    turned = table.iloc[::-1]
    for rows in (table, turned):
        np.testing.assert_allclose(
            fp.Allocator(rows)(WANTED).recruitment, fp.Allocator(NERVES)(WANTED).recruitment, atol=1e-12
        )


def test_a_matrix_that_names_a_channel_or_a_joint_twice_is_refused():
    pandas = pytest.importorskip("pandas")
    for table in (
        pandas.DataFrame([[1.0, 2.0]], columns=["a", "a"], index=["j"]),
        pandas.DataFrame([[1.0], [2.0]], columns=["a"], index=["j", "j"]),
    ):
        with pytest.raises(InputError, match="twice"):
            fp.Allocator(table)


def test_answers_answer_by_name():
    a = fp.allocate(WANTED, NERVES)
    assert a["left_tibial"] == a.pulse_widths_us["left_tibial"] > 180.0
    assert a.torque("left_knee_flexion") == a.achieved[JOINT_NAMES.index("left_knee_flexion")]
    together = fp.Allocator(NERVES).sequence({name: [0.0, value] for name, value in WANTED.items()})
    np.testing.assert_allclose(together["left_tibial"], [0.0, a["left_tibial"]], rtol=1e-12)
    np.testing.assert_allclose(together.torque("left_knee_flexion")[1], a.torque("left_knee_flexion"), rtol=1e-12)
    plan = fp.Horizon(fp.Allocator(NERVES), steps=2).plan({name: [0.0, value] for name, value in WANTED.items()})
    assert plan["left_tibial"].shape == plan.torque("left_knee_flexion").shape == (2,)
    for answer in (a, together, plan):
        with pytest.raises(InputError, match=r"channel: must be .*left_hamstrings.*, got 'tibial'"):
            answer["tibial"]
        with pytest.raises(InputError, match="joint"):
            answer.torque("left_kneee")


def test_answers_are_frames_and_tables():
    pytest.importorskip("pandas")
    a = fp.allocate(WANTED, NERVES)
    frame, torques = a.to_frame(), a.torques()
    assert frame.loc["left_tibial", "pulse_width_us"] == a["left_tibial"] and frame.limit.to_dict() | a.active
    assert torques.loc["left_knee_flexion", "achieved"] == a.torque("left_knee_flexion")
    assert (torques.least <= torques.achieved).all() and (torques.achieved <= torques.greatest).all()
    assert "left_tibial" in a._repr_html_() and "0.6 to 1.4 of the strength" in a._repr_html_()
    together = fp.Allocator(NERVES).sequence({name: [0.0, value] for name, value in WANTED.items()})
    plan = fp.Horizon(fp.Allocator(NERVES), steps=2).plan(together.wanted)
    for many in (together, plan):
        assert many.to_frame().columns.tolist() == list(NERVES.names) and len(many.to_frame()) == 2
        assert "left_tibial" in many._repr_html_()
    attainable = fp.AttainableTorques(NERVES, joints=["left_knee_flexion", "left_ankle_dorsiflexion"])
    assert attainable.to_frame().loc["left_knee_flexion"].tolist() == list(attainable.range("left_knee_flexion"))
    assert "left_knee_flexion" in attainable._repr_html_()


def test_the_plain_answer_holds_the_band_of_strength():
    answer = json.loads(json.dumps(fp.allocate(WANTED, NERVES).as_dict()))
    assert answer["strength_band"] == pytest.approx([0.6, 1.4])
    knee = answer["torque_nm"]["left_knee_flexion"]
    assert knee["band"] == pytest.approx(sorted(f * knee["achieved"] for f in answer["strength_band"]))
    assert fp.allocate([15.0], [[30.0]]).as_dict()["strength_band"] == [1.0, 1.0]  # nothing is known of it
