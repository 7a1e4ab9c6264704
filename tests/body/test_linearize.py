"""A, B and C: against finite differences of Pinocchio's own quantities, tilted bodies, and each other."""

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fes_pin import allocate
from fes_pin.body.anthropometry import Subject, skeleton_of_subject
from fes_pin.body.build import GRAVITY, Body
from fes_pin.body.gait import posture_angles, posture_names
from fes_pin.body.joints import JOINT_NAMES
from fes_pin.body.linearize import ground_normal, linearize, linearize_batch, model_on_slope
from fes_pin.body.passive import ElasticJoints, PassiveLegs
from fes_pin.body.skeleton import Segment, Skeleton
from fes_pin.data.errors import InputError
from fes_pin.muscles.nerves import Nerves

slopes = st.tuples(st.floats(-0.4, 0.4), st.floats(-0.4, 0.4))


def some_posture(body, seed):
    low, high = body.limits
    return low + (high - low) * np.random.default_rng(seed).uniform(0.2, 0.8, 19)


def derivative(f, x, step=1e-3):
    """Central differences of fourth order: (n, len(x))."""
    columns = []
    for i in range(len(x)):
        e = np.zeros(len(x))
        e[i] = step
        columns.append((8.0 * (f(x + e) - f(x - e)) - (f(x + 2 * e) - f(x - 2 * e))) / (12.0 * step))
    return np.array(columns).T


def potential(model, q):
    data = model.createData()
    pin.forwardKinematics(model, data, q)
    return pin.computePotentialEnergy(model, data)


def some_body(seed):
    """A subject of either sex and stance, or ten segments that no table knows: heavier, lighter, off their axis."""
    rng = np.random.default_rng(seed)
    stance = ("left", "right")[seed % 2]
    subject = Subject(rng.uniform(25, 200), rng.uniform(1.2, 2.2), ("male", "female")[seed // 2 % 2])
    if seed % 3:
        return Body.from_subject(subject.mass_kg, subject.height_m, subject.sex, stance)
    whole = skeleton_of_subject(subject)
    segments = {}
    for name, segment in whole.segments.items():
        turn = pin.exp3(rng.normal(size=3) * 0.3)
        mass = segment.mass * rng.uniform(0.5, 2.0)
        inertia = turn @ segment.inertia @ turn.T * rng.uniform(0.5, 2.0)
        segments[name] = Segment(mass, segment.com + rng.normal(size=3) * 0.02, 0.5 * (inertia + inertia.T))
    return Body.from_segments(Skeleton(segments, whole.centres, whole.points, whole.height), stance)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10**6), slopes)
def test_a_b_c_are_what_the_paper_says(seed, slope):
    body = some_body(seed)
    q = some_posture(body, seed)
    linear = linearize(body, q, slope)
    model = model_on_slope(body, slope)
    data = model.createData()
    assert np.array_equal(linear.A, linear.A.T)
    assert np.linalg.eigvalsh(linear.A)[0] > 0.0
    assert np.array_equal(linear.B, linear.B.T)

    def gravity(x):
        return pin.computeGeneralizedGravity(model, data, x).copy()

    assert np.abs(linear.B + derivative(gravity, q)).max() < 1e-7 * np.abs(linear.B).max()
    assert np.abs(linear.C + gravity(q)).max() < 1e-12 * np.abs(linear.C).max()
    slope_of_energy = derivative(lambda x: np.array([potential(model, x)]), q)[0]
    assert np.abs(linear.C + slope_of_energy).max() < 1e-7 * np.abs(linear.C).max()
    one = np.eye(19)
    alone = [kinetic(model, q, e) for e in one]
    pairs = [[kinetic(model, q, one[i] + one[j]) - alone[i] - alone[j] for j in range(19)] for i in range(19)]
    assert np.abs(linear.A - np.array(pairs)).max() < 1e-12 * np.abs(linear.A).max()


def kinetic(model, q, v):
    return pin.computeKineticEnergy(model, model.createData(), q, v)


