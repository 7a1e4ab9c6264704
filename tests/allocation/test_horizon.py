"""The horizon: against an exact solver, against its own simulation, limits and rates always kept, gap always true."""

from concurrent.futures import ThreadPoolExecutor

import daqp
import numpy as np
import pytest

from fes_pin.allocation.allocator import Allocator
from fes_pin.allocation.horizon import Horizon, StrengthFatigue, invert_lag
from fes_pin.data.errors import InputError
from fes_pin.muscles.nerves import Nerves


def random_horizon(rng, steps=5, **options):
    """A program with what goes wrong in practice: channels without strength, equal ones, joints that do not count."""
    n, m = int(rng.integers(1, 7)), int(rng.integers(1, 6))
    matrix = rng.normal(size=(m, n)) * 40 * rng.choice([0.0, 1.0], (m, n), p=[0.3, 0.7])
    if rng.random() < 0.3:
        matrix[:, rng.integers(n)] = 0.0
    if n > 1 and rng.random() < 0.3:
        matrix[:, 0] = matrix[:, 1]
    upper = rng.choice([0.0, 0.6, 1.0], n, p=[0.1, 0.2, 0.7])
    program = Allocator(
        matrix,
        upper=upper,
        lower=np.minimum(rng.choice([0.0, 0.1], n, p=[0.8, 0.2]), upper),
        weights=rng.choice([0.0, 0.1, 1.0, 10.0], m),
        rate=rng.choice([0.02, 0.1, 0.3, np.inf]),
        change=rng.choice([0.0, 1e-3, 0.1]),
        effort=10.0 ** rng.uniform(-6, -1, n),
    )
    horizon = Horizon(program, steps=steps, **options)
    horizon.act, horizon.before = rng.uniform(0, 1, n), rng.uniform(0, 1, n)
    return horizon


def random_torque(rng, horizon):
    return rng.normal(size=(horizon.steps, len(horizon.program.joints))) * rng.choice([0.0, 5.0, 40.0, 400.0])


def parts(horizon, wanted):
    """The program of a horizon, written down once more from its definition: H, f, rows, bounds, constant."""
    p, steps, n = horizon.program.problem, horizon.steps, horizon.program.n
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
    H += np.diag(np.tile(p.prices, steps)) + p.change * step.T @ step
    f -= p.change * step.T @ before
    constant += 0.5 * p.change * before @ before
    rate = min(p.rate, 1.0)
    low, high = np.tile(p.lower, steps), np.tile(p.upper, steps)
    low[:n], high[:n] = (np.clip(horizon.before + s * p.rate, p.lower, p.upper) for s in (-1, 1))
    change = np.full((steps - 1) * n, rate)
    return H, f, step[n:], np.r_[low, -change], np.r_[high, change], constant


def test_random_plans_are_exact_within_limits_and_rates():
    """Residuals and gap are recomputed from moment arms and limits; the next tests compare the cost with DAQP."""
    rng = np.random.default_rng(0)
    for _ in range(500):
        horizon = random_horizon(rng, int(rng.integers(1, 11)), delay_steps=int(rng.integers(0, 3)))
        wanted = random_torque(rng, horizon)
        plan = horizon.plan(wanted)
        assert plan.gap <= 1e-9 and plan.dual <= 1e-10 and plan.primal <= 1e-10
        p, u = horizon.program.problem, plan.recruitment
        low, high = horizon.limits()
        rows = np.vstack([u, np.diff(u, axis=0)])
        assert (rows >= low - 1e-12).all() and (rows <= high + 1e-12).all()
        on = plan.pulse_width_us > 0
        assert (on == (u > 0)).all()
        assert ((plan.pulse_width_us[on] >= 180) & (plan.pulse_width_us[on] <= 1000)).all()
        assert (u[:, p.upper == 0.0] == 0.0).all()


def test_plans_cost_what_the_exact_solver_finds():
    rng = np.random.default_rng(8)
    for _ in range(300):
        horizon = random_horizon(rng, delay_steps=int(rng.integers(0, 3)))
        wanted = random_torque(rng, horizon)
        plan = horizon.plan(wanted)
        H, f, rows, low, high, _ = parts(horizon, wanted)
        x, _, flag, _ = daqp.solve(H, f, rows, high, low, np.zeros(len(high), dtype=np.int32))
        assert flag == 1
        u = plan.recruitment.ravel()
        ours, best = (0.5 * v @ H @ v + f @ v for v in (u, x))
        both = np.r_[u, rows @ u]
        assert (both >= low - 1e-12).all() and (both <= high + 1e-12).all()
        size = 1.0 + np.abs(f).sum()
        assert best - 1e-6 * size <= ours <= best + 1e-6 * size  # DAQP's own bounds are kept to 1e-6


