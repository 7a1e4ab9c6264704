"""Units that files state hold wherever a column is named; a current is no effort, a force no pulse width."""

import numpy as np
import pytest
from data.test_laboratory_forms import drawn, study_of, written

from fes_pin.data.errors import InputError
from fes_pin.data.motion import read_coordinates, read_motion
from fes_pin.data.new_recording import propose
from fes_pin.data.recorded.formats import read_recording
from fes_pin.data.schema import known_rigs
from fes_pin.data.study import read_study
from fes_pin.data.units import split_header

TIME = 0.01 * np.arange(60)
ANGLE = 20.0 * np.cos(3.0 * TIME)


def recorded(path, *lines, second=ANGLE):
    return written(path, *lines, values=np.column_stack([TIME, ANGLE, second]))


DEGREES = {
    "brackets": ("Angle [deg]", ()),
    "round": ("Angle (°)", ()),
    "underscore": ("Angle_deg", ()),
    "slash": ("Angle/deg", ()),
    "blank": ("Angle deg", ()),
    "camel": ("kneeDeg", ()),
    "units_row": ("Angle", ("s,deg,-",)),
    "units_row_with_others": ("Angle", ("s,deg,LSB",)),
}


@pytest.mark.parametrize("case", DEGREES)
def test_a_column_that_is_named_by_hand_keeps_the_unit_of_the_file(tmp_path, case):
    name, units = DEGREES[case]
    path = recorded(tmp_path / "a.csv", f"Time,{name},x", *units)
    study, _ = study_of(tmp_path, path, columns={"position": name, "time_s": "Time:s"})
    assert np.allclose(study.trials[0]["position"], np.radians(ANGLE), atol=1e-6)
    place = tmp_path / "study.toml"
    by_hand = place.read_text().replace(f'{{ name = "{name}", unit = "deg" }}', f'"{name}"')
    assert by_hand != place.read_text()
    place.write_text(by_hand)
    with pytest.raises(InputError, match="says deg: expected the unit of the numbers"):
        read_study(tmp_path)
    place.write_text(by_hand.replace(f'position = "{name}"', f'position = {{ name = "{name}", unit = "rad" }}'))
    assert np.allclose(read_study(tmp_path).trials[0]["position"], ANGLE, atol=1e-4)  # a person knows better


@pytest.mark.parametrize(
    "name", ["Angle [rad]", "Angle", "Angle_rad", "Angle [left]", "angle_filtered", "knee.q", "leg_a"]
)
def test_names_without_another_unit_are_taken_as_they_are(tmp_path, name):
    path = recorded(tmp_path / "a.csv", f"Time,{name},x")
    study, _ = study_of(tmp_path, path, columns={"position": name, "time_s": "Time:s"})
    assert np.allclose(study.trials[0]["position"], ANGLE, atol=1e-4)


@pytest.mark.parametrize("name", ["Angle [V]", "Angle_mV", "Angle [counts]", "Angle [mm]", "Angle [N m]"])
def test_a_unit_of_another_quantity_wants_a_scale(tmp_path, name):
    path = recorded(tmp_path / "a.csv", f"Time,{name},x")
    columns = {"position": name, "time_s": "Time:s"}
    with pytest.raises(InputError, match=r"--column position: the file says a .*: expected NAME:UNIT, or NAME,scale="):
        study_of(tmp_path, path, columns=columns)
    study, _ = study_of(tmp_path, path, columns={**columns, "position": f"{name},scale=0.5"})
    assert np.allclose(study.trials[0]["position"], 0.5 * ANGLE, atol=1e-4)
    place = tmp_path / "study.toml"
    place.write_text(place.read_text().replace(", scale = 0.5", ""))
    with pytest.raises(InputError, match=r"columns\.position\.unit: missing, and the name says a "):
        read_study(tmp_path)


CURRENTS = ("current", "Motor current", "motorCurrent", "Current [A]", "Torque [A]", "torque_mA", "Strom", "u [A]")


