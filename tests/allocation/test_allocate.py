"""Allocation: optimal by an independent certificate, always within limits, and it says why a torque cannot be had."""

import itertools
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from fes_pin.allocation import certificate
from fes_pin.allocation.allocate import allocate
from fes_pin.allocation.allocator import Allocator
from fes_pin.allocation.bounded import solve_once
from fes_pin.allocation.certificate import Certificate
from fes_pin.body.joints import JOINT_NAMES
from fes_pin.data.errors import InputError
from fes_pin.muscles.nerves import Nerves
from fes_pin.muscles.recruitment import LinearRecruitment, SigmoidRecruitment

LEFT = Nerves([n for n in Nerves().names if n.startswith("left_")])


def random_problem(rng):
    n, m = rng.integers(1, 10), rng.integers(1, 8)
    matrix = rng.normal(size=(m, n)) * 50 * rng.choice([0.0, 1.0], (m, n), p=[0.4, 0.6])
    if rng.random() < 0.2:
        matrix[:, rng.integers(n)] = 0.0  # a muscle without strength
    if n > 1 and rng.random() < 0.2:
        matrix[:, 0] = matrix[:, 1]  # a singular matrix
    weights = rng.choice([0.0, 0.3, 1.0, 10.0], m)
    upper = rng.choice([0.0, 0.5, 1.0], n, p=[0.1, 0.2, 0.7])
    lower = np.minimum(rng.choice([0.0, 0.1], n, p=[0.8, 0.2]), upper)
    options = {"weights": weights, "upper": upper, "lower": lower, "effort": 10.0 ** rng.uniform(-6, -1)}
    return matrix, rng.normal(size=m) * rng.choice([0.0, 5.0, 100.0]), options


def within_limits(a, curve):
    widths = np.asarray(a.pulse_width_us)
    on = widths > 0.0
    assert ((widths == 0.0) | ((widths >= curve.threshold_us) & (widths <= curve.saturation_us))).all()
    assert (on == (a.recruitment > 0.0)).all()


def test_two_thousand_random_problems_are_optimal_and_within_threshold_and_saturation():
    rng, curve = np.random.default_rng(0), SigmoidRecruitment(150.0, 400.0)
    for _ in range(2000):
        matrix, torque, options = random_problem(rng)
        a = Allocator(matrix, recruitment=curve, **options)(torque)
        assert a.certificate.is_optimal(1e-11) and a.certificate.gap <= 1e-10
        assert ((options["lower"] <= a.recruitment) & (a.recruitment <= options["upper"])).all()
        within_limits(a, curve)
        np.testing.assert_allclose(a.achieved, matrix @ a.recruitment, atol=1e-9)
    assert "optimal to" in str(a)


def test_two_thousand_random_problems_cost_what_a_reference_solver_finds():
    """DAQP on the program written out from its definition, without any code of the allocator."""
    import daqp

    rng = np.random.default_rng(11)
    for _ in range(2000):
        matrix, torque, options = random_problem(rng)
        a = Allocator(matrix, **options)(torque)
        n, weights = matrix.shape[1], options["weights"]
        alive = np.where(options["upper"] > 0.0, matrix, 0.0)
        squares = alive.T @ (weights[:, None] * alive)
        scale = squares.diagonal().max() or 1.0
        H, f = squares / scale + options["effort"] * np.eye(n), -(torque * weights) @ alive / scale
        none = np.zeros((0, n))
        x, _, flag, _ = daqp.solve(H, f, none, options["upper"], options["lower"], np.zeros(n, dtype=np.int32))
        assert flag == 1
        allowed = np.clip(x, options["lower"], options["upper"])  # DAQP keeps limits to 1e-6
        ours, theirs, least = (0.5 * v @ H @ v + f @ v for v in (a.recruitment, allowed, x))
        assert least - 1e-6 * (1.0 + np.abs(f).sum()) <= ours <= theirs + 1e-12


