"""Small inputs like real ones, each read by one command and diagnosed: `cases` of the measured data."""

import contextlib
import re
import shutil
import sys
from dataclasses import replace

import pytest

import fes_pin as fp
from fes_pin.cli import main

pytestmark = pytest.mark.shared

KNEE = ("--pendulum", "0.25", "2.4", "--column", "position=knee angle [deg]:deg,zero=-90")
DROP = ("--pendulum", "0.24", "2.4", "--column", "time_s=time_s", "--column", "position=knee_deg:deg,zero=-90")
TWITCH = ("--rig", "muscle", "--column", "time_s=Time:s", "--column", "force_n=Force:mN")
CYCLE = (
    *("--rod", "0.2", "1", "--set", "kind=imposed"),
    *("--column", "position=angle_deg:deg", "--column", "effort=torque_Nm:Nm"),
)
LAGS = {"second_order_activation", "sensor_lag"}
STARTS = (0.01, 0.1, 10.0)
"""Factors on a believed damping: the verdict and its values do not depend on it."""


def study_of(shared, folder, files, *words):
    """The study that one command makes of files of the cases."""
    for file in files:
        shutil.copy(shared / "cases" / file, folder)
    names = [str(folder / file.rpartition("/")[2]) for file in files if file.endswith(".csv")]
    argv, sys.argv = sys.argv, ["fes-pin", "new-study", *names, *words]
    try:
        with contextlib.suppress(SystemExit):
            main.main()
    finally:
        sys.argv = argv
    return fp.read_study(folder)


def estimate(diagnosis, name):
    """The value and the interval of a parameter of the extended model."""
    return diagnosis.extended.values[name], diagnosis.extended.interval(name)


def named(diagnosis):
    return {c.name for c in diagnosis.causes}


def test_a_pendulum_test_of_a_knee_lacks_a_constant_torque(shared, tmp_path):
    study = study_of(shared, tmp_path, ["pendulum_test_of_a_knee.csv"], *KNEE)
    found = fp.diagnose(study)
    assert "effort_offset" in named(found) <= {"effort_offset", "coulomb_friction"} and found.extended_error[0] < 1.0
    torque, damping = (found.extended.values[n] for n in ("effort_offset.offset", "damping"))
    assert torque == pytest.approx(2.3, rel=0.02) and damping == pytest.approx(0.15, rel=0.1)


@pytest.mark.parametrize("factor", STARTS)
def test_one_clean_trial_has_one_answer_wherever_it_began(factor, shared, tmp_path):
    words = ("--rod", "0.4734", "2.3351")
    study = study_of(shared, tmp_path, ["pendulum_offset_one_clean_trial/a.csv"], *words)
    found = fp.diagnose(replace(study, start={**study.start, "damping": factor * study.start["damping"]}))
    assert named(found) == {"effort_offset"}
    assert found.extended.values["effort_offset.offset"] == pytest.approx(2.0, rel=0.01)
    assert not found.remainder.unexplained and found.ceiling_percent <= 1.0


def test_a_smoothed_drop_lacks_a_constant_torque(shared, tmp_path):
    found = fp.diagnose(study_of(shared, tmp_path, ["smoothed_single_drop/drop0.csv"], *DROP))
    assert named(found) == {"effort_offset"}
    assert found.extended.values["effort_offset.offset"] == pytest.approx(2.1, abs=0.01)
    assert found.extended_error[0] < 0.02


@pytest.mark.parametrize("which", ["resting_tension/tw", "twitch_on_resting_force/"])
def test_a_resting_force_and_a_twitch_are_fitted_together(which, shared, tmp_path):
    files = [f"{which}{k}.csv" for k in ("0123" if which.endswith("tw") else "abcd")]
    words = TWITCH if which.endswith("tw") else ("--rig", "muscle")
    found = fp.diagnose(study_of(shared, tmp_path, files, *words))
    assert named(found) - LAGS == {"sensor_offset", "electromechanical_delay"} and named(found) & LAGS
    offset, _ = estimate(found, "sensor_offset.offset")
    assert offset == pytest.approx(0.24 if which.endswith("tw") else 0.23, abs=0.002)
    assert found.extended_error[1] < 100.0


@pytest.mark.parametrize("file", ["100Hz.csv", "300Hz.csv", "imposed_pure_spring.csv"])
def test_a_slow_cycle_has_one_answer_at_any_rate(file, shared, tmp_path):
    found = fp.diagnose(study_of(shared, tmp_path, [f"one_slow_cycle/{file}"], *CYCLE))
    assert named(found) == {"parallel_stiffness", "coulomb_friction"}
    assert found.extended.values["coulomb_friction.torque_nm"] == pytest.approx(0.4, abs=0.01)
    assert found.extended.values["damping"] == pytest.approx(0.6, abs=0.02)
    assert found.extended_error[0] < 0.02


