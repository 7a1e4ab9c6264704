"""The story of the three claims runs and ends with numbers and a picture."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.shared
REPOSITORY = Path(__file__).parents[2]


def test_the_claims_are_told_with_numbers(walk, tmp_path):
    environment = {**os.environ, "PYTHONPATH": str(REPOSITORY), "FES_PIN_DATA": str(walk)}
    story = [sys.executable, str(REPOSITORY / "analysis/walk_claims.py")]
    result = subprocess.run(
        story, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False, timeout=300
    )
    assert result.returncode == 0, result.stderr
    for words in ("A resting forefoot costs", "free feet gain", "one posture leaves", "not identifiable"):
        assert words in result.stdout
    assert (tmp_path / "out/walk_claims.png").stat().st_size > 20_000
