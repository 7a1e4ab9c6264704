import os
from pathlib import Path

import pytest

from fes_pin.body.build import Body

REPOSITORY = Path(__file__).parents[1]


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
