"""The stories of walking run and end with numbers, a picture, and a page to watch."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.shared
REPOSITORY = Path(__file__).parents[2]


def told(name, walk, folder):
    environment = {**os.environ, "PYTHONPATH": str(REPOSITORY), "FES_PIN_DATA": str(walk)}
    story = [sys.executable, str(REPOSITORY / f"analysis/{name}.py")]
    result = subprocess.run(
        story, cwd=folder, env=environment, capture_output=True, text=True, check=False, timeout=300
    )
    assert result.returncode == 0, result.stderr
    assert (folder / f"out/{name}.png").stat().st_size > 20_000
    return result.stdout


def test_the_claims_are_told_with_numbers(walk, tmp_path):
    said = told("walk_claims", walk, tmp_path)
    for words in ("A resting forefoot costs", "free feet gain", "one posture leaves", "not identifiable"):
        assert words in said
    (line,) = (one for one in said.splitlines() if one.startswith("all joints together"))
    one, two, four, _, four_moving = map(float, re.findall(r" ([\d.]+)(?:,|$)", line))
    assert one > two > four > 2.0 * four_moving


def test_a_hidden_trunk_is_found_and_the_walk_can_be_watched(walk, tmp_path):
    said = told("walk_hidden_cause", walk, tmp_path)
    value, low, high = map(float, re.search(r"found: ([\d.]+) % \[([\d.]+), ([\d.]+)\]", said).groups())
    assert abs(value - 15.0) < 2.0 * (value - low) < 4.0 and low < value < high
    before, after = map(float, re.search(r"required: ([\d.]+) N rms by the believed body, ([\d.]+)", said).groups())
    assert after < 0.5 * before
    page = (tmp_path / "out/walk_hidden_cause.html").read_text()
    assert "read (black), required by the motion (orange)" in page
