"""Results of the body are values: compared, hashed, copied and pickled by what they hold, and never changed."""

import copy
import pickle
from dataclasses import fields, replace

import numpy as np
import pytest

from fes_pin.body.build import Body
from fes_pin.body.catchable import attainable, catchable
from fes_pin.body.controllability import modal_controllability
from fes_pin.body.inputs import Inputs
from fes_pin.body.joints import JOINT_NAMES
from fes_pin.body.linearize import linearize
from fes_pin.body.minimal_sets import minimal_sets
from fes_pin.body.observability import observability
from fes_pin.body.passive import ElasticJoints, PassiveLegs
from fes_pin.data.errors import InputError
from fes_pin.muscles.muscles import standard_muscles
from fes_pin.muscles.nerve_inputs import controllability, subject_nerves

NOT_ANKLE = [name for name in JOINT_NAMES if not name.startswith("right_ankle")]


def made(kind, mass=70.0):
    """One of each kind of result, the same for the same mass."""
    body = Body.from_subject(mass, 1.8)
    linear = linearize(body, "one_leg", (0.05, 0.0)).brace(NOT_ANKLE)
    motors = Inputs.torques([n for n in JOINT_NAMES if n not in NOT_ANKLE], limit_nm=2.0 * mass)
    return {
        "body": lambda: body,
        "linear": lambda: linear,
        "both feet": lambda: linearize(body, "standing"),
        "mode": lambda: linear.modes()[0],
        "modes": linear.modes,
        "inputs": lambda: motors,
        "controllability": lambda: modal_controllability(linear, motors),
        "minimal set": lambda: minimal_sets(linear, motors, balance=False)[0],
        "held": lambda: attainable(linear, motors, balance=False),
        "caught": lambda: catchable(linear, motors, balance=False),
        "seen": lambda: observability(linear, linear.joint_names),
        "legs": lambda: PassiveLegs(mass / 70.0, {"left_knee_flexion": 0.1}),
        "springs": lambda: ElasticJoints({"left_knee_flexion": mass}),
    }[kind]()


KINDS = ["body", "linear", "both feet", "mode", "modes", "inputs", "controllability", "minimal set", "held", "caught"]
KINDS += ["seen", "legs", "springs"]


@pytest.mark.parametrize("kind", KINDS)
def test_results_are_equal_where_what_they_hold_is(kind):
    one, again, other = made(kind), made(kind), made(kind, 80.0)
    assert one == again and hash(one) == hash(again) and len({one, again, other}) == 2
    assert one != other and one != 3
    for same in (copy.copy(one), copy.deepcopy(one), pickle.loads(pickle.dumps(one)), replace(one)):
        assert same == one and hash(same) == hash(one)
        assert str(same) == str(one)


@pytest.mark.parametrize("remade", [lambda x: x, copy.deepcopy, lambda x: pickle.loads(pickle.dumps(x))])
@pytest.mark.parametrize("kind", KINDS)
def test_what_a_result_holds_cannot_be_changed(kind, remade):
    one = remade(made(kind))
    for each in fields(one):
        value = getattr(one, each.name)
        with pytest.raises(AttributeError):
            setattr(one, each.name, value)
        if isinstance(value, np.ndarray):
            with pytest.raises(ValueError, match="read-only"):
                value[...] = 7
        elif hasattr(value, "keys"):
            with pytest.raises(TypeError):
                value["left_knee_flexion"] = 7.0


@pytest.mark.parametrize("name", ["F", "R", "basis", "mobility"])
def test_matrices_that_are_kept_cannot_be_changed(name):
    linear = made("linear")
    with pytest.raises(ValueError, match="read-only"):
        getattr(linear, name)[0, 0] = 7.0


def test_inputs_do_not_take_over_the_array_they_are_given():
    matrix = np.ones((19, 1))
    inputs = Inputs.pulling(["mine"], matrix)
    matrix[:] = 7.0
    assert inputs.matrix.max() == 1.0


def test_the_table_of_muscles_cannot_be_changed():
    table = standard_muscles()
    for array in (table.strength, table.levers, table.legs.place):
        with pytest.raises(ValueError, match="read-only"):
            array[:] = 0.0


