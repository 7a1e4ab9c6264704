"""Every block of the first pages of the manual runs as it is printed, from an empty folder."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from test_docs import study_by_hand

DOCS = Path(__file__).parents[1] / "docs"
ORDERS = (("getting_started.md", "what_to_do.md"), ("recipes.md",))
"""Pages that are run one after another in one folder."""
MARKS = ("long", "walk")
"""Behind the language of a block: it takes half a minute and more; it needs a measured walk."""
BLOCK = re.compile(r"^( *)```(bash|python)(?: (\S+))?\n(.*?)^ *```$", re.DOTALL | re.MULTILINE)


def blocks(pages):
    """Page, language, mark and code of the blocks of pages, in their order."""
    for page in pages:
        for indent, language, mark, code in BLOCK.findall((DOCS / page).read_text()):
            yield page, language, mark, re.sub(f"^{indent}", "", code, flags=re.MULTILINE)


def run(pages, folder, left_out):
    """Run the blocks of pages in a folder; those of Python share their names, as in one session."""
    names, path = {}, f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    for page, language, mark, code in blocks(pages):
        if mark in left_out:
            continue
        if language == "python":
            exec(compile(code, page, "exec"), names)
        else:
            shell = ["bash", "-euo", "pipefail", "-c", code]
            done = subprocess.run(
                shell, capture_output=True, text=True, cwd=folder, env=os.environ | {"PATH": path}, check=False
            )
            assert done.returncode == 0, f"{page}: {code}{done.stdout}{done.stderr}"


@pytest.mark.parametrize("pages", ORDERS, ids=lambda pages: pages[0])
def test_the_pages_run_as_written(pages, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    run(pages, tmp_path, MARKS)


@pytest.mark.long
@pytest.mark.parametrize("pages", [p for p in ORDERS if any(b[2] == "long" for b in blocks(p))], ids=lambda p: p[0])
def test_the_pages_run_with_what_takes_longer(pages, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    run(pages, tmp_path, ("walk",))


@pytest.mark.long
def test_the_study_by_hand_is_answered(tmp_path, monkeypatch):
    study_by_hand(tmp_path, damping=0.02)
    monkeypatch.chdir(tmp_path)
    run(["own_recordings.md"], tmp_path, ())
    assert (tmp_path / "predicted.csv").stat().st_size > 10_000


@pytest.mark.shared
def test_the_recipe_of_a_walk_runs(walk, tmp_path):
    (tmp_path / "walk").mkdir()
    shutil.copy(walk / "coords_mtpfree.csv", tmp_path / "walk" / "coordinates.csv")
    shutil.copy(walk / "grf_raw_600hz.csv", tmp_path / "walk" / "ground_reaction.csv")
    others = {mark for _, _, mark, _ in blocks(["recipes.md"])} - {"walk"}
    run(["recipes.md"], tmp_path, others)
    assert (tmp_path / "walk_answer" / "playback.html").stat().st_size > 10_000


def test_each_page_has_blocks_and_their_marks_are_known():
    for pages in ORDERS:
        assert {page for page, *_ in blocks(pages)} == set(pages)
        assert {mark for _, _, mark, _ in blocks(pages)} <= {"", *MARKS}
