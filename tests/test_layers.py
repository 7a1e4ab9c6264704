"""The imports run one way: cohort -> verdict -> view -> front ends -> faults -> search -> identify -> models -> data;
and control -> allocation -> muscles -> body. No front end (diagnosis, contrasts, comparison, walk) imports another.
Diagnosis has inverse dynamics (effort) as an estimator.

Inference (infer) knows no rig and no body: all may use it, and it uses nothing of ours but `workers`.
The controller takes eq. (1) from paper, which takes recruitment from muscles. Measured walking (walk) reads the body,
and the parameters and stages of models for its causes.
"""

import ast
import subprocess
import sys
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "fes_pin"
ALLOWED = {
    "infer": set(),
    "data": set(),
    "models": {"data"},
    "identify": {"models", "data"},
    "remainder": {"identify", "models", "data"},
    "search": {"prepare", "remainder", "identify", "models", "data"},
    "prepare": {"identify", "models", "data"},
    "faults": {"search", "prepare", "identify", "models", "data"},
    "diagnosis": {"effort", "faults", "prepare", "search", "remainder", "identify", "models", "data"},
    "contrasts": {"faults", "prepare", "search", "remainder", "identify", "models", "data"},
    "comparison": {"prepare", "search", "identify", "models", "data"},
    "effort": {"models", "data"},
    "paper": {"muscles", "body", "data"},
    "body": {"data"},
    "walk": {"body", "models", "data"},
    "muscles": {"body", "models", "data"},
    "allocation": {"muscles", "body", "data"},
    "control": {"paper", "allocation", "muscles", "identify", "models", "data"},
    "verdict": {"walk", "diagnosis", "models", "data"},
    "cohort": {"verdict", "view", "identify", "models", "data"},
    "view": {
        *("paper", "contrasts", "diagnosis", "identify", "models", "data"),
        *("control", "allocation", "muscles", "body", "walk"),
    },
}


def imported_chapters(path: Path) -> set[str]:
    names = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("fes_pin."):
            names.add(node.module.split(".")[1])
        elif isinstance(node, ast.ImportFrom) and node.module == "fes_pin":
            names.update(alias.name for alias in node.names)
        elif isinstance(node, ast.Import):
            names.update(a.name.split(".")[1] for a in node.names if a.name.startswith("fes_pin."))
    return names


@pytest.mark.parametrize("path", sorted(PACKAGE.rglob("*.py")), ids=lambda p: str(p.relative_to(PACKAGE)))
def test_imports_run_one_way(path):
    chapter = path.relative_to(PACKAGE).parts[0]
    if chapter not in ALLOWED:
        return
    known = set(ALLOWED) | {"cli"}
    forbidden = (imported_chapters(path) & known) - ALLOWED[chapter] - {chapter, "infer"}
    assert not forbidden, f"{path} imports {sorted(forbidden)}"


def test_inference_uses_nothing_of_ours_but_workers():
    """What `workers` itself needs, the settings and the one error, comes with it."""
    told = "import sys, pkgutil, importlib, fes_pin; before = set(sys.modules); import fes_pin.infer as infer; "
    told += "[importlib.import_module(f'fes_pin.infer.{m.name}') for m in pkgutil.iter_modules(infer.__path__)]; "
    told += "print(*(n for n in set(sys.modules) - before if n.startswith('fes_pin.') and '.infer' not in n))"
    run = subprocess.run([sys.executable, "-c", told], capture_output=True, text=True, check=True)
    assert set(run.stdout.split()) <= {"fes_pin.workers", "fes_pin.settings", "fes_pin.data", "fes_pin.data.errors"}


def imported_files(path: Path) -> set[Path]:
    """Files of the package that a file imports, wherever in it: inside functions, too."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("fes_pin"):
            names.update({node.module, *(f"{node.module}.{alias.name}" for alias in node.names)})
    files = {PACKAGE.parent.joinpath(*name.split(".")).with_suffix(".py") for name in names}
    return {file for file in files if file.exists()} - {path}


@pytest.mark.parametrize("chapter", sorted({*ALLOWED, "cli"}))
def test_files_import_one_way(chapter):
    """No circle within a chapter; between chapters there is none by the order above."""
    files = {path: imported_files(path) for path in (PACKAGE / chapter).rglob("*.py")}
    try:
        tuple(TopologicalSorter(files).static_order())
    except CycleError as error:
        pytest.fail(f"a circle: {' -> '.join(path.name for path in error.args[1])}")


def test_what_some_rigs_need_alone_is_not_imported_for_all():
    """scipy.signal and scipy.stats take half a second, a sixth of a diagnosis."""
    wanted = "import sys, fes_pin.diagnosis.diagnosis, fes_pin.models.catalogue, fes_pin.view.report"
    told = f"{wanted}; print([n for n in ('scipy.signal', 'scipy.stats') if n in sys.modules])"
    run = subprocess.run([sys.executable, "-c", told], capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "[]"
