"""Files that were read, by their identity: nothing that writes may write over one of them.

Identity is the device and the number of a file on it, so that links, hard links and names that the file system takes
for the same are one file.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from fes_pin.data.errors import InputError

Identity = tuple[int, int]
_read: dict[Identity, str] = {}
_written: dict[Identity, tuple[int, int]] = {}
"""Size and time of change of what this process wrote: to read that again does not make it an input."""


def note_read(path: str | Path) -> None:
    """Remember a file as an input, unless this process wrote it as it is."""
    known = _stat(path)
    if known is not None and _written.get(_identity(known)) != (known.st_size, known.st_mtime_ns):
        _read[_identity(known)] = os.path.abspath(path)


def note_written(path: str | Path) -> None:
    """Remember a file as one that this process wrote."""
    known = _stat(path)
    if known is not None:
        _written[_identity(known)] = known.st_size, known.st_mtime_ns


def was_read(path: str | Path) -> str:
    """The name under which a file was read; "" for one that was not."""
    known = _stat(path)
    place = "" if known is None else _read.get(_identity(known), "")
    still = _stat(place) if place else None  # the number of a file that is gone goes to another one
    return place if known and still and _identity(still) == _identity(known) else ""


def refuse_inputs(paths: Iterable[Path]) -> None:
    """Raise where one of the files that are to be written was read.

    Raises
    ------
    InputError
        With the file, and the name under which it was read.
    """
    for path in paths:
        if place := was_read(path):
            other = "" if place == os.path.abspath(path) else f" as {place}"
            raise InputError(f"was read{other}, and no output is written over it; expected another place", file=path)


@contextmanager
def one_command() -> Iterator[None]:
    """What is read and written inside is of one command: what was read before is not its input."""
    before = dict(_read), dict(_written)
    _read.clear()
    _written.clear()
    try:
        yield
    finally:
        _read.clear()
        _written.clear()
        _read.update(before[0])
        _written.update(before[1])


def _stat(path: str | Path) -> os.stat_result | None:
    try:
        return os.stat(path)
    except (OSError, ValueError):
        return None


def _identity(known: os.stat_result) -> Identity:
    return known.st_dev, known.st_ino
