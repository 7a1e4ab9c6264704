"""Trials as views of recordings: parts, sources with clocks of their own, positions from speeds."""

import numpy as np
import pytest

from fes_pin.data.errors import InputError
from fes_pin.data.recorded.free_part import free_from
from fes_pin.data.recorded.parts import HOLES, holes, restarts, rests
from fes_pin.data.study import read_study, write_study
from fes_pin.data.table import format_csv
from fes_pin.data.templates import rod

HEAD = '[study]\nname = "views"\nrig = "joint"\n[rig]\nurdf = "rod.urdf"\n[start]\ninertia_scale = 1.0\ndamping = 0.1\n'
DT = 0.01


def swing(time, phase=0.0):
    return 0.5 * np.cos(6.0 * time + phase)


def study(folder, text, files):
    """A study of these tables and files, each a mapping of columns."""
    (folder / "rod.urdf").write_text(rod(0.5, 1.0))
    for name, columns in files.items():
        (folder / name).write_text(format_csv(columns))
    (folder / "study.toml").write_text(HEAD + text)
    return read_study(folder)


def refused(folder, text, files):
    with pytest.raises(InputError) as caught:
        study(folder, text, files)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def joined_files(offset_s, seed=0, rate=(100.0, 270.0), share=1.0):
    """A driven rod's position, and its effort on a clock that is late by `offset_s`; J = 1/12, damping 0.2."""
    random = np.random.default_rng(seed)
    fine = np.arange(0.0, 6.0, 1e-4)
    parts = [(a, f, p) for a, f, p in zip(*random.uniform((0.2, 0.3, 0.0), (0.5, 1.5, 6.0), (4, 3)).T, strict=True)]
    wave = [a * np.sin(2.0 * np.pi * f * fine + p) for a, f, p in parts]
    position = np.sum(wave, axis=0)
    speed = np.gradient(position, fine)
    effort = np.gradient(speed, fine) / 12.0 + 0.2 * speed
    effort = share * effort + (1.0 - share) * random.normal(0.0, effort.std(), 13)[(fine * 2.0).astype(int)]
    one, other = (np.arange(0.0, 5.9, 1.0 / hz) for hz in rate)
    noisy = np.interp(one, fine, position) + random.normal(0.0, 1e-4, len(one))
    return {
        "a_pos.csv": {"time_s": one, "position": noisy},
        "a_tau.csv": {"time_s": other + offset_s, "effort": np.interp(other, fine, effort)},
    }


SOURCES = (
    '[sources.pos]\ntime_s = "time_s"\nposition = "position"\n[sources.tau]\ntime_s = "time_s"\neffort = "effort"\n'
)
JOINED = SOURCES + '[[trial]]\nkind = "motion"\nsources = { pos = "a_pos.csv", tau = "a_tau.csv" }\n'


def test_a_stretch_of_a_recording(tmp_path):
    time = np.arange(0.0, 4.0, DT)
    both = '[[trial]]\nfile = "a.csv"\nfrom = 0.5\nto = 1.5\n[[trial]]\nfile = "a.csv"\nfrom = 2.0\nrole = "held_out"\n'
    first, second = study(tmp_path, both, {"a.csv": {"time_s": time, "position": swing(time)}}).trials
    assert (first.name, second.name) == ("a-1", "a-2")
    assert (first.time[0], first.time[-1], second.time[0]) == (0.5, 1.5, 2.0)
    assert np.array_equal(second["position"], swing(time)[time >= 2.0])
    assert (first.role, second.role) == (None, "held_out")


def test_two_views_of_a_file_must_not_overlap(tmp_path):
    time = np.arange(0.0, 4.0, DT)
    both = '[[trial]]\nfile = "a.csv"\nfrom = 0.5\nto = 1.5\n[[trial]]\nfile = "a.csv"\nfrom = 1.4\n'
    said = refused(tmp_path, both, {"a.csv": {"time_s": time, "position": swing(time)}})
    assert "row 14" in said
    assert "the same file as trial[0].file; expected from and to" in said


@pytest.mark.parametrize("seed", range(20))
def test_times_that_start_again_make_trials(tmp_path, seed):
    random = np.random.default_rng(seed)
    lengths, begin = random.integers(30, 400, random.integers(2, 6)), random.uniform(0.0, 100.0)
    times = [begin + np.arange(n) * DT for n in lengths]
    position = np.concatenate([swing(t, i) for i, t in enumerate(times)])
    files = {"a.csv": {"time_s": np.concatenate(times), "position": position}}
    assert "it starts again" in refused(tmp_path, '[[trial]]\nfile = "a.csv"\n', files)
    found = study(tmp_path, '[[trial]]\nfile = "a.csv"\nsplit = "restarts"\nstart_s = 3.0\nposition0 = 0.4\n', files)
    assert [len(t) for t in found] == list(lengths)
    assert [t.name for t in found] == [f"a-{k + 1}" for k in range(len(lengths))]
    assert "position0" in found.trials[0].conditions  # of later parts nothing states where and when they began
    assert not any(t.conditions for t in found.trials[1:])
    assert all("cut into" in t.remarks[0] for t in found)
    write_study(found, tmp_path / "copy")
    assert read_study(tmp_path / "copy") == found


