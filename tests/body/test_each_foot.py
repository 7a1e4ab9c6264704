"""How two feet share the ground: against Pinocchio's own contact solver, and what it changes in what can be held."""

import numpy as np
import pinocchio as pin
import pytest
from scipy import optimize

from fes_pin.body.balance import balance, soles_of
from fes_pin.body.catchable import attainable
from fes_pin.body.ground import centre_of_pressure, ground_wrench, support
from fes_pin.body.inputs import Inputs
from fes_pin.body.linearize import linearize

SIDES = ("right", "left")
CONTACT = "left_mtp_extension"
PLATES = ("left_mtp_extension", "right_mtp_extension")


@pytest.fixture(scope="module")
def both(body):
    return linearize(body, "standing")


@pytest.fixture(scope="module")
def on_heels(both):
    return both.brace(PLATES)


def on_the_ground(body, q, free=slice(None)):
    """The nearest angles of joints that are free that put the second forefoot back where it is in the posture."""
    model, joint = body.model, body.model.getJointId(CONTACT)
    data, home = model.createData(), model.createData()
    pin.forwardKinematics(model, home, body.angles("standing"))
    for _ in range(30):
        pin.computeJointJacobians(model, data, q)
        off = pin.log6(home.oMi[joint].actInv(data.oMi[joint])).vector
        q, J = q.copy(), pin.getJointJacobian(model, data, joint, pin.ReferenceFrame.LOCAL)
        q[free] -= np.linalg.pinv(J[:, free]) @ off
    return q


def contact_wrenches(body, q, torque, locked=()):
    """By Pinocchio: the second foot's wrench from its contact solver, the first's is what inverse dynamics still needs.

    (f, n) about the origin, N and N m.
    """
    model = pin.buildReducedModel(body.model, [body.model.getJointId(name) for name in locked], q)
    free = [i for i, name in enumerate(body.joint_names) if name not in locked]
    foot = model.frames[model.getFrameId(CONTACT)]
    data, contacts, held = model.createData(), pin.StdVec_RigidConstraintModel(), pin.StdVec_RigidConstraintData()
    contacts.append(pin.RigidConstraintModel(pin.ContactType.CONTACT_6D, model, foot.parentJoint, foot.placement))
    held.append(contacts[0].createData())
    pin.initConstraintDynamics(model, data, contacts, held)
    a = np.zeros(19)
    a[free] = pin.constraintDynamics(model, data, q[free], np.zeros(len(free)), torque, contacts, held)
    whole = pin.buildModelFromXML(body.urdf, pin.JointModelFreeFlyer())
    whole.gravity.linear = body.model.gravity.linear
    outside, joint = pin.StdVec_Force(), whole.getJointId(CONTACT)
    for _ in range(whole.njoints):
        outside.append(pin.Force.Zero())
    outside[joint] = held[0].contact_force  # in the contact's frame, which is that joint's
    base, work = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]), whole.createData()
    efforts = pin.rnea(whole, work, np.r_[base, q], np.zeros(25), np.r_[np.zeros(6), a], outside)
    assert efforts[6:][free] == pytest.approx(torque, abs=1e-6)  # the two agree on the motion
    pin.forwardKinematics(whole, work, np.r_[base, q])
    second = work.oMi[joint].act(held[0].contact_force)
    return efforts[:6], np.r_[second.linear, second.angular]


def rows_of(body, first, second, heels):
    """The inequalities of both feet, evaluated at wrenches, in units of the weight, as `balance` orders them."""
    q, weight = body.angles("standing"), body.mass_kg * 9.80665
    soles = [support(body, q, dict.fromkeys(SIDES, heels), (side,)) for side in SIDES]
    return np.concatenate([sole.rows @ w for sole, w in zip(soles, (first, second), strict=True)]) / weight


def foretold(linear, deviation, torque):
    """The same by the linear body."""
    found, push = linear.modes(), linear.C + torque
    ground = balance(linear, found)
    eta, force = found.shapes.T @ linear.A @ deviation, found.shapes.T @ push
    return ground.constant + ground.per_mode @ eta + ground.per_force @ force + ground.per_torque @ push


def test_in_the_posture_each_foot_bears_what_pinocchios_contact_does(body, both):
    rng = np.random.default_rng(11)
    for size in (0.0, 1.0, 30.0):
        torque = -both.C + size * rng.normal(size=19)
        wrenches = contact_wrenches(body, both.q, torque)
        assert foretold(both, np.zeros(19), torque) == pytest.approx(rows_of(body, *wrenches, False), abs=1e-9)


def test_off_the_posture_it_does_so_to_first_order(body, both):
    """A tenth of the deviation leaves a hundredth of the difference."""
    rng = np.random.default_rng(12)
    way, push = both.basis @ rng.normal(size=both.basis.shape[1]), rng.normal(size=19)
    off = []
    for size in (1e-2, 1e-3):
        q = on_the_ground(body, both.q + size * way)
        torque = -both.C + 100.0 * size * push
        change = rows_of(body, *contact_wrenches(body, q, torque), False) - foretold(both, np.zeros(19), -both.C)
        told = foretold(both, q - both.q, torque) - foretold(both, np.zeros(19), -both.C)
        assert np.abs(change).max() > size  # there is something to foretell
        off.append(np.abs(told - change).max() / np.abs(change).max())
    assert off[1] < 0.2 * off[0] and off[1] < 0.02


