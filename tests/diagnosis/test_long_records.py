"""Records longer than a search can hold are searched in part, and that is said."""

import numpy as np
import pytest

from fes_pin.data.trial import Trial
from fes_pin.models.rigs.joint import Joint
from fes_pin.prepare import long_records
from fes_pin.prepare.long_records import searched_part, thinned

SCHEMA = Joint.described()


def trials(count, samples, dt):
    time = np.arange(samples) * dt
    return [Trial(f"{k:02d}", "motion", {"effort": np.sin(time), "position": time}, time) for k in range(count)]


@pytest.fixture(autouse=True)
def few(monkeypatch):
    monkeypatch.setattr(long_records, "MOST_SAMPLES", 1000)


def test_what_is_short_enough_is_left_alone():
    given = trials(4, 250, 0.001)
    assert searched_part(given, SCHEMA) == (given, [], [])


def test_fast_samples_are_averaged():
    part, left, said = searched_part(trials(4, 1000, 0.001), SCHEMA)
    assert [len(t) for t in part] == [250] * 4 and part[0].dt == pytest.approx(0.004) and not left
    assert said == ["4000 samples are more than a search needs: they were averaged to 1000"]


def test_trials_are_left_out_evenly_and_judge_the_rest():
    part, left, said = searched_part(trials(20, 250, 0.005), SCHEMA)
    assert [t.name for t in part] == ["00", "06", "13", "19"] and len(left) == 4
    assert not {t.name for t in part} & {t.name for t in left}
    assert said == ["4 of 20 trials were searched, evenly spread, and 4 others judged it"]


def test_a_single_record_is_cut_at_its_end():
    ((part,), left, said) = searched_part(trials(1, 5000, 0.005), SCHEMA)
    assert len(part) == 1000 and part.time[0] == 0.0 and not left
    assert said == ["only the first 5 s of 25 s were searched of trial 00"]


def test_two_trials_that_are_both_too_long():
    part, left, said = searched_part(trials(2, 5000, 0.005), SCHEMA)
    assert sum(map(len, part)) <= 1000 and sum(map(len, left)) <= 1000 and len(said) == 2


@pytest.mark.parametrize("driven", [False, True])
@pytest.mark.parametrize("count", [4, 5])
def test_what_is_read_keeps_its_time_beside_what_is_held(count, driven):
    time = np.arange(1000) * 0.004 / count
    effort = np.where(time < 0.5 * time[-1], 0.0, 2.0)
    trial = Trial("00", "motion", {"effort": effort, "position": 3.0 * time}, time)
    short = thinned(trial, SCHEMA, driven)
    assert short.dt == pytest.approx(0.004)
    assert np.allclose(short["position"], 3.0 * short.time)
    assert np.allclose(short["effort"], [effort[count * k : count * (k + 1)].mean() for k in range(len(short))])


def test_what_is_read_is_averaged_unless_the_effort_answers_it():
    time, rng = np.arange(40_000) * 1e-3, np.random.default_rng(0)
    trial = Trial("00", "motion", {"effort": np.zeros(40_000), "position": rng.normal(size=40_000)}, time)
    assert np.std(thinned(trial, SCHEMA)["position"]) == pytest.approx(3.0**-0.5, rel=0.05)
    assert np.array_equal(thinned(trial, SCHEMA, driven=True)["position"], trial["position"][::4])


def test_without_an_input_everything_is_averaged_alike():
    time = np.arange(100) * 1e-3
    short = thinned(Trial("00", "motion", {"position": time}, time), SCHEMA)
    assert np.allclose(short["position"], short.time)
    assert short.time[0] == pytest.approx(0.0015)