def some_passive(rng):
    legs = PassiveLegs(rng.uniform(0.3, 2.0), {"left_hip_flexion": rng.uniform(0, 3)})
    joints = rng.choice(JOINT_NAMES, 6, replace=False).tolist()
    stiffness, damping, rest = (dict(zip(joints, rng.uniform(0, s, 6).tolist(), strict=True)) for s in (80, 5, 1))
    return (None, legs, ElasticJoints(stiffness, damping, rest))[int(rng.integers(3))]


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10**6), slopes)
def test_around_a_moving_posture_with_passive_joints(seed, slope):
    """B, C, E against differences of the whole torque: inverse dynamics less what passive joints give."""
    rng, body = np.random.default_rng(seed), some_body(seed)
    q, v, a, passive = some_posture(body, seed), rng.normal(size=19), 3.0 * rng.normal(size=19), some_passive(rng)
    linear = linearize(body, q, slope, rates=v, accelerations=a, passive=passive)
    model = model_on_slope(body, slope)
    data = model.createData()
    names = body.joint_names

    def needed(q, v):
        tau = pin.rnea(model, data, q, v, a).copy()
        return tau if passive is None else tau - passive.torque(q, names) + passive.damping(names) @ v

    by_angle, by_rate = derivative(lambda x: needed(x, v), q), derivative(lambda x: needed(q, x), v)
    if isinstance(passive, PassiveLegs):  # measured moments have no potential: their stiffness is its symmetric part
        skew = derivative(lambda x: passive.torque(x, names), q)
        by_angle += 0.5 * (skew - skew.T)
    assert np.abs(linear.B + by_angle).max() < 1e-7 * np.abs(by_angle).max()
    assert np.abs(linear.E - by_rate).max() < 1e-7 * np.abs(by_rate).max()
    assert np.abs(linear.C + needed(q, v)).max() < 1e-12 * np.abs(linear.C).max()


def test_kinetic_energy_is_half_v_a_v(body):
    q, v = some_posture(body, 1), np.random.default_rng(2).normal(size=19)
    energy = pin.computeKineticEnergy(body.model, body.model.createData(), q, v)
    assert 0.5 * v @ linearize(body, q).A @ v == pytest.approx(energy, rel=1e-12)


@settings(max_examples=10, deadline=None)
@given(slopes)
def test_a_slope_is_the_whole_body_tilted_with_its_ground(slope):
    """Turn the root of the body itself by the rotation that takes up into the normal: same C, same B."""
    body = Body.from_subject(mass_kg=70.0, height_m=1.7)
    q = body.angles("mid_stance")
    normal = ground_normal(slope)
    turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), normal).matrix()
    tilted = pin.Model(body.model)
    root = tilted.jointPlacements[1]
    tilted.jointPlacements[1] = pin.SE3(turn, np.zeros(3)) * root
    data = tilted.createData()
    linear = linearize(body, "mid_stance", slope)
    g = pin.computeGeneralizedGravity(tilted, data, q)
    assert np.abs(linear.C + g).max() < 1e-10 * np.abs(g).max()
    dg = pin.computeGeneralizedGravityDerivatives(tilted, data, q)
    assert np.abs(linear.B + dg).max() < 1e-10 * np.abs(dg).max()
    assert np.abs(linear.A - pin.crba(tilted, data, q)).max() < 1e-12


def test_uphill_makes_the_upright_body_lean_back(body):
    """Ground that rises ahead has a normal that points back; the body, square to it, must be held against falling
    back."""
    level, uphill = (linearize(body, "neutral", s).holding_torque for s in ((0.0, 0.0), (-0.05, 0.0)))
    change = uphill["right_ankle_dorsiflexion"] - level["right_ankle_dorsiflexion"]
    assert change == pytest.approx(0.05 * body.mass_kg * GRAVITY * 0.95, rel=0.1)  # dorsiflexion pulls it forward again


def test_moving_posture_is_the_derivative_of_inverse_dynamics(body):
    rng = np.random.default_rng(3)
    q, v, a = some_posture(body, 3), rng.normal(size=19), rng.normal(size=19)
    linear = linearize(body, q, (0.03, -0.02), rates=v, accelerations=a)
    model = model_on_slope(body, (0.03, -0.02))
    data = model.createData()
    by_angle = derivative(lambda x: pin.rnea(model, data, x, v, a).copy(), q)
    by_rate = derivative(lambda x: pin.rnea(model, data, q, x, a).copy(), v)
    assert np.abs(linear.B + by_angle).max() < 1e-7 * np.abs(by_angle).max()
    assert np.abs(linear.E - by_rate).max() < 1e-7 * np.abs(by_rate).max()
    assert np.allclose(linear.C, -pin.rnea(model, data, q, v, a), rtol=1e-12)
    assert not linear.conservative
    still = linearize(body, q, (0.03, -0.02), rates=np.zeros(19))
    assert np.abs(still.B - linearize(body, q, (0.03, -0.02)).B).max() < 1e-9


def test_linear_equation_predicts_the_nonlinear_body(body):
    """Acceleration under torques near the posture: error of second order in the deviation."""
    q = body.angles("mid_stance")
    linear = linearize(body, "mid_stance")
    rng = np.random.default_rng(5)
    direction, torque = rng.normal(size=19), rng.normal(size=19)
    data = body.model.createData()
    errors = []
    for size in (1e-3, 1e-4):
        gamma = size * direction
        D = -linear.C + torque * size
        true = pin.aba(body.model, data, q + gamma, np.zeros(19), D)
        errors.append(np.abs(np.linalg.solve(linear.A, linear.B @ gamma + linear.C + D) - true).max())
    assert errors[1] < 0.02 * errors[0]


