"""A second estimator of the same data: fits of its own type, judged by errors alone, candidates at two sites."""

from dataclasses import dataclass, field, replace
from itertools import combinations

import numpy as np
import pytest
from regression import COUNT, Regression, RegressionVerdict

from fes_pin.infer.estimators import CHOICE, Estimator, choose
from fes_pin.infer.fits import Candidate, FittedSets
from fes_pin.infer.held_out import Errors, deal, held_out_gain
from fes_pin.infer.keys import Key
from fes_pin.infer.result import Remainder
from fes_pin.infer.search import Policy, Search
from fes_pin.infer.verdict import Verdict, Weighed
from fes_pin.infer.why import why_of

CLIPPED = "runs, up to three deviations"


@dataclass(frozen=True)
class Line:
    """A fit by least absolute errors: no likelihood, no covariance."""

    names: tuple[str, ...]
    values: np.ndarray
    sse: float

    @property
    def degrees(self):
        return len(self.names)

    @property
    def criterion(self):
        return self.sse + 12.0 * self.degrees


class LeastAbsolute(FittedSets[Line, None]):
    """Sets of columns fitted to the mean of runs by least absolute errors, by reweighting; judged by errors alone."""

    estimator = "least absolute errors"

    def __init__(self, columns, runs):
        super().__init__()
        self.columns, self.runs = columns, runs

    def line(self, names, runs=slice(None)):
        y = self.runs[runs]
        x = np.column_stack([np.ones(y.size), *(np.tile(self.columns[n], len(y)) for n in names)])
        y, weights = y.ravel(), np.ones(y.size)
        for _ in range(30):
            values = np.linalg.lstsq(weights[:, None] * x, weights * y, rcond=None)[0]
            weights = np.maximum(np.abs(y - x @ values), 1e-3) ** -0.5
        return Line(names, values, float(2.0 * np.abs(y - x @ values).sum()))

    def predicted(self, fitted):
        return fitted.values[0] + sum(
            (v * self.columns[n] for n, v in zip(fitted.names, fitted.values[1:], strict=True)), np.zeros(COUNT)
        )

    def nominal(self):
        return self.fits.setdefault((), self.line(()))

    def candidates(self, base):
        return {n: Candidate(0.0, None) for n in self.columns if n not in base.names}

    def begin(self, base, starts):
        return {names: self.line(names) for names in starts}

    def without(self, names, name):
        rest = tuple(n for n in names if n != name)
        return self.fits.setdefault(rest, self.line(rest))

    def noise_p_value(self, gain, degrees):
        return float(gain < 12.0)


class ByErrors(Verdict):
    """Each run is predicted by a fit to the others, with errors that outliers do not dominate."""

    currencies = (CLIPPED,)

    def errors_of(self, names):
        models, squares = self.search.models, []
        for held in range(len(models.runs)):
            fitted = models.line(names, np.arange(len(models.runs)) != held)
            squares.append(clipped(models.runs[held] - models.predicted(fitted)))
        return errors_of(np.array(squares), models.runs)

    def weigh(self, found):
        nominal, best = self.errors_of(()), self.errors_of(found.best.names)
        gains = {n: held_out_gain(nominal, self.errors_of(f.names), best, 0) for n, f in found.without.items()}
        return Weighed(gains, {}, Remainder(False, 0.5, None))

    def errors_in(self, state, currency, unit):
        return self.errors_of(state.found.best.names)


def clipped(left):
    return float(np.sum(np.minimum(left**2, 9.0)))


def errors_of(squares, runs):
    around = np.sum((runs - runs.mean(axis=1, keepdims=True)) ** 2, axis=1)
    return Errors(squares, around, np.full(len(squares), float(COUNT)))


class Gaussian(RegressionVerdict):
    """The first estimator, in the same currency."""

    currencies = ("what the other cannot predict", CLIPPED)

    def errors_in(self, state, currency, unit):
        models, rows = self.search.models, np.arange(len(self.search.models.runs))
        squares = [clipped(models.left(state.found.best.free, rows == k)) for k in rows]
        return errors_of(np.array(squares), models.runs)


class ByAbsoluteErrors(Estimator):
    def __init__(self, columns, runs):
        self.columns, self.runs, self.asked = columns, runs, 0

    def state(self, first):
        self.asked += 1
        search = Search(
            LeastAbsolute(self.columns, self.runs), lambda share, words: None, Policy(fitted=None, rivals=None)
        )
        return ByErrors(search).of(search.run(), replaced=first)


SITES = [Key("friction", site) for site in ("knee", "hip")]


def drawn(seed, outliers):
    """Runs with friction at the knee, one candidate cause at two sites, and outliers of one sign."""
    rng = np.random.default_rng(seed)
    names = [*map(str, SITES), *(f"x{k}" for k in range(6))]
    columns = {n: rng.standard_normal(COUNT) for n in names}
    runs = 0.7 * columns["friction@knee"] + rng.standard_normal((6, COUNT))
    runs[rng.random(runs.shape) < outliers] += 25.0
    return columns, runs


