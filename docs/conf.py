"""Sphinx: Markdown and numpydoc, the stories of `analysis/` as a gallery; nothing is asked of the network."""

from __future__ import annotations

import re
import sys
from importlib.metadata import version as installed_version
from pathlib import Path

DOCS = Path(__file__).parent
sys.path[:0] = [str(DOCS), str(DOCS.parent / "analysis")]  # what stories share lies beside them

import stories  # noqa: E402
import tables  # noqa: E402

tables.write(DOCS)
executed = stories.write(DOCS)

project = "fes_pin"
author = "The fes_pin maintainers"
copyright = author
release = version = installed_version("fes-pin")

extensions = ["myst_parser", "sphinx.ext.autodoc", "numpydoc", "sphinx_gallery.gen_gallery"]
exclude_patterns = ["_build", "_generated", "stories_source", "requirements.lock"]
default_role = "py:obj"
myst_heading_anchors = 4
myst_enable_extensions = ["colon_fence"]

html_theme = "furo"
html_title = f"fes_pin {release}"
html_static_path = ["static"]
html_css_files = ["wide.css"]
html_show_sourcelink = False
html_copy_source = False

autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_typehints_format = "short"
numpydoc_show_class_members = False
numpydoc_class_members_toctree = False

sphinx_gallery_conf = {
    "examples_dirs": ["stories_source"],
    "gallery_dirs": ["stories"],
    "filename_pattern": "|".join(rf"/{re.escape(name)}\.py$" for name in executed) or r"^$",
    "within_subsection_order": "FileNameSortKey",
    "capture_repr": (),
    "download_all_examples": False,
    "show_signature": False,
    "write_computation_times": False,  # its page would load scripts from the network
    "plot_gallery": not tags.has("no_stories"),  # type: ignore[name-defined]  # noqa: F821  (Sphinx defines it)
}


def bars(line: str) -> str:
    """Text in which bars are absolute values, as the docstrings have them, and no substitutions of reStructuredText."""
    parts = re.split(r"(`[^`]*`)", line)
    return "".join(p if p.startswith("`") else p.replace("|", "\\|") for p in parts)


def literal_blocks(app: object, what: str, name: str, obj: object, options: object, lines: list[str]) -> None:
    """Show what a docstring indents, equations and commands, as it stands: mark it as a literal block.

    Sections of numpydoc have indented texts of their own, and stay as they are.
    """
    first = next((k for k, line in enumerate(lines) if re.fullmatch(r"-{3,}", line.strip())), len(lines))
    lines[:] = [bars(line) if k > first or not line.startswith("    ") else line for k, line in enumerate(lines)]
    out: list[str] = []
    inside = False
    for k, line in enumerate(lines):
        following = lines[k + 1] if k + 1 < len(lines) else ""
        if re.fullmatch(r"-{3,}", following.strip()):
            out += lines[k:]
            break
        indented = line.startswith("    ")
        if indented and not inside and (not out or not out[-1].strip()):
            out += ["::", ""]
            inside = True
        elif line.strip() and not indented:
            inside = False
        out.append(line)
    lines[:] = out


def setup(app: object) -> None:
    """Connect the above, before numpydoc reads the docstrings."""
    app.connect("autodoc-process-docstring", literal_blocks, priority=100)  # type: ignore[attr-defined]
