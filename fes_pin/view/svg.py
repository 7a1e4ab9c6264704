"""Figures as text that stands inside a page: no identifiers that clash, colours that follow the page."""

from __future__ import annotations

import html
import io
import re

import matplotlib as mpl
from matplotlib.figure import Figure

from fes_pin.view.style import COLOURS, styled

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
