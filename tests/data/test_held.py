"""A study holds what was read: whatever becomes of its files, and whatever its trials are edited to, is told truly."""

import copy
import hashlib
import pickle
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from data import studies
from data.test_motion import folder as walk_folder  # noqa: F401

import fes_pin as fp
from fes_pin.data.as_read import HeldFile
from fes_pin.data.provenance import provenance_now
from fes_pin.data.study import EDITED
from fes_pin.models.nominal import nominal_model

READ = {"ankle": studies.ankle, "joint": studies.joint, "muscle": studies.muscle, "own": studies.own}


def sha(path):
    return hashlib.sha256(path.read_bytes()).hexdigest()


def test_a_study_in_memory_was_read_from_no_file(tmp_path, monkeypatch):
    """Whatever study.toml lies in the working directory."""
    read = fp.read_study(studies.ankle(tmp_path))
    monkeypatch.chdir(tmp_path)
    made = fp.Study("made", "ankle", read.constants, read.start, [replace(t, as_read=None) for t in read.trials])
    assert provenance_now(made, 0).inputs == {}


def test_hashes_are_those_of_the_bytes_at_reading(tmp_path):
    folder = studies.joint(tmp_path)
    names = ("study.toml", "rig.urdf", "a.csv", "b.csv")
    before = {name: sha(folder / name) for name in names}
    study = fp.read_study(folder)
    for name in names:
        (folder / name).write_text("changed\n")
    assert provenance_now(study, 0).inputs == before == provenance_now(pickle.loads(pickle.dumps(study)), 0).inputs


def test_what_was_edited_is_called_so(tmp_path):
    study = fp.read_study(studies.joint(tmp_path))
    first, second = study.trials
    inputs = study.inputs()
    moved = replace(study, trials=(first.with_columns(position=first["position"] + 1e-12), second))
    assert moved.inputs() == {**inputs, "a.csv": EDITED}
    same = replace(study, trials=(first.with_columns(position=first["position"] + 0.0), second))
    assert same.inputs() == inputs
    assert replace(study, start={**study.start, "damping": 1.0}).inputs() == {**inputs, "study.toml": EDITED}
    fewer = replace(study, trials=study.trials[:1]).inputs()
    assert fewer == {n: s for n, s in {**inputs, "study.toml": EDITED}.items() if n != "b.csv"}
    other = tmp_path / "other.urdf"
    other.write_text(studies.URDF.replace("0.15", "0.16"))
    changed = replace(study, files={"urdf": other}).inputs()
    assert changed["other.urdf"] == sha(other) and "rig.urdf" not in changed


@pytest.mark.parametrize("rig", READ)
def test_a_study_that_was_read_needs_its_folder_no_more(tmp_path, monkeypatch, rig):
    monkeypatch.chdir(tmp_path)
    READ[rig](Path("here"))
    study = fp.read_study("here")
    before = nominal_model(study)
    assert study.folder == tmp_path / "here"
    monkeypatch.chdir("/")
    assert nominal_model(study) == before
    shutil.rmtree(tmp_path / "here")
    assert nominal_model(study) == nominal_model(pickle.loads(pickle.dumps(study))) == before
    fp.write_study(study, tmp_path / "again")
    assert fp.read_study(tmp_path / "again") == study


@pytest.mark.parametrize("rig", READ)
def test_copies_of_a_study_are_equal_to_it_and_as_read_only(tmp_path, rig):
    study = fp.read_study(READ[rig](tmp_path))
    for other in (pickle.loads(pickle.dumps(study)), copy.copy(study), copy.deepcopy(study), replace(study)):
        assert other == study and hash(other) == hash(study) and other.inputs() == study.inputs()
        held = (other.constants, other.start, other.files, other.schema.constants, other.schema.outputs)
        for mapping in (*held, other.trials[0].columns, other.trials[0].conditions):
            with pytest.raises(TypeError):
                mapping["x"] = 1.0
        with pytest.raises(ValueError, match="read-only"):
            other.trials[0].time[0] = 1.0
        with pytest.raises(AttributeError):
            other.name = "x"
    assert study != replace(study, name="other") and study != "small"


def test_a_held_file_is_a_path_and_what_is_made_of_it_is_none(tmp_path):
    path = tmp_path / "rig.urdf"
    path.write_text("before")
    held = HeldFile.holding(path, path.read_bytes())
    path.write_text("after")
    assert held == path and held.read_text() == "before" and copy.deepcopy(held).read_bytes() == b"before"
    with pytest.raises(AttributeError):
        held.content = b"other"
    assert (held.parent / "rig.urdf").read_text() == "after" and held.parent.exists()


def test_a_urdf_that_is_not_there_or_not_one_is_refused_when_the_study_is_built(tmp_path):
    study = fp.read_study(studies.joint(tmp_path))
    with pytest.raises(fp.InputError, match=r"none.urdf: no such file"):
        replace(study, files={"urdf": tmp_path / "none.urdf"})
    with pytest.raises(fp.InputError, match="not XML"):
        replace(study, files={"urdf": tmp_path / "a.csv"})
    with pytest.raises(fp.InputError, match=r"files.urfd: unknown; did you mean urdf\?"):
        replace(study, files={**study.files, "urfd": tmp_path / "rig.urdf"})


