"""Why candidates are named or not: rejected by a claim, not significant in the extended answer, or less likely."""

import numpy as np
import pytest
from regression import COUNT, Regression, RegressionVerdict

from fes_pin.infer.search import Search
from fes_pin.infer.why import Tried, why_of


@pytest.fixture
def judged():
    def judge(runs, x):
        search = Search(Regression(x, runs), lambda share, words: None)
        return RegressionVerdict(search).of(search.run())

    return judge


def columns(rng, count=20):
    return {f"x{k:02d}": rng.standard_normal(COUNT) for k in range(count)}


def test_every_candidate_is_named_rejected_or_tried(judged):
    rng = np.random.default_rng(3)
    x = columns(rng)
    found = why_of(judged(0.5 * x["x03"] - 0.4 * x["x11"] + rng.standard_normal((6, COUNT)), x))
    assert not found.rejected and set(found.tried) == set(x) - {"x03", "x11"}
    assert all(
        "not significant" in words or "less than that of the answer" in words for words in found.reasons().values()
    )
    extended = [one for one in found.tried.values() if {"x03", "x11"} < set(one.names)]
    assert all(one.p_value >= found.level and one.gain >= 0.0 for one in extended)


def test_a_rejected_candidate_has_its_claim_and_its_numbers(judged):
    rng = np.random.default_rng(5)
    x, runs = columns(rng), rng.standard_normal((3, COUNT))
    runs[1] += 1.6 * x["x07"]
    found = why_of(judged(runs, x))
    record = found.record()["rejected"]["x07"]
    assert record["claim"] == "drop_unsupported" and record["p_value"] < 1e-3
    assert found.record()["steps"][0] == {"claim": "drop_unsupported", "name": "x07"}
    assert "do not confirm" in found.reasons()["x07"] and "x07" not in found.tried


@pytest.mark.parametrize(
    ("tried", "words"),
    [
        (Tried(("a", "b"), 3.0, 0.2, True), "p = 0.2, level 0.01): not significant"),
        (Tried(("a", "b"), -4.32, 1.0, True), "it lowers twice the log-likelihood by 4.32 (p = 1, level"),
        (Tried(("a", "b"), 90.0, 1e-9, True), "lowers no error of prediction"),
        (Tried(("b", "c"), 7.0, float("nan"), True), "(b and c) is 7 more than that of the answer"),
        (Tried(("b",), -1234.0, float("nan"), True), "(b) is 1230 less than that of the answer"),
        (Tried(("b",), 40.0, 1e-9, False), "not physically possible (b)"),
    ],
    ids=["chance", "evidence against it", "no better", "likelier", "in its place", "impossible"],
)
def test_the_reason_follows_from_the_numbers(tried, words):
    assert words in tried.words(0.01)
