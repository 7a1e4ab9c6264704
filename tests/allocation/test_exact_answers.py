"""An answer does not depend on earlier calls: warm equals cold and the exact optimum, prices over 1e-8 to 1e8."""

import numpy as np
import pytest

from fes_pin.allocation.allocate import allocate
from fes_pin.allocation.allocator import Allocator
from fes_pin.allocation.bounded import solve_once
from fes_pin.allocation.certificate import Certifier
from fes_pin.allocation.horizon import Horizon
from fes_pin.data.errors import InputError
from fes_pin.muscles.nerves import Nerves
from tests.allocation.exact_fractions import optimum

SAME = 1e-12
"""Recruitments of a warm and of a cold start are the same to this: the limit within which a channel is at its limit."""
EXACT = 3e-12
"""Recruitments differ from the exact optimum by this at most, times channels over the least share of a price in its
channel's curvature (the condition of the program), and never by more than a microsecond of a pulse."""

FAR_APART = [([[9, 16, -1]], [1e6, 1e-8, 1e-8]), ([[37, 42, -1]], [1e-10, 1e4, 1e-10])]


@pytest.mark.parametrize(("matrix", "effort"), FAR_APART)
def test_an_answer_is_the_same_after_another_torque(matrix, effort):
    program = Allocator(matrix, effort=effort)
    cold = program([0.22])
    program([-40])
    warm = program([0.22])
    np.testing.assert_allclose(warm.recruitment, cold.recruitment, atol=SAME)
    p = program.problem
    exact = optimum(p.matrix, [0.22], p.prices, p.scale, p.lower, p.upper)
    np.testing.assert_allclose(warm.recruitment, exact, atol=1e-9)
    assert warm.certificate.is_optimal() and warm.pulse_width_us[2] == 0.0


@pytest.mark.parametrize(("matrix", "effort"), FAR_APART)
def test_the_cache_of_allocate_and_a_sequence_do_not_remember_either(matrix, effort):
    cold = Allocator(matrix, effort=effort)([0.22]).recruitment
    for torque in ([0.22], [-40], [0.22]):
        cached = allocate(torque, matrix, effort=effort).recruitment
    np.testing.assert_allclose(cached, cold, atol=SAME)
    together = Allocator(matrix, effort=effort).sequence([[0.22], [-40], [0.22], [-40]])
    np.testing.assert_allclose(together.recruitment[[0, 2]], [cold, cold], atol=SAME)
    np.testing.assert_allclose(together.recruitment[1], together.recruitment[3], atol=SAME)


@pytest.mark.parametrize(("matrix", "effort"), FAR_APART)
def test_a_certificate_rejects_a_wrong_limit_at_the_smallest_price(matrix, effort):
    program = Allocator(matrix, effort=effort)
    p, best = program.problem, program([0.22]).recruitment
    wrong = best.copy()
    wrong[2] = 0.999  # what the third channel takes off, the strongest of the other two makes
    helper = int(np.argmax(best))
    wrong[helper] += 0.999 / p.matrix[0, helper]
    found, *_ = program.certify(np.zeros(3), np.array([0.22]), wrong, (p.lower, p.upper))
    assert not found.is_optimal()


def asked(rng):
    """A problem of few channels: equal ones, whole numbers, weak ones, prices that are far apart."""
    n, m = int(rng.integers(1, 6)), int(rng.integers(1, 4))
    matrix = rng.normal(size=(m, n)) * 30
    matrix *= [1.0, rng.choice([0.0, 1.0], (m, n)), 10.0 ** rng.uniform(-3, 0, n)][rng.integers(3)]
    if rng.random() < 0.3:
        matrix = np.round(matrix)
    if n > 1 and rng.random() < 0.3:
        matrix[:, 0] = matrix[:, 1]
    effort = 10.0 ** rng.uniform(-8, rng.choice([0.0, 8.0]), n)
    lower, upper = rng.choice([0.0, 0.1], n, p=[0.8, 0.2]), rng.choice([0.5, 1.0], n)
    torques = rng.normal(size=(int(rng.integers(2, 5)), m)) * 10.0 ** rng.uniform(-3, 2.5)
    return matrix, {"effort": effort, "lower": lower, "upper": upper}, torques


