"""What a result was made of: when, by which versions, from which files, with which seed and command."""

import hashlib
import platform
import shlex
import sys
import tomllib
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from fes_pin.data.errors import InputError
from fes_pin.data.files import inside, read_bytes
from fes_pin.data.read_only import ReadOnly, as_dicts
from fes_pin.data.study import Study
from fes_pin.settings import source_date

PACKAGES = ("fes-pin", "pin", "casadi", "numpy", "scipy", "llvmlite")
"""Whose versions a result depends on."""


@dataclass(frozen=True)
class Provenance(ReadOnly):
    """Where a result comes from.

    Attributes
    ----------
    date
        When it was made, UTC, to the second (ISO 8601). `SOURCE_DATE_EPOCH` stands in for the clock where it is set.
    versions
        Of Python and the packages that it depends on.
    inputs
        SHA-256 of each file as it was when it was read, by its path in the study; "edited after it was read" for one
        whose trial or table was changed in memory; empty for a study that was made in memory.
    seed
        Of what is simulated.
    command
        The command line that made it; empty for a call from Python.
    """

    date: str
    versions: Mapping[str, str]
    inputs: Mapping[str, str]
    seed: int
    command: str = ""

    def record(self) -> dict[str, Any]:
        """As a dictionary for JSON."""
        return {name: value for name, value in as_dicts(vars(self)).items() if name != "command" or value}


def this_command() -> str:
    """The command line of this process, as it would be typed."""
    return shlex.join(["fes-pin", *sys.argv[1:]])


def provenance_now(study: Study, seed: int) -> Provenance:
    """Where what is made of a study now comes from."""
    return Provenance(today(), versions(), study.inputs(), seed)


def today() -> str:
    """The moment, UTC, to the second; that of `SOURCE_DATE_EPOCH` where it is set."""
    return (source_date() or datetime.now(UTC)).isoformat(timespec="seconds").replace("+00:00", "Z")


def versions() -> dict[str, str]:
    """Of Python and of the packages that a result depends on."""
    from importlib import metadata  # noqa: PLC0415 - reads the packages' own records, when they are asked for

    found = {"python": platform.python_version()}
    for name in PACKAGES:
        with suppress(metadata.PackageNotFoundError):
            found[name] = metadata.version(name)
    return found


def hashes(folder: Path) -> dict[str, str]:
    """SHA-256 of `study.toml` and of every file that it names."""
    try:
        tables = tomllib.loads(read_bytes(folder / "study.toml").decode("utf-8-sig"))
    except (InputError, ValueError):
        return {}
    out = {}
    for text in ("study.toml", *_texts(tables)):
        with suppress(ValueError, OSError, InputError):
            path = inside(folder, text)
            if path.is_file():
                out[text] = hashlib.sha256(read_bytes(path)).hexdigest()
    return out


def _texts(value: Any) -> Iterator[str]:
    if isinstance(value, str):
        yield value
    elif isinstance(value, dict | list):
        for one in value.values() if isinstance(value, dict) else value:
            yield from _texts(one)
