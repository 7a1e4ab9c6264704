"""The public names, however and whenever they are first used."""

import importlib
import inspect
import pickle
import pkgutil
import sys
from pathlib import Path

import pytest
import typed
from data import studies

import fes_pin as fp

ROOT = Path(__file__).parents[1]
DEMO = ROOT / "analysis/studies/ankle_demo"
sys.path.insert(0, str(ROOT / "scripts" / "generate"))
import effect_types  # noqa: E402


def test_every_public_name_can_be_had():
    for name in fp.__all__:
        assert getattr(fp, name) is not None


def every_module():
    return [module.name for module in pkgutil.walk_packages(fp.__path__, "fes_pin.")]


def test_no_module_shares_a_name_with_a_public_function():
    assert {name.rpartition(".")[2] for name in every_module() if name.count(".") == 1} & set(fp._WHERE) == set()


def test_public_names_stay_what_they_are_after_every_module_was_imported():
    """Importing a module binds its name in the package above it: no public function may be hidden by that."""
    for name in every_module():
        importlib.import_module(name)
    for name, where in fp._WHERE.items():
        for _ in range(2):
            assert getattr(fp, name) is getattr(importlib.import_module(where), name)
            assert not inspect.ismodule(getattr(fp, name))


def test_allocate_twice_and_imported():
    from fes_pin import allocate

    nerves = fp.Nerves(["left_femoral"])
    first, again = (fp.allocate({"left_knee_flexion": -40.0}, nerves) for _ in range(2))
    assert (
        allocate({"left_knee_flexion": -40.0}, nerves).pulse_widths_us == first.pulse_widths_us == again.pulse_widths_us
    )


def test_public_functions_can_be_sent_to_a_pool_and_say_their_arguments():
    assert pickle.loads(pickle.dumps(fp.diagnose)) is fp.diagnose
    assert "study" in inspect.signature(fp.diagnose).parameters


def test_type_checkers_are_told_of_types():
    assert (Path(fp.__file__).parent / "py.typed").exists()


def test_answers_on_rigs_are_told_from_those_on_walks(tmp_path):
    verdict, model = typed.answered(fp.read_study(DEMO), tmp_path)
    assert verdict == "stopped" and isinstance(model, fp.Model)
    assert fp.load_model(tmp_path / "model.toml") == model and (tmp_path / "report.html").exists()


def test_type_checkers_know_every_effect_by_name():
    """A new effect is told by `scripts/generate/effect_types.py`."""
    assert effect_types.FILE.read_text() == effect_types.text()


@pytest.mark.filterwarnings("ignore:fewer than 16 samples:fes_pin.InputWarning")
def test_what_a_user_writes_in_types_runs(tmp_path):
    study = fp.read_study(studies.ankle(tmp_path / "study"))
    model = typed.with_friction(study)
    assert typed.residual(model, study.trials[0], "angle_rad").shape == study.trials[0].time.shape
    fitted = typed.refitted(study, tmp_path)
    assert "torque_nm" in repr(fitted)
    pytest.importorskip("pandas")
    assert typed.tables(study, fitted)[0] > 0.0
    assert typed.friction().torque_nm == 0.04
    assert typed.one_line(tmp_path / "none").startswith(str(tmp_path / "none"))
