"""Smallest sets of nerves and braces, against trying every set; and what bounded inputs can hold."""

import itertools

import numpy as np
import pytest

from fes_pin.body.build import Body
from fes_pin.body.catchable import attainable, catchable
from fes_pin.body.controllability import modal_controllability
from fes_pin.body.inputs import Inputs
from fes_pin.body.joints import mirrored
from fes_pin.body.linearize import linearize
from fes_pin.body.minimal_sets import ORTHOSES, minimal_sets, pareto
from fes_pin.data.errors import InputError
from fes_pin.muscles.nerves import Nerves

RIGHT = tuple(f"right_{n}" for n in ("superior_gluteal", "hamstrings", "femoral", "obturator", "iliopsoas", "tibial"))
PEELED = (*ORTHOSES["corset"], *ORTHOSES["left_ankle_foot_orthosis"], *ORTHOSES["right_ankle_foot_orthosis"])
PEELED = (*PEELED, "left_mtp_extension", "right_mtp_extension", "left_knee_flexion", "left_hip_rotation")


@pytest.fixture(scope="module")
def braced(body):
    return linearize(body, "neutral").brace(PEELED)


@pytest.mark.parametrize(
    ("stimulation", "gravity", "lean"),
    [*(("constant", g, x) for g in (True, False) for x in (0.5, 3.0)), ("over_time", True, 0.5)],
)
def test_no_smaller_set_holds_the_leans(braced, gravity, lean, stimulation):
    nerves = Inputs.of(Nerves(RIGHT, strength=1.0), braced)

    def holds(names):
        some = nerves.select(names)
        if stimulation == "over_time":
            return catchable(braced, some, gravity=gravity, balance=False).least_lean_deg >= lean * (1 - 1e-6)
        return attainable(braced, some, gravity, balance=False).least_lean_deg >= lean * (1 - 1e-6)

    options = {"gravity": gravity, "lean_deg": lean, "stimulation": stimulation, "balance": False}
    found = minimal_sets(braced, nerves, alternatives=20, **options)
    working = [size for size in range(len(RIGHT) + 1) if any(holds(n) for n in itertools.combinations(RIGHT, size))]
    if not working:
        assert found == []
        return
    expected = {n for n in itertools.combinations(RIGHT, working[0]) if holds(n)}
    assert {s.inputs for s in found} == expected
    assert all(s.lean_deg >= lean * (1 - 1e-6) for s in found)
    for s in found:  # stronger nerves can do what weaker ones can, up to the rounding that the programs account for
        assert s.error_deg <= 1e-8 * max(1.0, s.lean_deg)
        assert s.lean_band_deg[1] >= s.lean_deg - 2.0 * s.error_deg


def test_no_smaller_set_pulls_both_ways_in_turn(braced):
    nerves = Inputs.of(Nerves(RIGHT), braced)
    modes = braced.modes()
    gains, load = modes.shapes.T @ nerves.on(braced), modes.values * modes.degree
    gains, load = gains[modes.kinds == "fall"], load[modes.kinds == "fall"]

    def pulls(names):
        keep = [RIGHT.index(n) for n in names]
        up, down = (np.maximum(s * gains[:, keep], 0.0).sum(axis=1) for s in (1.0, -1.0))
        return np.all(up >= load) and np.all(down >= load)

    found = minimal_sets(braced, nerves, together=False, gravity=False, alternatives=20)
    size = len(found[0].inputs)
    assert not any(pulls(n) for n in itertools.combinations(RIGHT, size - 1))
    assert {s.inputs for s in found} == {n for n in itertools.combinations(RIGHT, size) if pulls(n)}
    assert all(modal_controllability(braced, nerves.select(s.inputs)).controls_falls for s in found)


MIRRORED = tuple(name.replace("right_", "left_") for name in RIGHT)


@pytest.mark.parametrize("options", [{"lean_deg": 0.5}, {"stimulation": "constant", "gravity": False}])
def test_the_cheapest_set_is_the_same_in_a_mirror_and_in_any_order(options):
    """Of all smallest sets the cheapest, not the first that a search meets."""
    found = {}
    for stance, names in (("right", (*RIGHT, *MIRRORED)), ("left", (*MIRRORED, *RIGHT)), ("left", (*RIGHT, *MIRRORED))):
        linear = linearize(Body.from_subject(72.6, 1.80, stance=stance), "neutral")
        linear = linear.brace({*PEELED, "right_knee_flexion", "right_hip_rotation"})
        nerves = Nerves(names, strength=1.0)
        found[stance, names[0]] = minimal_sets(linear, nerves, alternatives=2, balance=False, **options)
    one, *others = found.values()
    assert (
        one[0].equals > 1 and one[0].energy < one[1].energy and f"{one[0].equals} sets of this size do" in str(one[0])
    )
    for other in others:
        assert [s.energy for s in other] == pytest.approx([s.energy for s in one], rel=1e-9)
        assert {mirrored(n) for n in other[0].inputs} == set(one[0].inputs)