def test_torques_far_beyond_what_channels_make_are_met_at_the_limits():
    rng = np.random.default_rng(16)
    for _ in range(100):
        horizon = random_horizon(rng)
        wanted = rng.uniform(-1e4, 1e4, size=(5, len(horizon.program.joints)))
        plan = horizon.plan(wanted)
        f = parts(horizon, wanted)[1]
        assert plan.dual <= 1e-10 * max(1.0, np.abs(f).max())
        low, high = horizon.limits()
        assert ((plan.recruitment >= low[:5]) & (plan.recruitment <= high[:5])).all()


def test_a_plan_does_not_depend_on_the_plans_before_it():
    rng = np.random.default_rng(9)
    horizon = random_horizon(rng)
    wanted = random_torque(rng, horizon)
    first = horizon.plan(wanted)
    horizon.plan(random_torque(rng, horizon))
    np.testing.assert_array_equal(horizon.plan(wanted).recruitment, first.recruitment)


def test_channels_that_die_in_the_middle_of_random_runs_and_torques_that_are_refused():
    rng = np.random.default_rng(15)
    for _ in range(60):
        horizon = random_horizon(rng, 6, fatigue=StrengthFatigue(1.0, 3.0, 0.1))
        p = horizon.program.problem
        for k in range(8):
            if k == 4:
                dead = [n for n in p.names if rng.random() < 0.5]
                options = {"weights": p.weights, "effort": p.prices, "rate": p.rate, "change": p.change}
                horizon.carry_on(Allocator(p.nominal, lower=p.lower, upper=p.upper, dead=dead, **options))
                p = horizon.program.problem
            act, left, before = horizon.act, horizon.left, horizon.before
            with pytest.raises(InputError):
                horizon.advance(np.full((6, len(p.joints)), np.nan))
            assert horizon.act is act and horizon.left is left and horizon.before is before
            plan = horizon.advance(random_torque(rng, horizon))
            assert plan.gap <= 1e-9
            assert (plan.recruitment[:, p.upper == 0.0] == 0.0).all()
            moved = np.diff(np.vstack([np.clip(before, p.lower, p.upper), plan.recruitment]), axis=0)
            assert np.abs(moved).max() <= p.rate + 1e-12


def test_a_wrong_plan_has_a_gap_that_covers_what_it_loses():
    """The proof knows nothing of the solver: plans and multipliers made up."""
    rng = np.random.default_rng(10)
    for _ in range(200):
        horizon = random_horizon(rng)
        wanted = random_torque(rng, horizon)
        H, f, *_ = parts(horizon, wanted)
        low, high = horizon.limits()
        best = horizon.plan(wanted).recruitment.ravel()
        n = horizon.program.n
        u = horizon.feasible(rng.uniform(0, 1, (5, n)), low, high)
        y = rng.normal(size=(9, n)) * 0.1
        _, gap = horizon.proof(u, y, f.reshape(5, n), low, high)
        lost = (0.5 * u.ravel() @ H @ u.ravel() + f @ u.ravel()) - (0.5 * best @ H @ best + f @ best)
        assert -1e-12 <= lost <= gap + 1e-12


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
            seen.append(horizon.matrix @ act)
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
    horizon = Horizon(Allocator(nerves, rate=0.1, upper=0.9), fatigue=StrengthFatigue(2.0, 5.0, 0.1))
    before = np.zeros(4)
    for k in range(60):
        if k == 30:
            horizon.carry_on(Allocator(nerves, rate=0.1, upper=0.9, dead=["left_tibial"]))
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


def test_at_rest_nothing_is_stimulated():
    for matrix in (np.eye(4) * 30.0, np.random.default_rng(1).normal(size=(6, 9)) * 40):
        for options in ({}, {"rate": 0.1}, {"change": 1e-3}, {"rate": 0.2, "change": 1e-3}):
            plan = Horizon(Allocator(matrix, **options)).plan(np.zeros((10, len(matrix))))
            assert not plan.pulse_width_us.any()


