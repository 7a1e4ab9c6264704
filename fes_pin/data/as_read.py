"""What was read, as it was then: hashes of the bytes, files that are held, and files that nothing may write over.

What becomes of a file after it was read changes nothing of what was made of it. A file's identity is its device and its
number on that, so that links, hard links and names that the file system takes for the same are one file.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from pathlib import Path, PosixPath
from typing import Any

import numpy as np

from fes_pin.data.errors import InputError
from fes_pin.data.read_only import ReadOnly
from fes_pin.settings import while_set

_SEEN: ContextVar[dict[str, str] | None] = ContextVar("seen", default=None)


@dataclass(frozen=True, eq=False)
class AsRead(ReadOnly):
    """Where a study or a trial comes from, and what it was then.

    Attributes
    ----------
    sha256
        Of the bytes of each file, by its absolute path.
    digest
        Of what was made of them: an object with another one was edited.
    half_digit
        Half of the last digit that the times were printed with, s; None: as they themselves show.
    recordings
        Of a walk: time and columns of the coordinates and of the ground reaction, each at its own rate.
    factors
        What numbers of a column were multiplied by, as their unit was stated; NaN where a scale was stated.
    interpolated
        Whether samples were interpolated to equal steps.
    stated
        Of a walk: keys of the conventions that its study states, which are not tested.
    """

    sha256: Mapping[str, str]
    digest: bytes
    half_digit: float | None = None
    recordings: tuple[tuple[np.ndarray, Mapping[str, np.ndarray]], ...] = field(default=(), repr=False)
    factors: Mapping[str, float] = field(default_factory=dict)
    interpolated: bool = False
    stated: frozenset[str] = frozenset()

    def file_of(self, column: str) -> str | None:
        """The file that holds a column of a trial or of a walk; None where several may."""
        files = list(self.sha256)
        if len(files) == len(self.recordings):  # of a walk, in the order of its recordings
            files = [f for f, (_, columns) in zip(files, self.recordings, strict=True) if column in columns]
        return files[0] if len(files) == 1 else None


class HeldFile(PosixPath):
    """A path with the bytes that were there when it was read: whoever reads it reads those."""

    @classmethod
    def holding(cls, path: str | Path, content: bytes) -> HeldFile:
        """The path, absolute, with its bytes."""
        held = cls(os.path.abspath(path))
        vars(held)["content"] = content
        return held

    @property
    def content(self) -> bytes | None:
        """The bytes; None of a path that was made of this one."""
        return vars(self).get("content")

    def __reduce__(self) -> tuple[Any, ...]:
        return (type(self), self.parts) if self.content is None else (HeldFile.holding, (str(self), self.content))

    def read_bytes(self) -> bytes:
        return super().read_bytes() if self.content is None else self.content

    def read_text(self, *args: Any, **more: Any) -> str:
        return super().read_text(*args, **more) if self.content is None else self.content.decode("utf-8")


def hashing() -> AbstractContextManager[dict[str, str]]:
    """SHA-256 of every file that is read inside, by its absolute path."""
    return while_set(_SEEN, dict[str, str]())


def note_bytes(path: str | Path, content: bytes) -> None:
    """Note the bytes of a file that was read."""
    if (seen := _SEEN.get()) is not None:
        seen[os.path.abspath(path)] = hashlib.sha256(content).hexdigest()


def digest_of(parts: Iterable[Any]) -> bytes:
    """A short hash of arrays and of whatever else `repr` distinguishes."""
    made = hashlib.blake2b(digest_size=16)
    for part in parts:
        made.update(part.tobytes() if isinstance(part, np.ndarray) else repr(part).encode())
    return made.digest()


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
