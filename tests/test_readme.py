"""What the README and the pages of the documentation show runs as it is printed."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PAGES = ("README.md", "docs/ankle.md", "docs/body.md", "docs/allocation.md", "docs/study_format.md")
BLOCKS = [
    pytest.param(page, code, id=f"{page}-{number}")
    for page in PAGES
    for number, code in enumerate(re.findall(r"```python\n(.*?)```", (ROOT / page).read_text(), re.DOTALL))
]


@pytest.fixture(scope="module")
def names(tmp_path_factory):
    """What a page's blocks define, one after another, run in a folder of their own beside the repository's."""
    folder, before = tmp_path_factory.mktemp("readme"), Path.cwd()
    (folder / "analysis").symlink_to(ROOT / "analysis")
    os.chdir(folder)
    yield {page: {} for page in PAGES}
    os.chdir(before)


@pytest.mark.parametrize(("page", "code"), BLOCKS)
def test_each_block_runs(names, page, code):
    exec(compile(code, page, "exec"), names[page])


def test_every_page_has_a_block():
    assert {block.values[0] for block in BLOCKS} == set(PAGES)


def test_every_page_passes_a_strict_type_checker(tmp_path):
    """As the file of a user, whose checker does not report what is within the library."""
    pytest.importorskip("mypy")
    for page in PAGES:
        code = [block.values[1] for block in BLOCKS if block.values[0] == page]
        (tmp_path / f"{Path(page).stem}.py").write_text("\n".join(code))
    files = [str(path) for path in (*sorted(tmp_path.glob("*.py")), ROOT / "tests" / "typed.py")]
    strict = ["--strict", "--follow-imports=silent", "--cache-dir", str(tmp_path / "cache")]
    run = [sys.executable, "-m", "mypy", *strict, *files]
    told = subprocess.run(run, capture_output=True, text=True, cwd=ROOT, check=False)
    assert told.returncode == 0, told.stdout
    assert f"in {len(PAGES) + 1} source files" in told.stdout


def test_the_first_one_leaves_a_model_and_a_report(names):
    assert names["README.md"]["diagnosis"].verdict == "causes_found"
    assert all(Path(file).stat().st_size > 100 for file in ("model.toml", "report.html"))


def test_the_first_picture_says_what_each_curve_is():
    picture = (ROOT / "analysis/figures/verdict.svg").read_text()
    for words in ("measured", "nominal model, fitted", "extended model", "angle (rad)", "pulse width (µs)"):
        assert f">{words}</text>" in picture, words
