"""Files that were read, by their identity: nothing that writes may write over one of them.

Identity is the device and the number of a file on it, so that links, hard links and names that the file system takes
for the same are one file.
"""

import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from fes_pin.data.errors import InputError

_read: dict[tuple[int, int], str] = {}
"""The name under which each was read, by identity."""
_written: dict[tuple[int, int], tuple[int, int]] = {}
"""Size and time of change of what this process wrote: to read that again does not make it an input."""


def note_read(path: str | Path) -> None:
    """Remember a file as an input, unless this process wrote it as it is."""
    known = os.stat(path)
    if _written.get((known.st_dev, known.st_ino)) != (known.st_size, known.st_mtime_ns):
        _read[known.st_dev, known.st_ino] = os.path.abspath(path)


def note_written(path: str | Path) -> None:
    """Remember a file as one that this process wrote."""
    known = os.stat(path)
    _written[known.st_dev, known.st_ino] = known.st_size, known.st_mtime_ns


def was_read(path: str | Path) -> str:
    """The name under which a file was read; "" for one that was not."""
    try:
        known = os.stat(path)
        place = _read.get((known.st_dev, known.st_ino), "")
        return place if place and os.path.samestat(os.stat(place), known) else ""  # numbers go to new files
    except (OSError, ValueError):
        return ""


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
    before: list[tuple[dict[Any, Any], dict[Any, Any]]] = [(known, dict(known)) for known in (_read, _written)]
    for known, _ in before:
        known.clear()
    try:
        yield
    finally:
        for known, then in before:
            known.clear()
            known.update(then)
