import os
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def shared() -> Path:
    """Folder of the measured data: FES_PIN_DATA, or `shared` beside the repository."""
    folder = Path(os.environ.get("FES_PIN_DATA") or Path(__file__).resolve().parents[2] / "shared")
    if not (folder / "practice").is_dir() or not (folder / "data").is_dir():
        pytest.skip(f"measured data not there: {folder} holds no practice and data; set FES_PIN_DATA")
    return folder
