"""Good studies: read as they stand, round trips, real data."""

import pickle
import string
import time

import numpy as np
import pytest
from data import studies
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fes_pin.data.errors import InputError
from fes_pin.data.outputs import RECORD
from fes_pin.data.study import Study, read_study, write_study
from fes_pin.data.trial import Trial
from fes_pin.data.trial_files import read_trial, write_trial
from fes_pin.models.rigs.rigid import load_urdf

numbers = st.floats(-1e6, 1e6)
names = st.text(string.ascii_lowercase + string.digits + "_-", min_size=1, max_size=12)


def test_ankle(tmp_path):
    folder = studies.ankle(tmp_path)
    study = read_study(folder)
    assert (study.name, study.rig, study.folder, study.urdf) == ("small", "ankle", folder, None)
    assert study.constants["foot_mass_kg"] == 0.1 and study.constants["theta_r_rad"] == 1.3
    assert dict(study.start) == {"gain": 0.65, "time_constant_s": 0.05, "inertia_kgm2": 0.001, "damping_nms": 0.06}
    motion, isometric = study.trials
    assert (motion.name, motion.kind, motion.role, dict(motion.conditions)) == ("00", "motion", "fit", {"load_kg": 1.0})
    assert (isometric.name, isometric.kind, isometric.role) == ("10", "isometric", None)
    assert dict(isometric.conditions) == {"angle_rad": 1.9}
    assert list(motion.columns) == ["pulse_width_us", "angle_rad"] and len(motion) == 5
    assert motion.dt == pytest.approx(0.005) and motion.duration == pytest.approx(0.02)
    assert motion["angle_rad"].tolist() == [1.80, 1.81, 1.82, 1.83, 1.84]
    assert not motion.time.flags.writeable and not motion["angle_rad"].flags.writeable
    with pytest.raises(KeyError, match="pulse_width_us, angle_rad"):
        motion["force_n"]
    assert "2 trials" not in repr(study) and "1 motion and 1 isometric" in repr(study)
    assert "200 Hz" in repr(motion) and study.trial("10") is isometric
    assert_same(read_study(folder / "study.toml"), study)


def test_what_is_tolerated(tmp_path):
    """A byte-order mark, Windows line ends, blanks in the header, blank lines at the end."""
    folder = studies.ankle(tmp_path)
    text = studies.MOTION.replace("_us,", "_us, ") + "\n\n"
    (folder / "trials/00.csv").write_bytes(b"\xef\xbb\xbf" + text.replace("\n", "\r\n").encode())
    assert list(read_study(folder).trials[0].columns) == ["pulse_width_us", "angle_rad"]


def test_joint_start_values_in_rig_are_known(tmp_path):
    folder = studies.joint(tmp_path)
    toml = studies.JOINT.replace("damping = 1e-3\n", "").replace("[start]", "damping = 2e-3\n[start]")
    (folder / "study.toml").write_text(toml)
    study = read_study(folder)
    assert dict(study.constants) == {"damping": 2e-3} and dict(study.start) == {"inertia_scale": 1.0}
    assert study.urdf == folder / "rig.urdf"


def test_joint_mimic_is_not_moving(tmp_path):
    folder = studies.joint(tmp_path)
    more = '<link name="toe"/><joint name="mtp" type="continuous"><parent link="arm"/><child link="toe"/>'
    urdf = studies.URDF.replace("</robot>", more + '<mimic joint="pivot"/></joint></robot>')
    (folder / "rig.urdf").write_text(urdf)
    assert read_study(folder).rig == "joint"
    assert load_urdf(folder / "rig.urdf").nv == 1


def test_inputs_only(tmp_path):
    path = tmp_path / "x.csv"
    path.write_text("time_s,pulse_width_us\n0,0\n1,300\n2,0\n")
    trial = read_trial(path, rig="ankle", conditions={"load_kg": 1}, inputs_only=True)
    assert (trial.name, trial.kind, list(trial.columns)) == ("x", "motion", ["pulse_width_us"])
    with pytest.raises(InputError, match=r"row 1, column angle_rad: missing"):
        read_trial(path, rig="ankle", conditions={"load_kg": 1})
    with pytest.raises(InputError, match=r"load_kg: missing"):
        read_trial(path, rig="ankle", inputs_only=True)
    path.write_text("time_s\n0\n1\n2\n")
    assert not read_trial(path, rig="joint", inputs_only=True).columns


@pytest.mark.parametrize(("rate", "decimals"), [(60, 3), (600, 4), (1200, 4), (240, 3), (128, 3), (400, 3), (1000, 3)])
def test_rounded_times_are_one_rate(tmp_path, rate, decimals):
    path = tmp_path / "a.csv"
    rows = [f"{i / rate - 0.002:.{decimals}f},0.0" for i in range(500)]
    path.write_text("\n".join(["time_s,position", *rows]) + "\n")
    trial = read_trial(path, rig="joint")
    assert trial.dt == pytest.approx(1 / rate, rel=5e-3)
    bad = rows[:250] + rows[251:]
    path.write_text("\n".join(["time_s,position", *bad]) + "\n")
    with pytest.raises(InputError, match="fixed step") as caught:
        read_trial(path, rig="joint")
    assert rate != 1000 or caught.value.row == 252