def check(seed, count):
    """Asks random problems, warm and cold, alone and in sequence, against the exact optimum."""
    rng = np.random.default_rng(seed)
    for _ in range(count):
        matrix, options, torques = asked(rng)
        program = Allocator(matrix, **options)
        p, cold = program.problem, program(torques[0])
        for other in torques[1:]:
            program(other)
        warm = program(torques[0])
        together = program.sequence(np.vstack([torques, torques[:1]])).recruitment
        np.testing.assert_allclose(warm.recruitment, cold.recruitment, atol=SAME)
        np.testing.assert_allclose(together[[0, -1]], [cold.recruitment] * 2, atol=SAME)
        exact = optimum(p.matrix, torques[0], p.prices, p.scale, p.lower, p.upper)
        tolerance = min(EXACT * p.n / cold.certificate.flattest, 1e-3)
        np.testing.assert_allclose(warm.recruitment, exact, atol=tolerance)
        assert warm.certificate.is_optimal() and cold.certificate.is_optimal()


def test_random_problems_warm_and_cold_have_the_exact_answer():
    check(51, 1500)


@pytest.mark.long
def test_a_hundred_thousand_random_problems_warm_and_cold_have_the_exact_answer():
    check(510, 100_000)


def test_a_horizon_with_prices_far_apart_is_the_exact_optimum():
    """Without a rate its program has limits alone, as that of a torque has: the same exchange from a cold start."""
    rng = np.random.default_rng(52)
    for _ in range(150):
        matrix, options, _ = asked(rng)
        horizon = Horizon(Allocator(matrix, **options), steps=3)
        p, n = horizon.program.problem, horizon.program.n
        horizon.act = rng.uniform(0, 1, n)
        torques = rng.normal(size=(3, len(matrix))) * 10.0 ** rng.uniform(-2, 2.3)
        found = horizon.plan(torques).recruitment
        free = horizon.keep ** np.arange(1, 4)[:, None] * horizon.act
        H = np.kron(horizon.response.T @ horizon.response, p.matrix.T @ p.matrix) / p.scale + np.diag(
            np.tile(p.prices, 3)
        )
        f = horizon.response.T @ ((free @ p.matrix.T - torques) @ p.matrix) / p.scale
        best = solve_once(H, f.ravel(), np.tile(p.lower, 3), np.tile(p.upper, 3))
        tolerance = min(EXACT * 3 * n / Certifier(p).flattest, 1e-3)
        np.testing.assert_allclose(found.ravel(), best, atol=tolerance)


@pytest.mark.parametrize("start", [[368.0], {"left_femoral": 1.5}, [-0.1], [np.nan], "off", {"left_tibial": 0.1}])
def test_previous_recruitments_are_held_to_what_a_recruitment_can_be(start):
    nerves = Nerves(["left_femoral"])
    program, torque = Allocator(nerves, rate=0.1), {"left_knee_flexion": -40}
    for ask in (
        lambda: allocate(torque, nerves, previous=start, rate=0.1),
        lambda: program(torque, start),
        lambda: program.sequence(np.zeros((2, 19)), previous=start),
        lambda: setattr(program, "previous", start),
    ):
        with pytest.raises(InputError, match="previous recruitment"):
            ask()
    assert not program.previous.any()


def test_pulse_widths_given_as_the_recruitments_before_are_refused_and_recruitments_are_taken():
    nerves, torque = Nerves(), {"left_knee_flexion": -40}
    last = allocate(torque, nerves)
    with pytest.raises(InputError, match=r"left_\w+ must lie between 0 and 1 \(a recruitment, not a pulse width\)"):
        allocate(torque, nerves, previous=last.pulse_width_us, rate=0.1)
    by_name = dict(zip(last.names, last.recruitment, strict=True))
    taken, named = (allocate(torque, nerves, previous=b, rate=0.1) for b in (last.recruitment, by_name))
    np.testing.assert_array_equal(taken.recruitment, named.recruitment)
    np.testing.assert_allclose(taken.recruitment, last.recruitment, atol=SAME)


def test_without_rate_and_change_nothing_depends_on_the_recruitments_before():
    program = Allocator([[30.0, 20.0]])
    first = program([15.0], [0.0, 0.0]).recruitment
    np.testing.assert_allclose(program([15.0], [1.0, 1.0]).recruitment, first, atol=SAME)
    with_rate = Allocator([[30.0, 20.0]], rate=0.1)
    assert with_rate([15.0]).recruitment.max() == pytest.approx(0.1)
    np.testing.assert_array_equal(with_rate.previous, with_rate([15.0], [0.0, 0.0]).recruitment)
