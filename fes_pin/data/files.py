"""Files of a study: read as text, kept inside its folder, written whole or not at all."""

import json
import math
import os
import shutil
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from itertools import takewhile
from pathlib import Path, PurePosixPath
from typing import Any

from fes_pin.data.as_read import HeldFile, note_bytes, note_read, note_written, refuse_inputs
from fes_pin.data.errors import InputError, as_text

try:
    import fcntl
except ImportError:  # Windows, for which Pinocchio has no wheels either
    raise ImportError("fes_pin runs on Linux and macOS, and in WSL on Windows") from None

MAX_BYTES = 1 << 30
SCRATCH = ".fes_pin-"
"""How the names of folders begin in which files are prepared."""


def as_path(value: str | Path, name: str = "path") -> Path:
    """A path.

    Raises
    ------
    InputError
        Anything else than text or a path.
    """
    try:
        return value if isinstance(value, Path) else Path(value)
    except TypeError:
        raise InputError(f"expected a path, found a {type(value).__name__}", column=name) from None


def read_bytes(path: str | Path) -> bytes:
    """Content of a regular file, over which nothing is written from now on; see `read_files`.

    Raises
    ------
    InputError
        Missing, a folder, not a regular file, larger than 1 GiB, or not readable.
    """
    if isinstance(path, HeldFile) and path.content is not None:
        return path.content
    path = as_path(path)
    try:
        if not path.exists():
            raise InputError(missing(path), file=path)
        if (found := what_is_at(path)) != "a file":
            raise InputError(f"expected a file, found {found}", file=path)
        if path.stat().st_size > MAX_BYTES:
            raise InputError("expected at most 1 GiB", file=path)
        note_read(path)
        content = path.read_bytes()
        note_bytes(path, content)
        return content
    except (OSError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"cannot be read: {_reason(error)}", file=path) from error


def read_text(path: str | Path, encoding: str = "utf-8") -> str:
    """Text of a file, a byte-order mark of UTF-8 removed and its line ends as "\\n".

    Raises
    ------
    InputError
        As `read_bytes`, and for bytes that are no text of this encoding, with the row.
    """
    return text_of(read_bytes(path), path, encoding)


def text_of(content: bytes, path: str | Path, encoding: str = "utf-8") -> str:
    """Text of a file's content, as `read_text`.

    Raises
    ------
    InputError
        For bytes that are no text of this encoding, with the row.
    """
    try:
        text = content.decode("utf-8-sig" if encoding == "utf-8" else encoding)
    except UnicodeError as error:
        row = content[: getattr(error, "start", 0)].count(b"\n") + 1
        raise InputError(f"expected {encoding.upper()} text", file=path, row=row) from error
    return text.replace("\r\n", "\n").replace("\r", "\n") if "\r" in text else text


def read_json(path: str | Path) -> Any:
    """What a file of JSON holds.

    Raises
    ------
    InputError
        As `read_text`, and for what is no JSON, with the row.
    """
    text = read_text(path)
    try:
        return json.loads(text, parse_int=_whole)
    except (ValueError, RecursionError) as error:
        raise InputError(f"expected JSON: {error}", file=path, row=getattr(error, "lineno", None)) from None


def read_json_lines(path: str | Path) -> list[Any]:
    """What each line of a file of JSON lines holds, but for empty ones.

    Raises
    ------
    InputError
        As `read_text`, and for a line that is no JSON, with its row.
    """
    out = []
    for row, line in enumerate(read_text(path).splitlines(), 1):
        try:
            out += [json.loads(line, parse_int=_whole)] if line.strip() else []
        except (ValueError, RecursionError) as error:
            raise InputError(f"expected JSON: {error}", file=path, row=row) from None
    return out


def _whole(digits: str) -> int | float:
    """An integer; inf where it is beyond what a float can be, as JSON's `1e400` is."""
    number = float(digits)
    return int(digits) if math.isfinite(number) else number


def own_json(path: Path) -> dict[str, Any]:
    """A table that fes_pin wrote itself; empty where there is none, or where it is no longer one."""
    with suppress(OSError, ValueError):
        found = json.loads(path.read_bytes())
        return found if isinstance(found, dict) else {}
    return {}


def hold(path: str | Path) -> HeldFile:
    """A file with its bytes as they are now.

    Raises
    ------
    InputError
        As `read_bytes`.
    """
    return path if isinstance(path, HeldFile) else HeldFile.holding(path, read_bytes(path))


def missing(path: Path) -> str:
    """What to say where no file is: a link of git-annex or DVC whose content was not fetched is one as well."""
    return "no such file" if not path.is_symlink() else f"a link to {os.readlink(path)}, which is not there"


