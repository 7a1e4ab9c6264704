"""What a file of any format holds: columns of numbers by the names that the file gives them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from fes_pin.data.errors import InputError


@dataclass(frozen=True, eq=False)
class Recording:
    """Columns as they were recorded, in the file's own names and units.

    Parameters
    ----------
    path
        The file.
    names
        Every column of the file, in its order.
    columns
        Numbers of those that were asked for, each of shape (n,); NaN where a sample is missing.
    rows : ndarray of int, shape (n,)
        Where each sample stands: its line in a text file, else its number from 1.
    header_row
        Line of the names; None where the file is no text.
    units
        Units as the file itself states them, by name, where it does.
    rate_hz
        Sample rate as the file itself states it, None where it does not.
    half_digit
        Half of the last digit that a column was printed with, by its name; 0 where numbers are not printed.
    """

    path: Path
    names: tuple[str, ...]
    columns: Mapping[str, np.ndarray]
    rows: np.ndarray
    header_row: int | None = None
    units: Mapping[str, str] = field(default_factory=dict)
    rate_hz: float | None = None
    half_digit: Callable[[str], float] = lambda _name: 0.0

    def error(self, message: str, column: str, sample: int | None = None) -> InputError:
        """The error that names this file, a sample's row (or the header's) and a column."""
        row = self.header_row if sample is None else int(self.rows[sample])
        return InputError(message, file=self.path, row=row, column=column)


def without_twins(names: list[str]) -> tuple[str, ...]:
    """Names of which no two are the same: the second `Value` is `Value#2`; what has none is called by its place."""
    out: list[str] = []
    for place, name in enumerate(names, 1):
        base = name or f"column{place}"
        count = sum(1 for other in names[: place - 1] if other == name) + 1 if name else 1
        out.append(base if count == 1 else f"{base}#{count}")
    return tuple(out)
