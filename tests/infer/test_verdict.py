"""The verdict is a table of claims: each may change what was found, and what no claim objects to is the answer."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from infer.regression import COUNT, Regression, RegressionVerdict

from fes_pin.contrasts.verdict import ContrastVerdict
from fes_pin.diagnosis.verdict import RigVerdict
from fes_pin.infer.held_out import deal
from fes_pin.infer.result import CROSS_VALIDATED, FITTED, NO_GAIN, Evidence, Gain
from fes_pin.infer.search import Search
from fes_pin.infer.verdict import CLAIMS as TABLE
from fes_pin.infer.verdict import State, Verdict, Weighed, word_of
from fes_pin.walk.verdict import WalkVerdict

NOISE, SOMETHING = SimpleNamespace(unexplained=False), SimpleNamespace(unexplained=True)


def gain(low):
    return Gain(low + 1.0, low, low + 2.0)


FIT = SimpleNamespace(sse=0.0)


def unsupported(gains, evidence, left=NOISE):
    """The candidate that is rejected as held-out data do not support it, if any."""
    found = SimpleNamespace(
        without=dict.fromkeys(gains, FIT), p_values=dict.fromkeys(gains, 0.0), nominal=FIT, best=FIT
    )
    search = SimpleNamespace(result=lambda names: SimpleNamespace(without=dict.fromkeys(names, FIT)))
    verdict = Claims(search)
    state = verdict.drop_unsupported(State(verdict, found, Weighed(gains, evidence, left), {}, frozenset(gains)))
    return [] if state is None else list(state.rejected)


class Claims(Verdict):
    def weigh(self, found):
        return Weighed({}, {}, NOISE)


def test_a_candidate_together_with_others_gains_something():
    """Before, a torque that repeats was named beside friction for 0.00 % of the error."""
    gains = {"friction": gain(40.0), "periodic": gain(0.0)}
    likely = Evidence(500.0, 500.0)
    assert unsupported(gains, dict.fromkeys(gains, likely)) == ["periodic"]
    assert unsupported({"periodic": gain(0.0)}, {"periodic": likely}) == []


@pytest.mark.parametrize("wrong", [True, False])
def test_a_candidate_alone_that_makes_predictions_worse_is_none(wrong):
    """Where the model has a lack of fit its likelihood is no evidence, not even of a candidate alone."""
    likely, left = {"friction": Evidence(500.0, 500.0)}, SOMETHING if wrong else NOISE
    assert unsupported({"friction": gain(-3.0)}, likely, left) == ["friction"]
    assert unsupported({"friction": gain(-1.0)}, likely, left) == ["friction"] * wrong
    assert unsupported({"friction": gain(40.0)}, {"friction": Evidence(-1.0, 0.0)}) == ["friction"]


def test_of_fitted_data_alone_the_likelihood_judges_with_a_lack_of_fit_too():
    """Friction was dropped beneath a random torque: its likelihood gains 80, free simulations of one trial nothing."""
    likely = {"friction": Evidence(80.0, 80.0, on=FITTED)}
    assert unsupported({"friction": Gain(-40.0, -113.0, 21.0)}, likely, SOMETHING) == []
    assert unsupported({"friction": Gain(-40.0, -113.0, -1.0)}, likely, SOMETHING) == ["friction"]


def test_of_several_units_a_candidate_together_with_others_needs_their_likelihood_too():
    gains = {"friction": gain(40.0), "lag": gain(2.0)}
    evidence = {"friction": Evidence(500.0, 500.0), "lag": Evidence(-3.0, 0.0)}
    assert unsupported(gains, evidence) == ["lag"]
    assert unsupported(gains, evidence, SOMETHING) == []


@pytest.mark.parametrize(
    ("has_candidates", "left", "word"),
    [
        (True, SOMETHING, "causes_found"),
        (False, SOMETHING, "unexplained"),
        (False, NOISE, "adequate"),
    ],
)
def test_the_word_says_what_is_claimed_first(has_candidates, left, word):
    assert word_of(has_candidates, left) == word


def test_folds_keep_every_group():
    groups = ["a", "a", "b", "a", "b", "c"]
    folds = deal(range(6), groups)
    assert sorted(i for fold in folds for i in fold) == [0, 1, 2, 3, 4]
    for fold in folds:
        assert {"a", "b", "c"} == {g for i, g in enumerate(groups) if i not in fold}
    assert deal([0]) == []


@pytest.fixture
def judged():
    def judge(runs, x, groups=None):
        search = Search(Regression(x, runs, groups), lambda share, words: None)
        return RegressionVerdict(search).of(search.run())

    return judge


def test_two_hidden_columns_are_borne_out_by_runs_held_out(judged):
    rng = np.random.default_rng(3)
    x = {f"x{k:02d}": rng.standard_normal(COUNT) for k in range(20)}
    runs = 0.5 * x["x03"] - 0.4 * x["x11"] + rng.standard_normal((6, COUNT))
    found = judged(runs, x)
    assert found.names == {"x03", "x11"} and not found.steps
    assert all(g.low > 0.0 for g in found.weighed.gains.values())
    assert all(e.low > 0.0 for e in found.weighed.evidence.values())


def test_a_change_of_one_group_is_borne_out_and_what_the_others_lack_is_left(judged):
    rng = np.random.default_rng(4)
    x = {f"x{k:02d}": rng.standard_normal(COUNT) for k in range(20)}
    groups = np.array([0, 0, 0, 1, 1, 1])
    runs = 0.6 * np.outer(groups, x["x05"]) + rng.standard_normal((6, COUNT))
    assert judged(runs, x, groups).names == {"x05:1"}


def test_what_one_run_alone_shows_is_refused_and_said_to_be_refused(judged):
    """A column that acts in one of three runs is significant in their mean, and the others speak against it."""
    rng = np.random.default_rng(5)
    x = {f"x{k:02d}": rng.standard_normal(COUNT) for k in range(20)}
    runs = rng.standard_normal((3, COUNT))
    runs[1] += 1.6 * x["x07"]
    found = judged(runs, x)
    assert found.names == frozenset() and "drop_unsupported" in {s.claim for s in found.steps}
    assert "x07" in found.rejected and found.rejected["x07"].p_value < 1e-3
    assert "do not confirm" in found.rejected["x07"].reason


@pytest.mark.parametrize(
    ("on", "percent", "is_material"), [(CROSS_VALIDATED, 0.02, True), (FITTED, 0.02, False), (FITTED, 5.0, True)]
)
def test_most_of_a_negligible_remainder_is_material_on_held_out_data_alone(on, percent, is_material):
    """On fitted data, a lag removed 68 % of an error of 0.3 % next to a torque that removed 200 %."""
    assert Gain(percent, 0.01, 2.0 * percent, on=on, given=68.0).is_material == is_material


class Given(RegressionVerdict):
    """The same with one piece of evidence given for each candidate, in the place of what runs say."""

    def __init__(self, search, given):
        super().__init__(search)
        self.given = given

    def weigh(self, found):
        said = {n: {} if one is None else dict.fromkeys(found.without, one) for n, one in self.given.items()}
        return replace(super().weigh(found), **said)


@pytest.fixture
def two_columns():
    rng = np.random.default_rng(3)
    x = {f"x{k:02d}": rng.standard_normal(COUNT) for k in range(20)}
    runs = 0.5 * x["x03"] - 0.4 * x["x11"] + rng.standard_normal((6, COUNT))
    return Search(Regression(x, runs), lambda share, words: None)


@pytest.mark.parametrize(
    ("given", "claim"),
    [
        ({"gains": gain(-50.0), "evidence": None}, "drop_unsupported"),
        ({"carried": -1.0}, "drop_not_carried"),
        ({"over_unrepeated": 0.9}, "drop_unrepeated"),
        ({"gains": NO_GAIN, "evidence": Evidence(-3.0, 0.0)}, "drop_unsupported"),
    ],
    ids=["errors alone", "not on other parts", "no more than repeats differ", "the likelihood alone"],
)
def test_every_claim_judges_what_a_front_end_weighs(two_columns, given, claim):
    """A front end judged by errors alone had dropped nothing."""
    state = Given(two_columns, given).of(two_columns.run())
    assert state.names == frozenset() and set(state.rejected) >= {"x03", "x11"}
    assert {r.claim for r in state.rejected.values()} == {claim}


@pytest.mark.parametrize(
    ("says", "claim"),
    [("is_a_model", "drop_of_no_model"), ("is_possible", "drop_impossible"), ("is_certain", "drop_uncertain")],
)
def test_no_front_end_names_what_is_no_model_or_of_no_certain_size(two_columns, says, claim):
    found = two_columns.run()
    setattr(two_columns.models, says, lambda *_: False)
    state = RegressionVerdict(two_columns).of(found)
    assert state.names == frozenset() and {r.claim for r in state.rejected.values()} == {claim}
    assert [s.name for s in state.steps if s.claim == claim] == list(state.rejected)


def test_the_size_of_a_candidate_is_certain_by_the_intervals_that_an_answer_gives(two_columns):
    """They may be wider than those of its fit."""
    verdict, wide = RegressionVerdict(two_columns), object()
    verdict.estimated = lambda state: wide
    two_columns.models.is_certain = lambda fitted, name: fitted is not wide or name != "x11"
    state = verdict.of(two_columns.run())
    assert state.names == {"x03"} and state.rejected["x11"].claim == "drop_uncertain"


def test_a_candidate_that_a_given_level_finds_insignificant_is_dropped(two_columns):
    found = two_columns.run()
    two_columns.models.level = lambda fitted: 0.0
    state = RegressionVerdict(two_columns).of(found)
    assert {r.claim for r in state.rejected.values()} == {"drop_insignificant"}


def test_the_table_of_claims_is_whole_and_the_same_for_every_front_end():
    drops = {n for n in vars(Verdict) if n.startswith("drop_")}
    assert set(TABLE) == drops | {"settle"} and all(TABLE.values())
    fronts = RigVerdict, ContrastVerdict, WalkVerdict
    assert not any(set(TABLE) & set(vars(front)) or "evidence" in vars(front) for front in fronts)


def test_nothing_is_named_of_a_system_that_the_recorded_inputs_do_not_move(two_columns):
    """A spring or friction is then mistaken for what did move it."""

    class Unmoved(RegressionVerdict):
        def weigh(self, found):
            return replace(super().weigh(found), is_moved=False)

    state = Unmoved(two_columns).of(two_columns.run())
    assert state.names == frozenset() and {r.claim for r in state.rejected.values()} == {"drop_unmoved"}