def test_jitter_is_no_new_beginning():
    random = np.random.default_rng(3)
    time = np.arange(500) * DT + random.uniform(-0.6, 0.6, 500) * DT
    assert len(restarts(time)) == 0
    assert len(restarts(np.arange(500) * DT)) == 0


@pytest.mark.parametrize("rate_hz", [50.0, 100.0, 1000.0])
def test_holes_are_cut_or_bridged_as_the_rate_asks(tmp_path, rate_hz):
    time = np.arange(0.0, 4.0, 1.0 / rate_hz)
    time = time[(time < 1.0) | (time > 1.0 + 10.5 / rate_hz)]
    time = time[(time < 3.0) | (time > 3.0 + 2.5 / rate_hz)]  # which is no hole
    files = {"a.csv": {"time_s": time, "position": swing(time)}}
    trial = '[[trial]]\nfile = "a.csv"\n'
    assert len(holes(time)) == 1
    assert f'split = "{HOLES}"' in refused(tmp_path, f"{trial}rate = {rate_hz}\n", files)
    (bridged,) = study(tmp_path, f"{trial}rate = {rate_hz / 4.0}\n", files)
    assert bridged.remarks[0].startswith("holes in time are bridged: 1, the longest")
    parts = study(tmp_path, f'{trial}split = "holes"\nrate = {rate_hz / 2.0}\n', files)
    assert np.allclose([t.time[0] for t in parts], [0.0, time[time > 1.0 + 1e-9][0]])
    assert not any("bridged" in said for t in parts for said in t.remarks)


def test_steps_that_grow_are_no_holes():
    """An encoder writes a row an edge while a wheel runs out."""
    time = np.cumsum(0.002 * np.exp(np.linspace(0.0, 5.0, 400)))
    assert len(holes(time)) == 0
    assert list(holes(np.r_[time[:200], time[200:] + 2.0])) == [200]
    even = np.arange(100) * DT
    assert list(holes(np.delete(even, [*range(20, 30), *range(31, 45)]))) == [20, 21]


def test_rests_are_left_out(tmp_path):
    time = np.arange(0.0, 12.0, DT)
    moving = ((time > 2.0) & (time < 5.0)) | ((time > 7.0) & (time < 10.0))
    noise = 1e-3 * np.random.default_rng(0).standard_normal(len(time))
    files = {"a.csv": {"time_s": time, "position": np.where(moving, np.sin(4.0 * np.pi * time), 0.0) + noise}}
    one, other = study(tmp_path, '[[trial]]\nfile = "a.csv"\nsplit = "rests"\n', files)
    assert abs(one.time[0] - 2.0) < 0.1
    assert abs(one.time[-1] - 5.0) < 0.1
    assert abs(other.time[0] - 7.0) < 0.1
    assert rests(time, [np.sin(time)]) == []


@pytest.mark.parametrize("times", [[0.0], [0.0, 0.01], [0.0, 0.0, 0.0, 0.0], [2.0, 1.0, 0.5, 0.2]])
@pytest.mark.parametrize("way", ["rests", "holes", "restarts"])
def test_too_few_rows_or_times_that_stand_are_one_line_however_they_are_split(tmp_path, times, way):
    files = {"a.csv": {"time_s": np.array(times), "position": swing(np.arange(len(times)) * DT)}}
    assert "a.csv" in refused(tmp_path, f'[[trial]]\nfile = "a.csv"\nsplit = "{way}"\n', files)


def test_a_column_and_marks_split_a_recording(tmp_path):
    time = np.arange(0.0, 6.0, DT)
    files = {"a.csv": {"time_s": time, "position": swing(time), "trial_no": np.floor(time / 2.0)}}
    by_column = study(tmp_path, '[[trial]]\nfile = "a.csv"\nsplit = "trial_no"\n', files)
    assert [len(t) for t in by_column] == [200, 200, 200]
    assert all(list(t.columns) == ["position"] for t in by_column)
    del files["a.csv"]["trial_no"]
    marks = study(tmp_path, '[[trial]]\nfile = "a.csv"\nat = [4.0, 2.0]\n', files)
    assert [float(t.time[0]) for t in marks] == [0.0, 2.0, 4.0]
    assert "split names it" in refused(tmp_path, '[[trial]]\nfile = "a.csv"\nsplit = "trial"\n', files)


ODD = (
    "from = 2.0\nto = 1.0",
    'from = "a"',
    "from = 90.0",
    "to = nan",
    "at = 3.0",
    "split = 1",
    "rate = -1.0",
    "sources = 3",
)
ODD += (
    'at = [1.0]\nsplit = "holes"',
    'derive = { position = "effort" }',
    'derive = "velocity"',
    "offset_s = { b = 1.0 }",
)


