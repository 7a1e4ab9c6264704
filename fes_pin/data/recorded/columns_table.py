"""The table `[columns]` of a study, checked: which column of a file is which of the rig's, how files are written."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

from fes_pin.data.errors import KeyFault
from fes_pin.data.recorded.columns import INTERPOLATE, Columns, ColumnSource, unsaid
from fes_pin.data.recorded.events import EVENTS
from fes_pin.data.recorded.form import AFTER, AFTER_COMMENTS, DECIMALS, DELIMITERS, ENCODINGS, TextForm
from fes_pin.data.schema import RigSchema, any_number, check_known, one_of, positive, unknown
from fes_pin.data.units import factor_of

SOURCE_KEYS = ("name", "unit", "scale", "zero", "edge", "rate_hz")
ValueFault = Callable[[str], Exception]
"""Makes the exception of one key for a message."""


def columns_of(table: Mapping[str, Any], schema: RigSchema, revolute: bool | None, error: KeyFault) -> Columns:
    """The table `[columns]` of a study, checked.

    Parameters
    ----------
    table
        As TOML gives it.
    revolute
        Whether the rig's joint turns or slides; None if it has none, or that is not known.
    error
        Makes the exception for a key below `columns` and a message.

    Raises
    ------
    Exception
        What `error` makes.
    """
    if len(schema.recordings) > 1:
        raise error("", f"expected no [columns] for rig {schema.name}: its files name their columns themselves")
    for key in table:
        if key not in (*schema.columns, "ignored", "file"):
            raise error(key, unknown(key, (*schema.columns, "ignored", "file")))
    ignored = _names(table.get("ignored", []), partial(error, "ignored"), "a list of column names")
    about = table.get("file", {})
    if not isinstance(about, dict):
        raise error("file", "expected a table [columns.file]")
    stated = {c: value for c, value in table.items() if c in schema.columns}
    sources = {c: _source(c, value, revolute, error) for c, value in stated.items()}
    names = [*ignored, *(s.name for s in sources.values() if s.name)]
    for column, source in sources.items():
        if names.count(source.name) > 1:
            raise error(column, f"{source.name!r} is named twice in [columns]")
    scaled = frozenset(c for c, value in stated.items() if isinstance(value, dict) and "scale" in value)
    return _with_file(Columns(sources, ignored, revolute=revolute, scaled=scaled), about, error)


def _source(column: str, value: Any, revolute: bool | None, error: KeyFault) -> ColumnSource:
    """One column of the table, checked."""
    given = {"name": value} if isinstance(value, str) else value
    if not isinstance(given, dict):
        raise error(column, 'expected the name of a column, or a table like { name = "Angle", unit = "deg" }')
    check_known(given, SOURCE_KEYS, lambda key, message: error(f"{column}.{key}", message))
    numbers = _numbers_of(column, given, error)
    name, unit = given.get("name", ""), given.get("unit", "")
    if not isinstance(unit, str):
        raise error(f"{column}.unit", "expected a unit as text")
    if "rate_hz" not in numbers and (not isinstance(name, str) or not name):
        raise error(f"{column}.name", "expected the name of a column of the files")
    is_stated = bool(unit) or bool({"scale", "edge", "rate_hz"} & set(numbers))
    if name != column and not is_stated and (why := unsaid(column, name, "", revolute)):
        raise error(f"{column}.unit", why)
    factor = factor_of(unit, column, revolute, partial(error, f"{column}.unit")) if unit else 1.0
    return ColumnSource(name, factor, **numbers, is_stated=is_stated)


def _numbers_of(column: str, given: Mapping[str, Any], error: KeyFault) -> dict[str, float]:
    """The numbers that a column states: scale, zero, edge or rate."""
    keys = [k for k in ("scale", "zero", "edge", "rate_hz") if k in given]
    numbers = {k: any_number("").check(given[k], partial(error, f"{column}.{k}")) for k in keys}
    if "rate_hz" in numbers and (column != "time_s" or not numbers["rate_hz"] > 0.0 or len(given) > 1):
        raise error(f"{column}.rate_hz", "expected a rate above 0, alone, and of time_s only")
    if "edge" in numbers and column != "stim":
        raise error(f"{column}.edge", "expected for stim only: where a recorded trigger rises above it, a pulse begins")
    if numbers.get("scale") == 0.0:
        raise error(f"{column}.scale", "expected a number other than 0")
    return numbers


def _with_file(columns: Columns, about: Mapping[str, Any], error: KeyFault) -> Columns:
    """With what `[columns.file]` says of how the files are written."""
    check_known(about, tuple(FILE_KEYS), lambda key, message: error(f"file.{key}", message))
    form = {key: FILE_KEYS[key](value, partial(error, f"file.{key}")) for key, value in about.items()}
    rate, missing, rows = (form.pop(key, None) for key in ("resample_hz", "missing", "rows"))
    if rows is not None and rate is None:
        raise error("file.rows", f'expected resample_hz as well: rows = "{EVENTS}" are held from step to step')
    form.setdefault("first_row", form.get("header_row", 1) + 1)
    if form.get("header_row") == AFTER_COMMENTS and ("comment" not in form or "first_row" in about):
        raise error("file.header_row", f'"{AFTER}" wants comment to say what begins one, and no first_row')
    text = TextForm(**form)
    if text.first_row <= text.header_row:
        raise error("file.first_row", f"expected a line below the header in line {text.header_row}")
    return replace(columns, form=text, resample_hz=rate, fills=missing is not None, events=rows is not None)


def _names(value: Any, error: ValueFault, expected: str) -> tuple[str, ...]:
    if not isinstance(value, list) or not all(isinstance(one, str) for one in value):
        raise error(f"expected {expected}")
    return tuple(value)


def _file_names(value: Any, error: ValueFault) -> tuple[str, ...]:
    expected = "a list of names, one for each column of the files"
    names = _names(value, error, expected)
    if not names:
        raise error(f"expected {expected}")
    return names


def _comment(value: Any, error: ValueFault) -> str:
    if not isinstance(value, str) or not value.strip():
        raise error("expected what a comment begins with")
    return value.strip()


def _true_or_false(value: Any, error: ValueFault) -> bool:
    if not isinstance(value, bool):
        raise error("expected true or false")
    return value


def _sheet(value: Any, error: ValueFault) -> str:
    if not isinstance(value, str):
        raise error("expected the name of a sheet of a spreadsheet")
    return value


def _line(value: Any, error: ValueFault, least: int, hint: str = "") -> int:
    if isinstance(value, bool) or not isinstance(value, int) or value < least:
        raise error(f"expected the number of a line, from 1{hint}")
    return value


def _header_row(value: Any, error: ValueFault) -> int:
    return AFTER_COMMENTS if value == AFTER else _line(value, error, 0, " (0: no header)")


def _word(words: Sequence[str]) -> Callable[[Any, ValueFault], str]:
    return lambda value, error: one_of(value, tuple(words), error)


FILE_KEYS: Mapping[str, Callable[[Any, ValueFault], Any]] = {
    **{"delimiter": _word(DELIMITERS), "decimal": _word(DECIMALS)},
    **{"header_row": _header_row, "first_row": partial(_line, least=1)},
    **{"comment": _comment, "encoding": _word(ENCODINGS), "names": _file_names, "transposed": _true_or_false},
    "labelled": _true_or_false,
    **{"sheet": _sheet},
    **{"resample_hz": positive("Hz").check, "missing": _word((INTERPOLATE,)), "rows": _word((EVENTS,))},
}
"""Keys of `[columns.file]`, and what checks the value of each."""
