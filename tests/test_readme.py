"""What the README shows runs as it is printed."""

import os
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
BLOCKS = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(), re.DOTALL)
GIVEN = {"angle_rad": 1.6, "angles_rad": [1.6, 1.7]}
"""What a block takes from the reader's own rig."""


@pytest.fixture(scope="module")
def names(tmp_path_factory):
    """What the blocks define, one after another, run in a folder of their own beside the repository's."""
    folder, before = tmp_path_factory.mktemp("readme"), Path.cwd()
    (folder / "analysis").symlink_to(ROOT / "analysis")
    os.chdir(folder)
    yield dict(GIVEN)
    os.chdir(before)


@pytest.mark.parametrize("number", range(len(BLOCKS)))
def test_each_block_runs(names, number):
    exec(compile(BLOCKS[number], f"README block {number}", "exec"), names)


def test_the_first_one_leaves_a_model_and_a_report(names):
    assert names["diagnosis"].verdict == "causes_found"
    assert all(Path(file).stat().st_size > 100 for file in ("model.toml", "report.html"))
