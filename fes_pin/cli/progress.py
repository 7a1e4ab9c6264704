"""Parts of several commands: the library that is asked for, whose code runs, a progress bar."""

from __future__ import annotations

import math
import shutil
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING

from fes_pin.cli.group import VOICE, remark

if TYPE_CHECKING:
    from fes_pin.data.results import Saveable
    from fes_pin.models.catalogue import Catalogue


def catalogue_with(library: list[str] | None) -> Catalogue:
    """Return the catalogue with the causes and rigs of `--library`."""
    from fes_pin.models.catalogue import load_library

    return load_library(*(library or []))


def say_whose_code(catalogue: Catalogue) -> None:
    """Print on standard error whose code runs in addition to that of fes-pin, a line for each file or module."""
    for where, names in catalogue.origins().items():
        remark(f"fes-pin: runs the code of {where}: {', '.join(names)}")


@contextmanager
def progress(every_s: float = math.inf) -> Iterator[Callable[[float, str], None]]:
    """A progress bar on standard error, if a person is watching; lines with --verbose, nothing with --quiet.

    Where nobody watches there is a line every so many seconds, and at the end, without --verbose as well.
    """
    if VOICE.get() < 0 or not sys.stderr.isatty():
        said = [time.monotonic()]

        def line(share: float, words: str) -> None:
            due = time.monotonic() - said[0] > every_s or (share == 1.0 and every_s < math.inf)
            if VOICE.get() > 0 or due:
                said[0] = time.monotonic()
                remark(f"fes-pin: {share:4.0%} {words}")

        yield line
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("reading", total=1.0)
        yield lambda share, words: bar.update(task, completed=share, description=words)


def print_result(found: Saveable, notes: Sequence[str] = ()) -> None:
    """Print a result as a table, and further notes: as wide as the terminal, in a pipe as `COLUMNS`, or 80, says.

    No cell is cut, and names of causes stay whole.
    """
    from rich import box
    from rich.console import Console
    from rich.table import Column, Table
    from rich.text import Text

    title, head, rows, own = found.as_table()
    console = Console(width=shutil.get_terminal_size().columns, highlight=False)
    console.print(Text(title, style="bold"))
    if rows:
        columns = [Column(name, overflow="fold", no_wrap=not k) for k, name in enumerate(head)]
        table = Table(*columns, box=box.SIMPLE_HEAD, show_edge=False, pad_edge=False)
        for row in rows:
            table.add_row(*map(Text, row))
        console.print(table)
    for note in (*own, *notes):
        console.print(Text(note))
