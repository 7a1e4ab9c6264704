"""Recordings in Parquet, MATLAB, C3D, XDF and OpenSim's files, as their programs write them, made a study."""

import json
import struct

import numpy as np
import pytest

from fes_pin.data import errors
from fes_pin.data.as_read import HeldFile
from fes_pin.data.errors import InputError
from fes_pin.data.new_study import new_study
from fes_pin.data.recorded.form import TextForm
from fes_pin.data.recorded.formats import read_recording
from fes_pin.data.schema import known_rigs
from fes_pin.data.study import read_study
from fes_pin.data.templates import pendulum
from fes_pin.data.wanted import Wanted

TIME = np.arange(80) * 0.005
ANGLE = 30.0 * np.cos(4.0 * TIME)
TORQUE = 200.0 * np.sin(3.0 * TIME)


def parquet(path):
    pyarrow = pytest.importorskip("pyarrow")
    from pyarrow.parquet import write_table

    columns = {"Time [ms]": 1e3 * TIME, "Angle (deg)": ANGLE, "Torque_mNm": TORQUE, "note": ["x"] * len(TIME)}
    write_table(pyarrow.table(columns), path)


def matlab_5(path):
    from scipy.io import savemat

    log = {"t_ms": 1e3 * TIME, "angle_deg": ANGLE[:, None], "torque_mNm": TORQUE, "gains": np.arange(5.0), "who": "me"}
    savemat(path, {"log": log})


def matlab_73(path):
    """HDF5 behind MATLAB's own 512 bytes, numbers in rows as MATLAB stores them."""
    h5py = pytest.importorskip("h5py")
    with h5py.File(path, "w", userblock_size=512) as file:
        log = file.create_group("log")
        log.attrs["MATLAB_class"] = np.bytes_("struct")
        for name, values in {"t_ms": 1e3 * TIME, "angle_deg": ANGLE, "torque_mNm": TORQUE}.items():
            log.create_dataset(name, data=values[None, :]).attrs["MATLAB_class"] = np.bytes_("double")
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file".ljust(124) + struct.pack("<H", 0x0200) + b"IM")


