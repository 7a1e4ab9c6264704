"""Readings that go to and fro between two counts."""

import numpy as np
import pytest

from fes_pin.data.counts import hunts

COUNT = 0.0015


def of_runs(*runs: tuple[int, int]) -> np.ndarray:
    """A reading of so many counts for so many samples each."""
    return np.concatenate([np.full(n, COUNT * value) for value, n in runs])


def test_what_turns_in_two_counts_in_a_row_hunts():
    column = of_runs((3, 4), (2, 2), (1, 5), (2, 3), (1, 2), (2, 4), (3, 2), (5, 6))
    assert hunts(column).tolist() == [False] * 6 + [True] * 10 + [False] * 12


@pytest.mark.parametrize(
    "runs",
    [
        [(0, 3), (1, 3), (2, 3), (3, 3)],
        [(0, 3), (1, 9), (0, 3), (-1, 3)],
        [(0, 40)],
        [(0, 3), (1, 3), (2, 3), (1, 3), (0, 3), (1, 3), (2, 3)],
        [(0, 3), (5, 3), (0, 3), (5, 3), (6, 3)],
    ],
    ids=["passes", "ends a swing", "rests", "over three counts", "jumps"],
)
def test_other_readings_do_not(runs):
    assert not hunts(of_runs(*runs)).any()


def test_numbers_do_not_hunt():
    rng = np.random.default_rng(0)
    assert not hunts(rng.standard_normal(500)).any()
    assert not hunts(np.zeros(0)).any()


def test_what_is_missed_ends_a_run():
    column = of_runs((0, 3), (1, 3), (0, 3), (1, 3), (0, 3))
    column[7] = np.nan
    assert not hunts(column).any()