def test_one_sample_moved_by_its_last_digit(tmp_path):
    path = tmp_path / "a.csv"
    times = [f"{0.005 * i:.3f}" for i in range(400)]
    times[200] = "1.001"
    path.write_text("\n".join(["time_s,position", *(f"{t},0" for t in times)]))
    with pytest.raises(InputError, match=r"row 202, column time_s: expected a fixed step"):
        read_trial(path, rig="joint")


def test_residual():
    measured = Trial("a", "motion", {"position": np.ones(3)}, np.arange(3.0))
    simulated = Trial("a", "motion", {"position": np.full(3, 0.25)}, np.arange(3.0))
    assert measured.residual(simulated, "position").tolist() == [0.75] * 3
    with pytest.raises(ValueError, match="same times"):
        measured.residual(Trial("b", "motion", {"position": np.ones(3)}, np.arange(3.0) * 2), "position")
    assert list(measured.with_columns(velocity=np.zeros(3)).without("position").columns) == ["velocity"]
    with pytest.raises(ValueError, match="shape"):
        Trial("a", "motion", {"position": np.ones(2)}, np.arange(3.0))


@settings(max_examples=30, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(values=st.lists(numbers, min_size=3, max_size=30), step=st.floats(1e-5, 10.0), start=st.floats(-100, 100))
def test_trial_round_trip(tmp_path, values, step, start):
    trial = Trial("a", "motion", {"position": np.array(values)}, start + step * np.arange(len(values)))
    write_trial(trial, tmp_path / "a.csv")
    assert_same_trial(read_trial(tmp_path / "a.csv", rig="joint"), trial)


@settings(max_examples=30, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(
    name=st.text(string.printable, min_size=1).filter(lambda s: s.strip() and s.isprintable()),
    files=st.lists(names, min_size=1, max_size=4, unique=True),
    start=st.fixed_dictionaries({"gain": st.floats(1e-6, 1e6), "time_constant_s": st.floats(1e-6, 1e3)}),
    role=st.sampled_from([None, "fit", "held_out"]),
    start_s=numbers,
    group=st.none() | names,
)
def test_study_round_trip(tmp_path_factory, name, files, start, role, start_s, group):
    columns = {"stim": np.array([1.0, 0.0, 0.0]), "force_n": np.array([0.0, start["gain"], -0.0])}
    trials = [Trial(f, "isometric", columns, np.arange(3) * 0.1, {"start_s": start_s}, role, group) for f in files]
    folder = tmp_path_factory.mktemp("round") / "study"
    study = Study(name, "muscle", {}, start, tuple(trials), folder)
    write_study(study, folder)
    assert_same(read_study(folder), study)


@pytest.mark.parametrize("rig", ["ankle", "joint", "muscle"])
def test_write_read_and_pickle(tmp_path, rig):
    study = read_study(getattr(studies, rig)(tmp_path / "a"))
    write_study(study, tmp_path / "b")
    assert_same(read_study(tmp_path / "b"), study)
    assert_same(pickle.loads(pickle.dumps(study)), study)
    write_study(study, tmp_path / "b")
    assert {p.name for p in (tmp_path / "b").rglob(".*")} == {RECORD}


def test_clean_files_read_fast(tmp_path):
    """10 000 rows of three columns: a few ms; the bound leaves room for a busy machine."""
    path = tmp_path / "a.csv"
    values = np.column_stack([np.arange(10_000) * 1e-3, np.random.default_rng(0).normal(size=(10_000, 2))])
    np.savetxt(path, values, delimiter=",", header="time_s,position,velocity", comments="", fmt="%.6f")
    read_trial(path, rig="joint")
    best = min(timed(lambda: read_trial(path, rig="joint")) for _ in range(5))
    assert best < 0.1


@pytest.mark.shared
def test_practice_studies(shared):
    folders = sorted(path.parent for path in (shared / "practice").glob("*/study.toml"))
    assert len(folders) == 36
    for folder in folders:
        study = read_study(folder)
        assert (study.name, study.rig) == (folder.name, "ankle")
        assert len(study.trials) == len(list((folder / "trials").glob("*.csv")))
        assert all(t.dt == pytest.approx(0.005) for t in study.trials)


@pytest.mark.shared
@pytest.mark.parametrize(("name", "rig", "count"), [("free_pendulum", "joint", 6), ("biceps_fes", "muscle", 20)])
def test_real_studies(shared, tmp_path, name, rig, count):
    study = read_study(shared / "data" / name)
    assert (study.rig, len(study.trials)) == (rig, count)
    write_study(study, tmp_path / name)
    assert_same(read_study(tmp_path / name), study)


def timed(call):
    start = time.perf_counter()
    call()
    return time.perf_counter() - start


def assert_same(one, other):
    assert (one.name, one.rig) == (other.name, other.rig)
    assert dict(one.constants) == dict(other.constants) and dict(one.start) == dict(other.start)
    assert list(one.files) == list(other.files)
    assert len(one.trials) == len(other.trials)
    for a, b in zip(one.trials, other.trials, strict=True):
        assert_same_trial(a, b)


def assert_same_trial(one, other):
    assert (one.name, one.kind, one.role, one.group) == (other.name, other.kind, other.role, other.group)
    assert dict(one.conditions) == dict(other.conditions)
    assert list(one.columns) == list(other.columns)
    np.testing.assert_array_equal(one.time, other.time)
    for name in one.columns:
        np.testing.assert_array_equal(one[name], other[name])
