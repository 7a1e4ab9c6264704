"""The horizon: against an exact solver, against its own simulation, limits and rates always kept, gap always true."""

import daqp
import numpy as np
import pytest

from fes_pin.data.errors import InputError
from fes_pin.stimulate.allocate import Allocator
from fes_pin.stimulate.horizon import Fatigue, Horizon, invert_lag
from fes_pin.stimulate.nerves import Nerves
from fes_pin.stimulate.polish import polish
from fes_pin.stimulate.splitting import compiled


def random_horizon(rng, steps=5, **options):
    n, m = int(rng.integers(1, 6)), int(rng.integers(1, 5))
    upper = rng.choice([0.0, 0.6, 1.0], n, p=[0.1, 0.2, 0.7])
    program = Allocator(
        rng.normal(size=(m, n)) * 40,
        upper=upper,
        weights=rng.uniform(0.1, 2, m),
        rate=rng.choice([0.1, 0.3, np.inf]),
        change=rng.choice([0.0, 1e-3, 0.1]),
    )
    horizon = Horizon(program, steps=steps, **options)
    horizon.act, horizon.before = rng.uniform(0, 1, n) * upper, rng.uniform(0, 1, n) * upper
    return horizon


def parts(horizon, wanted):
    """The program of a horizon, written down once more from its definition: H, f, rows, bounds, constant."""
    p, steps, n = horizon.program, horizon.steps, horizon.program.n
    act = horizon.act_when_pulses_act()
    effect = np.zeros((steps, n, steps * n))  # activation after step k as a linear function of all commands
    free, gain = np.zeros((steps, n)), np.zeros((n, steps * n))
    for k in range(steps):
        act, gain = horizon.keep * act, horizon.keep * gain
        gain[:, k * n : (k + 1) * n] += (1 - horizon.keep) * np.eye(n)
        free[k], effect[k] = act, gain
    matrix = p.matrix * horizon.left
    H, f, constant = np.zeros((steps * n, steps * n)), np.zeros(steps * n), 0.0
    for k in range(steps):
        A, e = matrix @ effect[k], matrix @ free[k] - wanted[k]
        H += A.T @ (p.weights[:, None] * A) / p.scale
        f += A.T @ (p.weights * e) / p.scale
        constant += 0.5 * e @ (p.weights * e) / p.scale
    step = np.kron(np.eye(steps) - np.eye(steps, k=-1), np.eye(n))
    before = np.r_[horizon.before, np.zeros((steps - 1) * n)]
    H += p.effort[0] * np.eye(steps * n) + p.change * step.T @ step
    f -= p.change * step.T @ before
    constant += 0.5 * p.change * before @ before
    rate = min(p.rate, 1.0)
    low, high = np.tile(p.lower, steps), np.tile(p.upper, steps)
    low[:n], high[:n] = (np.clip(horizon.before + s * p.rate, p.lower, p.upper) for s in (-1, 1))
    change = np.full((steps - 1) * n, rate)
    return H, f, step[n:], np.r_[low, -change], np.r_[high, change], constant


def test_plans_cost_what_the_exact_solver_finds_within_a_true_gap():
    rng, exact = np.random.default_rng(0), 0
    for _ in range(150):
        horizon = random_horizon(rng, delay_steps=int(rng.integers(0, 3)))
        wanted = rng.normal(size=(5, len(horizon.program.joints))) * 40
        plan = horizon.plan(wanted)
        H, f, rows, low, high, _ = parts(horizon, wanted)
        x, _, flag, _ = daqp.solve(H, f, rows, high, low, np.zeros(len(high), dtype=np.int32))
        assert flag == 1
        u = plan.recruitment.ravel()
        ours, best = (0.5 * v @ H @ v + f @ v for v in (u, x))
        both = np.r_[u, rows @ u]
        assert (both >= low - 1e-12).all() and (both <= high + 1e-12).all()
        assert best - 1e-6 <= ours <= best + plan.gap + 1e-6  # DAQP's own bounds are kept to 1e-6
        assert plan.gap <= 2e-2 and plan.dual <= 1e-3
        if plan.rounds:
            exact += 1
            assert plan.gap <= 1e-9 and plan.dual <= 1e-10
            np.testing.assert_allclose(u, x, atol=1e-4)
    assert exact > 75


