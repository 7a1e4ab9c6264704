"""What an allocation, a horizon and a set of torques may be told: out of range is refused, before anything changes."""

import copy
import pickle

import numpy as np
import pytest

import fes_pin as fp
from fes_pin.allocation.horizon import invert_lag
from fes_pin.data.errors import InputError

MATRIX = [[30.0, -20.0, 8.0], [5.0, 10.0, -12.0]]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"rate": 44.0}, "rate"),
        ({"rate": -0.1}, "rate"),
        ({"lexicographic": "no"}, "lexicographic"),
        ({"rounding": 1.5}, "rounding"),
        ({"upper": 2.0}, "upper limits"),
        ({"upper": 500.0}, "not a pulse width"),
        ({"lower": -0.5}, "lower limits"),
        ({"least": 180.0}, "least recruitment"),
        ({"effort": 1e9}, "effort"),
        ({"weights": 1e9}, "weight"),
        ({"change": np.inf}, "change"),
        ({"seconds": 0.0}, "seconds"),
    ],
)
def test_options_out_of_range_are_refused(options, words):
    with pytest.raises(InputError, match=words):
        fp.Allocator(MATRIX, **options)


def test_a_channel_that_may_neither_be_off_nor_on_is_refused():
    with pytest.raises(InputError, match=r"channel_1 may not be off, for its lower limit is 0\.2, and not on"):
        fp.allocate([20], [[30]], lower=0.2, upper=0.3, least=0.5)
    raised = fp.allocate([20], [[30]], lower=0.2, upper=0.9, least=0.5)
    assert raised.recruitment[0] >= 0.5 and raised.certificate.is_optimal()
    assert fp.allocate([20], [[30]], upper=0.3, least=0.5).recruitment[0] == 0.0  # off is allowed


@pytest.mark.parametrize("solver", ["daqp", "piqp", "osqp", "proxqp", "quadprog"])
def test_a_torque_of_nothing_is_off_by_every_solver(solver):
    import qpsolvers

    if solver != "daqp" and solver not in qpsolvers.available_solvers:
        pytest.skip(f"{solver} is not installed")
    rng = np.random.default_rng(3)
    for _ in range(20):
        matrix = rng.normal(size=(3, 6)) * 30
        assert not fp.allocate(np.zeros(3), matrix, solver=solver).pulse_width_us.any()
        some = fp.allocate(rng.normal(size=3) * 20, matrix, solver=solver)
        assert some.certificate.is_optimal()
        assert not ((some.recruitment > 0.0) & (some.recruitment < 1e-9)).any()
    assert fp.allocate([1e-12], [[30]], solver=solver).pulse_width_us == [0.0]


def test_other_solvers_only_propose_and_the_answer_is_exact():
    rng = np.random.default_rng(4)
    for _ in range(50):
        matrix, torque = rng.normal(size=(3, 6)) * 30, rng.normal(size=3) * 40
        ours, theirs = (fp.Allocator(matrix)(torque, solver=s).recruitment for s in ("daqp", "osqp"))
        np.testing.assert_allclose(theirs, ours, atol=1e-10)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda p: fp.Horizon(p, time_constant_s=50.0), "time_constant_s"),
        (lambda p: fp.Horizon(p, step_s=33.0), "step_s"),
        (lambda p: fp.Horizon(p, fatigue=0.5), "StrengthFatigue"),
        (lambda p: fp.StrengthFatigue(20_000.0), "fatigue_s"),
        (lambda p: fp.StrengthFatigue(recovery_s=0.001), "recovery_s"),
        (lambda p: invert_lag(np.zeros((3, 2)), 0.02, 50.0), "time_constant_s"),
        (lambda p: invert_lag(np.full((3, 2), np.nan), 0.02, 0.05), "recruitment"),
        (lambda p: fp.AttainableTorques(MATRIX, upper=2.0), "upper limits"),
        (lambda p: fp.AttainableTorques(MATRIX, upper=[1.0, -1.0, 0.0]), "upper limits"),
        (lambda p: fp.AttainableTorques(MATRIX, joints=[]), "joints"),
        (lambda p: fp.AttainableTorques(MATRIX, joints=5), "joint"),
        (lambda p: fp.AttainableTorques(MATRIX).nearest(-40), "one torque for 2 joints"),
        (lambda p: fp.AttainableTorques(MATRIX).share(-40), "one torque for 2 joints"),
        (lambda p: fp.AttainableTorques(MATRIX, joints=["joint_1", "joint_1"]), "joints"),
    ],
)
def test_horizons_and_sets_of_torques_refuse_what_is_out_of_range(make, words):
    with pytest.raises(InputError, match=words):
        make(fp.Allocator(MATRIX))