def what_is_at(path: Path) -> str:
    """ "a file", "a folder", "a special file", "nothing", or "a name that no file can have"."""
    try:
        if not path.exists():
            return missing(path) if path.is_symlink() else "nothing"
        return "a file" if path.is_file() else ("a folder" if path.is_dir() else "a special file")
    except (OSError, ValueError):
        return "a name that no file can have"


def inside(folder: Path, relative: object) -> Path:
    """Resolved path of a file named relative to `folder`.

    Raises
    ------
    ValueError
        Not text, empty, absolute, with `..`, or in a folder that is a link to one elsewhere. The message says which.
        The file itself may be a link: git-annex and DVC keep recordings so.
    """
    if not isinstance(relative, str) or not relative.strip() or not relative.isprintable():
        raise ValueError("expected a path relative to the study, as text")
    parts = relative.replace("\\", "/").split("/")
    if relative.startswith(("/", "\\", "~")) or ":" in parts[0] or ".." in parts:
        raise ValueError(f"path leaves the study's folder: {relative!r}; expected a path inside it")
    root = folder.resolve()
    try:
        path = (root / relative).parent.resolve() / (root / relative).name
    except (OSError, RuntimeError) as error:
        raise ValueError(f"path cannot be resolved: {_reason(error)}") from error
    if not path.is_relative_to(root):
        raise ValueError(f"path leaves the study's folder through a link: {relative!r}; expected a path inside it")
    return path


def write_bytes(path: str | Path, content: bytes, mode: int = 0o666) -> None:
    """Write one file whole or not at all: to a temporary file next to it, synchronised, then renamed over it.

    Parameters
    ----------
    mode
        Permissions of a new file, of which the process's mask takes its share.

    Raises
    ------
    InputError
        The folder is missing, `path` is a folder or a file that was read (see `read_files`), or the file cannot be
        written; the old file is then untouched.
    """
    if not isinstance(path, str | Path):
        raise InputError(f"cannot be written: expected a path, found {path!r}")
    path = Path(path)
    with _input_errors(path):
        if path.is_dir():
            raise InputError("cannot be written: expected a file, found a folder", file=path)
        if path.exists() and not path.is_file():
            path.write_bytes(content)
            return
        if not path.parent.is_dir():
            raise InputError("cannot be written: the folder does not exist", file=path)
        target = path.resolve()
        refuse_inputs([path])
        with scratch_folder(target.parent) as scratch:
            os.replace(_stage(scratch / "new", content, mode), target)
        note_written(target)
        _sync_folder(target.parent)


def write_text(path: str | Path, text: str) -> None:
    """Write text as UTF-8, as `write_bytes`."""
    write_bytes(path, as_bytes(text))


def as_bytes(content: str | bytes) -> bytes:
    """A file's bytes, of text in UTF-8."""
    return as_text(content).encode("utf-8") if isinstance(content, str) else content


def check_folder(folder: str | Path) -> None:
    """Raise where `write_files` would, before the work that makes the files.

    Raises
    ------
    InputError
        The folder is a file, or cannot be written or made.
    """
    path = as_path(folder, "folder").absolute()
    with _input_errors(path):
        nearest = next(p for p in (path, *path.parents) if p.exists())
    if not nearest.is_dir():
        raise InputError("is a file; expected a folder", file=nearest)
    if not os.access(nearest, os.W_OK | os.X_OK):
        raise InputError("cannot be written", file=nearest)


def write_files(folder: str | Path, contents: Mapping[str, str | bytes], without: Iterable[str] = ()) -> None:
    """Write several files into a folder: all of them, or none.

    Every file is staged and synchronised first. Old files are moved aside, all of them before the first new one comes,
    and come back if any rename fails: whenever a run is killed, what stands in the folder is whole, and of one run.

    Parameters
    ----------
    folder
        Made if it is missing (with its parents).
    contents
        Text or bytes by the path relative to `folder`, with forward slashes.
    without
        Files of an earlier run that go with its others, where they are there.

    Raises
    ------
    InputError
        The folder or a file in it cannot be written, a file in it was read (see `read_files`), or a path leaves the
        folder.
    """
    folder = as_path(folder, "folder")
    with _input_errors(folder):
        made = make_folder(folder)
        try:
            _write_into(folder, contents, without)
        except BaseException:
            if made is not None:
                shutil.rmtree(made, ignore_errors=True)
            raise


def _write_into(folder: Path, contents: Mapping[str, str | bytes], without: Iterable[str]) -> None:
    targets = {name: _target(folder, name) for name in contents}
    gone = [_target(folder, name) for name in without]
    refuse_inputs([*targets.values(), *gone])
    with scratch_folder(folder) as scratch:
        staged = {}
        for index, (name, content) in enumerate(contents.items()):
            staged[targets[name]] = _stage(scratch / f"new-{index}", as_bytes(content))
        _exchange(staged, [*targets.values(), *gone], scratch)
    for target in targets.values():
        note_written(target)
    for parent in {target.parent for target in targets.values()}:
        _sync_folder(parent)