def test_recordings_that_are_links_are_read(tmp_path):
    """As git-annex and DVC keep them: in a folder of their own."""
    folder, store = studies.joint(tmp_path / "study"), tmp_path / "annex"
    store.mkdir()
    for name in ("a.csv", "rig.urdf"):
        shutil.move(folder / name, store / f"SHA-{name}")
        (folder / name).symlink_to(store / f"SHA-{name}")
    assert fp.read_study(folder) == fp.read_study(studies.joint(tmp_path / "plain"))
    assert fp.read_study(folder).inputs()["a.csv"] == sha(store / "SHA-a.csv")
    (store / "SHA-a.csv").unlink()
    with pytest.raises(fp.InputError, match=r"study.toml, row 10.*a link to .*SHA-a.csv, which is not there"):
        fp.read_study(folder)


@pytest.fixture
def measured(walk, tmp_path):
    """The measured walk as a study of coordinates at 60 Hz and plates at 600."""
    text = (
        '[study]\nname = "w"\nrig = "body"\n[rig]\nmass_kg = 72.6\nheight_m = 1.8\n[[trial]]\nbelt_speed_mps = 1.135\n'
    )
    (tmp_path / "study.toml").write_text(text + 'coordinates = "coords.csv"\nground_reaction = "grf.csv"\n')
    for source, name in (("coords_mtpfree.csv", "coords.csv"), ("grf_raw_600hz.csv", "grf.csv")):
        shutil.copy(walk / source, tmp_path / name)
    return fp.read_study(tmp_path)


def test_a_walk_is_the_trials_that_it_is_given(measured):
    """Doubled forces and fewer samples give other answers; a trial as it was read is read at its own rates."""
    from fes_pin.walk.recording import recordings_of

    study = measured
    (trial,) = study.trials
    doubled = trial.with_columns(**{n: 2.0 * trial[n] for n in trial.columns if n[1:3] in ("_F", "_T")})
    (whole,) = recordings_of(study)
    (again,) = recordings_of(replace(study, trials=(trial.with_columns(r_Fx=trial["r_Fx"]),)))
    (heavy,) = recordings_of(replace(study, trials=(doubled,)))
    (short,) = recordings_of(replace(study, trials=(trial.first(len(trial) // 2),)))
    assert np.array_equal(whole.plates.total, again.plates.total) and len(whole.read.args[0]) > len(trial)
    up = [plates.plates.feet["right"][:, 2].max() for plates in (whole, heavy)]
    assert up[1] == pytest.approx(2.0 * up[0], rel=0.05)
    assert len(short.motion.time) < len(whole.motion.time) and short.time[-1] < whole.time[-1]


def test_a_walk_is_written_at_its_own_rates_and_needs_its_files_no_more(walk_folder, tmp_path):  # noqa: F811
    from fes_pin.walk.recording import recordings_of

    study = fp.read_study(walk_folder)
    fp.write_study(study, tmp_path / "copy")
    again = fp.read_study(tmp_path / "copy")
    assert again == study
    for one, other in zip(again.trials[0].as_read.recordings, study.trials[0].as_read.recordings, strict=True):
        assert np.array_equal(one[0], other[0]) and one[1].keys() == other[1].keys()
    edited = replace(study, trials=(study.trials[0].with_columns(r_Fx=0.0 * study.trials[0].time),))
    fp.write_study(edited, tmp_path / "edited")
    assert fp.read_study(tmp_path / "edited") == edited != study
    with pytest.raises(fp.InputError, match="trial coords has 0 samples of motion and reaction together"):
        recordings_of(replace(edited, trials=(edited.trials[0].first(4),)))


WALKS = {
    "a coordinate is missing": (lambda t: t.without("q_hip_flexion_r"), "q_hip_flexion_r: missing"),
    "a force is missing": (lambda t: t.without("r_Fx"), "r_Fx: missing"),
    "a misspelt coordinate": (lambda t: t.with_columns(q_lumbar_extnsion=t.time), "did you mean q_lumbar_extension"),
    "another column": (lambda t: t.with_columns(emg=t.time), "emg: unknown; expected q_<coordinate>"),
    "degrees": (lambda t: t.with_columns(q_hip_flexion_r=np.degrees(t["q_hip_flexion_r"]) + 9.0), "is it in degrees?"),
    "knees the other way": (
        lambda t: t.with_columns(**{f"q_knee_angle_{s}": np.abs(t[f"q_knee_angle_{s}"]) + 0.8 for s in "rl"}),
        "flexion below 0",
    ),
}


@pytest.mark.parametrize("case", WALKS)
def test_a_walk_that_cannot_be_is_refused_when_it_is_built(measured, case):
    change, words = WALKS[case]
    with pytest.raises(fp.InputError) as caught:
        replace(measured, trials=(change(measured.trials[0]),))
    assert words in str(caught.value)
