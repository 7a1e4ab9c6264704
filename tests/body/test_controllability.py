"""Controllability and observability against brute force: ranks, quadrature, Riccati."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import integrate, linalg

from fes_pin.body.build import Body
from fes_pin.body.controllability import modal_controllability, mode_price, pbh, stabilizing_price
from fes_pin.body.inputs import Inputs
from fes_pin.body.linearize import linearize, linearize_batch
from fes_pin.body.modes import NEUTRAL_RATE
from fes_pin.body.observability import LOOK_S, NOISE_DEG, RATE_HZ, fewest_goniometers, observability
from fes_pin.data.errors import InputError
from fes_pin.muscles.nerves import Nerves


@pytest.fixture(scope="module")
def standing(body):
    return linearize(body, "mid_stance")


@settings(max_examples=10, deadline=None)
@given(st.integers(0, 10**6))
def test_pbh_is_the_rank_test(seed):
    """Modes out of reach by the table are those where [s I - F, R Q] loses rank, on inputs built to miss some modes."""
    rng = np.random.default_rng(seed)
    body = Body.from_subject(mass_kg=70.0, height_m=1.75)
    low, high = body.limits
    linear = linearize(body, low + (high - low) * rng.uniform(0.3, 0.7, 19))
    found = linear.modes()
    Q = rng.normal(size=(19, 3))
    missed = rng.choice(19, size=3, replace=False)
    Q = Q - linear.A @ found.shapes[:, missed] @ (found.shapes[:, missed].T @ Q)
    result = modal_controllability(linear, Inputs.pulling(["a", "b", "c"], Q, linear.joint_names))
    G = linear.R @ Q
    scale = np.diag(np.concatenate([np.ones(19), np.full(19, 1.0 / 30.0)]))  # balances angles and rates
    for i, value in enumerate(found.values):
        root = np.emath.sqrt(value)
        pencil = np.hstack([scale @ (root * np.eye(38) - linear.F) @ np.linalg.inv(scale), scale @ G])
        singular = np.linalg.svd(pencil, compute_uv=False)
        assert result.controllable[i] == (singular[-1] > 1e-8 * singular[0]), (i, singular[-1] / singular[0])
        assert result.controllable[i] == (i not in missed)
        assert np.isinf(result.energy[i]) == (i in missed)


def test_equal_poles_need_as_many_inputs():
    """Two equal pendulums side by side: one input on both cannot part them."""
    body = Body.from_subject(mass_kg=70.0, height_m=1.75)
    knees = linearize(body, "neutral").brace(
        [n for n in body.joint_names if n not in ("left_knee_flexion", "left_hip_flexion")]
    )
    twins = replace(knees, A=np.diag([1.0, 1.0]), B=np.diag([-4.0, -4.0]), C=np.zeros(2))
    one = modal_controllability(twins, Inputs.pulling(["a"], [[1.0], [2.0]], twins.joint_names))
    assert not one.controllable.any()
    two = modal_controllability(twins, Inputs.pulling(["a", "b"], [[1.0, 0.0], [2.0, 1.0]], twins.joint_names))
    assert two.controllable.all()


def test_pbh_with_damping_sees_the_same_hole(body, standing):
    """An input that misses a mode of the frictionless body misses it with damping in proportion to inertia."""
    mode = standing.modes()[7]
    rng = np.random.default_rng(0)
    Q = rng.normal(size=(19, 2))
    Q = Q - np.outer(standing.A @ mode.shape, mode.shape @ Q)
    damped = replace(standing, E=0.5 * standing.A)
    poles, reach = pbh(damped, Inputs.pulling(["a", "b"], Q, standing.joint_names))
    expected = -0.25 + np.sqrt(0.0625 + mode.value)
    assert reach[np.argmin(np.abs(poles - expected))] < 1e-8 * reach.max()
    assert np.sum(reach < 1e-8 * reach.max()) == 2  # its two poles and no other


@pytest.mark.parametrize("value", [40.0, 3.0, 1e-5, 0.0, -1e-5, -9.0, -400.0])
@pytest.mark.parametrize("horizon", [0.1, 0.3, 1.0])
def test_price_of_a_mode_is_its_gramians(value, horizon):
    """Least energy to bring (1, 0) to rest: [1 0] W^-1 [1 0]' of the time-reversed double integrator with mu."""
    F, g = np.array([[0.0, 1.0], [value, 0.0]]), np.array([0.0, 1.0])
    W = integrate.quad_vec(lambda t: np.outer(x := linalg.expm(-F * t) @ g, x), 0.0, horizon, epsrel=1e-11)[0]
    assert mode_price(np.array([value]), horizon)[0] == pytest.approx(np.linalg.inv(W)[0, 0], rel=2e-4)