def first_state(columns, runs):
    search = Search(Regression(columns, runs), lambda share, words: None)
    return Gaussian(search).of(search.run())


@pytest.mark.parametrize(("outliers", "takes"), [(0.05, True), (0.0, False)])
def test_the_estimator_that_predicts_better_answers(outliers, takes):
    columns, runs = drawn(2, outliers)
    first, other = first_state(columns, runs), ByAbsoluteErrors(columns, runs)
    state = choose(first, [other])
    assert other.asked == 1 and (state is not first) is takes
    assert state.names == {"friction@knee"}
    if takes:
        assert state.replaced is first and isinstance(state.verdict, ByErrors)
        assert state.steps[-1].claim == CHOICE and f"E of {CLIPPED}" in str(state.steps[-1])


def test_an_estimator_that_takes_its_errors_for_noise_is_replaced_all_the_same():
    columns, runs = drawn(2, 0.05)
    first = first_state(columns, runs)
    usual = first.verdict.errors_in
    first.verdict.errors_in = lambda *asked: replace(usual(*asked), noise=1e6 * np.ones(len(runs)))
    assert choose(first, [ByAbsoluteErrors(columns, runs)]) is not first


def test_pages_of_steps_know_the_other_estimator_and_its_sites():
    columns, runs = drawn(2, 0.05)
    told = why_of(choose(first_state(columns, runs), [ByAbsoluteErrors(columns, runs)]))
    assert told.estimator == LeastAbsolute.estimator and "friction@hip" in told.reasons()
    assert told.record()["steps"][-1]["claim"] == CHOICE


def test_a_candidate_at_two_sites_is_two_candidates():
    columns, runs = drawn(7, 0.0)
    runs = runs - 0.6 * columns["friction@hip"]
    state = first_state(columns, runs)
    assert {Key.of(n) for n in state.names} == set(SITES)
    assert all(len(state.found.rivals[n]) > 0 for n in state.names)


def test_candidates_that_are_not_significant_are_left_out():
    columns, runs = drawn(2, 0.0)
    state = first_state(columns, runs)
    search = state.search
    search.sets.extend(("friction@knee",))
    both = search.result(("friction@knee", "x0"))
    begun = replace(state, found=both, weighed=state.verdict.weigh(both))
    kept = state.verdict.drop_insignificant(begun)
    assert kept.names == {"friction@knee"} and state.verdict.drop_insignificant(kept) is None
    assert {*kept.rejected} == {"x0"}
    assert search.backward(("friction@knee", "x0")) == ("friction@knee",)


def test_an_estimator_that_does_not_apply_or_has_no_common_currency_is_passed_over():
    columns, runs = drawn(2, 0.05)
    first, other = first_state(columns, runs), ByAbsoluteErrors(columns, runs)

    class Never(Estimator):
        def state(self, first):
            return None

    first.verdict.currencies = ("what the other cannot predict",)
    assert choose(first, [Never(), other]) is first and other.asked == 1


def test_folds_of_the_toy_are_those_of_the_house():
    """A run is held out at most once in either estimator: their errors are paired by run."""
    folds = deal(range(6), None, 6)
    assert all(not set(a) & set(b) for a, b in combinations(folds, 2)) and sum(map(len, folds)) == 6


@dataclass(frozen=True)
class Stated:
    """A state as far as `choose` looks at it: its candidates, and its errors by currency and run."""

    names: frozenset
    errors: dict
    steps: tuple = ()
    tied: dict = field(default_factory=dict)

    @property
    def verdict(self):
        return self

    @property
    def currencies(self):
        return tuple(self.errors)

    def errors_in(self, state, currency, unit):
        squares = self.errors[currency]
        return Errors(squares, np.full(len(squares), 1e3), np.zeros(len(squares)))


class Known(Estimator):
    def __init__(self, other, prefers_smaller, is_independent=True):
        self.other, self.prefers_smaller, self.is_independent = other, prefers_smaller, is_independent

    def state(self, first):
        return self.other

    def words(self, state):
        return "another estimator"


SURE, UNSURE = np.full(12, 1.0), np.tile([-40.0, 60.0], 6)
"""Changes of an error of 100 in each run, percent: 1 % surely, and 10 % that is not sure."""


