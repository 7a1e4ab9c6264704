"""Parts of a diagnosis in words: what stands beneath the table."""

import math

import numpy as np
import pytest

from fes_pin.data.trial import Trial
from fes_pin.diagnosis.errors_ahead import RandomPart
from fes_pin.diagnosis.result import left_out_text
from fes_pin.infer.text import quantity


@pytest.mark.parametrize(
    ("value", "std", "words"),
    [
        (0.04123, 0.0021, "0.0412 [0.0370, 0.0454] N"),
        (123.4, 7.0, "123.4 [109.4, 137.4] N"),
        (2.0, math.inf, "2 N (not identified)"),
        (0.25, 0.0, "0.25 N (held)"),
        (2.5e6, 4e5, "2.50e+06 [1.70e+06, 3.30e+06] N"),
        (1e-9, 2e-10, "1.00e-09 [6.0e-10, 1.40e-09] N"),
    ],
)
def test_a_quantity_is_rounded_to_what_it_means(value, std, words):
    assert quantity(value, std, (value - 2.0 * std, value + 2.0 * std), "N") == words


def test_what_acts_at_random_is_told_in_units_of_the_effort():
    wind = RandomPart("effort", 0.12, 0.3, 0.04)
    assert wind.words("N m") == "0.12 N m, 4 % of what drives the rig, changing within 0.3 s"


def test_spikes_are_counted_by_column_and_trials_are_named_if_they_are_few():
    trials = [Trial(n, "motion", {}, np.arange(10.0), {}) for n in ("a", "b", "c", "d")]
    two = {"a": {"angle_rad": (3,)}, "c": {"angle_rad": (1, 5), "force_n": (2,)}}
    assert left_out_text(two, trials) == "3 of 20 samples of angle_rad in a and c, 1 of 10 samples of force_n in c"
    three = {n: {"angle_rad": (3,)} for n in ("a", "b", "d")}
    assert left_out_text(three, trials) == "3 of 30 samples of angle_rad in 3 trials"