@pytest.mark.parametrize("kind", [None, "motion", "imposed"])
def test_a_joint_under_position_control_lacks_dry_friction_alone(kind, shared, tmp_path):
    """Whatever kind is said: the noise of the torque that was read would move so light a rod far more."""
    words = ("--rod", "0.05", "0.7", *(("--set", f"kind={kind}") if kind else ()))
    study = study_of(shared, tmp_path, [f"controlled_{x}.csv" for x in "abc"], *words)
    found = fp.diagnose(study)
    assert named(found) == {"coulomb_friction"} and not found.remainder.unexplained
    torque, interval = estimate(found, "coulomb_friction.torque_nm")
    assert torque == pytest.approx(0.25, abs=0.001) and interval[0] < 0.25 < interval[1]
    contradicted = any('is contradicted and "imposed" is taken' in w for w in found.warnings)
    assert {t.kind for t in study.trials} == {kind or "imposed"} and contradicted is (kind == "motion")


def test_a_rod_of_another_inertia_and_weight_lacks_dry_friction_alone(shared, tmp_path):
    """No periodic torque at the frequency of a commanded sine: weight is fitted, as the inertia is."""
    study = study_of(shared, tmp_path, ["position_controlled_friction.csv"], "--rod", "0.05", "0.7")
    found = fp.diagnose(study)
    assert named(found) == {"coulomb_friction"} and not found.remainder.unexplained
    torque, interval = estimate(found, "coulomb_friction.torque_nm")
    assert torque == pytest.approx(0.25, abs=0.001) and interval[0] < 0.25 < interval[1]
    assert found.extended.values["gravity_scale"] == pytest.approx(0.0, abs=0.02)


def test_a_goal_position_is_taken_as_one(shared, tmp_path):
    """The stiffness is 8 N m/rad, and the damping of the controller, 0.4 N m s/rad, adds to that of the joint."""
    columns = ("--column", "position=actual:rad", "--column", "effort=command:Nm")
    files = [f"position_command_as_effort/{x}.csv" for x in "abc"]
    study = study_of(shared, tmp_path, files, "--rod", "0.4", "1.2", *columns)
    assert any(
        re.search(r"looks like a goal position in 3 trials.* [78](\.\d)? N m/rad", w) for w in fp.check(study).odd
    )
    found = fp.diagnose(study)
    assert named(found) == {"coulomb_friction"} and found.extended.values["damping"] > 0.4
    for name in ("inertia_scale", "gravity_scale"):
        assert found.extended.values[name] == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize("file", ["100Hz.csv", "300Hz.csv", "imposed_pure_spring.csv"])
def test_a_slow_cycle_that_a_stand_imposes_needs_no_kind(file, shared, tmp_path):
    words = [w for w in CYCLE if w not in ("--set", "kind=imposed")]
    study = study_of(shared, tmp_path, [f"one_slow_cycle/{file}"], *words)
    assert {t.kind for t in study.trials} == {"imposed"}


def test_no_practice_loop_is_doubted(shared):
    studies = [fp.read_study(folder) for folder in sorted((shared / "practice_loops").glob("c*"))]
    assert len(studies) == 30
    for study in studies:
        kinds = {t.kind for t in study.trials if "effort" in t}
        assert kinds == {"motion"} and '"motion" is taken' in study.trials[0].remarks[0], study.name


def test_a_joint_that_turns_thirty_times_is_diagnosed(shared, tmp_path):
    files = ["turning_a.csv", "turning_b.csv", "turning_rotor.urdf"]
    found = fp.diagnose(study_of(shared, tmp_path, files, "--urdf", str(tmp_path / "turning_rotor.urdf")))
    assert named(found) == {"coulomb_friction"}
    assert found.extended.values["coulomb_friction.torque_nm"] == pytest.approx(0.02, rel=0.01)


def test_a_joint_that_turns_is_checked_in_degrees_too(shared, tmp_path, capsys):
    """No fit, grid or start ends in an input error, though what is read is in another unit than it says."""
    shutil.copy(shared / "cases/turning_rotor.urdf", tmp_path)
    for file in ("turning_a.csv", "turning_c.csv"):
        head, *rows = (shared / "cases" / file).read_text().splitlines()
        cells = (row.split(",") for row in rows)
        turned = (f"{time},{effort},{float(angle) * 57.29578:.6g}" for time, effort, angle in cells)
        (tmp_path / file).write_text("\n".join([head, *turned]))
    names = [str(tmp_path / file) for file in ("turning_a.csv", "turning_c.csv")]
    for words in (
        ("new-study", *names, "--urdf", str(tmp_path / "turning_rotor.urdf")),
        ("check", str(tmp_path)),
    ):
        sys.argv = ["fes-pin", *words]
        with pytest.raises(SystemExit) as ended:
            main.main()
        assert not ended.value.code, capsys.readouterr().err
    assert re.search(r"these trials can show \d+ causes", capsys.readouterr().out)
