"""The bounded program: against DAQP, against its own interpreted source, warm and cold, degenerate and singular."""

import numpy as np
import pytest

from fes_pin.allocate import box
from fes_pin.allocate.box import BoxProgram, solve_sequence


def problems(count, seed, largest=12):
    rng = np.random.default_rng(seed)
    for _ in range(count):
        n, m = rng.integers(1, largest + 1), rng.integers(1, 8)
        B = rng.normal(size=(m, n)) * rng.choice([0.0, 1.0], (1, n), p=[0.1, 0.9])
        H = B.T @ B / max(1.0, (B * B).sum(0).max()) + 10.0 ** rng.uniform(-6, -2) * np.eye(n)
        lower = rng.choice([0.0, 0.2], n)
        upper = rng.choice([0.2, 0.7, 1.0], n)
        yield H, rng.normal(size=n) * rng.choice([0.0, 0.1, 1.0]), lower, upper


def natural(H, f, lower, upper, r):
    return np.abs(r - np.clip(r - (H @ r + f), lower, upper)).max()


def test_thousands_of_problems_are_solved_exactly_and_as_daqp_solves_them():
    import daqp

    for H, f, lower, upper in problems(3000, 0):
        program = BoxProgram(H)
        program.lower[:], program.upper[:] = lower, upper
        assert program.solve(f)
        assert ((lower <= program.r) & (program.r <= upper)).all()
        assert natural(H, f, lower, upper, program.r) <= 1e-12
        n = len(f)
        x, _, flag, _ = daqp.solve(H, f, np.zeros((0, n)), upper, lower, np.zeros(n, dtype=np.int32))
        assert flag == 1
        ours, theirs = (0.5 * v @ H @ v + f @ v for v in (program.r, np.clip(x, lower, upper)))
        assert ours <= theirs + 1e-13


def test_warm_start_gives_the_answer_of_a_cold_start():
    rng = np.random.default_rng(1)
    for H, _, lower, upper in problems(100, 2):
        warm = BoxProgram(H)
        for _ in range(30):
            f = rng.normal(size=len(H))
            cold = BoxProgram(H)
            for program in (warm, cold):
                program.lower[:], program.upper[:] = lower, upper
                assert program.solve(f)
            np.testing.assert_allclose(warm.r, cold.r, atol=1e-9)


def test_machine_code_equals_the_same_source_interpreted():
    for H, f, lower, upper in problems(60, 3, largest=6):
        n = len(f)
        P, status, r, g = np.empty(n * n), np.ones(n, dtype=np.int64), np.zeros(n), np.zeros(n)
        box.rebuild(n, H.ravel(), P, status)
        pivots = box.solve(n, H.ravel(), f, lower, upper, P, status, r, g, 500, 1e-12)
        program = BoxProgram(H)
        program.lower[:], program.upper[:] = lower, upper
        program.f[:] = f
        assert program.native["solve"](*program.arguments) == pivots
        np.testing.assert_allclose(program.r, r, atol=1e-13)
        np.testing.assert_array_equal(program.status, status)


def test_least_index_rule_alone_ends_at_the_solution():
    for H, f, lower, upper in problems(50, 4, largest=5):
        n = len(f)
        P, status, r, g = np.empty(n * n), np.ones(n, dtype=np.int64), np.zeros(n), np.zeros(n)
        box.rebuild(n, H.ravel(), P, status)
        for _ in range(500):  # Murty's rule by hand, with the functions of the solver
            box.respond(n, f, lower, upper, P, status, r, g)
            free = status == 0
            out = free & ((r < lower - 1e-12) | (r > upper + 1e-12) | (lower == upper))
            wrong = ~free & (lower < upper) & (np.where(status == 1, -g, g) > 1e-12)
            violated = np.flatnonzero(out | wrong)
            if not len(violated):
                break
            i = violated[0]
            status[i] = 0 if not free[i] else 1 if r[i] < lower[i] or lower[i] == upper[i] else 2
            box.pivot(n, i, P)
        assert natural(H, f, lower, upper, r) <= 1e-9


def test_giving_up_is_reported():
    H, f = np.eye(3), -np.full(3, 0.5)
    program = BoxProgram(H)
    arguments = list(program.arguments)
    arguments[-2] = 1  # one pivot, three are needed
    program.f[:] = f
    assert program.native["solve"](*arguments) == -2


@pytest.mark.parametrize("each", [False, True])
def test_sequence_equals_single_solutions(each):
    rng = np.random.default_rng(5)
    n, count = 9, 400
    base = rng.normal(size=(6, n))
    t = np.linspace(0, 3, count)[:, None]
    B = base + 0.3 * np.sin(t[:, :, None] + base) if each else np.broadcast_to(base, (count, 6, n))
    H = np.swapaxes(B, 1, 2) @ B + 1e-3 * np.eye(n)
    F = rng.normal(size=n) * np.sin(3 * t + rng.uniform(0, 6, n)) * 4
    upper = 0.6 + 0.4 * np.cos(t + np.arange(n)) ** 2
    R = solve_sequence(H if each else H[0], F, np.zeros((count, n)), upper)
    for k in range(count):
        assert natural(H[k], F[k], np.zeros(n), upper[k], R[k]) <= 1e-11


def test_sequence_keeps_rate_and_price_of_change():
    rng = np.random.default_rng(6)
    n, count, rate, keep = 5, 200, 0.05, 0.2
    B = rng.normal(size=(4, n))
    H = B.T @ B + (1e-3 + keep) * np.eye(n)
    F = 3 * rng.normal(size=(count, n))
    previous = np.full(n, 0.5)
    R = solve_sequence(H, F, np.zeros(n), np.ones(n), keep=keep, rate=rate, previous=previous)
    before = np.vstack([previous, R[:-1]])
    assert np.abs(R - before).max() <= rate + 1e-15
    for k in range(count):
        lower, upper = np.clip(before[k] - rate, 0, 1), np.clip(before[k] + rate, 0, 1)
        assert natural(H, F[k] - keep * before[k], lower, upper, R[k]) <= 1e-12


@pytest.mark.parametrize(("keep", "rate"), [(0.0, np.inf), (0.1, np.inf), (0.0, 0.1)])
def test_where_pivoting_gives_up_daqp_answers_and_the_rest_follows_from_its_answer(monkeypatch, keep, rate):
    rng = np.random.default_rng(7)
    n, count = 6, 60
    B = rng.normal(size=(4, n))
    H = B.T @ B + (1e-3 + keep) * np.eye(n)
    F = 2 * np.cumsum(rng.normal(size=(count, n)), axis=0) * 0.2
    whole = solve_sequence(H, F, np.zeros(n), np.ones(n), keep=keep, rate=rate)
    asked = []
    real = box.by_daqp
    monkeypatch.setattr(box, "by_daqp", lambda *a: asked.append(1) or real(*a))
    monkeypatch.setattr(box, "PIVOTS_PER_VARIABLE", 0)
    np.testing.assert_allclose(solve_sequence(H, F, np.zeros(n), np.ones(n), keep=keep, rate=rate), whole, atol=1e-5)
    assert 10 < len(asked) <= count
