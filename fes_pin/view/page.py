"""Pieces of a page: every text that enters is escaped here, once."""

from __future__ import annotations

import base64
import hashlib
import html
import re
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import resources
from urllib.parse import quote

from fes_pin.view.drawing import Drawing
from fes_pin.view.style import COLOURS

POLICY = "default-src 'none'; style-src 'unsafe-inline'; img-src data:; script-src '{script}'"
"""Content security policy: the page loads nothing, and runs the one script that it brings, by its hash."""


@dataclass(frozen=True)
class Markup:
    """HTML that is safe already; everything else is escaped when it is put into a page."""

    text: str

    def __add__(self, other: Markup) -> Markup:
        return Markup(self.text + other.text)


Content = Markup | str


def safe(content: Content) -> str:
    """Content as HTML: markup as it is, text escaped, with signs and code for what is typed in their place."""
    if isinstance(content, Markup):
        return content.text
    escaped = html.escape(content.replace("->", "\N{RIGHTWARDS ARROW}"), quote=True)
    return re.sub("`([^`]*)`", r"<code>\1</code>", escaped)


def element(tag: str, *contents: Content, **attributes: str) -> Markup:
    """An element; `class_` is written as `class`."""
    names = "".join(f' {n.rstrip("_")}="{html.escape(v, quote=True)}"' for n, v in attributes.items())
    return Markup(f"<{tag}{names}>{''.join(safe(c) for c in contents)}</{tag}>")


def joined(parts: Sequence[Markup], between: str = "\n") -> Markup:
    """Markup one after the other."""
    return Markup(between.join(p.text for p in parts))


def html_table(
    head: Sequence[str], rows: Sequence[Sequence[Content]], numbers: Sequence[int] = (), prose: bool = False
) -> Markup:
    """A table; on a narrow screen each row becomes a list of its cells with their titles.

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
        known = [{"class_": "number"} if k in numbers else {} for k in range(len(row))]
        titled = zip(row, head, known, strict=True)  # titles stand before cells on a narrow screen
        return element("tr", *(element(tag, cell, **own, **{"data-title": title}) for cell, title, own in titled))

    body = joined([cells("td", row) for row in rows])
    table = element("table", element("thead", cells("th", head)), element("tbody", body))
    return element("div", table, class_="scroll prose" if prose else "scroll")


def section(title: str, *contents: Markup) -> Markup:
    """A titled part of a page; nothing where it has no content."""
    kept = [c for c in contents if c.text]
    return element("section", element("h2", title), joined(kept)) if kept else Markup("")


def figure(drawing: Drawing, caption: Content = "", class_: str = "", file: str = "figure") -> Markup:
    """An inline drawing (SVG, trusted) with a caption, and its data as CSV behind it."""
    known = {"class_": class_} if class_ else {}
    words = f"data (CSV, {drawing.note})" if drawing.note else "data (CSV)"
    link = element("a", words, class_="data", download=f"{file}.csv", href=f"data:text/csv,{quote(drawing.csv)}")
    return element("figure", Markup(drawing.svg), element("figcaption", caption, " ", link), **known)


def folded(summary: Content, *contents: Markup) -> Markup:
    """Return a section that a line opens; it is printed in full."""
    return element("details", element("summary", summary), joined(contents))


def document(title: str, parts: Sequence[Markup], residual: str = "") -> str:
    """A whole document with its style inside: its parts, and a footer that says what a residual is."""
    footer = element("footer", f"Made by fes-pin. {residual}Intervals are 95 %. SI units.")
    body = joined([p for p in (*parts, footer) if p.text])
    files = resources.files("fes_pin.view")
    colours = " ".join(f"--{name}: {value};" for name, value in COLOURS.items())
    style = f":root {{ {colours} }}\n{files.joinpath('report.css').read_text(encoding='utf-8')}"
    script = files.joinpath("report.js").read_text(encoding="utf-8")
    allowed = "sha256-" + base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY.format(script=allowed)}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"{element('title', title).text}\n<style>\n{style}</style>\n</head>\n<body>\n{body.text}\n"
        f"<script>{script}</script>\n</body>\n</html>\n"
    )


def unit_text(unit: str) -> str:
    """A unit as printed: with its exponents and the micro sign."""
    return re.sub(r"(?<=[a-z])[23]", lambda power: "²" if power[0] == "2" else "³", unit).replace("us", "µs")


def key(*entries: tuple[str, str]) -> Markup:
    """A legend for the figures beneath it: colour names of `style.COLOURS`, and their meanings."""
    marks = [(Markup(f'<i style="background: var(--{name})"></i>'), said) for name, said in entries]
    return element("p", joined([element("span", *one, class_="entry") for one in marks], " "), class_="key")