def test_channels_that_die_in_the_middle_of_random_runs():
    """Rate limit and price of change carry on from what was in force; the dead are off at once and stay off."""
    rng, curve = np.random.default_rng(12), LinearRecruitment()
    for _ in range(150):
        matrix, _, options = random_problem(rng)
        options.update(rate=rng.choice([0.05, 0.3, np.inf]), change=rng.choice([0.0, 1e-2]))
        before, program = np.zeros(matrix.shape[1]), Allocator(matrix, **options)
        dead: list[str] = []
        for k in range(12):
            if k == 6:
                dead = [n for n in program.names if rng.random() < 0.4]
                program = Allocator(matrix, dead=dead, **options)
            a = program(rng.normal(size=len(matrix)) * 60, before)
            off = np.isin(program.names, dead)
            assert (a.recruitment[off] == 0.0).all() and (a.pulse_width_us[off] == 0.0).all()
            moved = np.abs(a.recruitment - np.clip(before, program.problem.lower, program.problem.upper))
            assert (moved <= options["rate"] + 1e-12).all()
            assert a.certificate.is_optimal(1e-11)
            within_limits(a, curve)
            before = a.recruitment


def test_a_refused_torque_leaves_the_run_as_it_was():
    torque, again = {"left_knee_flexion": -60.0}, Allocator(LEFT, rate=0.05)
    program = Allocator(LEFT, rate=0.05)
    for _ in range(3):
        program(torque)
        again(torque)
        with pytest.raises(InputError, match="finite"):
            program({"left_knee_flexion": float("nan")})
        with pytest.raises(InputError, match="solver"):
            program(torque, solver="abacus")
    np.testing.assert_array_equal(program(torque).recruitment, again(torque).recruitment)


@pytest.mark.parametrize("solver", ["daqp", "osqp"])
def test_other_solvers_give_the_same_allocation_and_cost_no_less(solver):
    rng = np.random.default_rng(1)
    for _ in range(100):
        matrix, torque, options = random_problem(rng)
        program = Allocator(matrix, **options)
        ours, theirs = program(torque), program(torque, solver=solver)
        assert ours.certificate.cost <= theirs.certificate.cost + 1e-12
        assert theirs.certificate.cost <= ours.certificate.cost + 1e-3 * (1 + abs(ours.certificate.cost))


@pytest.mark.parametrize("kind", ["squares", "cubes"])
def test_gradient_is_the_slope_of_the_cost_and_a_wrong_answer_is_rejected(kind):
    rng = np.random.default_rng(2)
    matrix, weights, prices = rng.normal(size=(6, 5)) * 30, rng.uniform(0.1, 2, 6), rng.uniform(1e-4, 1, 5)
    program = Allocator(matrix, weights=weights, effort=prices, effort_kind=kind, change=0.3)
    certify, step = program.certify, 1e-5
    for _ in range(50):
        before, r, wanted = rng.uniform(0, 1, 5), rng.uniform(0.1, 0.9, 5), rng.normal(size=6) * 40
        proof, achieved, gradient = certify(before, wanted, r, (np.zeros(5), np.ones(5)))
        np.testing.assert_allclose(achieved, matrix @ r, atol=1e-11)
        error = matrix @ r - wanted
        effort = (prices * (r**3 / 3 if kind == "cubes" else r**2 / 2)).sum() + 0.15 * ((r - before) ** 2).sum()
        assert proof.cost == pytest.approx(0.5 * (weights * error**2).sum() / proof.scale + effort)
        costs = [
            [certify(before, wanted, r + s * step * e, (np.zeros(5), np.ones(5)))[0].cost for s in (1, -1)]
            for e in np.eye(5)
        ]
        np.testing.assert_allclose(gradient, [(up - down) / (2 * step) for up, down in costs], atol=1e-6)
        assert not proof.is_optimal()


def test_certified_gap_bounds_what_any_other_choice_could_save():
    rng = np.random.default_rng(3)
    for _ in range(200):
        matrix, torque, options = random_problem(rng)
        program = Allocator(matrix, **options)
        best = program(torque).certificate.cost
        r = rng.uniform(program.problem.lower, program.problem.upper)
        other = program.result(r, torque, (program.problem.lower, program.problem.upper), r)
        assert other.certificate.cost - other.certificate.gap <= best + 1e-12
        assert other.certificate.cost >= best - 1e-12


def test_certificate_takes_nothing_from_the_solver():
    text = Path(certificate.__file__).read_text()
    assert "allocate.bounded" not in text and "allocate.allocat" not in text and "qp" not in text