@pytest.mark.parametrize("passive", [PassiveLegs(), PassiveLegs(factor=0.5, damping_nms={"left_knee_flexion": 0.3})])
def test_passive_legs_have_the_stiffness_of_their_torque(body, passive):
    q = body.angles("mid_swing")
    slope = -derivative(lambda x: passive.torque(x, body.joint_names), q, 1e-4)
    assert np.abs(passive.stiffness(q, body.joint_names) - 0.5 * (slope + slope.T)).max() < 1e-7 * np.abs(slope).max()
    free, held = linearize(body, "mid_swing"), linearize(body, "mid_swing", passive=passive)
    assert np.allclose(free.B - held.B, passive.stiffness(q, body.joint_names))
    assert np.allclose(held.C - free.C, passive.torque(q, body.joint_names))
    assert held.conservative == (not passive.damping_nms)


def test_passive_legs_pull_back_from_the_ends():
    """Riener and Edrich: a stretched hip flexes, a bent ankle lets go, a hyperextended knee flexes; some N m near
    rest."""
    legs, names = PassiveLegs(), JOINT_NAMES
    index = {n: i for i, n in enumerate(names)}

    def torque(joint, degrees):
        q = np.zeros(19)
        q[index[joint]] = np.radians(degrees)
        return legs.torque(q, names)[index[joint]]

    assert torque("left_hip_flexion", -20.0) > 15.0
    assert torque("left_hip_flexion", 90.0) < -15.0
    assert torque("right_ankle_dorsiflexion", 20.0) < -5.0
    assert torque("right_ankle_dorsiflexion", -40.0) > 0.5
    assert torque("right_knee_flexion", -5.0) > torque("right_knee_flexion", 5.0) > 0.0
    assert abs(torque("right_knee_flexion", 45.0)) < 10.0


def test_springs_and_dampers_by_name(body):
    springs = ElasticJoints({"left_knee_flexion": 10.0}, {"lumbar_bending": 2.0}, {"left_knee_flexion": 0.1})
    linear, free = (
        linearize(body, {"left_knee_flexion": 0.5}, passive=springs),
        linearize(body, {"left_knee_flexion": 0.5}),
    )
    i, j = body.joint_names.index("left_knee_flexion"), body.joint_names.index("lumbar_bending")
    assert free.B[i, i] - linear.B[i, i] == pytest.approx(10.0)
    assert linear.C[i] - free.C[i] == pytest.approx(-4.0)
    assert linear.E[j, j] == 2.0
    with pytest.raises(InputError, match="negative"):
        linearize(body, passive=ElasticJoints({"left_knee_flexion": -1.0}))
    with pytest.raises(InputError, match="unknown joint"):
        linearize(body, passive=ElasticJoints({"knee": 1.0}))


def test_a_batch_is_the_single_ones(body):
    postures = np.array([some_posture(body, seed) for seed in range(7)])
    A, B, C = linearize_batch(body, postures, (0.05, 0.02))
    for k, q in enumerate(postures):
        linear = linearize(body, q, (0.05, 0.02))
        assert np.abs(A[k] - linear.A).max() < 1e-12
        assert np.abs(B[k] - linear.B).max() < 1e-9
        assert np.abs(C[k] - linear.C).max() < 1e-10
    into = np.empty_like(A), np.empty_like(B), np.empty_like(C)
    linearize_batch(body, postures, (0.05, 0.02), into)
    assert all(map(np.array_equal, into, (A, B, C)))
    for wrong in (np.zeros(19), np.zeros((2, 18)), np.full((2, 19), np.nan)):
        with pytest.raises(InputError, match="shape"):
            linearize_batch(body, wrong)


def test_braces_hold_what_a_constraint_would(body):
    """Locked joints leave the equations of the others as Lagrange multipliers would."""
    linear = linearize(body, "mid_stance")
    locked = ["right_knee_flexion", "lumbar_bending"]
    braced = linear.brace(locked)
    D = np.random.default_rng(0).normal(size=19)
    N = np.zeros((2, 19))
    for row, name in zip(N, locked, strict=True):
        row[linear.joint_names.index(name)] = 1.0
    kkt = np.block([[linear.A, N.T], [N, np.zeros((2, 2))]])
    whole = np.linalg.solve(kkt, np.concatenate([linear.C + D, np.zeros(2)]))[:19]
    keep = [linear.joint_names.index(name) for name in braced.joint_names]
    assert np.allclose(np.linalg.solve(braced.A, braced.C + D[keep]), whole[keep], atol=1e-9)
    assert braced.whole_posture == pytest.approx(linear.posture)
    with pytest.raises(InputError, match="not among"):
        braced.brace(["right_knee_flexion"])
    with pytest.raises(InputError, match="nothing is left"):
        linear.brace(linear.joint_names)


