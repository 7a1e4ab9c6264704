"""How results show themselves: tables for a notebook, frames for pandas."""

from __future__ import annotations

import html
from collections.abc import Mapping, Sequence
from itertools import zip_longest
from typing import TYPE_CHECKING, Any

from fes_pin.data.libraries import optional_library

if TYPE_CHECKING:
    from pandas import DataFrame
else:
    DataFrame = Any


def table_html(title: str, head: Sequence[str], rows: Sequence[Sequence[str]], notes: Sequence[str] = ()) -> str:
    """A titled table as a notebook shows it; every text is escaped here."""

    def cells(tag: str, row: Sequence[str]) -> str:
        made = "".join(f'<{tag} style="text-align: left">{html.escape(c)}</{tag}>' for c in row)
        return f"<tr>{made}</tr>"

    body = "".join(cells("td", row) for row in rows)
    table = f"<table><thead>{cells('th', head)}</thead><tbody>{body}</tbody></table>" if rows else ""
    said = "".join(f"<p>{html.escape(n)}</p>" for n in notes)
    return f"<div><p><strong>{html.escape(title)}</strong></p>{table}{said}</div>"


def table_text(title: str, head: Sequence[str], rows: Sequence[Sequence[str]], notes: Sequence[str] = ()) -> str:
    """The same as text: columns flush left, cells of several lines beneath each other, no head without rows."""
    lines = [row for one in (head, *rows) for row in zip_longest(*(cell.split("\n") for cell in one), fillvalue="")]
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    table = ["  ".join(c.ljust(w) for c, w in zip(line, widths, strict=True)).rstrip() for line in lines]
    return "\n ".join([title, *(table if rows else ()), *notes])


def by_columns(head: Sequence[str], rows: Sequence[Sequence[Any]]) -> dict[str, list[Any]]:
    """A table given by rows as columns by name."""
    return {name: [row[k] for row in rows] for k, name in enumerate(head)}


def frame(columns: Mapping[str, Any], index: str | None = None) -> DataFrame:
    """Columns as a frame of pandas, one of them as its index.

    Raises
    ------
    InputError
        pandas is not installed.
    """
    made = optional_library("pandas", "pandas", "frames need pandas").DataFrame(dict(columns))
    return made.set_index(index) if index is not None else made