def test_sequence_equals_single_allocations_and_certifies_itself():
    rng = np.random.default_rng(4)
    t = np.linspace(0, 2, 300)[:, None]
    torque = 60 * rng.normal(size=19) * np.sin(2 * np.pi * t + rng.uniform(0, 6, 19))
    for options in (
        {},
        {"change": 0.05},
        {"rate": 0.02},
        {"rate": 0.05, "change": 0.01, "upper": {"left_tibial": 0.5}},
    ):
        together = Allocator(LEFT, **options).sequence(torque)
        assert together.residual.max() <= 1e-11
        single = Allocator(LEFT, **options)
        for k in range(0, 300):
            a = single(torque[k])
            np.testing.assert_allclose(a.recruitment, together.recruitment[k], atol=1e-8)
            assert a.certificate.is_optimal(1e-11)


def test_words_name_the_saturated_nerve():
    a = allocate({"left_ankle_dorsiflexion": -400.0}, Nerves(["left_tibial", "right_femoral"]))
    assert a.reasons[0].startswith("left ankle dorsiflexion") and a.reasons[0].endswith("left tibial saturated")
    short = -400.0 - a.achieved[JOINT_NAMES.index("left_ankle_dorsiflexion")]
    assert f"{abs(short):.1f} N m short" in a.reasons[0]
    assert a.active == {"left_tibial": "saturated", "right_femoral": "off"}
    assert a.multipliers["left_tibial"] > 0.0
    assert a.pulse_widths_us == {"left_tibial": 1000.0, "right_femoral": 0.0}


@pytest.mark.parametrize(
    ("torque", "nerves", "options", "words"),
    [
        ({"left_hip_rotation": 5.0}, ["left_tibial"], {}, "no stimulated nerve turns it"),
        ({"left_knee_flexion": 30.0}, ["left_femoral"], {}, "no stimulated nerve pulls that way"),
        ({"left_knee_flexion": -30.0}, ["left_femoral"], {"dead": "left_femoral"}, "left femoral dead"),
        ({"left_knee_flexion": -300.0}, ["left_femoral"], {"upper": 0.4}, "left femoral limited"),
        ({"left_knee_flexion": -200.0}, ["left_femoral"], {"rate": 0.1}, "left femoral rising"),
        (
            {"left_knee_flexion": -100.0},
            ["left_femoral"],
            {"weights": {"left_hip_flexion": 10.0}},
            "would spoil left hip",
        ),
        ({"left_knee_flexion": -100.0}, ["left_femoral"], {"effort": 1.0}, "not worth its effort"),
    ],
)
def test_words_for_every_kind_of_reason(torque, nerves, options, words):
    a = allocate(torque, Nerves(nerves), **options)
    joint = next(iter(torque)).replace("_", " ")
    assert any(reason.startswith(joint) and words in reason for reason in a.reasons), a.reasons


def test_a_met_torque_has_no_complaints():
    nerves = Nerves(["left_tibial", "left_femoral", "right_obturator"])
    a = allocate(nerves.torque_matrix() @ [0.3, 0.5, 0.0], nerves, effort=1e-8)
    assert a.reasons == [] and "every torque within 0.5 N m" in str(a)


def test_an_answer_says_what_is_achieved_and_what_is_assumed():
    a = allocate({"left_knee_flexion": -30.0}, Nerves(strength=0.5), {"left_knee_flexion": np.deg2rad(20.0)})
    assert f"achieved: left knee flexion {a.achieved[a.joints.index('left_knee_flexion')]:.1f} of -30.0 N m" in str(a)
    assumed = a.as_dict()["assumed"]
    assert assumed in str(a) and "0.5 of a healthy adult's strength (as given" in assumed
    assert assumed.endswith("posture in degrees: left_knee_flexion 20, else 0")
    assert Nerves().assumed().endswith("0.7), neutral posture")


def test_a_channel_that_dies_is_replaced_as_far_as_it_can_be():
    torque = {"left_knee_flexion": 25.0, "left_hip_flexion": -35.0}
    whole, without = allocate(torque, LEFT), allocate(torque, LEFT, dead=["left_hamstrings"])
    assert without.pulse_widths_us["left_hamstrings"] == 0.0
    assert without.certificate.is_optimal(1e-11) and without.certificate.cost > whole.certificate.cost
    assert any("left hamstrings dead" in reason for reason in without.reasons)
    assert (
        without.recruitment[LEFT.names.index("left_biceps_short_head")]
        > whole.recruitment[LEFT.names.index("left_biceps_short_head")]
    )


