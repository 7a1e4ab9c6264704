"""Frozen dataclasses of numbers and arrays: read-only, checked, compared by value, shown as tables."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np

from fes_pin.data.errors import InputError
from fes_pin.data.numbers import numbers
from fes_pin.data.read_only import ReadOnly
from fes_pin.data.show import DataFrame, frame, table_html


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
