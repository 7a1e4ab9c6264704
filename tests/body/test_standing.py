"""What feet on the ground add: the centre of pressure, a second foot; and what inputs over time catch."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from scipy import integrate, linalg

from fes_pin.body.balance import balance, place_of_weight
from fes_pin.body.catchable import attainable, catchable, modal_bound, plans_of
from fes_pin.body.closed_loop import close_the_loop
from fes_pin.body.gait import posture_names
from fes_pin.body.ground import centre_of_pressure, ground_wrench, support
from fes_pin.body.inputs import Inputs
from fes_pin.body.linearize import linearize
from fes_pin.body.plans import PULSE_S
from fes_pin.data.errors import InputError

ANKLE = "right_ankle_inversion"


@pytest.fixture(scope="module")
def pendulum(body):
    """The whole body about one ankle: one fall."""
    return linearize(body, "one_leg").brace([n for n in body.joint_names if n != ANKLE])


@pytest.fixture(scope="module")
def two_links(body):
    keep = (ANKLE, "right_hip_adduction")
    return linearize(body, "one_leg").brace([n for n in body.joint_names if n not in keep])


def free_body(body):
    """The same URDF without the ground: six more degrees of freedom, whose efforts the ground must supply."""
    model = pin.buildModelFromXML(body.urdf, pin.JointModelFreeFlyer())
    model.gravity.linear = np.array([0.0, 0.0, -9.80665])
    return model


def test_the_wrench_of_the_ground_is_that_of_inverse_dynamics(body):
    model, rng = free_body(body), np.random.default_rng(3)
    q, a = body.angles("one_leg"), rng.normal(size=19)
    base = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])

    def inverse(q, a):
        wrench = pin.rnea(model, model.createData(), np.r_[base, q], np.zeros(25), np.r_[np.zeros(6), a])
        return wrench[:6]

    found = ground_wrench(body.model, q)
    assert found.at_rest == pytest.approx(inverse(q, np.zeros(19)), abs=1e-9)
    assert found.per_acceleration @ a == pytest.approx(inverse(q, a) - inverse(q, np.zeros(19)), abs=1e-9)
    step = 1e-5 * rng.normal(size=19)
    change = (inverse(q + step, np.zeros(19)) - inverse(q - step, np.zeros(19))) / 2.0
    assert found.per_angle @ step == pytest.approx(change, abs=1e-8)


def test_the_weight_lies_outside_the_foot_in_every_instant_of_a_walk(body):
    for name in posture_names():
        linear = linearize(body, name).brace(["left_mtp_extension", "right_mtp_extension"])
        outside, line = place_of_weight(linear)
        assert (outside <= 0.0) == (name in ("standing", "one_leg")), line
        assert ("instant of a walk" in line) == (name not in ("standing", "one_leg", "neutral"))
        assert (outside <= 0.0) == bool(balance(linear, linear.modes()).constant.max() <= 0.0)


def test_without_a_plate_the_forefoot_alone_carries(body):
    free = linearize(body, "one_leg")
    assert "foot plates" in place_of_weight(free)[1]
    q = body.angles("one_leg")
    sole, fore = (support(body, q, {"left": h, "right": h}, ("right",)).corners for h in (True, False))
    assert np.ptp(sole[:, 0]) == pytest.approx(0.2581 / 1.741 * 1.80, rel=1e-9)
    assert np.ptp(fore[:, 0]) == pytest.approx(0.28 * np.ptp(sole[:, 0]))


def test_a_lean_ends_where_the_centre_of_pressure_leaves_the_foot(body, pendulum):
    """A strong ankle still holds no more than half a foot's breadth, of the centre of mass's height."""
    strong = Inputs.torques([ANKLE], limit_nm=1000.0)
    found = attainable(pendulum, strong)
    assert found.lean_deg.max() < attainable(pendulum, strong, balance=False).lean_deg.min() / 5.0
    q = body.angles(pendulum.whole_posture, check=False)
    area = support(body, q, {"left": True, "right": True}, ("right",))
    for sign, lean in zip((1.0, -1.0), found.lean_deg[0], strict=True):
        tilted = {**pendulum.whole_posture, ANKLE: pendulum.q[0] + sign * np.radians(lean)}
        place = centre_of_pressure(ground_wrench(body.model, body.angles(tilted, check=False)).at_rest)
        assert area.outside(place) == pytest.approx(0.0, abs=1e-3)


def test_two_feet_move_as_the_closed_loop_does(body):
    """Accelerations against Pinocchio's tree with the second foot's constraint, near the posture."""
    linear = linearize(body, "standing")
    assert linear.basis.shape == (19, 13) and len(linear.modes()) == 13
    rng = np.random.default_rng(5)
    tau = -linear.C + 0.1 * rng.normal(size=19)
    M = pin.crba(body.model, body.model.createData(), linear.q)
    h = pin.computeGeneralizedGravity(body.model, body.model.createData(), linear.q)
    J = linear.closure
    solved = np.linalg.solve(np.block([[M, -J.T], [J, np.zeros((6, 6))]]), np.r_[tau - h, np.zeros(6)])
    assert linear.mobility @ (linear.C + tau) == pytest.approx(solved[:19], abs=1e-8)
    assert J @ linear.modes().shapes == pytest.approx(np.zeros((6, 13)), abs=1e-9)


def test_stiffness_on_two_feet_is_that_along_the_ground(body):
    """The energy of gravity along a path that keeps the second foot in place, second derivative by differences."""
    linear = linearize(body, "standing")
    shape = linear.modes()[8].shape * 0.01
    joint = body.model.getJointId("left_mtp_extension")
    data = body.model.createData()
    pin.forwardKinematics(body.model, data, linear.q)
    home = data.oMi[joint].copy()

    def energy(step):
        q = linear.q + step * shape
        for _ in range(20):
            pin.computeJointJacobians(body.model, data, q)
            off = pin.log6(home.actInv(data.oMi[joint])).vector
            J = pin.getJointJacobian(body.model, data, joint, pin.ReferenceFrame.LOCAL)
            q = q - np.linalg.pinv(J) @ off
        return pin.computePotentialEnergy(body.model, data, q) - (-linear.C) @ (q - linear.q)

    second = energy(1.0) - 2.0 * energy(0.0) + energy(-1.0)
    assert -shape @ linear.B @ shape == pytest.approx(second, rel=2e-2)


def test_a_second_foot_in_the_air_is_refused(body):
    with pytest.raises(InputError, match="not on the ground"):
        linearize(body, {"left_hip_flexion": 0.5}, both_feet=True)
    with pytest.raises(InputError, match="at rest only"):
        linearize(body, "standing", rates=np.zeros(19))


def test_one_fall_alone_is_caught_up_to_the_modal_bound(pendulum):
    """A plan of finite length reaches bound (1 - e^(-rate time)) before its last piece: exact for one mode."""
    motor = Inputs.torques([ANKLE], limit_nm=30.0)
    found = catchable(pendulum, motor, settle_deg=40.0, balance=False, rest_deg=0.0)
    plans = plans_of(pendulum, motor, 40.0)
    switch = PULSE_S * sum(plans.pieces[:-1])
    share = 1.0 - np.exp(-np.sqrt(pendulum.modes().values[0]) * switch)
    assert found.lean_deg == pytest.approx(share * modal_bound(pendulum, motor), rel=1e-9)
    assert np.all(found.lean_deg < found.bound_deg)


def test_beyond_the_modal_bound_a_full_effort_loses_and_below_it_wins(pendulum):
    """The nonlinear pendulum under the best there is, full torque against the lean; half a degree either side."""
    motor = Inputs.torques([ANKLE], limit_nm=30.0)
    bound = modal_bound(pendulum, motor)[0]
    inertia, stiffness, constant = pendulum.A[0, 0], pendulum.B[0, 0], pendulum.C[0]
    for sign, most in zip((1.0, -1.0), bound, strict=True):
        for start, falls in ((most * 1.05, True), (most * 0.95, False)):
            torque = -sign * 30.0
            run = integrate.solve_ivp(
                lambda _, x, torque=torque: (x[1], (stiffness * x[0] + constant + torque) / inertia),
                (0.0, 1.0),
                (sign * np.radians(start), 0.0),
                rtol=1e-9,
            )
            assert (sign * run.y[0, -1] > np.radians(start)) == falls


def test_a_plan_does_to_the_linear_body_what_it_says(two_links):
    """The plan's inputs in the exact discrete linear system: it ends at rest, within the limits at every look."""
    motors = Inputs.torques([ANKLE, "right_hip_adduction"], limit_nm=80.0)
    plans = plans_of(two_links, motors, 10.0)
    eta = np.array([0.3, -0.5]) * plans.modes.degree
    answer = plans.program(eta, np.zeros(2)).solve()
    assert answer.x is not None
    torques = answer.x.reshape(len(plans.pieces), 2)
    block = np.zeros((6, 6))
    block[:4, :4], block[:4, 4:] = two_links.F, two_links.R
    flow = linalg.expm(block * PULSE_S)
    x, inputs = np.r_[plans.modes.shapes @ eta, np.zeros(2)], motors.on(two_links)
    reached = []
    for pulses, u in zip(plans.pieces, torques, strict=True):
        for _ in range(pulses):
            x = flow[:4, :4] @ x + flow[:4, 4:] @ (two_links.C + inputs @ u)
            reached.append(np.abs(plans.modes.shapes.T @ two_links.A @ x[:2]) / plans.modes.degree)
        assert reached[-1].max() <= 10.0 + 1e-4
    assert np.max(reached) < 10.5  # between the looks a little more
    rest = -np.linalg.solve(two_links.B, two_links.C + inputs @ torques[-1])
    growing = plans.modes.shapes.T @ two_links.A @ (x[:2] - rest)
    growing += plans.modes.shapes.T @ two_links.A @ x[2:] / np.sqrt(plans.modes.values)
    assert growing == pytest.approx(np.zeros(2), abs=1e-6)