def test_dead_limb_gives_zero_pulses_and_no_error():
    a = allocate({"left_knee_flexion": -50.0}, Nerves(["left_femoral"], strength=0.0))
    assert a.pulse_width_us.tolist() == [0.0] and "left femoral without strength" in a.reasons[0]


def test_redundant_muscles_share_as_arm_under_squares_and_as_its_root_under_cubes():
    for arms in ([40.0, 10.0], [30.0, 20.0, 5.0]):
        squares = allocate([15.0], [arms]).recruitment
        cubes = allocate([15.0], [arms], effort_kind="cubes")
        assert cubes.certificate.is_optimal(1e-10) and cubes.note == ""
        np.testing.assert_allclose(squares / squares[0], np.array(arms) / arms[0], rtol=1e-9)
        np.testing.assert_allclose(
            cubes.recruitment / cubes.recruitment[0], np.sqrt(np.array(arms) / arms[0]), rtol=1e-6
        )


def test_cubes_on_random_problems_are_optimal():
    rng = np.random.default_rng(7)
    for _ in range(150):
        matrix, torque, options = random_problem(rng)
        a = allocate(torque, matrix, effort_kind="cubes", **options)
        assert a.certificate.is_optimal(1e-10) and a.note == ""


def test_lexicographic_reaches_the_least_error_then_the_least_effort():
    rng = np.random.default_rng(5)
    muscles = Nerves.muscles("left_tibial", "left_femoral", "left_hamstrings")
    for _ in range(10):
        torque = muscles.torque_matrix() @ rng.uniform(0, 0.6, muscles.n) + rng.normal(size=19)
        squares = allocate(torque, muscles)
        lexicographic = allocate(torque, muscles, lexicographic=True)
        assert lexicographic.certificate.is_optimal(1e-11)  # of the error alone
        error = [float(((a.shortfall) ** 2).sum()) for a in (lexicographic, squares)]
        assert error[0] <= error[1]
        # no other choice with the same error costs less: move along the null space of the matrix
        null = np.linalg.svd(muscles.torque_matrix())[2][np.linalg.matrix_rank(muscles.torque_matrix()) :]
        for direction in np.vstack([null, -null]):
            other = lexicographic.recruitment + 1e-3 * direction
            if (other >= 0).all() and (other <= 1).all():
                assert (other**2).sum() >= (lexicographic.recruitment**2).sum() - 1e-8


def test_fatigue_moves_the_load_to_fresh_channels():
    names = ["left_hamstrings", "left_biceps_short_head"]
    torque = {"left_knee_flexion": 8.0}
    weights = {j: float(j == "left_knee_flexion") for j in JOINT_NAMES}
    tired = Nerves(names).tired(left_hamstrings=0.3)
    plain = allocate(torque, tired, weights=weights)
    spared = allocate(torque, tired, weights=weights, effort_kind="fatigue")
    assert spared.recruitment[0] < plain.recruitment[0] and spared.recruitment[1] > plain.recruitment[1]


def test_one_joint_rig_is_a_matrix_of_one_number():
    a = allocate([1.02], [[0.034 * 60.0]], recruitment=LinearRecruitment(180.0, 1000.0), effort=1e-9)
    assert a.pulse_width_us[0] == pytest.approx(180.0 + 0.5 * 820.0, abs=1e-3)


def test_allocate_again_is_warm_but_forgets_the_recruitments_before():
    options = {"rate": 0.1}
    first = allocate({"left_knee_flexion": -200.0}, Nerves(["left_femoral"]), **options)
    again = allocate({"left_knee_flexion": -200.0}, Nerves(["left_femoral"]), **options)
    np.testing.assert_array_equal(first.recruitment, again.recruitment)
    carried = allocate({"left_knee_flexion": -200.0}, Nerves(["left_femoral"]), previous=first.recruitment, **options)
    assert carried.recruitment[0] == pytest.approx(0.2)


def test_a_certificate_that_overflowed_is_not_optimal():
    for broken in ((np.nan, 0.0, 0.0, 0.0, 0.0), (0.0, 0.0, np.nan, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0, np.nan)):
        assert not Certificate(*broken, 1.0).is_optimal()
    assert not Certificate(0.0, 0.0, 0.0, np.inf, 0.0, 1.0).is_optimal()
    assert Certificate(0.0, 0.0, 0.0, 0.0, 1.0, 1.0).is_optimal()


