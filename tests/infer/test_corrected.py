"""Faults of a record as candidates: when the answer for a corrected record takes the place of that for the record."""

import math
from dataclasses import dataclass, field

import numpy as np
import pytest

from fes_pin.data.log import Log
from fes_pin.faults.log_faults import LogFault
from fes_pin.infer.corrected import Correction, lead_of
from fes_pin.infer.levels import PARAMETER_PENALTY, SEPARABLE
from fes_pin.infer.problem import Linearized

CERTAIN, DOUBTED = 60.0, 3.0


@dataclass
class Answered:
    """An answer that leaves a residual, with a penalty for its causes."""

    left: np.ndarray
    penalty: float = 0.0
    sse: float = field(init=False)

    def __post_init__(self):
        self.sse = float(self.left @ self.left)
        self.parts = [Linearized(self.left, np.zeros((len(self.left), 0)), np.zeros((len(self.left), 0)))]

    @property
    def criterion(self):
        return self.sse + self.penalty


NOISE = np.random.default_rng(2).standard_normal(400)
RIGHT, WRONG = Answered(NOISE), Answered(NOISE + np.sin(np.arange(400.0)))


def test_the_lead_is_that_of_the_penalised_likelihood():
    lead, least = lead_of(RIGHT, WRONG, degrees=1, tried=8)
    assert lead == pytest.approx(WRONG.sse - RIGHT.sse - PARAMETER_PENALTY - 2.0 * math.log(8))
    assert lead > least >= SEPARABLE


def test_an_answer_with_more_causes_must_be_likelier_by_more():
    """Dry friction that explains what noise of the effort explains as well is no reason against that noise."""
    costly = Answered(NOISE, penalty=10.0)
    assert lead_of(RIGHT, costly)[0] == pytest.approx(10.0) and lead_of(costly, RIGHT)[0] == pytest.approx(-10.0)


@pytest.mark.parametrize(
    ("p_value", "lead", "named"), [(1e-9, 9.0, True), (1e-3, 9.0, False), (1e-9, 2.0, False), (1e-9, math.nan, False)]
)
def test_a_fault_is_named_by_its_gain_and_by_the_lead_of_its_answer(p_value, lead, named):
    test = Correction("late_effort", p_value, 1e-6, "late by 2 ms", lead, 3.0)
    assert test.is_named is named and test.record()["named"] is named
    assert ("cannot be compared" in str(test)) is math.isnan(lead)


def fault(gain, bare=None):
    return LogFault("effort_noise", Log(), Log(effort_noise=0.1), gain, "noise of 0.1", bare)


def decided(one, answer, known):
    """The answer that is decided for, its test, and the logs that were searched again."""
    asked = []

    def again(log):
        asked.append(log)
        return known[log]

    return *one.decided(answer, again, lambda a: a, lambda a, b: (a, b)), asked


@pytest.mark.parametrize(
    ("gain", "other", "corrected", "searched"),
    [(CERTAIN, RIGHT, True, 1), (CERTAIN, WRONG, False, 1), (DOUBTED, RIGHT, False, 0)],
    ids=["likelier", "as likely", "not significant"],
)
def test_a_new_fault_needs_a_search_of_the_corrected_log_that_leads(gain, other, corrected, searched):
    answer, test, asked = decided(fault(gain), WRONG, {Log(effort_noise=0.1): other})
    assert (answer is other and other is RIGHT) is corrected is test.is_named and len(asked) == searched


@pytest.mark.parametrize(("gain", "kept"), [(CERTAIN, True), (DOUBTED, False)])
def test_a_fault_that_was_corrected_first_must_be_significant_with_the_causes_too(gain, kept):
    """Without that the log as recorded is searched."""
    answer, test, asked = decided(fault(gain, bare=WRONG), RIGHT, {Log(): WRONG})
    assert (answer is RIGHT) is kept is test.is_named and asked == ([] if kept else [Log()])