@pytest.mark.parametrize("name", CURRENTS)
def test_a_current_is_no_effort_without_a_scale(tmp_path, name):
    path = recorded(tmp_path / "a.csv", f"time_s,angle_rad,{name}")
    with pytest.raises(InputError) as caught:
        study_of(tmp_path, path)
    assert f"--column effort={name},scale=NUMBER (N m for each " in str(caught.value)
    assert "or nothing: --column effort=" in str(caught.value)
    with pytest.raises(InputError, match=r"a current in m?A: expected NAME:UNIT, or NAME,scale="):
        study_of(tmp_path, path, columns={"effort": name})
    study, _ = study_of(tmp_path, path, columns={"effort": f"{name},scale=0.1"})
    assert np.allclose(study.trials[0]["effort"], 0.1 * ANGLE, atol=1e-5)
    assert "effort" not in study_of(tmp_path, path, columns={"effort": ""})[0].trials[0].columns


@pytest.mark.parametrize("name", ["torque", "Motor", "command", "effort", "u"])
def test_other_efforts_are_proposed_as_before(tmp_path, name):
    path = recorded(tmp_path / "a.csv", f"time_s,angle_rad,{name}")
    assert propose(path, known_rigs()["joint"], True).candidates["effort"] == (name,)


@pytest.mark.parametrize("name", ["CurrentKG", "Current [N]", "stim force [N]", "load_kg", "Force", "current_N"])
@pytest.mark.parametrize("rig", ["muscle", "ankle"])
def test_a_force_is_no_pulse_width(tmp_path, rig, name):
    path = recorded(tmp_path / "a.csv", f"time_s,Microseconds,{name}")
    found = propose(path, known_rigs()[rig], None).candidates
    assert found["pulse_width_us"] == ("Microseconds",)
    assert name in found["force_n"]


@pytest.mark.parametrize("name", ["current", "stim current", "MilliAmpere", "stim_mA", "Stimulation [mA]"])
def test_a_current_is_no_pulse_width(tmp_path, name):
    path = recorded(tmp_path / "a.csv", f"time_s,PW,{name}")
    assert propose(path, known_rigs()["muscle"], None).candidates["pulse_width_us"] == ("PW",)


@pytest.mark.parametrize(
    ("header", "parts"),
    [("CurrentKG", ("Current", "KG")), ("kneeDeg", ("knee", "Deg")), ("Microseconds", ("Microseconds", "Microseconds")),
     ("AngVel/rad/s", ("AngVel", "rad/s")), ("leg_a", ("leg_a", "")), ("x_V", ("x_V", "")), ("log In", ("log", "In")),
     ("Cylinder bar", ("Cylinder bar", "")), ("McKibben", ("McKibben", "")), ("stim_mA", ("stim", "mA"))],
)  # fmt: skip
def test_units_at_the_end_of_names(header, parts):
    assert split_header(header) == parts


def storage(path, between, pad=0, rows=30, stated=None, degrees="yes", decimal="."):
    """A .mot file as OpenSim writes it (between tabs), or as a spreadsheet that saved it."""
    end = (between * pad if between != "\t" else "") + "\n"
    values = np.column_stack([TIME, ANGLE, 2 * ANGLE])[:rows]
    lines = ["Coordinates", "version=1", f"nRows={rows if stated is None else stated}", "nColumns=3"]
    lines += [f"inDegrees={degrees}", "", "endheader", between.join(["time", "knee_angle_r", "pelvis_tx"])]
    lines += [between.join(f"{x:.6f}".replace(".", decimal) for x in row) for row in values]
    path.write_text("".join(line + end for line in lines))
    return path


