"""Libraries of extras that read recordings, and tables of what they read."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from fes_pin.data.errors import InputError, optional_library
from fes_pin.data.table import Table


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


def made(path: Path, columns: Mapping[str, np.ndarray], wanted: Sequence[str] | None, **more: Any) -> Table:
    """A recording of columns, of which only those that are wanted must be of one length; others are no part of it."""
    chosen = columns if wanted is None else {n: v for n, v in columns.items() if n in wanted}
    count = max((len(v) for v in chosen.values()), default=0)
    names = tuple(n for n, v in columns.items() if n in chosen or len(v) == count)
    return Table(path, names, chosen, np.arange(1, count + 1), **more)