def test_long_horizons_cost_what_catching_costs():
    values = np.array([9.0, 100.0, 1000.0])
    assert mode_price(values, 10.0) == pytest.approx(2.0 * values**1.5, rel=1e-9)


def test_stabilizing_price_is_the_riccati_solution(standing):
    """min integral u'u that brings X to rest over all time is x' P x, P the stabilizing Riccati solution without state
    cost."""
    inputs = Inputs.of(Nerves(), standing)
    result = modal_controllability(standing, inputs)
    rows = result.falling
    values, gains = result.modes.values[rows], result.gains[rows]
    scale = np.array([np.radians(1.0) / np.abs(m.shape).max() for m in result.modes.falling])
    energy, condition = stabilizing_price(values, gains, scale)
    k = len(values)
    F = np.block([[np.zeros((k, k)), np.eye(k)], [np.diag(values), np.zeros((k, k))]])
    G = np.vstack([np.zeros_like(gains), gains])
    size = 1e-9  # a little state cost picks the stabilizing solution
    P = linalg.solve_continuous_are(F, G, size * np.eye(2 * k), np.eye(inputs.n))
    assert energy == pytest.approx(np.diag(P)[:k] * scale**2, rel=1e-2)
    assert condition > 1.0


def test_influence_is_acceleration_per_input(standing):
    inputs = Inputs.of(Nerves(), standing)
    result = modal_controllability(standing, inputs)
    assert np.allclose(standing.A @ result.joint_influence, inputs.on(standing), atol=1e-9)
    back = result.modes.shapes @ result.gains  # A^-1 = sum of shape shape'
    assert np.abs(back - result.joint_influence).max() < 1e-7 * np.abs(back).max()


def test_muscles_that_only_pull_need_pulls_both_ways(body):
    whole = linearize(body, "neutral").brace([n for n in body.joint_names if n != "right_ankle_dorsiflexion"])
    plantar = Inputs.pulling(["tibial"], [[-100.0]], whole.joint_names)
    both = Inputs.pulling(["tibial", "peroneal"], [[-100.0, 40.0]], whole.joint_names)
    motor = Inputs.torques(["right_ankle_dorsiflexion"])
    one, two, three = (modal_controllability(whole, i) for i in (plantar, both, motor))
    assert one.controllable.all()
    assert not one.controls_falls
    assert two.controls_falls
    assert three.controls_falls
    assert two.energy[0] == pytest.approx(one.energy[0] / (1.0 + 0.4**2))


def test_all_nerves_reach_every_fall_of_the_stance(standing):
    result = modal_controllability(standing, Nerves())
    assert result.controls_falls
    assert "right_tibial" in str(result)
    without = modal_controllability(standing, Nerves(("left_deep_peroneal",)))
    assert not without.controls_falls


def test_influence_of_nerves_knows_biarticular_muscles(standing):
    """The paper's closing question in one row: the femoral nerve turns knee and hip, the hamstring branches both
    too."""
    torque = Inputs.of(Nerves(("right_femoral", "right_hamstrings"), strength=1.0), standing).on(standing)
    knee, hip = (standing.joint_names.index(f"right_{n}") for n in ("knee_flexion", "hip_flexion"))
    assert torque[knee, 0] < -100.0 < 10.0 < torque[hip, 0]
    assert torque[knee, 1] > 10.0 > -50.0 > torque[hip, 1]


def test_goniometers_by_brute_force(body):
    linear = linearize(body, "mid_stance").brace(["lumbar_rotation", "lumbar_bending", "lumbar_extension"])
    held = ("left_ankle_inversion", "left_ankle_rotation", "right_ankle_rotation", "left_mtp_extension")
    linear = linear.brace([*held, "right_mtp_extension", "left_hip_rotation"])
    best = fewest_goniometers(linear, within_deg=2.0)
    size = len(best[0].sensors)

    def sees(names):
        return observability(linear, names).worst_deg <= 2.0

    assert size > 1
    assert not any(sees(names) for names in itertools.combinations(linear.joint_names, size - 1))
    assert {o.sensors for o in best} == {n for n in itertools.combinations(linear.joint_names, size) if sees(n)}
    assert best[0].worst_deg <= best[-1].worst_deg <= 2.0