@pytest.mark.parametrize("pad", [0, 2, 5])
@pytest.mark.parametrize(("between", "decimal"), [("\t", "."), (",", "."), (";", "."), (";", ",")])
def test_a_motion_file_that_a_spreadsheet_saved_is_read(tmp_path, between, decimal, pad):
    path = storage(tmp_path / "a.mot", between, pad, decimal=decimal)
    table, in_degrees = read_motion(path)
    assert table.names == ("time", "knee_angle_r", "pelvis_tx") and in_degrees is True and table.said == ()
    assert np.allclose(table.columns["knee_angle_r"], ANGLE[:30], atol=1e-6)
    assert read_recording(path).units == {"knee_angle_r": "deg", "time": "s"}


@pytest.mark.parametrize("stated", [29, 31, 1000])
@pytest.mark.parametrize("between", ["\t", ",", ";"])
def test_another_number_of_rows_is_read_and_said(tmp_path, between, stated):
    path = storage(tmp_path / "a.mot", between, stated=stated)
    study, _ = study_of(tmp_path, path, columns={"position": "knee_angle_r"})
    assert np.allclose(study.trials[0]["position"], np.radians(ANGLE[:30]), atol=1e-6)
    assert study.trials[0].remarks == (f"the header of a.mot says {stated} rows, and there are 30",)


def test_a_spreadsheet_that_lost_a_cell_is_refused(tmp_path):
    path = storage(tmp_path / "a.mot", ",", 2)
    path.write_text(path.read_text().replace(f"{2 * ANGLE[5]:.6f}", ""))
    with pytest.raises(InputError, match="row 14"):
        read_coordinates(path)


def mat(path, **content):
    savemat = pytest.importorskip("scipy.io").savemat
    savemat(path, content)
    return path


def trial_of(count, seed):
    rng = np.random.default_rng(seed)
    return {"time_s": 0.01 * np.arange(count), "angle_rad": rng.normal(size=count), "torque_Nm": rng.normal(size=count)}


@pytest.mark.parametrize("lengths", [(80, 60, 70), (50, 90), (40, 41, 42, 43, 44)])
def test_trials_of_other_lengths_in_one_matlab_file_are_all_offered(tmp_path, lengths):
    pytest.importorskip("pymatreader")
    trials = {f"trial{k}": trial_of(n, k) for k, n in enumerate(lengths)}
    path = mat(tmp_path / "a.mat", gains=np.arange(7.0), **trials)
    study, said = study_of(tmp_path, path)
    for trial, (name, one) in zip(study.trials, trials.items(), strict=True):
        assert trial.name == f"a-{name}" and np.allclose(trial["position"], one["angle_rad"])
    assert "are trials: their names say so" in said[0]
    last = f"trial{len(lengths) - 1}"
    study, said = study_of(tmp_path, path, columns={"position": f"{last}.angle_rad"})
    assert np.allclose(study.trials[0]["position"], trials[last]["angle_rad"])
    assert np.allclose(study.trials[0]["effort"], trials[last]["torque_Nm"])
    assert f"vectors of {lengths[-1]} samples are taken" in said[0]


def test_one_trial_in_a_matlab_file_says_nothing_of_lengths(tmp_path):
    pytest.importorskip("pymatreader")
    path = mat(tmp_path / "a.mat", log=trial_of(50, 0), gains=np.arange(7.0))
    assert study_of(tmp_path, path)[1] == ()


@pytest.mark.parametrize("suffix", [".c3d", ".trc"])
def test_markers_are_no_joint_coordinates(tmp_path, suffix):
    path = tmp_path / f"walk{suffix}"
    path.write_bytes(b"\x02\x50 markers")
    with pytest.raises(InputError, match=r"OpenSim's inverse kinematics makes joint coordinates .* \.mot is read"):
        read_motion(path)


def test_nothing_is_said_of_a_plain_recording(tmp_path):
    path = written(tmp_path / "a.csv", "time_s,position,effort", values=drawn(0)[1])
    study, said = study_of(tmp_path, path)
    assert said == () and not any("time_s" in one or "a.csv" in one for one in study.trials[0].remarks)
    assert "[columns]" not in (tmp_path / "study.toml").read_text()
