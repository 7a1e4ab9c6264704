"""The quick stories run and end with a number and a picture."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).parents[2]


@pytest.mark.parametrize(
    ("story", "says"),
    [
        ("body_modes_of_the_gait", "The paper's claim of one linear model holds"),
        ("body_on_a_slope", "N m at the ankle"),
    ],
)
def test_story(story, says, tmp_path):
    path = REPOSITORY / f"analysis/{story}.py"
    environment = {**os.environ, "PYTHONPATH": str(REPOSITORY)}
    result = subprocess.run(
        [sys.executable, str(path)],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    assert result.returncode == 0, result.stderr
    assert says in result.stdout
    assert (tmp_path / f"out/{story}.png").stat().st_size > 10_000


@pytest.mark.parametrize("path", sorted((REPOSITORY / "analysis").glob("*.py")), ids=lambda path: path.stem)
def test_every_story_draws_into_out_where_it_is_run(path):
    text = path.read_text()
    assert "__file__" not in text
    assert text.count("savefig(") == 0 or '"out' in text