def test_braces_and_plates_are_as_pinocchios_locked_joints(body, on_heels):
    linear = on_heels.brace(["left_knee_flexion"])
    locked = (*PLATES, "left_knee_flexion")
    torque = -linear.C + 20.0 * np.random.default_rng(13).normal(size=16)
    wrenches = contact_wrenches(body, body.angles("standing"), torque, locked)
    assert foretold(linear, np.zeros(16), torque) == pytest.approx(rows_of(body, *wrenches, True), abs=1e-9)


def test_torques_end_where_a_foots_own_centre_of_pressure_leaves_its_sole(body, on_heels):
    """On Pinocchio's contacts; the centre of pressure of both together is then often well inside the hull."""
    q, heels, rng = body.angles("standing"), dict.fromkeys(SIDES, True), np.random.default_rng(14)
    soles, hull = [support(body, q, heels, (side,)) for side in SIDES], soles_of(on_heels)
    rest, inside = foretold(on_heels, np.zeros(17), -on_heels.C), []
    for _ in range(10):
        way = rng.normal(size=17)
        step = reach(rest, foretold(on_heels, np.zeros(17), way - on_heels.C) - rest)
        wrenches = contact_wrenches(body, q, step * way - on_heels.C, PLATES)
        places = [sole.outside(centre_of_pressure(w)) for sole, w in zip(soles, wrenches, strict=True)]
        lifted = min(w[2] for w in wrenches) < 1e-6
        assert lifted or max(places) == pytest.approx(0.0, abs=1e-9)
        inside.append(hull.outside(centre_of_pressure(sum(wrenches))))
    assert sorted(inside)[5] < -0.01


def test_the_greatest_lean_is_that_of_a_program_over_joints_and_pinocchios_contacts(body, on_heels):
    """Over the joints' deviations and torques; each foot's rows are differences of Pinocchio's wrenches."""
    motors, settle = Inputs.torques(limit_nm=300.0), 10.0
    found, held = on_heels.modes(), attainable(on_heels, motors, settle_deg=settle)
    project, degree = found.shapes.T @ on_heels.A, np.radians(1.0) / np.abs(found.shapes).max(axis=0)
    kinds = np.array([mode.kind for mode in found])
    fall, swing, neutral = (kinds == kind for kind in ("fall", "swing", "neutral"))
    Q, basis = motors.on(on_heels), on_heels.basis
    rest = rows_of(body, *contact_wrenches(body, body.angles("standing"), -on_heels.C, PLATES), True)
    per_torque = np.column_stack([contact_rows(body, 0.0 * e, e - on_heels.C) - rest for e in np.eye(17)])
    per_way = np.column_stack(
        [contact_rows(body, 1e-5 * way, -on_heels.C) - contact_rows(body, -1e-5 * way, -on_heels.C) for way in basis.T]
    )
    per_way /= 2e-5
    lean = project @ basis / degree[:, None]
    hang = np.column_stack([lean[swing], np.zeros((swing.sum(), motors.n))])
    rows = np.vstack([np.column_stack([per_way, per_torque @ Q]), hang, -hang])
    room = np.concatenate([-rest - per_torque @ on_heels.C, np.full(2 * len(hang), settle)])
    at_rest = found.shapes[:, ~neutral].T  # what is neutral may drift
    still = np.column_stack([at_rest @ on_heels.B @ basis, at_rest @ Q])
    for place, i in enumerate(np.flatnonzero(fall)):
        upright = lean[neutral | fall & (np.arange(len(lean)) != i)]
        others = np.column_stack([upright, np.zeros((len(upright), motors.n))])
        for way, sign in enumerate((1.0, -1.0)):
            best = optimize.linprog(
                np.concatenate([-sign * lean[i], np.zeros(motors.n)]),
                A_ub=rows,
                b_ub=room,
                A_eq=np.vstack([still, others]),
                b_eq=np.concatenate([-at_rest @ on_heels.C, np.zeros(len(others))]),
                bounds=[(None, None)] * basis.shape[1] + list(zip(motors.lower, motors.upper, strict=True)),
            )
            assert held.lean_deg[place, way] == pytest.approx(-best.fun, rel=1e-6)


def contact_rows(body, way, torque):
    """The inequalities a little off the posture, along a way of the joints that plates leave free."""
    free = [i for i, name in enumerate(body.joint_names) if name not in PLATES]
    q = body.angles("standing").copy()
    q[free] += way
    return rows_of(body, *contact_wrenches(body, on_the_ground(body, q, free), torque, PLATES), True)


def test_where_all_is_rigid_between_the_feet_the_hull_of_both_soles_is_the_limit(both):
    """What the feet share then is anybody's guess, so that any centre of pressure in the hull may be had."""
    trunk = ("lumbar_bending", "lumbar_extension")
    linear = both.brace([name for name in both.joint_names if name not in trunk])
    modes = linear.modes()
    ground = balance(linear, modes)
    hull, total = soles_of(linear), whole_wrench(linear)
    per_torque = ground.per_force @ modes.shapes.T + ground.per_torque
    whole = hull.rows @ total.per_acceleration @ np.linalg.inv(linear.A)
    for angle in np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False):
        way = np.array([np.cos(angle), np.sin(angle)])
        limit = reach(hull.rows @ total.at_rest, whole @ way)
        assert reach(ground.constant, per_torque @ way) == pytest.approx(limit, rel=1e-9)


def reach(constant, slope):
    """How far one can go until a row is 0."""
    return np.min(-constant[slope > 1e-9] / slope[slope > 1e-9])


def whole_wrench(linear):
    places = [linear.body.joint_names.index(name) for name in linear.joint_names]
    return ground_wrench(linear.body.model, linear.body.angles("standing")).on(places)
