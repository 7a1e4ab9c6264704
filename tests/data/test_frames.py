"""Studies and trials as users of pandas expect them: from frames and back, by name, in slices of time."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas
import pytest
from data import studies

import fes_pin as fp

DEMO = Path(__file__).parents[2] / "analysis/studies/ankle_demo"
TIME = np.arange(200) * 0.01
START = {"gain": 0.65, "time_constant_s": 0.05, "inertia_kgm2": 0.001, "damping_nms": 0.06}


def frames(count=3):
    columns = {"pulse_width_us": 300.0 + 0.0 * TIME, "angle_rad": 1.8 + 0.1 * np.sin(TIME)}
    return {f"t{k}": pandas.DataFrame({"time_s": TIME, **columns}) for k in range(count)}


def constants(tmp_path):
    return fp.read_study(studies.ankle(tmp_path)).constants


def test_a_study_is_made_of_frames_and_of_mappings_of_arrays(tmp_path):
    about = {f"t{k}": {"load_kg": k + 0.5, "role": "fit"} for k in range(3)}
    known = {"name": "mine", "rig": "ankle", "start": START, "constants": constants(tmp_path)}
    study = fp.Study.from_frames(frames(), about, **known)
    assert [t.name for t in study] == ["t0", "t1", "t2"] and {t.kind for t in study} == {"motion"}
    assert [t.conditions["load_kg"] for t in study] == [0.5, 1.5, 2.5] and study["t1"].role == "fit"
    as_index = {name: one.set_index("time_s") for name, one in frames().items()}
    as_arrays = {name: {n: one[n].to_numpy() for n in one} for name, one in frames().items()}
    assert fp.Study.from_frames(as_index, about, **known) == study == fp.Study.from_frames(as_arrays, about, **known)


@pytest.mark.parametrize("rig", ["ankle", "joint", "muscle"])
def test_frames_of_a_study_make_it_again(tmp_path, rig):
    study = fp.read_study(getattr(studies, rig)(tmp_path))
    whole = {n: getattr(study, n) for n in ("name", "rig", "constants", "start", "files")}
    assert fp.Study.from_frames({t.name: t.to_frame() for t in study}, study.to_frame(), **whole) == study
    for trial in study:
        labels = {n: getattr(trial, n) for n in ("name", "kind", "conditions", "role", "group")}
        assert fp.Trial.from_frame(trial.to_frame(), **labels) == trial


def doubled(frame, name):
    """A frame with a column twice, the second of other numbers."""
    return pandas.concat([frame, 2.0 * frame[[name]]], axis=1)


BAD = {
    "no times": (lambda f: {n: one.drop(columns="time_s") for n, one in f.items()}, {}, "time_s: missing"),
    "rows lost": (lambda f: {n: one.drop(index=[5, 9]) for n, one in f.items()}, {}, "fixed step"),
    "rows that were chosen": (lambda f: {n: one[one["angle_rad"] < 1.899] for n, one in f.items()}, {}, "fixed step"),
    "a column twice": (
        lambda f: {**f, "t1": doubled(f["t1"], "angle_rad")}, {},
        "angle_rad: this name is there twice; expected it once (trial t1)",
    ),
    "times twice": (
        lambda f: {n: doubled(one, "time_s") for n, one in f.items()}, {}, "time_s: this name is there twice"
    ),
    "a trial twice": (
        lambda f: f, pandas.DataFrame({"load_kg": [1.0, 2.0, 3.0, 4.0]}, index=["t0", "t1", "t2", "t1"]),
        "about.t1: this name is there twice",
    ),
    "a condition twice": (
        lambda f: f, doubled(pandas.DataFrame({"load_kg": [1.0, 2.0, 3.0]}, index=["t0", "t1", "t2"]), "load_kg"),
        "about.load_kg: this name is there twice",
    ),
    "no frame": (
        lambda f: {"t0": [1.0, 2.0]}, {}, "frame: expected a mapping of names to values, found a list (trial t0)"
    ),
    "an unknown trial": (lambda f: f, {"t9": {"load_kg": 1.0}}, "expected names of frames, found 't9'"),
    "an unknown condition": (lambda f: f, {"t0": {"load": 1.0}}, "load"),
    "no condition": (lambda f: f, {}, "load_kg: missing"),
    "no frames": (lambda f: {}, {}, "at least one trial"),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD)
def test_frames_that_make_no_study_are_refused(tmp_path, case):
    change, about, words = BAD[case]
    about = about if len(about) else ({} if case == "no condition" else {n: {"load_kg": 1.0} for n in change(frames())})
    with pytest.raises(fp.InputError) as caught:
        fp.Study.from_frames(change(frames()), about, name="s", rig="ankle", start=START, constants=constants(tmp_path))
    assert words in str(caught.value)
    with pytest.raises(fp.InputError, match="rig: expected one of"):
        fp.Study.from_frames(frames(), name="s", rig="knee", start=START)


def test_trials_are_found_by_name_and_place(tmp_path):
    study = fp.read_study(studies.ankle(tmp_path))
    assert len(study) == 2 and list(study) == list(study.trials) and study["10"] is study[1] is study[-1]
    assert "10" in study and study[0] in study and "11" not in study
    with pytest.raises(KeyError, match="no trial '11'; it has 00, 10"):
        study["11"]
    with pytest.raises(IndexError):
        study[2]


def test_a_stretch_of_time_is_a_trial_and_what_was_stated_of_the_start_is_lost():
    trial = fp.Trial("a", "motion", {"position": TIME}, TIME, {"position0": 0.1, "start_s": 5.0})
    part = trial.between(0.5, 1.0)
    assert part.time[0] == 0.5 and part.time[-1] == 1.0 and len(part) == 51
    assert dict(part.conditions) == {"start_s": 5.5} and part.remarks == ("the first 0.5 s are cut off",)
    begin = trial.between(-1.0, 0.995)
    assert len(begin) == 100 and begin.conditions == trial.conditions and begin == trial.first(100)
    assert trial.between(0.0, 9.0) == trial == trial.part(slice(None))
    with pytest.raises(fp.InputError, match=r"at least 3 samples, found 0 of those from 0 to 1.99 s \(trial a\)"):
        trial.between(3.0, 4.0)
    assert part.between(0.6, 0.7).dt == pytest.approx(0.01)


def test_a_part_of_times_with_few_decimals_is_a_trial():
    trial = fp.Trial("a", "motion", {"position": np.zeros(300)}, np.round(np.arange(300) / 60.0, 3))
    assert len(trial.between(1.0, 1.05)) == 4 and replace(trial.between(1.0, 2.0), role="fit").role == "fit"


def test_errors_of_a_study_in_memory_name_no_file(tmp_path):
    study = fp.Study.from_frames(
        frames(2), {n: {"load_kg": 1.0} for n in ("t0", "t1")}, name="s", rig="ankle", start=START,
        constants=constants(tmp_path),
    )  # fmt: skip
    with pytest.raises(fp.InputError) as caught:
        fp.contrast(study)
    assert str(caught.value).startswith("group: trial t0 has no group") and caught.value.file is None


def test_what_a_check_says_is_a_frame_and_a_page():
    found = fp.check(fp.read_study(DEMO))
    table = found.to_frame()
    assert set(table["testable"]) <= {"shown", "absorbed", "silent"} and table.index.name == "cause"
    assert list(table.index[table["testable"] == "shown"]) == list(found.testable.shown)
    assert repr(found) == str(found) and "<p>" in found._repr_html_()


def test_the_example_of_the_documentation_runs(capsys):
    page = (DEMO.parents[2] / "docs" / "study_format.md").read_text()
    exec(page.split("```python\n")[1].split("```")[0], {})
    assert "Trial rested (isometric, fit): 101 samples" in capsys.readouterr().out
