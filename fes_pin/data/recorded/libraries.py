"""Libraries of extras that read recordings, and tables of what they read."""

import pickle
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from fes_pin.data.errors import InputError, optional_library
from fes_pin.data.table import Table

_CHILD = """
import importlib, os, pickle, sys, warnings
out = os.fdopen(os.dup(1), "wb")
os.dup2(2, 1)
module, function, path = sys.argv[1:]
try:
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        content = getattr(importlib.import_module(module), function)(path)
    found = pickle.dumps((content, len(said)))
except Exception as error:
    found = pickle.dumps(str(error) or type(error).__name__)
out.write(found)
"""
"""What the own process of a library runs; what the library prints is kept out of what is returned."""


def library(module: str, extra: str, path: Path) -> Any:
    """The module of an extra; an input error where it is not installed."""
    needed = f"{path.suffix} files need {module.split('.', maxsplit=1)[0]}"
    return optional_library(module, extra, needed, file=path)


@contextmanager
def reading(path: Path, kind: str) -> Iterator[None]:
    """What a library cannot read is an input error."""
    try:
        yield
    except Exception as error:
        raise InputError(f"cannot be read as {kind}: {' '.join(str(error).split())[:120]}", file=path) from None


def read_apart(module: str, function: str, path: Path) -> tuple[Any, int]:
    """Return what a function of a library reads of a file, and the number of its warnings, from a process of its own.

    A damaged file ends the process in which a library of compiled code reads it.

    Raises
    ------
    ValueError
        The library cannot read the file.
    """
    command = [sys.executable, "-P", "-c", _CHILD, module, function, str(path)]
    done = subprocess.run(command, capture_output=True, check=False)
    if done.returncode:
        raise ValueError("it is damaged")
    found = pickle.loads(done.stdout)
    if isinstance(found, str):
        raise ValueError(found)
    content, warned = found
    return content, warned


def made(path: Path, columns: Mapping[str, np.ndarray], wanted: Sequence[str] | None, **more: Any) -> Table:
    """A recording of columns, of which only those that are wanted must be of one length; others are no part of it."""
    chosen = columns if wanted is None else {n: v for n, v in columns.items() if n in wanted}
    count = max((len(v) for v in chosen.values()), default=0)
    names = tuple(n for n, v in columns.items() if n in chosen or len(v) == count)
    return Table(path, names, chosen, np.arange(1, count + 1), **more)