def test_constant_stimulation_holds_no_more_than_stimulation_over_time_catches(two_links):
    motors = Inputs.torques([ANKLE, "right_hip_adduction"], limit_nm=60.0)
    held, caught = attainable(two_links, motors), catchable(two_links, motors, rest_deg=None)
    assert held.holds and caught.rests
    assert np.all(np.minimum(held.lean_deg, 9.0) <= caught.lean_deg + 1e-6)
    one = Inputs.torques(["right_hip_adduction"], limit_nm=60.0)  # cannot balance two falls at once, but catch them
    assert not attainable(two_links, one).holds
    assert catchable(two_links, one).least_lean_deg > 0.05


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_what_is_caught_by_the_linear_plan_is_caught_on_the_full_equations(two_links, sign):
    motors = Inputs.torques([ANKLE, "right_hip_adduction"], limit_nm=60.0)
    mode = two_links.modes().falling[-1]
    least = catchable(two_links, motors).lean_deg[-1].min()
    run = close_the_loop(two_links, motors, sign * 0.8 * least * mode.one_degree, seconds=2.0)
    assert not run.lost and run.outside_m < 0.002, str(run)
    assert run.last_deg < 5.0
    far = sign * 1.5 * modal_bound(two_links, motors)[-1].max() * mode.one_degree
    assert "no input" in close_the_loop(two_links, motors, far, seconds=1.0).lost


def test_bad_questions(two_links, body):
    motors = Inputs.torques([ANKLE])
    for call, says in (
        (lambda: catchable(two_links, motors, settle_deg=np.inf), "settle_deg"),
        (lambda: catchable(two_links, motors, rest_deg=-1.0), "rest_deg"),
        (lambda: catchable(replace(two_links, E=np.eye(2)), motors), "without damping"),
        (lambda: close_the_loop(linearize(body, "standing"), motors, np.zeros(19)), "one foot only"),
        (lambda: close_the_loop(two_links, motors, np.zeros(2), seconds="long"), "seconds"),
        (lambda: close_the_loop(two_links, motors, {"left_knee_flexion": 0.1}), "left_knee_flexion is not among"),
        (lambda: close_the_loop(two_links, motors, np.zeros(2), moving_arms=True), "moving_arms"),
    ):
        with pytest.raises(InputError, match=says):
            call()
