"""Modes: the paper's three properties, its Jacobi iteration, and what a moved body really does."""

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import linalg

from fes_pin.body.build import Body
from fes_pin.body.linearize import linearize
from fes_pin.body.modes import kind_of
from fes_pin.body.passive import ElasticJoints

postures = st.integers(0, 10**6)


def random_body(seed):
    body = Body.from_subject(
        mass_kg=50.0 + seed % 60, height_m=1.5 + (seed % 50) / 100, stance=("left", "right")[seed % 2]
    )
    low, high = body.limits
    return body, low + (high - low) * np.random.default_rng(seed).uniform(0.25, 0.75, 19)


@settings(max_examples=15, deadline=None)
@given(postures)
def test_the_papers_three_properties(seed):
    body, q = random_body(seed)
    linear = linearize(body, q)
    found = linear.modes()
    # the pairs, and their orthogonality
    assert np.allclose(
        linear.B @ found.shapes, linear.A @ found.shapes * found.values, atol=1e-6 * np.abs(linear.B).max()
    )
    assert np.allclose(found.shapes.T @ linear.A @ found.shapes, np.eye(19), atol=1e-9)
    # 1: the 38 eigenvalues of F are the square roots of the 19
    squares = np.linalg.eigvals(linear.F) ** 2
    expected = np.repeat(found.values, 2)
    scale = np.abs(expected).max()
    assert np.allclose(np.sort(squares.real), np.sort(expected), atol=1e-7 * scale)
    assert np.abs(squares.imag).max() < 1e-6 * scale
    # 2: F's modal matrix is built from the eigenvectors of A^-1 B
    roots = np.emath.sqrt(found.values).astype(complex)
    values, columns = np.concatenate([roots, -roots]), np.hstack([found.shapes, found.shapes])
    vectors = np.vstack([columns, columns * values])
    residual = np.abs(linear.F @ vectors - vectors * values).max(axis=0)
    assert np.all(residual < 1e-8 * scale * np.abs(vectors).max(axis=0))
    # 3: A^-1 B is similar to a symmetric matrix
    root = np.real(linalg.sqrtm(linear.A))
    Q = np.linalg.solve(root, np.linalg.solve(root, linear.B).T)
    assert np.allclose(Q, Q.T, atol=1e-8 * np.abs(Q).max())
    assert np.allclose(np.sort(np.linalg.eigvalsh(0.5 * (Q + Q.T))), np.sort(found.values), atol=1e-8 * scale)


@pytest.mark.parametrize("posture", ["neutral", "mid_stance", "pre_swing"])
def test_jacobis_iteration_finds_the_same_modes(body, jacobi, posture):
    linear = linearize(body, posture)
    L = np.linalg.cholesky(linear.A)
    Q = np.linalg.solve(L, np.linalg.solve(L, linear.B).T)
    values, vectors = jacobi(0.5 * (Q + Q.T))
    order = np.argsort(-values)
    found = linear.modes()
    assert np.allclose(values[order], found.values, rtol=1e-9, atol=1e-9 * np.abs(values).max())
    shapes = np.linalg.solve(L.T, vectors[:, order])
    for i in range(19):
        if min(abs(found.values[i] - np.delete(found.values, i))) > 1e-3:  # a mode of its own
            assert abs(abs(shapes[:, i] @ linear.A @ found.shapes[:, i]) - 1.0) < 1e-6


def test_a_hanging_leg_swings_and_a_standing_body_falls(body):
    found = linearize(body, "neutral").modes()
    assert found[0].kind == "fall"
    assert "knee" in found[0].name
    swings = [m for m in found if m.kind == "swing" and next(iter(m.joints)).startswith("left_hip_flexion")]
    assert any(0.4 < m.frequency < 1.2 for m in swings)  # a leg of 0.9 m swings in one to two seconds
    # one joint alone is a pendulum: hold the rest
    leg = linearize(body, "neutral").brace([n for n in body.joint_names if n != "left_hip_flexion"])
    (mode,) = leg.modes()
    assert mode.kind == "swing"
    assert mode.frequency == pytest.approx(np.sqrt(-leg.B[0, 0] / leg.A[0, 0]) / 2 / np.pi)
    whole = linearize(body, "neutral").brace([n for n in body.joint_names if n != "right_ankle_dorsiflexion"])
    (mode,) = whole.modes()
    assert mode.kind == "fall"
    assert 2.5 < mode.rate < 3.5  # an inverted pendulum of a man: about sqrt(g / 1.2 m)
    assert mode.name.startswith("fall forward or back about the stance ankle, 0.2")
    assert mode.doubling_time == pytest.approx(np.log(2) / mode.rate)


def test_a_fall_grows_as_its_mode_says(body):
    """Balance the neutral body, push it along its slowest fall, and let Pinocchio fall: the deviation grows as cosh."""
    linear = linearize(body, "mid_stance")
    mode = linear.modes().falling[-1]
    q, v = linear.q + 1e-5 * mode.shape, np.zeros(19)
    data, torque, dt = body.model.createData(), -linear.C, 2e-4
    steps = int(0.1 / dt)

    def rate(state):
        return np.concatenate([state[19:], pin.aba(body.model, data, state[:19], state[19:], torque)])

    x = np.concatenate([q, v])
    for _ in range(steps):
        k1 = rate(x)
        k2 = rate(x + 0.5 * dt * k1)
        k3 = rate(x + 0.5 * dt * k2)
        k4 = rate(x + dt * k3)
        x = x + dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    grown = mode.shape @ linear.A @ (x[:19] - linear.q) / 1e-5
    assert grown == pytest.approx(np.cosh(mode.rate * 0.1), rel=1e-3)


def test_poles_with_damping_are_those_of_f(body):
    damped = linearize(body, "mid_stance", passive=ElasticJoints(damping_nms=dict.fromkeys(body.joint_names, 1.0)))
    found = damped.poles()
    assert np.allclose(np.sort(found.real), np.sort(np.linalg.eigvals(damped.F).real), atol=1e-6)
    assert len(found) == 38
    assert "see poles" in str(damped.modes())
    free = linearize(body, "mid_stance").poles()
    assert free[0].real == pytest.approx(linearize(body, "mid_stance").modes()[0].rate)


def test_participation_and_names(body):
    found = linearize(body, "mid_stance").modes()
    assert len({mode.name for mode in found}) == 19
    for mode in found:
        assert mode.participation.sum() == pytest.approx(1.0)
        assert np.abs(mode.one_degree).max() == pytest.approx(np.radians(1.0))
        assert mode.name.split()[0] in ("fall", "swing", "twist", "drift")
    assert str(found).count("\n") == 19
    assert [kind_of(x) for x in (1.0, -1.0, 0.0)] == ["fall", "swing", "neutral"]
