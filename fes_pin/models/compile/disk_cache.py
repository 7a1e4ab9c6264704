"""Machine code kept on disk: where it cannot be used it costs time; executed is what this user alone can write."""

import hashlib
import logging
import os
import stat
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path

from fes_pin.data.errors import InputError
from fes_pin.data.files import write_bytes

_LOG = logging.getLogger("fes_pin")
_OTHERS_WRITE = stat.S_IWGRP | stat.S_IWOTH


def cache_folder() -> Path:
    """Return the folder of compiled models: `FES_PIN_CACHE`, else the user's cache folder.

    Raises
    ------
    RuntimeError
        The user has no home.
    """
    if chosen := os.environ.get("FES_PIN_CACHE"):
        return Path(chosen)
    usual = Path.home() / ("Library/Caches" if sys.platform == "darwin" else ".cache")
    return Path(os.environ.get("XDG_CACHE_HOME") or usual) / "fes_pin"


def read_cached(key: str) -> bytes | None:
    """Return the entry of a key, or None; an entry that is damaged, or that others can write, counts as none."""
    try:
        with _own(cache_folder(), os.O_DIRECTORY) as folder, _own(_entry(key), os.O_NOFOLLOW, folder) as handle:
            data = b"".join(iter(lambda: os.read(handle, 1 << 24), b""))
    except (OSError, RuntimeError):
        return None
    digest, body = data[:32], data[32:]
    return body if hashlib.sha256(body).digest() == digest else None


def write_cached(key: str, body: bytes) -> None:
    """Keep `body`; a cache that cannot be written, or that others can write, is no error: it is not used."""
    try:
        folder = cache_folder()
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        path = folder / _entry(key)
        with _own(folder, os.O_DIRECTORY):
            if not path.is_symlink() and (path.is_file() or not path.exists()):
                write_bytes(path, hashlib.sha256(body).digest() + body, mode=0o600)
    except (OSError, RuntimeError, InputError):
        return


def _entry(key: str) -> str:
    return f"{hashlib.sha256(key.encode()).hexdigest()[:40]}.program"


@contextmanager
def _own(path: str | Path, flags: int, folder: int | None = None) -> Iterator[int]:
    """A handle of a file or folder that this user owns and nobody else can write.

    What is checked is what is open, so nothing can come between the check and the reading.

    Raises
    ------
    OSError
        Not there, not of the kind that the flags ask for, or others can write it.
    """
    handle = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK | flags, dir_fd=folder)
    try:
        status = os.fstat(handle)
        if status.st_uid != os.geteuid() or status.st_mode & _OTHERS_WRITE:
            say_unsafe(f"{path} in the cache" if folder is not None else str(path))
            raise PermissionError(f"others can write {path}")
        yield handle
    finally:
        os.close(handle)


@cache
def say_unsafe(place: str) -> None:
    """A warning, once for each place."""
    _LOG.warning("compiled models are not read from %s: it is not this user's alone to write", place)
