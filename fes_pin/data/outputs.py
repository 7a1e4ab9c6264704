"""What a command writes: never over what was read, and only over what the same command wrote and nobody has changed."""

import fcntl
import hashlib
import json
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from fes_pin.data.as_read import refuse_inputs, was_read
from fes_pin.data.errors import InputError
from fes_pin.data.files import as_bytes, check_folder, own_json, write_bytes, write_files

RECORD = ".fes_pin.json"
"""In each folder that a command writes into: by name of a file which command wrote it, and its SHA-256."""


@dataclass(frozen=True)
class Outputs:
    """The writer of one command.

    A file that is there already is written over where `RECORD` in its folder says that the same command wrote it, and
    its content is still the same; any other one only with `force`. A file that was read is never written over.

    Parameters
    ----------
    command
        Its name.
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
        """Raise where `write_file` would, as `check`."""
        if (place := _place(path)) is not None:
            self.check(place.parent, (place.name,))

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
        record = {n: note for n, note in own_json(folder / RECORD).items() if isinstance(note, str)}
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
            why = f"fes-pin {by} wrote it" if by else f"fes-pin {self.command} did not write it"
            why = f"it was changed since {why}" if by == self.command else why
            expected = "expected another place, or force=True to write over it"
            raise InputError(f"is there already, and {why}; {expected}", file=place)
        return record

    def _wrote(self, folder: Path, name: str, record: Mapping[str, str]) -> bool:
        """True of a file that is as this command wrote it."""
        return (folder / name).is_file() and record.get(name) == self._note((folder / name).read_bytes())

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