@pytest.mark.parametrize(("solver", "gap"), [("daqp", 1e-4), ("osqp", 0.3)])
def test_other_solvers_plan_the_same_and_are_proven_alike(solver, gap):
    rng = np.random.default_rng(6)
    for _ in range(30):
        horizon = random_horizon(rng)
        wanted = rng.normal(size=(5, len(horizon.program.joints))) * 40
        theirs, ours = horizon.plan(wanted, solver=solver), horizon.plan(wanted)
        assert theirs.gap <= gap
        H, f, *_ = parts(horizon, wanted)
        first, second = (0.5 * v @ H @ v + f @ v for v in (theirs.recruitment.ravel(), ours.recruitment.ravel()))
        assert second - ours.gap - 1e-9 <= first <= second + theirs.gap + 1e-9


def test_plan_foretells_what_the_muscles_then_do():
    rng = np.random.default_rng(1)
    for delay in (0, 1, 3):
        horizon = random_horizon(rng, delay_steps=delay)
        wanted = rng.normal(size=(5, len(horizon.program.joints))) * 30
        plan = horizon.plan(wanted)
        act, queue, seen = horizon.act, list(horizon.queue) + list(plan.recruitment), []
        for command in queue:
            act = horizon.keep * act + (1 - horizon.keep) * command
            seen.append(horizon.program.matrix @ act)
        np.testing.assert_allclose(plan.achieved, seen[delay:], atol=1e-10)


def test_looking_ahead_beats_looking_at_now():
    nerves = Nerves(["left_tibial", "left_deep_peroneal", "left_femoral"])
    t = np.arange(60) / 30
    torque = np.zeros((70, 19))
    torque[:60, 4] = -60 * np.maximum(np.sin(2 * np.pi * t), 0)
    weights = {"left_ankle_dorsiflexion": 1.0, **{j: 0.0 for j in Allocator(nerves).joints if "ankle_dorsi" not in j}}
    errors = []
    for steps in (1, 10):
        horizon = Horizon(Allocator(nerves, weights=weights, effort=1e-6, rate=0.15), steps=steps)
        made = []
        for k in range(55):
            horizon.advance(torque[k : k + steps])
            made.append(horizon.torque[4])
        errors.append(np.sqrt(np.mean((np.array(made) - torque[:55, 4]) ** 2)))
    assert errors[1] < 0.8 * errors[0]


def test_a_run_keeps_limits_and_rates_and_survives_a_dying_channel():
    rng = np.random.default_rng(2)
    nerves = Nerves(["left_tibial", "left_femoral", "left_hamstrings", "left_deep_peroneal"])
    horizon = Horizon(Allocator(nerves, rate=0.1, upper=0.9), fatigue=Fatigue(2.0, 5.0, 0.1))
    before = np.zeros(4)
    for k in range(60):
        if k == 30:
            act, left = horizon.act, horizon.left
            horizon = Horizon(Allocator(nerves, rate=0.1, upper=0.9, dead=["left_tibial"]), fatigue=horizon.fatigue)
            horizon.act, horizon.left, horizon.before = act, left, before
        plan = horizon.advance(rng.normal(size=(10, 19)) * 50)
        command = plan.recruitment[0]
        if k == 30:
            assert plan.recruitment[:, 0].max() == 0.0  # a dead channel is off at once, whatever the rate
            before = np.where([True, False, False, False], 0.0, before)
        assert np.abs(command - before).max() <= 0.1 + 1e-12
        assert (command >= 0).all() and (command <= 0.9).all()
        widths = plan.pulse_width_us[(plan.pulse_width_us > 0)]
        assert ((widths >= 180) & (widths <= 1000)).all()
        before = command
    assert (horizon.left < 1.0).all() and (horizon.left[1:] < 0.95).any()