@pytest.mark.parametrize("kind", ["linear", "mode", "modes", "controllability", "held", "caught", "seen"])
def test_results_are_frames_and_tables(kind):
    one = made(kind)
    frame, page = one.to_frame(), one._repr_html_()
    assert len(frame) and frame.index.name in ("joint", "mode")
    for name in frame.index:
        assert str(name) in page
    assert all(str(column) in page for column in frame.columns)


def test_matrices_and_influence_answer_by_name():
    linear = made("linear")
    frames = {name: linear.to_frame(name) for name in ("A", "B", "E", "F", "R")}
    knee, ankle = "right_ankle_inversion", "right_ankle_dorsiflexion"
    i, j = linear.joint_names.index(knee), linear.joint_names.index(ankle)
    assert frames["A"].loc[knee, ankle] == linear.A[i, j]
    assert frames["F"].loc[f"{knee}_rate", ankle] == linear.F[linear.n + i, j]
    assert frames["R"].loc[f"{knee}_rate", ankle] == linear.R[linear.n + i, j]
    assert frames["F"].shape == (2 * linear.n, 2 * linear.n)
    with pytest.raises(InputError, match="matrix: must be"):
        linear.to_frame("D")
    found = made("controllability")
    assert found.influence(knee)[ankle] == found.joint_influence[j, found.inputs.names.index(knee)]
    with pytest.raises(InputError, match="unknown input"):
        found.influence("left_femoral")


@pytest.mark.parametrize(
    ("ask", "says"),
    [
        (lambda b, x: linearize(b, gravity=-9.81), "gravity: must lie between 0 and 100"),
        (lambda b, x: linearize(b, gravity=np.nan), "gravity: must be a finite number"),
        (lambda b, x: linearize(b, both_feet="no"), "both_feet: must be True or False"),
        (lambda b, x: linearize(b, passive=1.0), "passive: must be ElasticJoints or PassiveLegs"),
        (lambda b, x: linearize("me"), "body: must be a Body"),
        (lambda b, x: PassiveLegs(np.nan), "factor: must be a finite number"),
        (lambda b, x: PassiveLegs(-1.0), "factor: must lie between"),
        (lambda b, x: PassiveLegs(damping_nms={"left_knee_flexion": -1.0}), "must not be negative"),
        (lambda b, x: ElasticJoints({"left_knee_flexion": -1.0}), "must not be negative"),
        (lambda b, x: ElasticJoints({"knee": 1.0}), "unknown joint 'knee'"),
        (lambda b, x: x.brace("right_knee"), "cannot brace 'right_knee'"),
        (lambda b, x: x.brace(5), "names are expected"),
        (lambda b, x: b.placement(5, "neutral"), "unknown link 5"),
        (lambda b, x: controllability(x, 5), "inputs must be"),
        (lambda b, x: controllability("me", ["femoral"]), "linear: must be a LinearBody"),
        (lambda b, x: controllability(x, {"vagus"}), "unknown nerve 'vagus'"),
        (lambda b, x: minimal_sets("me", ["left_knee_flexion"]), "linear: must be a LinearBody"),
        (lambda b, x: minimal_sets(x, ["left_knee_flexion"], braces=5), "names are expected"),
        (lambda b, x: minimal_sets(x, ["left_knee_flexion"], balance="no"), "balance: must be True or False"),
        (lambda b, x: subject_nerves(b, []), "none is named"),
        (lambda b, x: subject_nerves(b, years="40"), "years: must be '18 to 25'"),
        (lambda b, x: Body.from_segments(5), "must be a path"),
        (lambda b, x: Body.from_urdf(5), "must be a path"),
    ],
)
def test_what_is_no_question_is_refused_in_one_line(body, ask, says):
    with pytest.raises(InputError, match=says) as caught:
        ask(body, linearize(body, "mid_stance"))
    assert "\n" not in str(caught.value)


def test_names_may_stand_in_sets_and_generators_or_alone(body):
    linear = linearize(body, "mid_stance")
    nerves = ("left_femoral", "right_femoral", "left_tibial", "right_tibial")
    assert controllability(linear, {"tibial", "femoral"}).inputs.names == nerves
    assert controllability(linear, (n for n in ("femoral", "tibial"))).inputs.names == nerves
    assert linear.brace("right_knee_flexion").braced == ("right_knee_flexion",)
    assert Inputs.torques({"right_knee_flexion"}).names == ("right_knee_flexion",)