@pytest.mark.parametrize("name", posture_names())
@pytest.mark.parametrize("stance", ["left", "right"])
def test_named_postures_linearize_and_mirror(name, stance):
    body = Body.from_subject(mass_kg=72.6, height_m=1.80, stance=stance)
    other = Body.from_subject(mass_kg=72.6, height_m=1.80, stance="left" if stance == "right" else "right")
    ours, mirrored = (np.linalg.eigvals(linearize(b, name).F) for b in (body, other))
    assert np.allclose(np.sort(ours.real), np.sort(mirrored.real), atol=1e-4)


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda b: linearize(b, "standing on the head"), "unknown posture"),
        (lambda b: linearize(b, {"left_knee": 0.1}), "did you mean 'left_knee_flexion'"),
        (lambda b: linearize(b, {"left_knee_flexion": 3.0}), "171.9 deg is outside its limits -10 to 150 deg"),
        (lambda b: linearize(b, {"left_knee_flexion": "bent"}), "must be a number"),
        (lambda b: linearize(b, np.zeros(18)), "19 joint values"),
        (lambda b: linearize(b, np.full(19, np.nan)), "finite"),
        (lambda b: linearize(b, slope=(0.8, 0.8)), "slope: alpha^2 + beta^2 must be below 1"),
        (lambda b: linearize(b, slope=(np.nan, 0.0)), "slope"),
        (lambda b: linearize(b, slope=0.1), "slope: must be two numbers"),
        (lambda b: linearize(b, rates={"knee": 1.0}), "unknown joint"),
    ],
)
def test_what_cannot_be_says_so_in_one_line(body, call, says):
    with pytest.raises(InputError) as error:
        call(body)
    assert says in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("stance", ["left", "right"])
def test_joint_vectors_hold_their_names_whatever_the_order(stance):
    """A body's order begins at its stance foot, the nerves' at the left hip: by name they mean the same."""
    body = Body.from_subject(70.0, 1.75, stance=stance)
    q, named = body.angles("mid_stance"), posture_angles("mid_stance", stance)
    assert dict(q) == named
    assert body.angles(q.arranged(JOINT_NAMES)).tolist() == body.angles(named).tolist() == q.tolist()
    assert body.rates(q.arranged(JOINT_NAMES)).tolist() == q.tolist()
    nerves = Nerves(["left_femoral", "right_tibial"])
    for same in (q, q.arranged(JOINT_NAMES), q.arranged(body.joint_names[::-1])):
        assert np.array_equal(nerves.torque_matrix(same), nerves.torque_matrix(named))
        rows = np.zeros((2, 1)) + same
        # rows of a stack are summed in another order than one posture, by kernels that differ between processors
        assert np.allclose(nerves.torque_matrix(rows)[1], nerves.torque_matrix(named), rtol=1e-12, atol=1e-12)
    linear = linearize(body, q)
    assert linear.C["right_hip_flexion"] == -linear.holding_torque["right_hip_flexion"]
    assert dict(linear.q) == named
    for mode in linear.modes():
        assert dict(mode.participation) == mode.joints
        assert max(np.abs(list(dict(mode.one_degree).values()))) == pytest.approx(np.radians(1.0), rel=1e-12)
    braced = linear.brace([f"{stance}_knee_flexion"])
    assert braced.C.keys() == braced.joint_names
    assert linear.state_names == (*linear.joint_names, *(f"{name}_rate" for name in linear.joint_names))


@pytest.mark.parametrize("stance", ["left", "right"])
def test_an_allocation_takes_a_bodys_posture_by_name(stance):
    body = Body.from_subject(70.0, 1.75, stance=stance)
    nerves, torque = Nerves(), {"left_ankle_dorsiflexion": -40.0, "right_hip_adduction": -20.0}
    one, other = (
        allocate(torque, nerves, q) for q in (body.angles("mid_stance"), posture_angles("mid_stance", stance))
    )
    assert one.pulse_widths_us == other.pulse_widths_us
    assert one.pulse_widths_us["left_tibial"] > 180.0


def test_postures_in_rows_are_taken_by_name(body):
    q = np.zeros((3, 1)) + body.angles("mid_stance")
    for A, B in zip(linearize_batch(body, q), linearize_batch(body, q.arranged(JOINT_NAMES)), strict=True):
        assert np.array_equal(A, B)
