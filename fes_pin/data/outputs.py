"""What a command writes: never over what was read, and only over what it wrote itself and nobody has changed.

Which that is, is noted in each folder by the SHA-256 of its files, and once more at the end of its page: a
copy without the hidden file is known by that. Functions of Python that write do the same under their own names.
"""

import hashlib
import json
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from contextvars import ContextVar
from dataclasses import dataclass
from pathlib import Path

from fes_pin.data.as_read import refuse_inputs, was_read
from fes_pin.data.errors import InputError
from fes_pin.data.files import (
    SCRATCH,
    as_bytes,
    as_path,
    check_folder,
    fcntl,
    locked,
    make_folder,
    own_json,
    write_bytes,
    write_files,
)
from fes_pin.settings import while_set

RECORD = ".fes_pin.json"
"""In each folder that a command writes into: by name of a file which command wrote it, and its SHA-256."""
WRITTEN = "<!-- written: "
"""At the end of a page, in a comment: the same of the files that were written with it, and of the text before."""
HTML, URDF_ENDINGS = (".html", ".htm"), (".urdf", ".xml")
"""How the names of pages and of rigs end."""
BUSY = f"{SCRATCH}busy"
"""How the files are named that a command locks while it works for a folder, or for one file."""
_CLAIMED: ContextVar[tuple[ExitStack, set[Path]] | None] = ContextVar("claimed", default=None)


@dataclass(frozen=True)
class Outputs:
    """The writer of one command.

    A file that is there already is written over where `RECORD` in its folder says that the same command wrote it, and
    its content is still the same; any other one only with `force`. A file that was read is never written over.

    Parameters
    ----------
    command
        Its name; of a function of Python with "fp." before it.
    force
        Whether files of others are written over.
    """

    command: str
    force: bool = False

    def check(self, folder: str | Path, names: Iterable[str]) -> None:
        """Raise where `write` would, before the work that makes the files of these names (or contents by name).

        Raises
        ------
        InputError
            The folder cannot be written, or one of the files must not be written over.
        """
        self._check(Path(folder), names if isinstance(names, Mapping) else dict.fromkeys(names))

    def check_file(self, path: str | Path) -> None:
        """Raise where `write_file` would, as `check`; no other command writes that file until this one ends."""
        if (place := _place(path)) is not None:
            self.check(place.parent, (place.name,))
            self._claim(place.parent, f"{BUSY}-{hashlib.sha256(os.fsencode(place.name)).hexdigest()[:16]}", place)

    def claim(self, folder: str | Path, names: Iterable[str]) -> None:
        """As `check`; and no other command that claims the folder runs until this one ends.

        Raises
        ------
        InputError
            As `check`, and where another command is at it.
        """
        self.check(folder, names)
        self._claim(Path(folder), BUSY, Path(folder))

    def _claim(self, folder: Path, lock: str, what: Path) -> None:
        """Hold the lock of a folder until the command ends; a folder that is made for it goes again if it stays empty.

        The lock ends with its process. On a disk that knows no locks nothing is held.
        """
        if (claimed := _CLAIMED.get()) is None or (place := folder.resolve() / lock) in claimed[1]:
            return
        stack, places = claimed
        with suppress(OSError):
            made = make_folder(folder)
            if made is not None:
                stack.callback(_remove_empty, folder.absolute(), made.absolute())
            try:
                stack.enter_context(locked(place))
                places.add(place)
            except BlockingIOError:
                raise InputError("another fes-pin writes here now; expected another place", file=what) from None

    def write(self, folder: str | Path, contents: Mapping[str, str | bytes], without: Iterable[str] = ()) -> None:
        """Write files into a folder, all or none, and note there that this command wrote them.

        Parameters
        ----------
        without
            Files that go, where an earlier run of this command wrote them.

        Raises
        ------
        InputError
            As `check` and `write_files`.
        """
        folder = Path(folder)
        contents = self._signed(contents)
        with _alone(folder):
            record = self._check(folder, contents)
            gone = [n for n in without if self._wrote(folder, n, record) and not was_read(folder / n)]
            kept = {n: note for n, note in record.items() if n not in gone and os.path.lexists(folder / n)}
            kept |= {name: self._note(content) for name, content in contents.items()}
            write_files(folder, {RECORD: json.dumps(kept, indent=1) + "\n", **contents}, without=gone)

    def write_file(self, path: str | Path, content: str | bytes, endings: Sequence[str] = ()) -> None:
        """Write one file into a folder that is there, as `write`; to a special file, such as a pipe, without a note.

        Parameters
        ----------
        endings
            As of `check_ending`.
        """
        place = _place(path)
        check_ending(path, endings)
        if place is not None:
            self.write(place.parent, {place.name: content})
        else:
            write_bytes(path, as_bytes(content))

    def _check(self, folder: Path, contents: Mapping[str, str | bytes | None]) -> dict[str, str]:
        """The record of the folder, where all files may be written."""
        check_folder(folder)
        record = _record(folder)
        refuse_inputs(folder / name for name in contents)
        for name, content in contents.items():
            place = folder / name
            if name == RECORD or place.is_dir():
                found = "a folder" if place.is_dir() else "where fes-pin notes what it wrote"
                raise InputError(f"cannot be written: expected a file, found {found}", file=place)
            is_same = content is not None and place.is_file() and self._note(content) == self._note(place.read_bytes())
            if not os.path.lexists(place) or self.force or is_same or self._wrote(folder, name, record):
                continue
            by = record.get(name, "").rpartition(" ")[0]
            why = f"{_called(by)} wrote it" if by else f"no note is here that {_called(self.command)} wrote it"
            why = f"it was changed since {why}" if by == self.command else why
            allowed = "overwrite=True" if self.command.startswith("fp.") else "force=True"
            raise InputError(f"is there already, and {why}; expected another place, or {allowed}", file=place)
        return record

    def _wrote(self, folder: Path, name: str, record: Mapping[str, str]) -> bool:
        """True of a file that is as this command wrote it, or of a function of Python as any of them did."""
        if not (folder / name).is_file():
            return False
        by, _, known = record.get(name, "").rpartition(" ")
        is_own = by == self.command or (by.startswith("fp.") and self.command.startswith("fp."))
        return is_own and f"{self.command} {known}" == self._note((folder / name).read_bytes())

    def _signed(self, contents: Mapping[str, str | bytes]) -> dict[str, str | bytes]:
        """Contents of which each page ends with notes of itself and the others, in a comment."""
        signed = dict(contents)
        for name, text in contents.items():
            if name.endswith(HTML) and isinstance(text, str):
                notes = json.dumps({n: self._note(content) for n, content in contents.items()})
                notes = notes.replace("--", "-\\u002d")  # which would end the comment
                signed[name] = f"{text}{WRITTEN}{notes} -->\n"
        return signed

    def _note(self, content: str | bytes) -> str:
        """What the record says of a file with this content."""
        return f"{self.command} {hashlib.sha256(as_bytes(content)).hexdigest()}"


