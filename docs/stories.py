"""The stories of `analysis/` as sphinx-gallery reads them: a title, text cells, and which of them run at build time.

A story that needs measured data or minutes is shown with its committed picture, if there is one, and its page says so.
"""

from __future__ import annotations

import re
import shutil
from dataclasses import dataclass
from pathlib import Path

from fes_pin.body.measured_walk import read_walk
from fes_pin.data.errors import InputError

ROOT = Path(__file__).parents[1]
FIGURES = ROOT / "analysis" / "figures"


@dataclass(frozen=True)
class Shown:
    """A story that does not run at every build: why, and the command that made its picture."""

    why: str
    command: str
    picture: str


def _walk_is_there() -> bool:
    try:
        read_walk()
    except InputError:
        return False
    return True


READS_WALK = "from fes_pin.body.measured_walk import"
READS_DATA = "from fes_pin.data.datasets import fetch"
DATA = (
    "It needs public measured data, which are not shipped: it runs where `FES_PIN_DATA` names a folder that holds them"
)
WALK = "It needs measured walking, which is not shipped: it runs where `FES_PIN_DATA` names a folder that holds it"
MINUTES = "It takes minutes: it does not run when this documentation is built"
LONG = ("body_which_nerves", "confounded_pair")


def shown(walk: bool | None = None) -> dict[str, Shown]:
    """Stories that are not run by a build, by name.

    Parameters
    ----------
    walk
        Whether the measured walk is there; None looks for it.
    """
    out = {name: Shown(MINUTES, f"analysis/{name}.py", f"{name}.png") for name in LONG}
    measured = [name for name in names() if READS_DATA in (ROOT / "analysis" / f"{name}.py").read_text()]
    out |= {name: Shown(DATA, f"analysis/{name}.py", f"{name}.png") for name in measured}
    if _walk_is_there() if walk is None else walk:
        return out
    need = [name for name in names() if READS_WALK in (ROOT / "analysis" / f"{name}.py").read_text()]
    return {**out, **{name: Shown(WALK, f"analysis/{name}.py", f"{name}.png") for name in need}}


def names() -> list[str]:
    """Every story."""
    return sorted(path.stem for path in (ROOT / "analysis").glob("*.py"))


def as_gallery(text: str, other: Shown | None = None) -> str:
    """A story's text with a title, and with its cells' headings as sphinx-gallery has them.

    Parameters
    ----------
    text
        Of the file: a docstring that begins with a question, cells that begin with `# %% heading`.
    other
        Why the story is not run, if it is not.
    """
    match = re.match(r'"""(.*?)"""\n', text, re.DOTALL)
    if match is None:
        raise ValueError("expected a story to begin with a docstring")
    title, _, rest = match[1].strip().partition("\n\n")
    question = re.match(r"[^?]*\?", " ".join(title.split()))
    first = question[0] if question else " ".join(title.split())
    after = " ".join(title.split())[len(first) :].strip()
    note = ""
    if other is not None:
        note = f".. note::\n\n   {other.why.replace('`', '``')}. Run it with::\n\n"
        note += f"       .venv/bin/python {other.command}\n\n"
        if (FIGURES / other.picture).exists():
            note += f"   The picture below was made so.\n\n.. image:: /_generated/figures/{other.picture}\n\n"
    words = "\n\n".join(part for part in (after, literal(rest.strip())) if part)
    head = f'r"""\n{first}\n{"=" * len(first)}\n\n{words}\n\n{note}"""\n'
    body = re.sub(r"^# %% +(.+)$", _cell, text[match.end() :], flags=re.MULTILINE)
    thumbnail = ""
    if other is not None and (FIGURES / other.picture).exists():
        thumbnail = f"# sphinx_gallery_thumbnail_path = '_generated/figures/{other.picture}'\n"
    return head + body.rstrip("\n") + "\n" + ("\n" + thumbnail if thumbnail else "")


def literal(text: str) -> str:
    """Commands, which stand on lines of their own, as literal blocks."""
    return re.sub(r"^(\.venv/bin/\S+.*)$", r"::\n\n    \1", text, flags=re.MULTILINE)


def _cell(match: re.Match[str]) -> str:
    return f"# %%\n# {match[1]}\n# {'-' * len(match[1])}\n"


def write(docs: Path) -> list[str]:
    """Write the stories below `docs/stories_source`; returns the names of those that are to be run."""
    source, figures = docs / "stories_source", docs / "_generated" / "figures"
    for folder in (source / "out", docs / "out", figures):
        folder.mkdir(parents=True, exist_ok=True)
    for picture in FIGURES.glob("*.png"):
        shutil.copy(picture, figures)
    others = shown()
    wanted = {"GALLERY_HEADER.rst": "Stories\n=======\n\nEach asks a question, and ends in a number and a picture.\n"}
    for name in names():
        wanted[f"{name}.py"] = as_gallery((ROOT / "analysis" / f"{name}.py").read_text(), others.get(name))
    for stale in source.glob("*.py"):
        if stale.name not in wanted:
            stale.unlink()
    for file, text in wanted.items():
        path = source / file
        if not path.exists() or path.read_text() != text:
            path.write_text(text)
    return [name for name in names() if name not in others]
