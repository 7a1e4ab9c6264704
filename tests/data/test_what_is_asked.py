"""What new-study asks for and proposes where files do not say everything: nothing that they cannot be."""

import json
import re

import numpy as np
import pytest

from fes_pin.data.errors import InputError
from fes_pin.data.new_body_study import new_body_study
from fes_pin.data.new_recording import propose
from fes_pin.data.new_study import new_study
from fes_pin.data.schema import BODY, known_rigs
from fes_pin.data.study import read_study
from fes_pin.data.templates import pendulum
from fes_pin.data.wanted import Wanted

RIGS = known_rigs()
SEEDS = range(3)
ANKLE = {f"{key}": "1" for key in ("foot_mass_kg", "com_distance_m", "moment_arm_m", "force_scale_n")}
ANKLE |= {"f0_n": "5", "f1_per_rad": "3", "theta_r_rad": "1.5"}


def csv(path, names, values):
    np.savetxt(path, values, delimiter=",", header=",".join(names), comments="", fmt="%.6f")
    return path


def drawn(seed, columns, rows=60):
    rng = np.random.default_rng(seed)
    return np.column_stack([0.01 * np.arange(rows), rng.normal(size=(rows, columns))])


def made(folder, *files, rig="joint", **more):
    (folder / "rod.urdf").write_text(pendulum(0.4, 1.0))
    urdf = folder / "rod.urdf" if rig == "joint" else None
    start = {"joint": {"inertia_scale": 1.0, "damping": 0.01}}
    return new_study(
        Wanted(files, RIGS[rig], folder, "own", urdf=urdf, **more), lambda *_: start.get(rig, {"gain": 1.0})
    )


def asked(folder, *files, **more):
    with pytest.raises(InputError) as caught:
        made(folder, *files, **more)
    return str(caught.value)


@pytest.mark.parametrize("rig", ["muscle", "ankle"])
def test_what_may_stand_in_the_place_of_a_pulse_width_is_said(tmp_path, rig):
    path = csv(tmp_path / "a.csv", ("t [s]", "angle [rad]", "foo", "bar"), drawn(1, 3))
    words = asked(tmp_path, path, rig=rig)
    assert "in its place" in words and "--set kind=imposed where nothing is stimulated" in words
    assert all(name in words for name in ("amplitude_ma", "frequency_hz", "emg_envelope"))


def test_a_column_that_is_taken_is_asked_for_no_other_quantity(tmp_path):
    path = csv(tmp_path / "a.csv", ("a", "b"), drawn(2, 1))
    words = asked(tmp_path, path, rig="muscle", columns={"time_s": "a:s", "force_n": "b:N"})
    assert "pulse_width_us=NAME:UNIT (no column is left; or in its place" in words
    words = asked(tmp_path, path, rig="muscle", columns={"time_s": "a:s"})
    assert "force_n=b:UNIT" in words and "pulse_width_us=NAME:UNIT (no column is left" in words
    words = asked(tmp_path, path, rig="joint", columns={"position": "b:rad"})
    assert "time_s=a:UNIT" in words


@pytest.mark.parametrize("unit", ["N", "kgf", "lbf"])
def test_a_torque_that_is_read_as_a_force_wants_a_lever(tmp_path, unit):
    path = csv(tmp_path / "a.csv", ("t [s]", "angle [deg]", f"Torque [{unit}]", "x"), drawn(3, 3))
    words = asked(tmp_path, path, rig="ankle", settings=ANKLE, kind="imposed")
    assert f"--column torque_nm=NAME,scale=NUMBER (Torque [{unit}]; N m for each unit of it)" in words
    taken = {"torque_nm": f"Torque [{unit}],scale=0.3"}
    text = str(made(tmp_path, path, rig="ankle", settings=ANKLE, kind="imposed", columns=taken).contents["study.toml"])
    assert f'torque_nm = {{ name = "Torque [{unit}]", scale = 0.3 }}' in text


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("begins", ["field.orientation.", "quat_", "q", "IMU Q"])
def test_parts_of_a_quaternion_are_no_angles(tmp_path, begins, seed):
    order = np.random.default_rng(seed).permutation(list("xyzw"))
    names = ("t [s]", *(f"{begins}{part}" for part in order))
    path = csv(tmp_path / "a.csv", names, drawn(seed, 4))
    found = propose(path, RIGS["joint"], True).candidates
    assert not found["position"] and not found["velocity"] and not found["effort"]
    alone = csv(tmp_path / "b.csv", (*names[:4], "angle"), drawn(seed, 4))
    assert propose(alone, RIGS["joint"], True).candidates["position"][-1:] == ("angle",)


@pytest.mark.parametrize("names", [("x", "y", "z", "w"), ("cart x", "cart y", "cart z", "speed w")])
def test_axes_beside_a_speed_are_no_quaternion(tmp_path, names):
    path = csv(tmp_path / "a.csv", ("t [s]", *names), drawn(4, 4))
    assert names[0] in propose(path, RIGS["joint"], False).candidates["position"]