def test_polish_takes_any_guess_to_the_same_answer_or_none():
    rng, found = np.random.default_rng(3), 0
    for _ in range(100):
        horizon = random_horizon(rng)
        wanted = rng.normal(size=(5, len(horizon.program.joints))) * 40
        H, f, rows, low, high, _ = parts(horizon, wanted)
        steps, n = 5, horizon.program.n
        order = np.arange(steps * n).reshape(steps, n).T.ravel()
        guess = rng.choice([-1.0, 0.0, 1.0], (2 * steps - 1, n), p=[0.1, 0.8, 0.1])
        exact = polish(
            np.ascontiguousarray(H[np.ix_(order, order)]),
            f.reshape(steps, n),
            low.reshape(-1, n),
            high.reshape(-1, n),
            guess,
            rounds=20,
        )
        if exact is None:
            continue
        found += 1
        u, y = exact.u.ravel(), exact.y
        pull = y[:steps].ravel() + rows.T @ y[steps:].ravel()
        assert np.abs(H @ u + f + pull).max() <= 1e-10
        both = np.r_[u, rows @ u]
        assert (both >= low - 1e-10).all() and (both <= high + 1e-10).all()
        slack = np.where(y.ravel() > 0, high - both, np.where(y.ravel() < 0, both - low, 0.0))
        assert np.abs(slack[np.abs(y.ravel()) > 1e-9]).max(initial=0.0) <= 1e-10
    assert found > 60


def test_coupling_in_machine_code_is_the_kronecker_product():
    rng = np.random.default_rng(4)
    n, steps = 7, 4
    S, T, G = (
        a @ a.T for a in (rng.normal(size=(steps, steps)), rng.normal(size=(steps, steps)), rng.normal(size=(n, n)))
    )
    u, work, out = rng.normal(size=steps * n), np.empty(steps * n), np.empty(steps * n)
    compiled()["couple"](n, steps, *(a.ctypes.data for a in (S, T, G, u, work, out)))
    np.testing.assert_allclose(out, (np.kron(S, G) + np.kron(T, np.eye(n))) @ u, atol=1e-10)


def test_fatigue_is_the_solution_of_its_equation():
    fatigue = Fatigue(15.0, 30.0, 0.25)
    left, act, dt = np.array([1.0, 0.5, 0.3]), np.array([1.0, 0.4, 0.0]), 1e-4
    euler = left.copy()
    for _ in range(10_000):
        euler += dt * ((0.25 - euler) * act / 15.0 + (1 - euler) * (1 - act) / 30.0)
    np.testing.assert_allclose(fatigue.after(left, act, 1.0), euler, atol=1e-5)


def test_inverting_the_lag_gives_back_the_activation():
    rng = np.random.default_rng(5)
    keep, act, seen = np.exp(-0.02 / 0.05), np.array([0.2, 0.7]), []
    commands = rng.uniform(0, 1, (50, 2))
    for command in commands:
        act = keep * act + (1 - keep) * command
        seen.append(act)
    np.testing.assert_allclose(invert_lag(np.array(seen), 0.02, 0.05, start=[0.2, 0.7]), commands, atol=1e-12)


@pytest.mark.parametrize(
    "make",
    [
        lambda p: Horizon(p, step_s=0.0),
        lambda p: Horizon(p, steps=0),
        lambda p: Horizon(p, delay_steps=-1),
        lambda p: Horizon(Allocator(np.eye(2), least=0.2)),
        lambda p: Horizon(Allocator(np.eye(2), effort=[1e-3, 1e-2])),
        lambda p: Horizon(p).plan(np.zeros((9, 2))),
        lambda p: Horizon(p).plan(np.full((10, 2), np.nan)),
        lambda p: Horizon(p).plan(np.zeros((10, 2)), solver="abacus"),
        lambda p: Fatigue(-1.0),
    ],
)
def test_bad_input_is_one_clear_line(make):
    with pytest.raises(InputError) as caught:
        make(Allocator(np.eye(2)))
    assert "\n" not in str(caught.value)
