"""How results show themselves: tables for a notebook, frames for pandas.

Frozen dataclasses of numbers and arrays are read-only, checked, and compared by value.
"""

import dataclasses
import html
from collections.abc import Mapping, Sequence
from itertools import zip_longest
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from fes_pin.data.errors import InputError, optional_library
from fes_pin.data.numbers import numbers
from fes_pin.data.read_only import ReadOnly

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


class Tabulated(ReadOnly):
    """Base of results that are numbers and arrays; use `dataclass(frozen=True, eq=False)`.

    Attributes
    ----------
    along
        Names of the arrays that share their first axis: the columns of `to_frame`. Those of one axis are copied, and
        must hold numbers. Without any, the numbers of the result are its one row.

    Raises
    ------
    InputError
        When it is built: arrays along one axis that are of different lengths, or hold no numbers.
    """

    along: ClassVar[tuple[str, ...]] = ()
    _index: ClassVar[str | None] = None

    def __post_init__(self) -> None:
        for item in dataclasses.fields(self):
            value = getattr(self, item.name)
            if item.name in self.along or (type(value) is np.ndarray and value.dtype != bool):
                vars(self)[item.name] = numbers(value, item.name)
        lengths = [getattr(self, name).shape[:1] for name in self.along]
        if len(set(lengths)) > 1 or () in lengths:
            raise InputError(f"expected arrays of one length, found others: {', '.join(self.along)}")
        self._freeze()

    def _values(self) -> dict[str, Any]:
        return {item.name: getattr(self, item.name) for item in dataclasses.fields(self)}

    def _table(self) -> Mapping[str, Sequence[Any]]:
        """The columns of `to_frame`; those with an `_index` are shown whole, others by their ranges."""
        if self.along:
            return {n: getattr(self, n) for n in self.along}
        return {n: [v] for n, v in self._values().items() if isinstance(v, int | float)}

    def to_frame(self) -> DataFrame:
        """The columns that share their first axis, or without any the numbers, as a frame of pandas.

        Raises
        ------
        InputError
            pandas is not installed.
        """
        return frame(self._table(), self._index)

    def _repr_html_(self) -> str:
        if self._index is not None:
            columns = self._table()
            cells = zip(*columns.values(), strict=True)
            texts = [[x if isinstance(x, str) else f"{x:.4g}" for x in row] for row in cells]
            return table_html(str(self).splitlines()[0], list(columns), texts)
        rows = []
        for name, value in self._values().items():
            if isinstance(value, np.ndarray) and value.size:
                rows.append((name, f"{np.nanmin(value):.4g} to {np.nanmax(value):.4g}, shape {value.shape}"))
            elif isinstance(value, int | float):
                rows.append((name, f"{value:.4g}"))
        return table_html(type(self).__name__, ("quantity", "value"), rows)