def _exchange(staged: Mapping[Path, Path], leaving: Iterable[Path], scratch: Path) -> None:
    """Rename new files to their places after the old ones have left; where that fails, everything is as before.

    The first file is always there, old or new: it may say what the others are.
    """
    first = next(iter(staged), None)
    aside: list[tuple[Path, Path]] = []
    placed: list[Path] = []
    try:
        for index, target in enumerate(leaving):
            if os.path.lexists(target):
                aside.append((target, scratch / f"old-{index}"))
                (shutil.copyfile if target == first and target.is_file() else os.replace)(*aside[-1])
        for target, new in staged.items():
            if not target.parent.exists():
                target.parent.mkdir(parents=True, exist_ok=True)
            placed.append(target)
            os.replace(new, target)
    except BaseException:
        for target in placed:
            target.unlink(missing_ok=True)
        for target, old in aside:
            if os.path.lexists(old):
                os.replace(old, target)
        raise


@contextmanager
def scratch_folder(folder: Path) -> Iterator[Path]:
    """A folder inside `folder`, and so on the same disk, to prepare files in; what killed runs left there goes first.

    It is locked as long as it is used. A lock ends with its process: what can be locked is of a run that was killed.
    """
    _remove_litter(folder)
    path, lock = _locked_folder(folder)
    try:
        yield path
    finally:
        shutil.rmtree(path, ignore_errors=True)
        if lock is not None:
            os.close(lock)


def _locked_folder(folder: Path) -> tuple[Path, int | None]:
    """A new folder and the handle that locks it; None on a disk that knows no locks."""
    while True:
        path = Path(tempfile.mkdtemp(prefix=SCRATCH, dir=folder))
        try:
            lock = _lock(path)
        except (BlockingIOError, FileNotFoundError):  # another run takes it for litter
            continue
        except OSError:
            return path, None
        if path.exists():
            return path, lock
        os.close(lock)


@contextmanager
def locked(path: Path) -> Iterator[None]:
    """Hold the lock of a file, which is made for it and goes again.

    Raises
    ------
    BlockingIOError
        Another one holds it.
    OSError
        The disk knows no locks, or the file cannot be made.
    """
    while True:
        lock = _lock(path, os.O_CREAT)
        with suppress(FileNotFoundError):
            if os.path.samestat(os.fstat(lock), os.stat(path)):
                break
        os.close(lock)  # it went meanwhile
    try:
        yield
    finally:
        path.unlink(missing_ok=True)
        os.close(lock)


def _lock(path: Path, further: int = 0) -> int:
    handle = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | further, 0o666)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BaseException:
        os.close(handle)
        raise
    return handle


def _remove_litter(folder: Path) -> None:
    """Remove what killed runs of this user left in a folder."""
    for path in folder.glob(f"{SCRATCH}*"):
        try:
            lock = _lock(path)
        except OSError:  # in use, gone, a link, or of somebody else
            continue
        if os.fstat(lock).st_uid == os.geteuid():
            shutil.rmtree(path, ignore_errors=True) if path.is_dir() else path.unlink(missing_ok=True)
        os.close(lock)


def _target(folder: Path, name: str) -> Path:
    parts = PurePosixPath(name).parts
    if not parts or ".." in parts or PurePosixPath(name).is_absolute():
        raise InputError(f"expected a file name inside the folder, found {name!r}", file=folder)
    target = folder.joinpath(*parts)
    if target.is_dir():
        raise InputError("expected a file to write, found a folder", file=target)
    return target


def make_folder(folder: Path) -> Path | None:
    """Make a folder; the topmost one that had to be made, to remove it again."""
    new = list(takewhile(lambda one: not one.exists(), (folder, *folder.parents)))
    if new:
        folder.mkdir(parents=True, exist_ok=True)
    return new[-1] if new else None


def _stage(path: Path, content: bytes, mode: int = 0o666) -> Path:
    """Write and synchronise a new file."""
    with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, mode), "wb") as stream:
        stream.write(content)
        stream.flush()
        os.fsync(stream.fileno())
    return path


def _sync_folder(folder: Path) -> None:
    """Make the rename itself durable."""
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
        named = error.filename if error.filename and SCRATCH not in str(error.filename) else path
        raise InputError(f"cannot be written: {_reason(error)}", file=named) from error


def _reason(error: BaseException) -> str:
    return getattr(error, "strerror", None) or str(error) or type(error).__name__