def test_a_fatigue_that_was_spoilt_later_fails_before_the_state_changes():
    horizon = fp.Horizon(fp.Allocator(MATRIX), steps=3, delay_steps=1)
    horizon.advance(np.full((3, 2), 20.0))
    act, before, queue = horizon.act, horizon.before, horizon.queue
    horizon.fatigue = 0.5
    with pytest.raises(AttributeError):
        horizon.advance(np.full((3, 2), 20.0))
    assert horizon.act is act and horizon.before is before and horizon.queue is queue


def test_strength_that_neither_falls_nor_comes_back_stays():
    left = np.array([1.0, 0.6, 0.3])
    for fatigue, act in (
        (fp.StrengthFatigue(recovery_s=np.inf), np.zeros(3)),
        (fp.StrengthFatigue(fatigue_s=np.inf), np.ones(3)),
        (fp.StrengthFatigue(np.inf, np.inf), np.array([0.0, 0.5, 1.0])),
    ):
        np.testing.assert_array_equal(fatigue.after(left, act, 1.0), left)


@pytest.mark.parametrize("name", ["act", "left", "before"])
def test_a_state_of_pulse_widths_is_refused(name):
    horizon = fp.Horizon(fp.Allocator(MATRIX), steps=3)
    setattr(horizon, name, np.array([0.0, 368.0, 0.0]))
    with pytest.raises(InputError, match=rf"{name} of channel_2 .* not a pulse width"):
        horizon.plan(np.zeros((3, 2)))


@pytest.mark.parametrize("again", [copy.copy, copy.deepcopy, lambda x: pickle.loads(pickle.dumps(x))])
def test_programs_and_horizons_are_copied_and_pickled_with_their_state(again):
    program = fp.Allocator(MATRIX, rate=0.1, change=1e-3)
    program([20.0, 5.0])
    other = again(program)
    np.testing.assert_array_equal(other.previous, program.previous)
    assert other.problem == program.problem and hash(other.problem) == hash(program.problem)
    first = other([20.0, 5.0]).recruitment  # copies are independent of each other
    np.testing.assert_allclose(program([20.0, 5.0]).recruitment, first, atol=1e-12)
    horizon = fp.Horizon(program, steps=4, delay_steps=1, fatigue=fp.StrengthFatigue(1.0, 3.0, 0.1))
    torques = np.full((4, 2), 15.0)
    horizon.advance(torques)
    copied = again(horizon)
    np.testing.assert_array_equal(copied.advance(torques).recruitment, horizon.advance(torques).recruitment)
    np.testing.assert_array_equal(copied.left, horizon.left)


def answers():
    program = fp.Allocator(MATRIX, rate=0.1)
    yield program([20.0, 5.0])
    yield program.sequence([[20.0, 5.0], [0.0, 3.0]])
    yield fp.Horizon(program, steps=2).plan([[20.0, 5.0], [0.0, 3.0]])
    yield fp.allocate_walk([[20.0, 5.0]] * 2, np.array([MATRIX] * 2), None)


@pytest.mark.parametrize("answer", list(answers()), ids=lambda a: type(a).__name__)
def test_answers_cannot_be_changed_and_are_equal_by_value_also_as_copies(answer):
    for same in (answer, copy.copy(answer), copy.deepcopy(answer), pickle.loads(pickle.dumps(answer))):
        assert same == answer and hash(same) == hash(answer)
        for array in (same.pulse_width_us, same.recruitment, same.achieved, same.problem.prices):
            with pytest.raises(ValueError, match="read-only"):
                array[...] = 999.0
        with pytest.raises(AttributeError):
            same.recruitment = None
    assert answer != 3 and next(answers()) != fp.Allocator(MATRIX)([1.0, 1.0])


def test_an_answer_does_not_hold_the_callers_arrays():
    wanted, before = np.array([20.0, 5.0]), np.zeros(3)
    answer = fp.Allocator(MATRIX, rate=0.1)(wanted, before)
    wanted[0] = before[0] = 0.7
    assert answer.wanted[0] == 20.0 and answer.previous[0] == 0.0
