"""The one error that bad input raises: a line that says where it is and what was expected.

A library that comes with an extra of the package, and is not installed, raises it as well.
"""

import importlib
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any


def as_text(words: str) -> str:
    """Words as UTF-8 can hold them: each byte of a file's name that is none of UTF-8 in digits, as `\\xff`."""
    return re.sub("[\ud800-\udfff]", lambda one: f"\\x{ord(one[0]) & 0xFF:02x}", words)


class InputError(ValueError):
    """Something that a person gave is not what it must be; the command line turns it into one line and exit code 2.

    Parameters
    ----------
    message
        What is wrong and what was expected, one sentence.
    file, row, column
        Where: path, line number in the file (the header is row 1), column name or dotted key. Each is optional.
    """

    def __init__(
        self, message: str, *, file: str | Path | None = None, row: int | None = None, column: str | None = None
    ) -> None:
        self.message, self.row, self.column = message, row, column
        self.file = None if file == Path() else file  # a study that was made in memory has no folder
        super().__init__(str(self))

    def __str__(self) -> str:
        place = [_short(str(self.file))] if self.file is not None else []
        if self.row is not None:
            place.append(f"row {self.row}")
        if self.column is not None:
            column = _short(str(self.column))
            place.append(f"column {column}" if self.row is not None else column)
        line = as_text(f"{', '.join(place)}: {self.message}" if place else self.message)
        return line if line.isprintable() else "".join(each if each.isprintable() else " " for each in line)


MOST_LISTED = 10
"""Names that a message lists at most: as many as a person looks through."""


def listed(names: Sequence[str], between: str = ", ") -> str:
    """Names in one line, at most `MOST_LISTED` of them: `a, b, ... and 390 more`."""
    if len(names) <= MOST_LISTED:
        return between.join(names)
    return f"{between.join(names[:MOST_LISTED])} ... and {len(names) - MOST_LISTED} more"


class InputWarning(UserWarning):
    """Numbers that a person gave are odd, as they are where a unit or a sign is wrong; what was asked is done."""


KeyFault = Callable[[str, str], InputError]
"""Makes the error of a key and a message."""


def fault_at(column: str = "{}", file: str | Path | None = None) -> KeyFault:
    """What makes the error of a key and a message.

    Parameters
    ----------
    column
        How the place of a key is written: `"--set {}"`.
    file
        Where it stands.
    """
    return lambda key, message: InputError(message, file=file, column=column.format(key))


@contextmanager
def errors_of(file: str | Path | None) -> Iterator[None]:
    """Let errors of input name a file.

    Raises
    ------
    InputError
        In the place of one that was raised within.
    """
    try:
        yield
    except InputError as error:
        raise InputError(error.message, file=file, column=error.column) from None


def _short(name: str) -> str:
    """A name without its middle, if it is longer than a line can hold."""
    return name if len(name) <= 500 else f"{name[:250]}...{name[-250:]}"


def optional_library(
    module: str, extra: str, needed: str, *, file: str | Path | None = None, column: str | None = None
) -> Any:
    """A module of a library that an extra brings.

    Parameters
    ----------
    module, extra
        Its name, and that of the extra.
    needed
        What needs it, as in "frames need pandas".
    file, column
        Where an error is.

    Raises
    ------
    InputError
        It is not installed; the message says how to install it.
    """
    try:
        return importlib.import_module(module)
    except ImportError:
        message = f"{needed}: pip install 'fes-pin[{extra}]'"
        raise InputError(message, file=file, column=column) from None
