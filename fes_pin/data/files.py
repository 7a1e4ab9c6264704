"""Files of a study: read as text, kept inside its folder, written whole or not at all."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path, PurePosixPath

from fes_pin.data.errors import InputError

MAX_BYTES = 1 << 30


def read_bytes(path: str | Path) -> bytes:
    """Content of a regular file.

    Raises
    ------
    InputError
        Missing, a folder, not a regular file, larger than 1 GiB, or not readable.
    """
    path = Path(path)
    try:
        if not path.exists():
            raise InputError("no such file", file=path)
        if not path.is_file():
            raise InputError(f"expected a file, found {'a folder' if path.is_dir() else 'a special file'}", file=path)
        if path.stat().st_size > MAX_BYTES:
            raise InputError("expected at most 1 GiB", file=path)
        return path.read_bytes()
    except (OSError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"cannot be read: {_reason(error)}", file=path) from error


def read_text(path: str | Path) -> str:
    """Text of a UTF-8 file, its byte-order mark removed and its line ends as "\\n".

    Raises
    ------
    InputError
        As `read_bytes`, and for bytes that are not UTF-8, with the row.
    """
    content = read_bytes(path)
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        row = content[: error.start].count(b"\n") + 1
        raise InputError("expected UTF-8 text", file=path, row=row) from error
    return text.replace("\r\n", "\n").replace("\r", "\n") if "\r" in text else text


def inside(folder: Path, relative: object) -> Path:
    """Resolved path of a file named relative to `folder`.

    Raises
    ------
    ValueError
        Not text, empty, absolute, with `..`, or leaving the folder through a symbolic link. The message says which.
    """
    if not isinstance(relative, str) or not relative.strip() or not relative.isprintable():
        raise ValueError("expected a path relative to the study, as text")
    parts = relative.replace("\\", "/").split("/")
    if relative.startswith(("/", "\\", "~")) or ":" in parts[0] or ".." in parts:
        raise ValueError(f"path leaves the study's folder: {relative!r}; expected a path inside it")
    root = folder.resolve()
    try:
        path = (root / relative).resolve()
    except (OSError, RuntimeError) as error:
        raise ValueError(f"path cannot be resolved: {_reason(error)}") from error
    if not path.is_relative_to(root):
        raise ValueError(f"path leaves the study's folder through a link: {relative!r}; expected a path inside it")
    return path


def write_bytes(path: str | Path, content: bytes) -> None:
    """Write one file whole or not at all: to a temporary file beside it, synchronised, then renamed over it.

    Raises
    ------
    InputError
        The folder is missing, `path` is a folder, or the file cannot be written; the old file is then untouched.
    """
    path = Path(path)
    with _input_errors(path):
        if path.is_dir():
            raise InputError("expected a file to write, found a folder", file=path)
        if path.exists() and not path.is_file():
            path.write_bytes(content)
            return
        if not path.parent.is_dir():
            raise InputError("the folder to write into does not exist", file=path)
        target = path.resolve()
        staged = _stage(target.parent, content)
        try:
            os.replace(staged, target)
        except BaseException:
            staged.unlink(missing_ok=True)
            raise
        _sync_folder(target.parent)


def write_text(path: str | Path, text: str) -> None:
    """Write text as UTF-8, as `write_bytes`."""
    write_bytes(path, text.encode("utf-8"))


def check_folder(folder: str | Path) -> None:
    """Raise where `write_files` would, before the work that makes the files.

    Raises
    ------
    InputError
        The folder is a file, or cannot be written or made.
    """
    path = Path(folder).absolute()
    with _input_errors(path):
        nearest = next(p for p in (path, *path.parents) if p.exists())
    if not nearest.is_dir():
        raise InputError("is a file; expected a folder", file=nearest)
    if not os.access(nearest, os.W_OK | os.X_OK):
        raise InputError("cannot be written", file=nearest)


def write_files(folder: str | Path, contents: Mapping[str, str | bytes]) -> None:
    """Write several files into a folder: all of them, or none.

    Every file is staged and synchronised first. Old files are moved aside and come back if any rename fails.

    Parameters
    ----------
    folder
        Made if it is missing (with its parents).
    contents
        Text or bytes by the path relative to `folder`, with forward slashes.

    Raises
    ------
    InputError
        The folder or a file in it cannot be written, or a path leaves the folder.
    """
    folder = Path(folder)
    with _input_errors(folder):
        made = _make_folder(folder)
        try:
            _write_into(folder, contents)
        except BaseException:
            if made is not None:
                shutil.rmtree(made, ignore_errors=True)
            raise


def _write_into(folder: Path, contents: Mapping[str, str | bytes]) -> None:
    targets = {name: _target(folder, name) for name in contents}
    with tempfile.TemporaryDirectory(prefix=".fes_pin-", dir=folder) as scratch:
        staged = {}
        for name, content in contents.items():
            staged[name] = _stage(Path(scratch), content.encode("utf-8") if isinstance(content, str) else content)
        done: list[tuple[Path, Path | None]] = []
        try:
            for index, (name, target) in enumerate(targets.items()):
                target.parent.mkdir(parents=True, exist_ok=True)
                old = Path(scratch) / f"old-{index}" if target.exists() else None
                if old is not None:
                    os.replace(target, old)
                done.append((target, old))
                os.replace(staged[name], target)
        except BaseException:
            for target, old in reversed(done):
                target.unlink(missing_ok=True)
                if old is not None:
                    os.replace(old, target)
            raise
    for parent in {target.parent for target in targets.values()}:
        _sync_folder(parent)


def _target(folder: Path, name: str) -> Path:
    parts = PurePosixPath(name).parts
    if not parts or ".." in parts or PurePosixPath(name).is_absolute():
        raise InputError(f"expected a file name inside the folder, found {name!r}", file=folder)
    target = folder.joinpath(*parts)
    if target.is_dir():
        raise InputError("expected a file to write, found a folder", file=target)
    return target


def _make_folder(folder: Path) -> Path | None:
    """Make a folder; the topmost one that had to be made, to remove it again."""
    made = None
    for parent in (folder, *folder.parents):
        if parent.exists():
            break
        made = parent
    folder.mkdir(parents=True, exist_ok=True)
    return made


def _stage(folder: Path, content: bytes) -> Path:
    handle, name = tempfile.mkstemp(prefix=".fes_pin-", dir=folder)
    try:
        with os.fdopen(handle, "wb") as stream:
            stream.write(content)
            stream.flush()
            os.fsync(stream.fileno())
        os.chmod(name, 0o666 & ~_umask())
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise
    return Path(name)


def _umask() -> int:
    mask = os.umask(0o022)
    os.umask(mask)
    return mask


def _sync_folder(folder: Path) -> None:
    """Make the rename itself durable, where the system can."""
    if not hasattr(os, "O_DIRECTORY"):
        return
    handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


@contextmanager
def _input_errors(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise InputError(f"cannot be written: {_reason(error)}", file=error.filename or path) from error


def _reason(error: BaseException) -> str:
    return getattr(error, "strerror", None) or str(error) or type(error).__name__
