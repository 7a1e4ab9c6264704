import functools
import itertools
import json
import os
import sys
from pathlib import Path
from typing import Any

import pytest

from fes_pin.body.build import Body

REPOSITORY = Path(__file__).parents[1]
sys.path.insert(0, str(REPOSITORY / "analysis"))  # paper_ankle, yardsticks
ROUNDING = {
    "allocation": "active sets, and certificates to the last digit",
    "body/test_controllability.py": "eigen-decompositions",
    "body/test_linearize.py": "eigen-decompositions",
    "body/test_minimal_sets.py": "least sets, chosen by comparing sums",
    "body/test_modes.py": "eigen-decompositions",
    "diagnosis/test_claims.py": "verdicts at their critical values",
    "diagnosis/test_found.py::coulomb_friction": "verdicts of whole diagnoses",
    "diagnosis/test_held_out.py": "verdicts at their critical values",
    "driven/test_forms_again.py": "where fits of friction end",
    "identify": "fits to the last digits",
    "paper/test_kalman.py": "factors of nearly singular covariances",
}
"""Files and folders whose tests get the mark `rounding`, after :: by a part of their name; and why."""

SECONDS = json.loads((Path(__file__).parent / "seconds.json").read_text("utf-8"))
"""Seconds that tests took which take one or more, by file; 30 of those that were not measured again.
`scripts/test -m '' --write-seconds` measures all."""
EACH_FILE_S, ONE_S = 3.0, 12.0
"""Of each file the quickest tests always run, as many as take 3 s together, and one of up to 12 s; others are `long`.
Of 9900 tests, 2 h 20 min of one processor, that leaves 14 minutes on two, of the 20 that .ci/run may take."""

WHOLE = {
    "cli/test_invocations.py": "how command lines end is counted over all of them",
    "test_readme.py": "the blocks of a page go on from those above",
}
"""Files of which all tests always run, and why."""


def pytest_addoption(parser: pytest.Parser) -> None:
    """Take the option that measures which tests are long."""
    parser.addoption("--write-seconds", action="store_true", help="write tests/seconds.json")


def pytest_configure() -> None:
    """Say where a file that must be run again, or only when asked for, was moved or renamed."""
    places = [place.partition("::")[0] for place in (*ROUNDING, *SECONDS, *WHOLE)]
    if gone := [place for place in places if not (Path(__file__).parent / place).exists()]:
        raise pytest.UsageError(f"tests/conftest.py, ROUNDING or WHOLE, or seconds.json: there is no {', '.join(gone)}")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark what depends on how a processor rounds, to run it once more under other kernels (.ci/run); what is long."""
    for item in items:
        path = item.path.relative_to(Path(__file__).parent)
        if item.nodeid.partition("::")[2] in _long_of(path.as_posix()):
            item.add_marker(pytest.mark.long)
        if any(_is_of(item, path, *place.split("::")) for place in ROUNDING):
            item.add_marker(pytest.mark.rounding)


@functools.cache
def _long_of(file: str) -> frozenset[str]:
    """Names of the tests of a file that are long."""
    slow = sorted(SECONDS.get(file, {}).items(), key=lambda one: one[1]) if file not in WHOLE else []
    together = itertools.accumulate(seconds for _, seconds in slow)
    limits = itertools.chain([ONE_S], itertools.repeat(EACH_FILE_S))
    return frozenset(name for (name, _), sum_s, most in zip(slow, together, limits, strict=False) if sum_s > most)


def pytest_terminal_summary(terminalreporter: Any, config: pytest.Config) -> None:
    """Write how long tests took, if that is asked for."""
    if not config.getoption("--write-seconds"):
        return
    found: dict[str, dict[str, float]] = {}
    for report in terminalreporter.stats.get("passed", ()):
        file, _, name = report.nodeid.removeprefix("tests/").partition("::")
        if report.when == "call" and report.duration >= 1.0:
            found.setdefault(file, {})[name] = round(report.duration, 1)
    text = json.dumps(dict(sorted(found.items())), indent=1, ensure_ascii=False)
    (Path(__file__).parent / "seconds.json").write_text(text + "\n", "utf-8")


def _is_of(item: pytest.Item, path: Path, place: str, part: str = "") -> bool:
    """True of a test in a file or folder, with a part of its name."""
    return place in (path.as_posix(), path.parts[0]) and part in item.name


@pytest.fixture(scope="session")
def shared() -> Path:
    """Folder of the measured data: FES_PIN_DATA, or `shared` beside the repository."""
    folder = Path(os.environ.get("FES_PIN_DATA") or Path(__file__).resolve().parents[2] / "shared")
    if not (folder / "practice").is_dir() or not (folder / "data").is_dir():
        pytest.skip(f"measured data not there: {folder} holds no practice and data; set FES_PIN_DATA")
    return folder


@pytest.fixture(scope="session")
def walk() -> Path:
    """Folder of the measured walk; the test that needs it is skipped, and says so, where there is none."""
    root = Path(os.environ.get("FES_PIN_DATA", REPOSITORY.parent / "shared"))
    for folder in (root / "data/walking_subject01", root / "walking_subject01"):
        if folder.is_dir():
            return folder
    pytest.skip(f"no measured walk: neither FES_PIN_DATA nor {root} holds walking_subject01")


@pytest.fixture(scope="session")
def body() -> Body:
    return Body.from_subject(mass_kg=72.6, height_m=1.80, sex="male", stance="right")
