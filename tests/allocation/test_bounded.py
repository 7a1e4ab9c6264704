"""The bounded program: optimal by its own conditions, as other solvers find it, warm and cold, singular, in threads."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
from scipy.optimize import lsq_linear

from fes_pin.allocation.bounded import BoundedProgram, solve_once


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
            first, again = (p.solve(f[None], lower, upper)[0] for p in (BoundedProgram(H), warm))
            np.testing.assert_allclose(again, first, atol=1e-8)


def test_threads_that_share_a_program_get_the_answers_of_one():
    rng = np.random.default_rng(9)
    B = rng.normal(size=(19, 30))
    H = B.T @ B / 30 + 1e-4 * np.eye(30)
    program, F = BoundedProgram(H), rng.normal(size=(4000, 30))
    alone = [solve_once(H, f, np.zeros(30), np.ones(30)) for f in F]
    lower, upper = np.zeros(30), np.ones(30)
    with ThreadPoolExecutor(8) as pool:
        together = list(pool.map(lambda f: program.solve(f[None], lower, upper)[0][0], F))
    np.testing.assert_allclose(together, alone, atol=1e-9)
