"""A damaged file ends the process in which a library of compiled code reads it; it is an input error here."""

from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from fes_pin.data.errors import InputError
from fes_pin.data.recorded.formats import read_recording
from fes_pin.data.recorded.libraries import read_apart

pytest.importorskip("pymatreader")
DAMAGED = (225, 256, 257, 344)
"""Bytes of a small file that end SciPy 1.17.1 by a segmentation fault or a bus error where they are 14."""


@pytest.mark.parametrize("at", DAMAGED)
def test_a_damaged_file_is_an_input_error(tmp_path: Path, at: int) -> None:
    file = tmp_path / "log.mat"
    savemat(file, {"log": {"time": np.arange(4.0), "angle": np.arange(4.0)}})
    whole = file.read_bytes()
    file.write_bytes(whole[:at] + bytes([14]) + whole[at + 1 :])
    with pytest.raises(InputError, match="MATLAB file"):
        read_recording(file)


def test_a_process_that_ends_is_an_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "ends_itself.py").write_text("import os\n\ndef read(path):\n    os._exit(3)\n", encoding="utf-8")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    with pytest.raises(ValueError, match="it is damaged"):
        read_apart("ends_itself", "read", tmp_path)


def test_what_a_library_prints_warns_and_refuses_is_kept_apart(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    lines = ["import warnings", "", "def read(path):", "    print('a word')", "    warnings.warn('two')"]
    lines += ["    return {'path': path}", "", "def refuse(path):", "    raise KeyError(path)", ""]
    (tmp_path / "prints.py").write_text("\n".join(lines), encoding="utf-8")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    assert read_apart("prints", "read", Path("a.mat")) == ({"path": "a.mat"}, 1)
    with pytest.raises(ValueError, match=r"a\.mat"):
        read_apart("prints", "refuse", Path("a.mat"))
    assert capfd.readouterr() == ("", "")