def test_pulling_inputs_need_one_more_than_falls(braced):
    falls = len(braced.modes().falling)
    found = minimal_sets(braced, Nerves(RIGHT), gravity=False, stimulation="constant")
    assert len(found[0].inputs) >= falls + 1
    limited = Inputs.torques(braced.joint_names, limit_nm=200.0)
    motors = minimal_sets(braced, limited, gravity=False, settle_deg=np.inf, stimulation="constant")
    assert len(motors[0].inputs) == falls


def test_braces_replace_nerves(body):
    linear = linearize(body, "neutral").brace(("left_mtp_extension", "right_mtp_extension", *ORTHOSES["corset"]))
    linear = linear.brace(ORTHOSES["left_ankle_foot_orthosis"])
    names = ("right_ankle_foot_orthosis", "right_knee_lock")
    healthy = Nerves((*RIGHT, "left_tibial"), strength=1.0)
    answers = minimal_sets(linear, healthy, braces=names, max_braces=2, lean_deg=0.5, balance=False)
    front = pareto(answers)
    assert [len(s.inputs) for s in front] == sorted((len(s.inputs) for s in front), reverse=True)
    assert [len(s.braces) for s in front] == sorted(len(s.braces) for s in front)
    fewest = min(answers, key=lambda s: len(s.inputs))
    assert "right_knee_lock" in fewest.braces
    assert all(s.energy > 0.0 for s in answers)
    assert "nerves" in str(front[0])


def test_a_motor_holds_up_to_its_limit(body):
    """One inverted pendulum, torque limit tau: it holds a lean of tau / stiffness, less what gravity takes."""
    ankle = linearize(body, "neutral").brace([n for n in body.joint_names if n != "right_ankle_inversion"])
    motor = Inputs.torques(["right_ankle_inversion"], limit_nm=100.0)
    found = attainable(ankle, motor, balance=False)
    stiffness, torque = ankle.B[0, 0], -ankle.C[0]
    leans = np.degrees((100.0 - np.array([1.0, -1.0]) * abs(torque)) / stiffness)
    assert np.sort(found.lean_deg[0]) == pytest.approx(np.sort(leans), rel=1e-6)
    assert found.effort["right_ankle_inversion"] == pytest.approx(torque, rel=1e-6)
    weak = attainable(ankle, Inputs.torques(["right_ankle_inversion"], limit_nm=0.5 * abs(torque)), balance=False)
    assert not weak.holds
    assert weak.least_lean_deg == 0.0
    assert "cannot be held" in str(weak)


def test_swinging_modes_must_stay_near(body):
    """A swing leg let go of does not hold a posture with its knee bent."""
    leg = linearize(body, "mid_stance").brace([n for n in body.joint_names if n != "left_knee_flexion"])
    nothing = Inputs.torques(["left_knee_flexion"], limit_nm=0.0)
    assert leg.modes()[0].kind == "swing"
    drop = np.degrees(abs(leg.C[0] / leg.B[0, 0]))
    assert not attainable(leg, nothing, settle_deg=0.9 * drop, balance=False).holds
    assert attainable(leg, nothing, settle_deg=1.1 * drop, balance=False).holds


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ({"braces": ["plaster"], "max_braces": 1}, "unknown brace"),
        ({"braces": {"plaster": ["knee"]}, "max_braces": 1}, "unknown joint"),
        ({"lean_deg": 0.0}, "lean_deg"),
        ({"max_braces": -1}, "max_braces"),
        ({"settle_deg": -1.0}, "settle_deg"),
        ({"lean_deg": np.inf}, "lean_deg"),
        ({"lean_deg": "a"}, "lean_deg"),
        ({"stimulation": "often"}, "stimulation"),
        ({"max_braces": 0.5}, "max_braces"),
    ],
)
def test_bad_questions(braced, arguments, says):
    with pytest.raises(InputError, match=says):
        minimal_sets(braced, Nerves(RIGHT), **arguments)