def test_the_largest_numbers_that_are_allowed_do_not_overflow():
    rng = np.random.default_rng(21)
    for size, weight, effort in itertools.product((1e-6, 1e4), (1e-6, 1e6), (1e-10, 1e6)):
        matrix = rng.uniform(-1, 1, (4, 6))
        matrix *= size / np.abs(matrix).max()
        a = allocate(rng.uniform(-1e4, 1e4, 4), matrix, weights=weight, effort=effort)
        assert np.isfinite(a.certificate.cost) and a.certificate.dual <= 1e-9


def test_lexicographic_costs_what_a_reference_solver_finds():
    """Effort and change at equal torque, by a penalty W on torque d away from ours.

    No choice of our torque costs less than the penalised one and 2 W d^2: its slope is W d, and the cost is convex. The
    best costs more than that only in second order: a hundredth of 2 W d^2 is allowed.
    """
    rng = np.random.default_rng(24)
    for _ in range(200):
        matrix, torque, options = random_problem(rng)
        change, before = rng.choice([0.0, 1e-3, 0.1]), rng.uniform(0, 1, matrix.shape[1])
        a = Allocator(matrix, lexicographic=True, change=change, **options)(torque, before)
        assert a.certificate.is_optimal(1e-10) and float(a.note.split()[-1]) <= 1e-9
        p = a.problem
        total, target = (p.prices + change) / (p.prices + change).max(), change * before / (p.prices + change)
        rows = np.sqrt(p.weights)[:, None] * p.matrix / np.sqrt(p.scale)
        pressed = np.abs(a.gradient) > 1e-9
        low, high = np.where(pressed, a.recruitment, p.lower), np.where(pressed, a.recruitment, p.upper)
        H = np.diag(total) + 1e7 * rows.T @ rows
        other = solve_once(H, -total * target - 1e7 * rows.T @ (rows @ a.recruitment), low, high)
        paid = [float((total * (r - target) ** 2).sum()) for r in (a.recruitment, other)]
        moved = ((rows @ (other - a.recruitment)) ** 2).sum()
        assert paid[0] <= paid[1] + 1.01 * 2e7 * moved + 1e-6


def test_lexicographic_with_a_price_of_change_stays_where_it_is():
    """The same torque asked again moves nothing: change is paid for only after the torque."""
    muscles = Nerves.muscles("left_tibial", "left_femoral", "left_hamstrings")
    program = Allocator(muscles, lexicographic=True, change=0.1)
    rng = np.random.default_rng(6)
    for _ in range(20):
        torque = muscles.torque_matrix() @ rng.uniform(0, 0.6, muscles.n) + rng.normal(size=19) * 5
        free = Allocator(muscles, lexicographic=True)(torque)
        first = program(torque, np.zeros(muscles.n))
        again = program(torque, first.recruitment)
        assert all(float(a.note.split()[-1]) <= 1e-9 for a in (free, first, again))  # how well both stages are met
        error = [(a.shortfall**2).sum() for a in (free, first, again)]
        np.testing.assert_allclose(error, error[0], atol=1e-7)
        for a, before in ((first, np.zeros(muscles.n)), (again, first.recruitment)):
            assert a.certificate.is_optimal(1e-10)
            paid = [1e-4 * (r**2).sum() + 0.1 * ((r - before) ** 2).sum() for r in (a.recruitment, free.recruitment)]
            assert paid[0] <= paid[1] + 1e-9
        moved = [np.abs(a.recruitment - b.recruitment).max() for a, b in ((again, first), (first, free))]
        assert moved[0] <= 0.01  # of effort's price, 1e-4 beside 0.1: a thousandth a call


