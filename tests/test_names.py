"""Every name of a chapter stands once in it, and every public name once in the library."""

import ast
from collections import defaultdict
from pathlib import Path

import pytest

import fes_pin

PACKAGE = Path(__file__).parents[1] / "fes_pin"
PAIRS = {"contrast", "fit"}
"""Verbs of the top level that are called as what they return: `fes_pin.fit` returns a `fes_pin.Fit`."""


def defined(path: Path) -> list[str]:
    """Public classes, functions and aliases of types of a file; constants in capitals are their file's own."""
    names = []
    for node in ast.parse(path.read_text()).body:
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            names.append(node.name)
        elif isinstance(node, ast.Assign | ast.AnnAssign):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            names += [target.id for target in targets if isinstance(target, ast.Name)]
    return [name for name in names if not name.startswith("_") and not name.isupper()]


def alike(files: list[Path]) -> dict[str, list[str]]:
    """Names that stand more than once, or differ in capitals only, with where they stand."""
    where = defaultdict(list)
    for path in files:
        for name in defined(path):
            where[name.lower()].append(f"{name} in {path.relative_to(PACKAGE)}")
    return {name: places for name, places in where.items() if len(places) > 1 and name not in PAIRS}


CHAPTERS = sorted({path.parent.relative_to(PACKAGE).parts[:1] for path in PACKAGE.rglob("*.py")} - {("cli",)})
"""Folders of the package; commands (`cli`) are called as what they do."""


@pytest.mark.parametrize("chapter", CHAPTERS, ids=lambda parts: "/".join(parts) or "top")
def test_no_two_names_of_a_chapter_are_alike(chapter):
    """Front ends may use one name for the same thing: each has its `Problem`."""
    files = sorted(PACKAGE.joinpath(*chapter).rglob("*.py") if chapter else PACKAGE.glob("*.py"))
    assert alike(files) == {}


def test_no_public_name_stands_twice():
    files = [path for path in sorted(PACKAGE.rglob("*.py")) if path.relative_to(PACKAGE).parts[0] != "cli"]
    assert len(files) > 200
    public = {name.lower() for name in fes_pin.__all__}
    assert {name: places for name, places in alike(files).items() if name in public} == {}


def test_the_pairs_are_names_that_users_know():
    for verb in PAIRS:
        assert {verb, verb.capitalize()} <= set(fes_pin.__all__)
