"""Pieces of a page: every text that enters is escaped here, once."""

from __future__ import annotations

import html
import math
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import resources

POLICY = "default-src 'none'; style-src 'unsafe-inline'; img-src data:"
"""Content security policy: the page loads nothing and runs nothing."""


@dataclass(frozen=True)
class Markup:
    """HTML that is safe already; everything else is escaped when it is put into a page."""

    text: str

    def __add__(self, other: Markup) -> Markup:
        return Markup(self.text + other.text)


Content = Markup | str


def safe(content: Content) -> str:
    """Content as HTML: markup as it is, text escaped."""
    return content.text if isinstance(content, Markup) else html.escape(content, quote=True)


def element(tag: str, *contents: Content, **attributes: str) -> Markup:
    """An element; `class_` is written as `class`."""
    names = "".join(f' {n.rstrip("_")}="{html.escape(v, quote=True)}"' for n, v in attributes.items())
    return Markup(f"<{tag}{names}>{''.join(safe(c) for c in contents)}</{tag}>")


def joined(parts: Sequence[Markup], between: str = "\n") -> Markup:
    """Markup one after the other."""
    return Markup(between.join(p.text for p in parts))


def table(
    head: Sequence[str], rows: Sequence[Sequence[Content]], numbers: Sequence[int] = (), prose: bool = False
) -> Markup:
    """A table that scrolls by itself where it is too wide.

    Parameters
    ----------
    head
        Titles of the columns.
    rows
        Cells, row by row.
    numbers
        Columns that are set flush right.
    prose
        True if the last column is text that may break.
    """

    def cells(tag: str, row: Sequence[Content]) -> Markup:
        made = [element(tag, c, **({"class_": "number"} if k in numbers else {})) for k, c in enumerate(row)]
        return element("tr", joined(made, ""))

    body = joined([cells("td", row) for row in rows])
    return element(
        "div",
        element("table", element("thead", cells("th", head)), element("tbody", body)),
        class_="scroll prose" if prose else "scroll",
        tabindex="0",
    )


def section(title: str, *contents: Markup) -> Markup:
    """A titled part of a page; nothing where it has no content."""
    kept = [c for c in contents if c.text]
    return element("section", element("h2", title), joined(kept)) if kept else Markup("")


def figure(drawing: str, caption: Content = "", class_: str = "") -> Markup:
    """An inline drawing (SVG, trusted) with a caption."""
    below = element("figcaption", caption) if caption else Markup("")
    return element("figure", Markup(drawing), below, **({"class_": class_} if class_ else {}))


def page(title: str, body: Markup) -> str:
    """A whole document with its style inside."""
    style = resources.files("fes_pin.view").joinpath("report.css").read_text(encoding="utf-8")
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"{element('title', title).text}\n<style>\n{style}</style>\n</head>\n<body>\n{body.text}\n</body>\n</html>\n"
    )


def percent(value: float | None) -> str:
    """A percentage as printed, "-" for none."""
    if value is None or not math.isfinite(value):
        return "-"
    return f"{value:.3g} %" if value >= 1.0 else f"{value:.2g} %"


def rounded(value: float, std: float) -> str:
    """A value with the digits that its standard deviation leaves it: two of the uncertain ones."""
    if not math.isfinite(std) or std <= 0.0:
        return f"{value:.4g}"
    digits = 1 - math.floor(math.log10(std))
    if abs(value) >= 1e5 or digits > 6:
        lead = math.floor(math.log10(abs(value))) if value else 0
        return f"{value:.{min(max(lead + digits, 0), 8)}e}"
    return f"{value:.{max(digits, 0)}f}"


def unit_text(unit: str) -> str:
    """A unit as printed: with its exponents and the micro sign; "1" for a pure number."""
    return unit.replace("m2", "m²").replace("us", "µs") or "1"


def probability(value: float) -> str:
    """A p-value as printed."""
    if math.isnan(value):
        return "not tested"
    return "p < 1e-12" if value < 1e-12 else f"p = {value:.2g}"


def key(*entries: tuple[str, str]) -> Markup:
    """A legend for the figures beneath it: colour names of `style.COLOURS`, and what they stand for."""
    made = [
        element("span", Markup(f'<i style="background: var(--{colour})"></i>'), words, class_="entry")
        for colour, words in entries
    ]
    return element("p", joined(made, " "), class_="key")