def test_what_a_look_leaves_in_doubt_is_what_a_regression_leaves(standing):
    """The posterior of the angles at the end, by least squares on simulated courses of the state, prior as rows."""
    sensors = ["right_knee_flexion", "right_ankle_inversion", "lumbar_bending", "right_hip_flexion", "left_hip_flexion"]
    found, n = standing.modes(), standing.n
    back = -np.arange(round(LOOK_S * RATE_HZ))[::-1] / RATE_HZ
    rows = [standing.joint_names.index(name) for name in sensors]
    rate = np.where(np.abs(found.values) > NEUTRAL_RATE**2, np.sqrt(np.abs(found.values)), 1.0)
    degree = np.radians(1.0) / np.abs(found.shapes).max(axis=0)
    falls = found.values > NEUTRAL_RATE**2
    blocks, prior = [], np.full(2 * n, 10.0)
    for t in back:  # unknowns: of falls z at the end and y at the beginning, of others angle and rate at the end
        angle, speed = np.zeros((n, n)), np.zeros((n, n))
        for i in range(n):
            if falls[i]:
                angle[i, i], speed[i, i] = 0.5 * np.exp(rate[i] * t), 0.5 * np.exp(-rate[i] * (t - back[0]))
            else:
                flow = linalg.expm(np.array([[0.0, 1.0], [found.values[i] * (abs(found.values[i]) > 1e-6), 0.0]]) * t)
                angle[i, i], speed[i, i] = flow[0, 0], flow[0, 1] * rate[i]
        blocks.append(np.degrees(found.shapes[rows] * degree) @ np.hstack([angle, speed]) / NOISE_DEG)
    prior[np.tile(falls, 2)] *= np.sqrt(2.0)
    tall = np.vstack([*blocks, np.diag(1.0 / prior)])
    r = np.linalg.qr(tall, mode="r")
    last = np.hstack([np.diag(np.where(falls, 0.5, 1.0)), np.diag(np.where(falls, 0.5 * np.exp(rate * back[0]), 0.0))])
    expected = np.linalg.norm(linalg.solve_triangular(r, last.T, trans="T"), axis=0)
    assert observability(standing, sensors).posterior_deg == pytest.approx(expected, rel=1e-5)


def test_more_goniometers_leave_less_in_doubt(standing):
    few = observability(standing, ["right_knee_flexion", "left_hip_flexion"])
    whole = observability(standing, standing.joint_names)
    assert np.all(whole.posterior_deg <= few.posterior_deg)
    assert whole.worst_deg < 0.5 < 4.0 < few.worst_deg < 15.0


def test_observability_is_controllability_of_the_transpose(body, standing):
    """An angle sensor sees a mode as a torque at its joint moves it."""
    seen = observability(standing, ["right_ankle_inversion", "left_hip_flexion"])
    moved = modal_controllability(standing, ["right_ankle_inversion", "left_hip_flexion"])
    assert np.array_equal(seen.observable, moved.controllable)
    apart = linearize(body, "neutral")
    apart = apart.brace([n for n in apart.joint_names if n not in ("left_knee_flexion", "lumbar_rotation")])
    blind = observability(apart, "lumbar_rotation")  # the long axis of the trunk and a knee know nothing of each other
    assert sorted(blind.observable) == [False, True]
    assert "NOT seen" in str(blind)


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda s: modal_controllability(s, ["knee"]), "unknown joint"),
        (lambda s: modal_controllability(s, 3), "inputs must be"),
        (lambda s: modal_controllability(s, Nerves(), horizon=0.0), "horizon"),
        (lambda s: modal_controllability(s, Nerves(), horizon="x"), "horizon"),
        (lambda s: linearize(s.body, ["a"] * 19), "joint values"),
        (lambda s: linearize(s.body, "neutral", gravity="x"), "gravity"),
        (lambda s: linearize_batch(s.body, [["a"] * 19]), "must be numbers"),
        (lambda s: Inputs.pulling(["a"], [["x"]] * 19), "must be numbers"),
        (lambda s: Inputs.torques(limit_nm="x"), "limit_nm"),
        (lambda s: fewest_goniometers(s, within_deg=0.0), "within_deg"),
        (lambda s: Inputs.torques(limit_nm=-1.0), "limit"),
        (lambda s: Inputs.pulling(["a"], np.zeros((19, 2))), "shape"),
        (lambda s: Inputs.pulling(["a", "a"], np.zeros((19, 2))), "twice"),
        (lambda s: Inputs(("a",), ("left_knee_flexion",), np.ones((1, 1)), np.ones(1), np.ones(1)), "hold 0"),
        (lambda s: Inputs.torques().select(["x"]), "unknown input"),
        (lambda s: observability(s, []), "at least one"),
        (lambda s: observability(s.brace(["lumbar_bending"]), ["lumbar_bending"]), "braced"),
        (lambda s: fewest_goniometers(s, ["lumbar_rotation"]), "do not see"),
    ],
)
def test_bad_inputs_say_so(standing, call, says):
    with pytest.raises(InputError, match=says):
        call(standing)