@pytest.mark.parametrize(
    ("options", "solver"),
    [
        ({}, "daqp"),
        ({"effort_kind": "cubes"}, "daqp"),
        ({"lexicographic": True}, "daqp"),
        ({"least": 0.2}, "daqp"),
        ({"change": 0.01, "rate": 0.1}, "daqp"),
        ({}, "osqp"),
    ],
)
def test_off_is_off_and_not_a_pulse_at_threshold(options, solver):
    rng = np.random.default_rng(19)
    for _ in range(300):
        matrix, torque, others = random_problem(rng)
        program = Allocator(matrix, **{**others, **options})
        for k in range(3):
            r = program(torque if k == 1 else 0.0 * torque, solver=solver).recruitment
            assert not ((r > 0.0) & (r < 1e-9)).any()
            at_rest = k != 1 and "change" not in options and not others["lower"].any()
            assert not at_rest or not r.any()
            assert not ((r < others["upper"]) & (r > others["upper"] - 1e-12)).any()


def test_a_price_of_change_fades_to_off_and_not_for_ever_towards_it():
    """Each sample is a part of the one before: what the certificate cannot tell from off ends it."""
    torque = np.vstack([np.full((20, 19), 5.0), np.zeros((400, 19))])
    together = Allocator(LEFT, change=1e-3).sequence(torque)
    assert together.recruitment[19].any() and not together.pulse_width_us[-1].any()
    assert together.residual.max() <= 1e-11


def test_dust_beside_an_optimum_is_swept_off_and_work_is_not():
    """What the certificate cannot tell from off is off; what it can, stays."""
    program = Allocator(np.diag([50.0, 40.0, 30.0]))
    limits = program.problem.lower, program.problem.upper
    wanted, before = np.array([20.0, 0.0, 0.0]), np.zeros(3)
    best = program(wanted).recruitment
    assert best[1] == best[2] == 0.0
    dusty = program.certify.at_limits(before, wanted, best + np.array([0.0, 1e-17, 1e-15]), limits)
    np.testing.assert_array_equal(dusty, best)
    working = best + np.array([0.0, 1e-6, 0.0])
    np.testing.assert_array_equal(program.certify.at_limits(before, wanted, working, limits), working)


@pytest.mark.parametrize("shared", [True, False])
def test_threads_get_the_answers_of_one(shared):
    """Eight threads, each with torques of its own, over few matrices: through `allocate` and through one program."""
    rng = np.random.default_rng(20)
    cases = []
    for k in range(1200):
        matrix = np.random.default_rng(k % 3).normal(size=(19, 30)) * 50
        cases.append((matrix, rng.normal(size=19) * 60, {"effort_kind": "cubes"} if k % 40 == 0 and not shared else {}))
    program = Allocator(cases[0][0])

    def solve(case):
        matrix, torque, options = case
        return program(torque, np.zeros(30)) if shared else allocate(torque, matrix, **options)

    alone = [solve(case) for case in cases]
    with ThreadPoolExecutor(8) as pool:
        together = list(pool.map(solve, cases))
    for a, b in zip(alone, together, strict=True):
        np.testing.assert_allclose(a.recruitment, b.recruitment, atol=1e-8)
        assert b.certificate.is_optimal()


