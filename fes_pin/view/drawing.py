"""A figure of a report: its drawing, its words for those who cannot see it, and its data as CSV behind it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

ROWS = 800
"""Rows of the data behind a figure, at most; of a longer trial every second, third ... sample stands there."""


@dataclass(frozen=True)
class Drawing:
    """The parts of a figure that a page needs.

    Attributes
    ----------
    svg
        The element, with its description inside.
    csv
        The data that it shows.
    note
        What the data leave out; empty for nothing.
    """

    svg: str
    csv: str
    note: str = ""

    @classmethod
    def of(cls, svg: str, columns: Mapping[str, np.ndarray], rows: int = ROWS) -> Drawing:
        """Return a drawing whose data are columns of numbers, thinned to about so many rows."""
        step = max(1, -(-len(next(iter(columns.values()))) // rows))
        arrays = [np.asarray(v, dtype=float)[::step].tolist() for v in columns.values()]
        csv = rows_csv(tuple(columns), list(zip(*arrays, strict=True)))
        return cls(svg, csv, f"one sample in {step}" if step > 1 else "")


def rows_csv(head: Sequence[str], rows: Sequence[Sequence[str | float]]) -> str:
    """Rows of words and numbers as CSV; the words hold no comma."""
    lines = [",".join(head)]
    lines += [",".join(v if isinstance(v, str) else f"{v:.6g}" for v in row) for row in rows]
    return "\n".join(lines) + "\n"
