"""The public names, however and whenever they are first used."""

import ast
from pathlib import Path

import pytest
import typed
from data import studies

import fes_pin as fp


def test_every_public_name_can_be_had():
    for name in fp.__all__:
        assert getattr(fp, name) is not None


def test_diagnose_can_be_called_after_its_chapter_was_imported():
    import fes_pin.diagnose.diagnosis  # noqa: F401

    assert callable(fp.diagnose)
    assert callable(fp.diagnose)


def test_type_checkers_see_the_same_names():
    tree = ast.parse(Path(fp.__file__).read_text())
    (block,) = (node for node in tree.body if isinstance(node, ast.If))
    seen = {alias.asname: node.module for node in block.body for alias in node.names}
    assert seen == fp._WHERE | {name: "fes_pin.models" for name in fp._CHAPTERS}
    assert (Path(fp.__file__).parent / "py.typed").exists()


def test_what_a_user_writes_in_types_runs(tmp_path):
    study = fp.read_study(studies.ankle(tmp_path / "study"))
    model = typed.with_friction(study)
    assert typed.residual(model, study.trials[0], "angle_rad").shape == study.trials[0].time.shape
    fitted = typed.refitted(study, tmp_path)
    assert "torque_nm" in repr(fitted)
    pytest.importorskip("pandas")
    assert typed.tables(study, fitted)[0] > 0.0
    assert typed.one_line(tmp_path / "none").startswith(str(tmp_path / "none"))