@pytest.mark.parametrize(
    ("motion", "effort", "names", "prefers_smaller", "answers"),
    [
        (UNSURE, 50.0 * SURE, "ab", False, True),  # sure in one, and more than an error of form in the other
        (0.0 * SURE, 50.0 * SURE, "ab", False, False),  # an error of form of the effort
        (0.5 * UNSURE, 50.0 * SURE, "ab", False, False),  # as above: 5 % that is not sure is no sixteenth
        (SURE, 50.0 * SURE, "ab", False, True),  # sure in both
        (0.0 * SURE, 0.0 * SURE, "", True, True),  # neither predicts better: the smaller set
        (0.0 * SURE, 0.0 * SURE, "", False, False),
        (0.0 * SURE, 0.0 * SURE, "ab", True, False),  # it is not smaller
        (0.0 * SURE, -50.0 * SURE, "", True, True),  # what the larger set adds is an error of form of the effort
        (-50.0 * SURE, 0.5 * UNSURE, "", True, True),
        (-50.0 * SURE, -50.0 * SURE, "", True, False),  # it is felt in both
        (-50.0 * SURE, -UNSURE, "", True, False),
        (-UNSURE, -UNSURE, "", True, True),  # and certain in none
        (-50.0 * SURE, 0.0 * SURE, "", False, False),
        (50.0 * SURE, 0.0 * SURE, "a", False, True),  # the same set: worse in none
        (50.0 * SURE, -50.0 * SURE, "a", False, False),
        (0.0 * SURE, 50.0 * SURE, "b", False, True),  # another cause in its place: worse in none
        (-SURE, 50.0 * SURE, "b", False, False),
    ],
)
def test_the_other_answers_by_every_currency(motion, effort, names, prefers_smaller, answers):
    """Of a first set of one candidate; `motion` and `effort` are what the other removes of the error, percent."""
    hundred = np.full(12, 100.0)
    first = Stated(frozenset("a"), {"motion": hundred, "effort": hundred})
    other = Stated(frozenset(names), {"motion": hundred - motion, "effort": hundred - effort})
    chosen = choose(first, [Known(other, prefers_smaller)])
    assert (chosen.errors is other.errors) is answers
    assert bool(chosen.steps) is (answers or bool(chosen.tied))


def test_each_estimator_is_compared_with_the_answer_so_far():
    """The same set with half of its error, a larger one with half of that, and one that is worse than both."""
    errors = (np.full(12, size) for size in (100.0, 50.0, 25.0, 75.0))
    first, same, larger, worse = (
        Stated(frozenset(names), {"motion": e}) for e, names in zip(errors, ("a", "a", "ab", "abc"), strict=True)
    )
    chosen = choose(first, [Known(one, False) for one in (same, larger, worse)])
    assert chosen.names == {"a", "b"} and len(chosen.steps) == 2
    assert "E of motion 10 % -> 5 %" in str(chosen.steps[0]) and "E of motion 5 % -> 2.5 %" in str(chosen.steps[1])


@pytest.mark.parametrize(
    ("motion", "effort", "names", "tied"),
    [
        (-5.0 * SURE, 50.0 * SURE, "b", {"a": "b"}),  # each predicts better in one currency
        (0.0 * SURE, 0.0 * SURE, "b", {"a": "b"}),  # neither does in any
        (0.0 * SURE, UNSURE, "b", {"a": "b"}),
        (-5.0 * SURE, 0.0 * SURE, "b", {}),  # the first predicts better
        (0.0 * SURE, 50.0 * SURE, "b", None),  # the other does, and answers
        (-5.0 * SURE, 50.0 * SURE, "a", {}),  # the same set
        (0.0 * SURE, 0.0 * SURE, "bc", {}),  # the smaller set answers
    ],
)
def test_two_causes_are_equivalents_where_neither_estimator_predicts_better(motion, effort, names, tied):
    hundred = np.full(12, 100.0)
    first = Stated(frozenset("a"), {"motion": hundred, "effort": hundred})
    other = Stated(frozenset(names), {"motion": hundred - motion, "effort": hundred - effort})
    chosen = choose(first, [Known(other, False)])
    if tied is None:
        assert chosen.names == other.names and not chosen.tied
        return
    assert chosen.names == first.names and chosen.tied == tied
    assert ["predicts neither better nor worse" in str(s) for s in chosen.steps] == [True] * len(tied)


@pytest.mark.parametrize(("effort", "answers"), [(0.0 * SURE, True), (-SURE, False), (-50.0 * SURE, False)])
def test_of_the_same_readings_a_smaller_set_answers_where_it_is_worse_in_none(effort, answers):
    hundred = np.full(12, 100.0)
    first = Stated(frozenset("a"), {"motion": hundred, "effort": hundred})
    other = Stated(frozenset(), {"motion": hundred, "effort": hundred - effort})
    assert (choose(first, [Known(other, True, is_independent=False)]).errors is other.errors) is answers


def test_a_currency_without_errors_of_both_is_not_compared():
    hundred = np.full(12, 100.0)
    first = Stated(frozenset("a"), {"motion": hundred, "effort": hundred})
    other = Stated(frozenset("b"), {"motion": 0.5 * hundred})
    assert choose(first, [Known(other, False)]).names == other.names
