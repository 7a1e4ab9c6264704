"""What was read, as it was then: hashes of the bytes, and files that are held.

What becomes of a file after it was read changes nothing of what was made of it.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterable, Mapping
from contextlib import AbstractContextManager
from contextvars import ContextVar
from dataclasses import dataclass, field
from pathlib import Path, PosixPath
from typing import Any

import numpy as np

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
    """

    sha256: Mapping[str, str]
    digest: bytes
    half_digit: float | None = None
    recordings: tuple[tuple[np.ndarray, Mapping[str, np.ndarray]], ...] = field(default=(), repr=False)


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
