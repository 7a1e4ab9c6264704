"""Records longer than a search can hold are searched in part, and that is said."""

import numpy as np
import pytest

from fes_pin.data.trial import Trial
from fes_pin.diagnose import long_records
from fes_pin.diagnose.long_records import searched_part


def trials(count, samples, dt):
    time = np.arange(samples) * dt
    return [Trial(f"{k:02d}", "motion", {"effort": np.sin(time), "position": time}, time) for k in range(count)]


@pytest.fixture(autouse=True)
def few(monkeypatch):
    monkeypatch.setattr(long_records, "MOST_SAMPLES", 1000)


def test_what_is_short_enough_is_left_alone():
    given = trials(4, 250, 0.001)
    assert searched_part(given) == (given, [], [])


def test_fast_samples_are_averaged():
    part, left, said = searched_part(trials(4, 1000, 0.001))
    assert [len(t) for t in part] == [250] * 4 and part[0].dt == pytest.approx(0.004) and not left
    assert said == ["4000 samples are too many for one search: they were averaged to 1000"]


def test_trials_are_left_out_evenly_and_judge_the_rest():
    part, left, said = searched_part(trials(20, 250, 0.005))
    assert [t.name for t in part] == ["00", "06", "13", "19"] and len(left) == 4
    assert not {t.name for t in part} & {t.name for t in left}
    assert said == ["4 of 20 trials were searched, evenly spread, and 4 others judged it"]


def test_a_single_record_is_cut_at_its_end():
    ((part,), left, said) = searched_part(trials(1, 5000, 0.005))
    assert len(part) == 1000 and part.time[0] == 0.0 and not left
    assert said == ["only the first 5 s of 25 s were searched of trial 00"]


def test_two_trials_that_are_both_too_long():
    part, left, said = searched_part(trials(2, 5000, 0.005))
    assert sum(map(len, part)) <= 1000 and sum(map(len, left)) <= 1000 and len(said) == 2