@pytest.mark.parametrize("text", ODD)
def test_a_view_that_cannot_be_is_one_line(tmp_path, text):
    time = np.arange(0.0, 4.0, DT)
    files = {"a.csv": {"time_s": time, "position": swing(time)}}
    said = refused(tmp_path, f'[[trial]]\nfile = "a.csv"\n{text}\n', files)
    assert len(said) < 500
    assert "expected" in said or "did you mean" in said


@pytest.mark.parametrize("seed", range(6))
def test_the_offset_of_a_clock_is_fitted(tmp_path, seed):
    offset = float(np.random.default_rng(seed).uniform(-0.08, 0.08))
    files = joined_files(offset, seed)
    (trial,) = study(tmp_path, f'{JOINED}offset_s = {{ tau = "fit" }}\n', files)
    (said,) = (r for r in trial.remarks if "fitted" in r)
    found = float(said.split(" ms")[0])
    assert abs(found + 1e3 * offset) < 1.0  # ms
    (stated,) = study(tmp_path, f"{JOINED}offset_s = {{ tau = {-offset} }}\n", files)
    assert f"{-1e3 * offset:.6g} ms are added" in stated.remarks[0]
    rows = slice(20, min(len(trial), len(stated)) - 20)
    assert np.corrcoef(stated["effort"][rows], trial["effort"][rows])[0, 1] > 0.99


def test_an_offset_that_data_do_not_show_is_refused(tmp_path):
    said = refused(tmp_path, f'{JOINED}offset_s = {{ tau = "fit" }}\n', joined_files(0.01, share=0.0))
    assert "do not show by how much the clocks differ" in said


def test_sources_without_a_time_in_common(tmp_path):
    files = joined_files(20.0)
    assert "in common" in refused(tmp_path, JOINED, files)
    files["a_tau.csv"]["position"] = files["a_tau.csv"]["effort"]
    both = JOINED.replace('effort = "effort"\n', 'effort = "effort"\nposition = "position"\n')
    assert "is also in pos" in refused(tmp_path, both, files)


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("case", ["moves again", "steps", "pushed twice"])
def test_what_moves_again_from_rest_or_swings_further_is_not_free(case, seed):
    """A joint that somebody wears rests where it ended, and moves by itself; a hand may push it twice."""
    random = np.random.default_rng(seed)
    time = np.arange(0.0, 24.0, DT)
    size, rate = random.uniform(0.2, 1.5) * random.choice([-1.0, 1.0]), random.uniform(3.0, 6.0)
    swing = lambda since: np.where(since > 0.0, np.exp(-1.2 * since) * np.sin(rate * since), 0.0)  # noqa: E731
    if case == "moves again":
        shape = swing(time - 2.0) + 0.4 * swing(time - 12.0)
    elif case == "steps":
        walks = (time > 2.0) & (time < 20.0)
        shape = walks * np.sin(rate * (time - 2.0)) * (1.0 + 0.15 * random.standard_normal(9)[(time // 3).astype(int)])
    else:
        shape = swing(time - 2.0) + random.uniform(0.3, 0.6) * swing(time - 2.0 - 4.0 * np.pi / rate)
    position = size * shape + 5e-4 * abs(size) * random.standard_normal(len(time)) + 0.3
    assert free_from(time, position) is None


def test_a_position_is_the_integral_of_a_speed(tmp_path):
    time = np.arange(0.0, 4.0, DT)
    files = {"a.csv": {"time_s": time, "velocity": np.cos(3.0 * time)}}
    (trial,) = study(tmp_path, '[[trial]]\nfile = "a.csv"\nderive = { position = "velocity" }\n', files)
    assert list(trial.columns) == ["position"]
    assert np.allclose(trial["position"], np.sin(3.0 * time) / 3.0, atol=1e-4)
    assert trial.remarks == ("position is the integral of velocity, from 0, and takes its place",)


@pytest.mark.parametrize("seed", range(20))
def test_the_free_part_begins_at_the_largest_deviation(seed):
    random = np.random.default_rng(seed)
    time = np.arange(0.0, 14.0, DT)
    rest, push = random.uniform(0.8, 2.0), random.uniform(0.3, 1.5)
    size, since = random.uniform(0.2, 1.5) * random.choice([-1.0, 1.0]), time - rest - push
    free = size * np.exp(-0.8 * since) * np.cos(random.uniform(4.0, 9.0) * since)
    by_hand = size * np.sin(0.5 * np.pi * np.clip((time - rest) / push, 0.0, 1.0)) ** 2
    position = np.where(since > 0.0, free, by_hand) + 5e-4 * abs(size) * random.standard_normal(len(time)) + 0.3
    begin = free_from(time, position)
    assert begin is not None
    assert abs(begin - rest - push) < 0.1
    assert free_from(time[since > 0.0], position[since > 0.0]) is None  # let go: all of it is free


def test_a_record_that_ends_elsewhere_has_no_free_part():
    time = np.arange(0.0, 6.0, DT)
    assert free_from(time, np.where(time < 1.0, 0.0, 1.0 - np.exp(-2.0 * (time - 1.0)))) is None
    assert free_from(time, np.sin(time)) is None
    assert free_from(time, np.zeros(len(time))) is None