def check_ending(path: str | Path, endings: Sequence[str]) -> None:
    """Refuse a name that ends as a file of another kind than what is written; one without an ending may be a pipe.

    Parameters
    ----------
    endings
        Of what can be written: ".csv" ...; without any each may be.

    Raises
    ------
    InputError
        Another ending.
    """
    if endings and (found := Path(path).suffix) and found.lower() not in endings:
        raise InputError(f"expected a name that ends in {' or '.join(endings)}, found {found}", file=path)


def written_by(name: str, path: str | Path, content: str, endings: Sequence[str], overwrite: bool) -> None:
    """Write the file of a function of Python, as `Outputs.write_file`.

    Parameters
    ----------
    name
        Of the function.
    overwrite
        Whether a file is replaced that the function did not write, or that was changed since.

    Raises
    ------
    InputError
        As `Outputs.write_file`.
    """
    Outputs(f"fp.{name}", overwrite).write_file(as_path(path), content, endings)


@contextmanager
def claims_held() -> Iterator[None]:
    """What is claimed inside is held until its end."""
    with ExitStack() as stack, while_set(_CLAIMED, (stack, set[Path]())):
        yield


def _called(command: str) -> str:
    return command if command.startswith("fp.") else f"fes-pin {command}"


def _record(folder: Path) -> dict[str, str]:
    """By name of a file who wrote it and its SHA-256, as the folder says; else as its pages do."""
    found = own_json(folder / RECORD)
    for path in sorted(folder.glob("*.htm*")) if folder.is_dir() else ():
        if path.name not in found:
            found = {**_signature(path), **found}
    return {n: note for n, note in found.items() if isinstance(note, str)}


def _signature(path: Path) -> dict[str, str]:
    """The notes at the end of a page that nobody has changed; its own becomes that of the whole file."""
    whole = path.read_bytes() if path.is_file() else b""
    text, mark, end = whole.rpartition(WRITTEN.encode())
    notes: object = None
    with suppress(ValueError):
        notes = json.loads(end.removesuffix(b" -->\n")) if mark else None
    if not isinstance(notes, dict):
        return {}
    by, _, known = str(notes.get(path.name)).rpartition(" ")
    if known != hashlib.sha256(text).hexdigest():
        return {}
    return {**notes, path.name: f"{by} {hashlib.sha256(whole).hexdigest()}"}


def _remove_empty(folder: Path, made: Path) -> None:
    """Remove a folder that was made, with its parents up to the topmost that was, where they are empty."""
    with suppress(OSError):
        while folder.is_relative_to(made):
            folder.rmdir()
            folder = folder.parent


def _place(path: str | Path) -> Path | None:
    """Where a file is written, at the end of symbolic links; None for a special file."""
    path = Path(path)
    refuse_inputs([path])
    with suppress(OSError, RuntimeError):
        place = path.resolve() if path.is_symlink() else path
        if not place.exists() or place.is_file() or place.is_dir():
            if not place.parent.is_dir():
                raise InputError("cannot be written: the folder does not exist", file=path)
            return place
    return None


@contextmanager
def _alone(folder: Path) -> Iterator[None]:
    """Let no other command write into the folder meanwhile, on a disk that knows locks: its record is one file."""
    with ExitStack() as held:
        with suppress(OSError):
            handle = os.open(next(p for p in (folder, *folder.absolute().parents) if p.exists()), os.O_RDONLY)
            held.callback(os.close, handle)
            fcntl.flock(handle, fcntl.LOCK_EX)
        yield