def c3d(path):
    ezc3d = pytest.importorskip("ezc3d")
    made = ezc3d.c3d()
    made["parameters"]["POINT"]["RATE"]["value"] = [100.0]
    made["parameters"]["POINT"]["UNITS"]["value"] = ["mm"]
    made["parameters"]["POINT"]["LABELS"]["value"] = ["KNEE"]
    made["data"]["points"] = np.ones((4, 1, len(TIME) // 2))
    made["parameters"]["ANALOG"]["RATE"]["value"] = [200.0]
    made["parameters"]["ANALOG"]["LABELS"]["value"] = ["Angle", "Torque"]
    made["parameters"]["ANALOG"]["UNITS"]["value"] = ["deg", "mNm"]
    made["data"]["analogs"] = np.stack([ANGLE, TORQUE])[None]
    made.write(str(path))


def xdf(path):
    pytest.importorskip("pyxdf")

    def chunk(tag, content):
        return b"\x04" + struct.pack("<IH", len(content) + 2, tag) + content

    channels = "".join(
        f"<channel><label>{n}</label><unit>{u}</unit></channel>" for n, u in (("angle", "deg"), ("torque", "mNm"))
    )
    header = (
        "<?xml version='1.0'?><info><name>rig</name><type>x</type><channel_count>2</channel_count>"
        "<nominal_srate>200</nominal_srate><channel_format>double64</channel_format>"
        f"<desc><channels>{channels}</channels></desc></info>"
    )
    samples = b"".join(struct.pack("<Bddd", 8, t, a, u) for t, a, u in zip(50.0 + TIME, ANGLE, TORQUE, strict=True))
    number = struct.pack("<I", 1)
    count = b"\x04" + struct.pack("<I", len(TIME))
    footer = f"<?xml version='1.0'?><info><sample_count>{len(TIME)}</sample_count></info>".encode()
    path.write_bytes(
        b"XDF:"
        + chunk(1, b"<?xml version='1.0'?><info><version>1.0</version></info>")
        + chunk(2, number + header.encode())
        + chunk(3, number + count + samples)
        + chunk(6, number + footer)
    )


def storage(path):
    rows = "".join(f"{t:.4f}\t{a:.6f}\t{u:.6f}\n" for t, a, u in zip(TIME, ANGLE, TORQUE, strict=True))
    path.write_text(
        f"log\nnRows={len(TIME)}\nnColumns=3\ninDegrees=yes\nendheader\ntime\tangle_deg\ttorque_mNm\n{rows}"
    )


def records(path):
    rows = [
        {"t_ms": 1e3 * t, "angle_deg": a, "torque_mNm": u, "on": True}
        for t, a, u in zip(TIME, ANGLE, TORQUE, strict=True)
    ]
    path.write_text(json.dumps({"mass": 0.5, "entries": rows, "gains": [1, 2, 3, 4]}))


def json_lines(path):
    rows = [{"t_ms": 1e3 * t, "angle_deg": [a], "torque_mNm": u} for t, a, u in zip(TIME, ANGLE, TORQUE, strict=True)]
    path.write_text("\n".join(map(json.dumps, rows)))


def vectors(path):
    log = {"t_ms": 1e3 * TIME, "angle_deg": ANGLE, "torque_mNm": TORQUE}
    path.write_text(json.dumps([{"kind": "swing", "log": {n: v.tolist() for n, v in log.items()}}]))


WRITERS = {
    "a.json": records,
    "b.json": vectors,
    "a.jsonl": json_lines,
    "a.parquet": parquet,
    "a.mat": matlab_5,
    "b.mat": matlab_73,
    "a.c3d": c3d,
    "a.xdf": xdf,
    "a.sto": storage,
}


@pytest.mark.parametrize("name", WRITERS)
def test_a_recording_of_each_format_becomes_a_study(tmp_path, name):
    path = tmp_path / name
    WRITERS[name](path)
    believed = HeldFile.holding("p.urdf", pendulum(0.3, 0.5).encode())
    wanted = Wanted((path,), known_rigs()["joint"], tmp_path, "own", believed)
    made = new_study(wanted, lambda *_: {"inertia_scale": 1.0, "damping": 0.01})
    for place, content in made.contents.items():
        (tmp_path / place).write_bytes(content if isinstance(content, bytes) else content.encode())
    (trial,) = read_study(tmp_path).trials
    assert trial.dt == pytest.approx(0.005) and len(trial) == len(TIME)
    single = 1e-5 if name.endswith("c3d") else 1e-6  # C3D holds single precision
    assert np.allclose(trial["position"], np.radians(ANGLE), atol=single)
    assert np.allclose(trial["effort"], 1e-3 * TORQUE, atol=single)
    path.write_bytes(b"no such thing, but long enough to be looked at")
    with pytest.raises(InputError, match=r"cannot be read as|expected a line endheader|expected JSON") as caught:
        read_study(tmp_path)
    assert len(str(caught.value).splitlines()) == 1


@pytest.mark.parametrize("name", [n for n in WRITERS if not n.endswith(("json", "jsonl", "mat"))])
def test_a_sheet_is_refused_of_a_file_that_has_none(tmp_path, name):
    WRITERS[name](tmp_path / name)
    with pytest.raises(InputError, match="sheet: expected a spreadsheet, which has sheets"):
        read_recording(tmp_path / name, TextForm(sheet="Angle"))


def test_columns_of_other_lengths_are_refused(tmp_path):
    matlab_5(tmp_path / "a.mat")
    with pytest.raises(InputError, match=r"expected columns of one length, found log.t_ms 80, log.gains 5"):
        read_recording(tmp_path / "a.mat", wanted=("log.t_ms", "log.gains"))


def test_null_in_json_is_a_missing_sample(tmp_path):
    angle = [None if k == 7 else a for k, a in enumerate(ANGLE.tolist())]
    (tmp_path / "a.json").write_text(json.dumps({"t": TIME.tolist(), "angle": angle}))
    read = read_recording(tmp_path / "a.json")
    assert np.flatnonzero(np.isnan(read.columns["angle"])).tolist() == [7]


def test_the_time_of_a_table_without_names_is_its_column_of_equal_steps(tmp_path):
    from scipy.io import savemat

    savemat(tmp_path / "a.mat", {"data": np.stack([ANGLE, TIME, TORQUE])})
    believed = HeldFile.holding("p.urdf", pendulum(0.3, 0.5).encode())
    said = {"position": "data.1:deg", "effort": "data.3:mNm"}
    wanted = Wanted((tmp_path / "a.mat",), known_rigs()["joint"], tmp_path, "own", believed, said)
    with pytest.raises(InputError, match=r"please add --column time_s=data.2:UNIT \(0 to 0.395: s, or which unit\?\)$"):
        new_study(wanted, lambda *_: {"inertia_scale": 1.0, "damping": 0.01})


def test_points_of_a_c3d_file_are_read_where_they_are_named(tmp_path):
    c3d(tmp_path / "a.c3d")
    read = read_recording(tmp_path / "a.c3d", wanted=("time", "KNEE_x"))
    assert read.columns["KNEE_x"] == pytest.approx(1e-3) and read.columns["time"][1] == pytest.approx(0.01)


@pytest.mark.parametrize(
    ("suffix", "extra"), [("parquet", "parquet"), ("mat", "matlab"), ("c3d", "c3d"), ("xdf", "xdf")]
)
def test_what_is_not_installed_is_said(tmp_path, monkeypatch, suffix, extra):
    path = tmp_path / f"a.{suffix}"
    path.write_bytes(b"x")

    def missing(module):
        raise ImportError(module)

    monkeypatch.setattr(errors.importlib, "import_module", missing)
    with pytest.raises(InputError, match=rf"pip install 'fes-pin\[{extra}\]'"):
        read_recording(path)


def test_missing_samples_of_a_parquet_file(tmp_path):
    pyarrow = pytest.importorskip("pyarrow")
    from pyarrow.parquet import write_table

    write_table(pyarrow.table({"t": pyarrow.array([0.0, None, 2.0, 3.0])}), tmp_path / "a.parquet")
    assert np.isnan(read_recording(tmp_path / "a.parquet").columns["t"]).tolist() == [False, True, False, False]
