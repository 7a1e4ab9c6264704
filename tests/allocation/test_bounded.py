"""The bounded program: optimal by its own conditions, as other solvers find it, warm and cold, singular, in threads."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from fes_pin.allocation.bounded import BoundedProgram, solve_once, solve_sequence


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


def test_thousands_of_problems_are_solved_exactly():
    for H, f, lower, upper in problems(3000, 0):
        r = solve_once(H, f, lower, upper)
        assert ((lower <= r) & (r <= upper)).all()
        assert natural(H, f, lower, upper, r) <= 1e-11


def test_another_method_finds_no_better_answer():
    for H, f, lower, upper in problems(200, 8):
        if (lower == upper).any():
            continue
        root = np.linalg.cholesky(H)
        other = lsq_linear(root.T, -np.linalg.solve(root, f), (lower, upper), method="bvls").x
        r = solve_once(H, f, lower, upper)
        ours, theirs = (0.5 * v @ H @ v + f @ v for v in (r, other))
        assert ours <= theirs + 1e-12


def test_warm_start_gives_the_answer_of_a_cold_start():
    rng = np.random.default_rng(1)
    for H, _, lower, upper in problems(100, 2):
        warm = BoundedProgram(H)
        for _ in range(30):
            f = rng.normal(size=len(H))
            np.testing.assert_allclose(warm.solve(f, lower, upper), BoundedProgram(H).solve(f, lower, upper), atol=1e-8)


def test_threads_that_share_a_program_get_the_answers_of_one():
    rng = np.random.default_rng(9)
    B = rng.normal(size=(19, 30))
    H = B.T @ B / 30 + 1e-4 * np.eye(30)
    program, F = BoundedProgram(H), rng.normal(size=(4000, 30))
    alone = [solve_once(H, f, np.zeros(30), np.ones(30)) for f in F]
    lower, upper = np.zeros(30), np.ones(30)
    with ThreadPoolExecutor(8) as pool:
        together = list(pool.map(lambda f: program.solve(f, lower, upper), F))
    np.testing.assert_allclose(together, alone, atol=1e-9)


@pytest.mark.parametrize("each", [False, True])
def test_sequence_equals_single_solutions(each):
    rng = np.random.default_rng(5)
    n, count = 9, 400
    base = rng.normal(size=(6, n))
    t = np.linspace(0, 3, count)[:, None]
    B = base + 0.3 * np.sin(t[:, :, None] + base) if each else np.broadcast_to(base, (count, 6, n))
    H = np.swapaxes(B, 1, 2) @ B + 1e-3 * np.eye(n)
    F = rng.normal(size=n) * np.sin(3 * t + rng.uniform(0, 6, n)) * 4
    upper = rng.uniform(0.3, 1.0, n)
    R = solve_sequence(H if each else H[0], F, np.zeros(n), upper)
    for k in range(count):
        assert natural(H[k], F[k], np.zeros(n), upper, R[k]) <= 1e-11


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
        assert natural(H, F[k] - keep * before[k], lower, upper, R[k]) <= 1e-11
