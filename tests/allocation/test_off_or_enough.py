"""Off, or at least so much: against every possible choice, with the gap told truly."""

import itertools

import numpy as np
import pytest

from fes_pin.allocation.allocate import allocate
from fes_pin.allocation.allocator import Allocator
from fes_pin.allocation.bounded import solve_once
from fes_pin.allocation.off_or_enough import best_choice, cost_of, rounded_to_least
from fes_pin.muscles.nerves import Nerves


def every_choice(H, f, upper, least):
    best = np.inf
    for on in itertools.product((0, 1), repeat=len(f)):
        if (np.array(on) * least > upper).any():
            continue
        r = solve_once(H, f, np.array(on) * least, np.array(on) * upper)
        best = min(best, cost_of(H, f, r))
    return best


def problems(count, seed):
    rng = np.random.default_rng(seed)
    for _ in range(count):
        n, m = rng.integers(1, 8), rng.integers(1, 5)
        B = rng.normal(size=(m, n))
        least = rng.uniform(0, 0.7, n) * rng.choice([0.0, 1.0], n, p=[0.2, 0.8])
        yield (
            B.T @ B + 10.0 ** rng.uniform(-5, -1) * np.eye(n),
            -B.T @ rng.normal(size=m) * 2,
            rng.uniform(0.5, 1, n),
            least,
        )


def test_the_best_of_all_choices_is_found_and_proven():
    for H, f, upper, least in problems(400, 0):
        choice = best_choice(H, f, np.zeros(len(f)), upper, least, seconds=10.0)
        assert choice.gap == 0.0
        assert choice.cost == pytest.approx(every_choice(H, f, upper, least), abs=1e-10)
        assert (((choice.r == 0.0) | (choice.r >= least)) & (choice.r <= upper)).all()


def test_rounding_is_allowed_never_better_and_its_gap_is_true():
    worse = 0
    for H, f, upper, least in problems(300, 1):
        cheap, best = rounded_to_least(H, f, np.zeros(len(f)), upper, least), every_choice(H, f, upper, least)
        assert (((cheap.r == 0.0) | (cheap.r >= least - 1e-15)) & (cheap.r <= upper)).all() or (least > upper).any()
        assert best - 1e-10 <= cheap.cost <= best + cheap.gap + 1e-10
        worse += cheap.cost > best + 1e-9
    assert worse > 10  # so branching is worth something


def test_stopped_early_the_gap_is_still_true():
    """Twenty-four channels take DAQP thousands of subproblems; what it has after 0.1 ms comes with a true gap."""
    rng, stopped = np.random.default_rng(2), 0
    for _ in range(20):
        B = rng.normal(size=(12, 24))
        H, f = B.T @ B + 1e-4 * np.eye(24), -B.T @ (B @ rng.uniform(0, 0.5, 24))
        off, full, least = np.zeros(24), np.ones(24), np.full(24, 0.5)
        hasty, best = (best_choice(H, f, off, full, least, seconds=s) for s in (1e-4, 60.0))
        assert best.gap == 0.0
        assert best.cost - 1e-9 <= hasty.cost <= best.cost + hasty.gap + 1e-9
        assert ((hasty.r == 0.0) | (hasty.r >= 0.5)).all()
        stopped += hasty.gap > 0.0
    assert stopped > 10


def test_allocation_with_least_recruitments():
    rng = np.random.default_rng(3)
    nerves = Nerves([n for n in Nerves().names if n.startswith("left_")][:12])
    program, free = Allocator(nerves, least=0.3), Allocator(nerves)
    for _ in range(30):
        torque = nerves.torque_matrix() @ (rng.uniform(0, 0.5, 12) * rng.choice([0, 1], 12)) + rng.normal(size=19) * 5
        a = program(torque)
        assert a.gap == 0.0 and a.certificate.is_optimal(1e-11)
        assert ((a.recruitment == 0.0) | (a.recruitment >= 0.3)).all()
        assert a.certificate.cost >= free(torque).certificate.cost - 1e-12


def test_rounded_allocation_is_allowed_and_its_gap_covers_the_best():
    rng = np.random.default_rng(4)
    nerves = Nerves([n for n in Nerves().names if n.startswith("left_")][:12])
    best, cheap, hasty = (Allocator(nerves, least=0.3, **o) for o in ({}, {"rounding": True}, {"seconds": 1e-6}))
    gaps = []
    for _ in range(30):
        torque = nerves.torque_matrix() @ (rng.uniform(0, 0.5, 12) * rng.choice([0, 1], 12)) + rng.normal(size=19) * 5
        cost = best(torque).certificate.cost
        for program in (cheap, hasty):
            a = program(torque)
            assert ((a.recruitment == 0.0) | (a.recruitment >= 0.3)).all()
            assert cost - 1e-12 <= a.certificate.cost <= cost + a.gap + 1e-12
            gaps.append(a.gap)
    assert max(gaps) > 0.0


def test_a_small_torque_is_off_rather_than_too_much_and_says_so():
    a = allocate({"left_knee_flexion": -7.0}, Nerves(["left_femoral"]), least=0.3)
    assert a.recruitment[0] == 0.0
    assert "left femoral off: its least recruitment would be too much" in a.reasons[0]


def test_with_a_rate_limit_a_channel_may_jump_between_off_and_its_least():
    program = Allocator(Nerves(["left_femoral"]), least=0.3, rate=0.1)
    torque = {"left_knee_flexion": -250.0}
    values = [program(torque).recruitment[0] for _ in range(4)]
    np.testing.assert_allclose(values, [0.3, 0.4, 0.5, 0.6], atol=1e-12)
    values = [program({}).recruitment[0] for _ in range(5)]
    np.testing.assert_allclose(values, [0.5, 0.4, 0.3, 0.0, 0.0], atol=1e-12)