@pytest.mark.parametrize("seed", SEEDS)
def test_units_that_a_row_states_are_shown_of_every_name(tmp_path, seed):
    names = ["LVas6", "Vmo", "Nav", "mVas"]
    path = tmp_path / "a.csv"
    rows = "\n".join(",".join(f"{x:.4f}" for x in row) for row in drawn(seed, 4))
    path.write_text(",".join(["t", *names]) + "\ns,V,V,N,mV\n" + rows + "\n")
    words = asked(tmp_path, path, rig="joint")
    assert all(f"{name} ({unit})" in words for name, unit in zip(names, ("V", "V", "N", "mV"), strict=True))


WALKS = {
    "markers.tsv": "NO_OF_FRAMES\t143\nNO_OF_CAMERAS\t14\nNO_OF_MARKERS\t19\nFrame\tTime\tHead X\n1\t0.0\t1.0\n",
    "plates.csv": "\nDevices\n1000\n,,Force plate 1\nFrame,Sub Frame,Fx,Fy\n,,N,N\n1,0,1.0,2.0\n",
    "binary.mat": "\x00\x01",
    "table.xlsx": "PK\x03\x04",
}


@pytest.mark.parametrize("name", WALKS)
def test_of_files_that_hold_no_walk_is_said_what_does(tmp_path, name):
    (tmp_path / name).write_text(WALKS[name])
    files, settings = (tmp_path / name, tmp_path / name), {"mass_kg": "70", "height_m": "1.7"}
    with pytest.raises(InputError) as caught:
        new_body_study(Wanted(files, BODY, tmp_path, "walk", settings=settings))
    message = str(caught.value)
    assert "a walk is .mot, .sto or CSV" in message and name in message and "\n" not in message
    assert re.search(r"OpenSim makes joint coordinates of markers", message)


def test_columns_of_one_sheet_that_end_earlier_are_whole_trials(tmp_path):
    """A logger's own clock goes on below the columns that are taken: rows without these are no missing samples."""
    values = drawn(5, 2, 50)
    path = tmp_path / "a.csv"
    rows = [f"{t:.4f},{x:.6f},{0.1 * k}" for k, (t, x, _) in enumerate(values)] + [
        f",,{0.1 * k}" for k in range(50, 90)
    ]
    path.write_text("t [s],angle [rad],sync\n" + "\n".join(rows) + "\n")
    (tmp_path / "study.toml").write_text(made(tmp_path, path).contents["study.toml"])
    (trial,) = read_study(tmp_path).trials
    np.testing.assert_allclose(trial["position"], values[:, 1], atol=1e-6)
    assert any("40 rows of the file below its last sample are left out" in words for words in trial.remarks)
    middle = [*rows[:20], f",,{0.1 * 20}", *rows[21:]]
    path.write_text("t [s],angle [rad],sync\n" + "\n".join(middle) + "\n")
    with pytest.raises(InputError, match=r"row 22, column .*: expected a time, found nothing"):
        read_study(tmp_path)


@pytest.mark.parametrize("suffix", [".mat", ".json"])
@pytest.mark.parametrize("rate", ["fs", "fsamp", "SampleRate", "sampling_frequency_Hz", "srate"])
def test_of_lists_of_events_and_one_signal_the_signal_is_taken_at_the_rate_of_the_file(tmp_path, suffix, rate):
    rng = np.random.default_rng(len(rate))
    events = [np.sort(rng.integers(0, 900, n)).tolist() for n in (30, 41, 41, 41, 12)]
    content = {"MUPulses": events, rate: 2048.0, "gain": 3.0, "ref_signal": rng.normal(size=900).tolist()}
    path = nested(tmp_path / f"a{suffix}", content)
    words = asked(tmp_path, path, rig="joint")
    assert "position=ref_signal:UNIT" in words and "time_s" not in words
    text = made(tmp_path, path, columns={"position": "ref_signal:deg"}).contents["study.toml"]
    assert "time_s = { rate_hz = 2048.0 }" in str(text)


@pytest.mark.parametrize("names", [("freq", "frequency"), ("fs", "frame_rate"), ("f_stim", "cutoff_hz")])
def test_other_rates_of_a_nested_file_are_none_of_samples(tmp_path, names):
    content = {names[0]: 50.0, names[1]: 20.0, "angle": list(np.linspace(0.0, 1.0, 50))}
    words = asked(tmp_path, nested(tmp_path / "a.json", content), columns={"position": "angle:rad"})
    assert "--column time_s=" in words


def nested(path, content):
    if path.suffix == ".json":
        path.write_text(json.dumps(content))
        return path
    pytest.importorskip("pymatreader")
    cells = np.empty(len(content.get("MUPulses", [])), dtype=object)
    cells[:] = [np.array(one, dtype=float) for one in content.get("MUPulses", [])]
    pytest.importorskip("scipy.io").savemat(path, {**content, "MUPulses": cells})
    return path


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("name", ["HipTor_L", "tor_knee", "KneeTor"])
def test_a_torque_may_be_shortened_and_its_constant_is_none(tmp_path, name, seed):
    names = ("t [s]", "angle [rad]", name, "observed torque constant [Nm/A]")
    one = propose(csv(tmp_path / "a.csv", names, drawn(seed, 3)), RIGS["joint"], True)
    assert one.candidates["effort"] == (name,)
