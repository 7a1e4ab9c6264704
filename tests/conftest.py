import os
from pathlib import Path

import pytest

from fes_pin.body.build import Body

REPOSITORY = Path(__file__).parents[1]
ROUNDING = {
    "allocate": "active sets, and certificates to the last digit",
    "body/test_controllability.py": "eigen-decompositions",
    "body/test_linearize.py": "eigen-decompositions",
    "body/test_minimal_sets.py": "least sets, chosen by comparing sums",
    "body/test_modes.py": "eigen-decompositions",
    "diagnose/test_claims.py": "verdicts at their critical values",
    "diagnose/test_found.py": "verdicts of whole diagnoses",
    "diagnose/test_held_out.py": "verdicts at their critical values",
    "identify": "fits to the last digits",
    "paper/test_kalman.py": "factors of nearly singular covariances",
}
"""Files and folders whose tests get the mark `rounding`, and why."""


def pytest_configure() -> None:
    """Say where a file that must be run again was moved or renamed."""
    if gone := [place for place in ROUNDING if not (Path(__file__).parent / place).exists()]:
        raise pytest.UsageError(f"tests/conftest.py, ROUNDING: there is no {', '.join(gone)}")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark what depends on how a processor rounds, to run it once more under other kernels (see .ci/run)."""
    for item in items:
        path = item.path.relative_to(Path(__file__).parent)
        if not ROUNDING.keys().isdisjoint((path.as_posix(), path.parts[0])):
            item.add_marker(pytest.mark.rounding)


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
