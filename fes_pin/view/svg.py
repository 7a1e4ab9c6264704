"""Figures of matplotlib inside a page: no identifiers that clash, colours that follow the page."""

from __future__ import annotations

import html
import io
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any

import matplotlib as mpl
from matplotlib.figure import Figure

from fes_pin.view.style import COLOURS, INK

WIDTH = 5.4
"""Width of a figure, inches; a report shows one or two beside each other."""
_RC: Mapping[str, Any] = {
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans", "Verdana", "sans-serif"],
    "font.size": 10.5,
    "axes.labelsize": 10.5,
    "xtick.labelsize": 9.5,
    "ytick.labelsize": 9.5,
    "legend.fontsize": 9.5,
    "axes.edgecolor": INK,
    "axes.labelcolor": INK,
    "text.color": INK,
    "xtick.color": INK,
    "ytick.color": INK,
    "axes.linewidth": 0.7,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.formatter.useoffset": False,
    "axes.formatter.limits": (-4, 5),
    "axes.formatter.use_mathtext": False,
    "axes.unicode_minus": True,
    "lines.solid_capstyle": "round",
    "legend.frameon": False,
    "path.simplify": True,
    "path.simplify_threshold": 0.2,
    "axes.titley": 1.0,
    "svg.fonttype": "none",
}
_STYLED = ContextVar("_STYLED", default=False)


@contextmanager
def styled() -> Iterator[None]:
    """The settings that every figure is drawn with, whatever the user's own are; many figures may share one call."""
    if _STYLED.get():
        yield
        return
    token = _STYLED.set(True)
    try:
        with mpl.rc_context():
            mpl.rcdefaults()
            mpl.rcParams.update(_RC)  # type: ignore[arg-type]
            yield
    finally:
        _STYLED.reset(token)


_PATH = re.compile(r' d="[^"]*"')
_TENTH = re.compile(r"(\.\d)\d+(?: \n)?")
"""Curves are drawn to a tenth of a point."""
_COLOUR = re.compile("|".join(COLOURS.values()))
_NAMES = {colour: name for name, colour in COLOURS.items()}


def inline_svg(figure: Figure, description: str) -> str:
    """A figure as an `<svg>` element that fills its place in a page.

    Colours become CSS variables (`--measured` ...) with the figure's own as their fallback.

    Parameters
    ----------
    figure
        With the colours of `style`.
    description
        What the figure shows, for those who cannot see it.
    """
    stream = io.StringIO()
    with styled():
        mpl.rcParams["svg.hashsalt"] = description
        figure.savefig(stream, format="svg", transparent=True, metadata=dict.fromkeys(("Date", "Creator", "Type")))
    text = stream.getvalue()
    text = text[text.index("<svg") :]
    head, body = text[: text.index(">")], text[text.index(">") + 1 :]
    box = re.search(r'viewBox="[^"]*"', head)
    assert box is not None
    body = re.sub(r"<metadata>.*?</metadata>", "", body, flags=re.DOTALL)
    body = re.sub(r'<g id="[^"]*"', "<g", body)
    body = _COLOUR.sub(lambda found: f"var(--{_NAMES[found[0]]}, {found[0]})", body)
    body = _PATH.sub(lambda found: _TENTH.sub(r"\1", found[0]), body)
    body = re.sub(r"\n\s*", "\n", body)
    label = html.escape(description, quote=True)
    return (
        f'<svg {box[0]} role="img" aria-label="{label}" xmlns="http://www.w3.org/2000/svg" '
        f'xmlns:xlink="http://www.w3.org/1999/xlink">{body}'
    )
