"""Readers of marker files."""

import numpy as np
import pytest

from fes_pin.data.errors import InputError
from fes_pin.data.recorded.formats import read_recording

TRC = """PathFileType\t4\t(X/Y/Z)\twalk.trc
DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames
60.00\t60.00\t3\t2\tmm\t60.00\t1\t3
Frame#\tTime\tR.Heel\t\t\tSternum\t\t
\t\tX1\tY1\tZ1\tX2\tY2\tZ2

1\t0.000\t100.0\t20.0\t30.0\t1.0\t2.0\t3.0
2\t0.017\t101.0\t21.0\t31.0\t\t\t
3\t0.033\t102.0\t22.0\t32.0\t1.2\t2.2\t3.2
"""


def write(tmp_path, text, name="walk.trc"):
    path = tmp_path / name
    path.write_text(text)
    return path


def place(columns, marker):
    return np.stack([columns[f"{marker}_{axis}"] for axis in "xyz"], axis=1)


def test_trc_is_read_in_metres_with_gaps(tmp_path):
    columns = read_recording(write(tmp_path, TRC)).columns
    assert np.allclose(columns["time"], [0.0, 0.017, 0.033])
    assert np.allclose(place(columns, "R.Heel")[1], [0.101, 0.021, 0.031])
    assert np.isnan(place(columns, "Sternum")[1]).all()
    assert np.allclose(place(columns, "Sternum")[2], [0.0012, 0.0022, 0.0032])


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("PathFileType", "Something", "PathFileType"),
        ("\tmm\t", "\tinch\t", "Units"),
        ("102.0", "x", "row 9, column R.Heel_x: expected a number, found 'x'"),
        ("0.033", "0.011", "increase"),
        ("\t3\t2\tmm", "\t9\t2\tmm", "NumFrames"),
    ],
)
def test_trc_that_is_wrong_says_where(tmp_path, old, new, words):
    with pytest.raises(InputError, match=words):
        read_recording(write(tmp_path, TRC.replace(old, new, 1)))


def test_c3d_is_read_or_says_what_it_needs(tmp_path):
    path = write(tmp_path, "", "walk.c3d")
    try:
        import ezc3d
    except ImportError:
        with pytest.raises(InputError, match="fes-pin\\[c3d\\]"):
            read_recording(path)
        return
    recording = ezc3d.c3d()
    recording["parameters"]["POINT"]["RATE"]["value"] = [100]
    recording["parameters"]["POINT"]["LABELS"]["value"] = ("R.Heel", "Sternum")
    recording["parameters"]["POINT"]["UNITS"]["value"] = ["mm"]
    points = np.ones((4, 2, 5))
    points[0, 1] = np.arange(5) * 100.0
    recording["data"]["points"] = points
    recording.write(str(path))
    columns = read_recording(path).columns
    assert np.allclose(columns["time"], np.arange(5) / 100.0)
    assert np.allclose(place(columns, "Sternum")[:, 0], 0.1 * np.arange(5), atol=1e-6)
    with pytest.raises(InputError, match="cannot be read as C3D"):
        read_recording(write(tmp_path, "no such thing", "bad.c3d"))
