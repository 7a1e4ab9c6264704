"""TOML read so that an error can name the line of a key."""

import re
import tomllib
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from fes_pin.data.errors import InputError, KeyFault
from fes_pin.data.files import as_path, inside, read_text, what_is_at
from fes_pin.data.schema import NumberKey, checked_numbers

_TABLE = re.compile(r"^\s*(\[\[?)\s*([^\]#]+?)\s*\]\]?\s*(?:#.*)?$")
_KEY = re.compile(r"""^\s*((?:[A-Za-z0-9_-]+|"[^"]*"|'[^']*')(?:\s*\.\s*(?:[A-Za-z0-9_-]+|"[^"]*"|'[^']*'))*)\s*=""")


@dataclass(frozen=True)
class Document:
    """A TOML file: its data, and the line of each dotted key (`rig.passive.f0_n`, `trial[2].load_kg`)."""

    path: Path
    data: dict[str, Any]
    rows: dict[str, int]
    elsewhere: Mapping[str, Path] = field(default_factory=dict)
    """Where files lie that are not below its folder yet, by the paths there."""

    def error(self, key: str, message: str) -> InputError:
        """The error that names this file, the line of a key (or of its table, if it is missing) and the key."""
        place = key
        while place and place not in self.rows:
            place = place.rpartition(".")[0]
        return InputError(message, file=self.path, row=self.rows.get(place), column=key)

    def under(self, table: str) -> KeyFault:
        """What makes the error of a key of a table and a message."""
        return lambda key, message: self.error(f"{table}.{key}", message)

    def table(self, key: str, data: dict[str, Any] | None = None) -> dict[str, Any]:
        """A table by its key, empty if it is missing.

        Raises
        ------
        InputError
            If it is not a table.
        """
        value = (self.data if data is None else data).get(key.rpartition(".")[2], {})
        if not isinstance(value, dict):
            raise self.error(key, f"expected a table [{key}]")
        return value

    def numbers(
        self, where: str, table: Mapping[str, Any], known: Mapping[str, NumberKey], also: tuple[str, ...] = ()
    ) -> dict[str, float]:
        """Numbers of a table by key.

        Parameters
        ----------
        where
            Dotted key of the table.
        table
            Its values.
        known
            What it may hold.
        also
            Other keys that it might hold, named when a key is unknown.

        Raises
        ------
        InputError
            An unknown key, a missing one, or a value that is not the number it must be.
        """
        return checked_numbers(table, known, self.under(where), also)

    def path_of(self, key: str, value: object) -> Path:
        """Path of a file that a key names relative to this one.

        Raises
        ------
        InputError
            Not a path inside this file's folder, or no file there.
        """
        if isinstance(value, str) and value in self.elsewhere:
            return self.elsewhere[value]
        try:
            path = inside(self.path.parent, value)
        except ValueError as problem:
            raise self.error(key, str(problem)) from None
        found = what_is_at(path)
        if found != "a file":
            raise self.error(key, f"expected a file at {str(value)[:80]!r}, found {found}")
        return self.path.parent / str(value)


def read_toml(path: str | Path) -> Document:
    """Read a TOML file.

    Raises
    ------
    InputError
        Not a readable file, or not TOML, with the line.
    """
    path = as_path(path)
    return document_of(read_text(path), path)


def document_of(text: str, path: Path, elsewhere: Mapping[str, Path] | None = None) -> Document:
    """The TOML file that a text is or would be, as `read_toml`."""
    try:
        data = tomllib.loads(text)
    except RecursionError:
        raise InputError("not TOML that can be read: nested too deeply", file=path) from None
    except ValueError as error:
        found = re.search(r"\(at line (\d+), column \d+\)", str(error))
        row = int(found[1]) if found else (text.count("\n") + 1 if "end of document" in str(error) else None)
        message = str(error).split(" (at ")[0]
        raise InputError(f"not TOML: {message[:1].lower() + message[1:]}", file=path, row=row) from None
    return Document(path, data, _rows(text), elsewhere or {})


def _rows(text: str) -> dict[str, int]:
    rows: dict[str, int] = {}
    count: Counter[str] = Counter()
    prefix = ""
    for row, line in enumerate(text.split("\n"), start=1):
        if table := _TABLE.match(line):
            prefix = _plain(table[2])
            if table[1] == "[[":
                count[prefix] += 1
                prefix = f"{prefix}[{count[prefix] - 1}]"
            rows.setdefault(prefix, row)
        elif key := _KEY.match(line):
            name = _plain(key[1])
            rows.setdefault(f"{prefix}.{name}" if prefix else name, row)
    return rows


def _plain(dotted: str) -> str:
    return ".".join(part.strip().strip("\"'") for part in dotted.split("."))