@pytest.mark.parametrize(
    "make",
    [
        lambda: allocate("left_knee_flexion=-40", LEFT),
        lambda: allocate({"left_knee_flexion": "much"}, LEFT),
        lambda: allocate({"left_knee_flexion": 1e300}, LEFT),
        lambda: allocate({}, LEFT, change="a"),
        lambda: allocate({}, LEFT, change=1e300),
        lambda: allocate({}, LEFT, rate="x"),
        lambda: allocate({}, LEFT, rate=float("nan")),
        lambda: allocate({}, LEFT, rate=[0.1, 0.2]),
        lambda: allocate({}, LEFT, seconds=float("nan")),
        lambda: allocate({}, LEFT, nodes=float("nan")),
        lambda: allocate({}, LEFT, weights=1e300),
        lambda: allocate({}, LEFT, weights=1e-300),
        lambda: allocate({}, LEFT, effort=1e300),
        lambda: allocate({}, LEFT, effort=[[1.0], [1.0, 2.0]]),
        lambda: allocate({}, LEFT, dead=3),
        lambda: allocate({}, LEFT, dead={"left_toe"}),
        lambda: allocate({}, LEFT, previous="off"),
        lambda: allocate({}, LEFT, solver=7),
        lambda: allocate({}, LEFT, solver="abacus", least=0.2),
        lambda: allocate({}, LEFT, solver="abacus", lexicographic=True),
        lambda: allocate({}, LEFT, solver="osqp", effort_kind="cubes"),
        lambda: allocate({}, LEFT, effort_kind=["squares"]),
        lambda: allocate({}, LEFT, effort_kind="cubes", lexicographic=True),
        lambda: allocate({}, LEFT, recruitment="steep"),
        lambda: allocate({}, LEFT, recruitment=LinearRecruitment(np.array([150.0, 180.0]), 1000.0)),
        lambda: allocate({}, LEFT, recruitment=[LinearRecruitment(np.array([150.0, 180.0]), 1000.0)] * LEFT.n),
        lambda: allocate([1.0], [["strong"]]),
        lambda: allocate([1.0], [[1.0], [1.0, 2.0]]),
        lambda: allocate([1.0], [[1e160]]),
        lambda: allocate([1.0], [[1e-160]]),
        lambda: allocate({}, Nerves(["left_femoral"], strength=1e300)),
        lambda: Allocator(LEFT).sequence([["a"] * 19]),
        lambda: Allocator(LEFT).sequence(np.full((3, 19), 1e300)),
        lambda: allocate({"left_knee_flexion": float("nan")}, LEFT),
        lambda: allocate({"left_kneee": 1.0}, LEFT),
        lambda: allocate(np.zeros(5), LEFT),
        lambda: allocate({}, LEFT, weights={"left_knee_flexion": -1.0}),
        lambda: allocate({}, LEFT, effort=0.0),
        lambda: allocate({}, LEFT, effort=float("inf")),
        lambda: allocate({}, LEFT, lower=0.5, upper=0.2),
        lambda: allocate({}, LEFT, upper=1.5),
        lambda: allocate({}, LEFT, dead=["right_tibial"]),
        lambda: allocate({}, LEFT, rate=0.0),
        lambda: allocate({}, LEFT, change=-1.0),
        lambda: allocate({}, LEFT, least=2.0),
        lambda: allocate({}, LEFT, least=0.2, effort_kind="cubes"),
        lambda: allocate({}, LEFT, effort_kind="work"),
        lambda: allocate({}, LEFT, solver="abacus"),
        lambda: allocate({}, LEFT, recruitment=[LinearRecruitment()]),
        lambda: allocate([1.0], [[float("nan")]]),
        lambda: allocate([], np.zeros((0, 3))),
        lambda: Allocator(LEFT).sequence(np.full((3, 19), np.nan)),
        lambda: Allocator(LEFT).sequence(np.zeros((3, 18))),
        lambda: Allocator(LEFT, least=0.2).sequence(np.zeros((3, 19))),
    ],
)
def test_bad_input_is_one_clear_line(make):
    """No overflow on the way either: warnings are errors here."""
    with pytest.raises(InputError) as caught:
        make()
    assert "\n" not in str(caught.value)


def test_what_is_printed_holds_the_band_of_strength():
    nerves = Nerves(["left_tibial"])
    a = allocate({"left_ankle_dorsiflexion": -50.0}, nerves)
    low, high = nerves.strength_band
    j = a.joints.index("left_ankle_dorsiflexion")
    np.testing.assert_allclose([band[j] for band in a.achieved_band], [low * a.achieved[j], high * a.achieved[j]])
    assert f"left ankle dorsiflexion {low * a.achieved[j]:.1f} to {high * a.achieved[j]:.1f} N m" in str(a)
    assert "of the strength assumed" not in str(allocate([20.0], [[30.0]]))  # an array says nothing of its strengths


def test_a_muscle_that_shortens_needs_more_recruitment():
    nerves = Nerves(["left_femoral"])
    wanted = {"left_knee_flexion": -30.0}
    still, extends, flexes = (
        Allocator(nerves, {"left_knee_flexion": 0.5}, v={"left_knee_flexion": v})(wanted).recruitment[0]
        for v in (0.0, -2.0, 2.0)
    )
    assert flexes < still < extends
    assert still == Allocator(nerves, {"left_knee_flexion": 0.5})(wanted).recruitment[0]
    with pytest.raises(InputError, match="velocity"):
        Allocator([[1.0]], v=[0.0])


@pytest.mark.parametrize("options", [{"least": 0.2}, {"effort_kind": "cubes"}, {"lexicographic": True}])
def test_a_solver_that_an_option_does_not_ask_is_refused(options):
    with pytest.raises(InputError, match="osqp"):
        Allocator([[2.0, 1.0]], **options)([1.0], solver="osqp")