def test_off_is_off_along_a_run():
    """Also where the rate leads down to off: 0.6 - 0.2 - 0.2 - 0.2 is no pulse at threshold."""
    rng, t = np.random.default_rng(18), np.arange(150) / 30
    matrix = rng.normal(size=(6, 12)) * 40
    torque = rng.normal(size=6) * 40 * np.sin(2 * np.pi * t[:, None] + rng.uniform(0, 6, 6))
    for options in ({"rate": 0.2, "change": 1e-3}, {"rate": 0.1}, {}):
        horizon = Horizon(Allocator(matrix, **options))
        for k in range(120):
            u = horizon.advance(torque[k : k + 10]).recruitment
            assert not ((u > 0.0) & (u < 1e-9)).any()
            assert not ((u < 1.0) & (u > 1.0 - 1e-12)).any()


@pytest.mark.parametrize("solver", ["daqp", "osqp"])
def test_off_is_off_by_other_solvers(solver):
    """Within their own rounding; 0.2 - 0.2 is off also where neither step is exactly 0.2."""
    rng = np.random.default_rng(23)
    for _ in range(10):
        horizon = Horizon(Allocator(rng.normal(size=(4, 5)) * 40, rate=0.2, change=1e-3))
        for torques in (np.zeros((10, 4)), rng.normal(size=(10, 4)) * 40):
            u = horizon.plan(torques, solver=solver).recruitment
            assert not ((u > 0.0) & (u < 1e-9)).any()
            assert torques.any() or not u.any()


def test_threads_that_share_a_horizon_get_the_plans_of_one():
    rng = np.random.default_rng(22)
    horizon = Horizon(Allocator(rng.normal(size=(6, 12)) * 40, rate=0.2, change=1e-3))
    torques = rng.normal(size=(200, 10, 6)) * 40
    alone = [horizon.plan(t).recruitment for t in torques]
    with ThreadPoolExecutor(8) as pool:
        together = list(pool.map(lambda t: horizon.plan(t).recruitment, torques))
    np.testing.assert_allclose(together, alone, atol=1e-9)


def test_fatigue_is_carried_from_pulse_to_pulse_and_the_plan_knows_it():
    """Every plan is the one of a fresh horizon whose muscles have just the strength that is left."""
    rng = np.random.default_rng(14)
    matrix, fatigue = rng.normal(size=(3, 4)) * 40, StrengthFatigue(1.0, 3.0, 0.1)
    tiring = Horizon(Allocator(matrix, rate=0.2, change=1e-3), steps=6, fatigue=fatigue)
    left = np.ones(4)
    for _ in range(40):
        wanted = rng.normal(size=(6, 3)) * 40
        fresh = Horizon(Allocator(matrix, rate=0.2, change=1e-3), steps=6)
        fresh.act, fresh.before, fresh.left = tiring.act, tiring.before, left
        fresh.carry_on(fresh.program)
        alone = fresh.plan(wanted).recruitment
        np.testing.assert_allclose(tiring.advance(wanted).recruitment, alone, atol=1e-9)
        left = fatigue.after(left, tiring.act, tiring.step_s)
        np.testing.assert_array_equal(tiring.left, left)
        np.testing.assert_allclose(tiring.torque, matrix @ (left * tiring.act), atol=1e-12)
    assert left.min() < 0.8


def test_fatigue_is_the_solution_of_its_equation():
    fatigue = StrengthFatigue(15.0, 30.0, 0.25)
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
        lambda p: Horizon(p, step_s="x"),
        lambda p: Horizon(p, step_s=float("nan")),
        lambda p: Horizon(p, time_constant_s=float("inf")),
        lambda p: Horizon(p, steps=0),
        lambda p: Horizon(p, steps=2.5),
        lambda p: Horizon(p, steps=float("nan")),
        lambda p: Horizon(p, steps="ten"),
        lambda p: Horizon(np.eye(2)),
        lambda p: Horizon(p).plan([["a", "b"]] * 10),
        lambda p: Horizon(p).plan(np.full((10, 2), 1e300)),
        lambda p: StrengthFatigue("x"),
        lambda p: Horizon(p, delay_steps=-1),
        lambda p: Horizon(Allocator(np.eye(2), least=0.2)),
        lambda p: Horizon(p).carry_on(Allocator(np.eye(3))),
        lambda p: Horizon(p).carry_on(Allocator(np.eye(2), effort_kind="cubes")),
        lambda p: Horizon(p).plan(np.zeros((9, 2))),
        lambda p: Horizon(p).plan(np.full((10, 2), np.nan)),
        lambda p: Horizon(p).plan(np.zeros((10, 2)), solver="abacus"),
        lambda p: StrengthFatigue(-1.0),
    ],
)
def test_bad_input_is_one_clear_line(make):
    with pytest.raises(InputError) as caught:
        make(Allocator(np.eye(2)))
    assert "\n" not in str(caught.value)
