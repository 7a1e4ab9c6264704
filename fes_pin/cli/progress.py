"""Parts of several commands: the library that is asked for, whose code runs, a progress bar."""

from __future__ import annotations

import json
import math
import re
import shutil
import sys
import textwrap
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import typer

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


def print_text(text: str) -> None:
    """Print lines of words, broken between words where they are longer than the terminal is wide."""
    width = shutil.get_terminal_size().columns
    for line in text.splitlines():
        further = " " * (len(line) - len(line.lstrip()) + 4)
        kept = textwrap.wrap(line, width, subsequent_indent=further, break_long_words=False, break_on_hyphens=False)
        typer.echo("\n".join(kept))


def print_found(found: Any, as_json: bool) -> None:
    """Print what a command found: its `as_dict` as JSON, or its words, no wider than the terminal."""
    if as_json:
        typer.echo(json.dumps(found.as_dict(), indent=1))
    else:
        print_text(str(found))


PIECES = re.compile(r"\[[^\]]*\]|\S+")
"""What stays on one line of a cell: an interval, or a word."""
ASIDE = "equivalents"
"""Column that becomes a line below a table that is wider than the terminal."""


def print_result(found: Saveable, notes: Sequence[str] = ()) -> None:
    """Print a result as a table, and further notes: as wide as the terminal, in a pipe as `COLUMNS`, or 80, says.

    No cell is cut; names of causes and intervals stay whole.
    """
    from rich.console import Console
    from rich.text import Text

    title, head, rows, own = found.as_table()
    console = Console(width=shutil.get_terminal_size().columns, highlight=False)
    console.print(Text(title, style="bold"))
    if rows:
        table = _table(head, rows)
        if console.measure(table, options=console.options.update(max_width=10**4)).maximum > console.width:
            table = _narrow_table(head, rows)
            own = [*_aside(head, rows), *own]
        console.print(table)
    for note in (*own, *notes):
        console.print(Text(note))


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> Any:
    """Return a table for the terminal; no column is narrower than its longest piece."""
    from rich import box
    from rich.table import Column, Table
    from rich.text import Text

    longest = [max(len(p) for cell in column for p in PIECES.findall(cell)) for column in zip(head, *rows, strict=True)]
    columns = [Column(n, overflow="fold", no_wrap=not k, min_width=longest[k]) for k, n in enumerate(head)]
    table = Table(*columns, box=box.SIMPLE_HEAD, show_edge=False, pad_edge=False)
    for row in rows:
        table.add_row(*map(Text, row))
    return table


def _narrow_table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> Any:
    """Return a table with every interval on a line of its own, and without the equivalents."""
    kept = [k for k, name in enumerate(head) if name != ASIDE]
    return _table([head[k] for k in kept], [[row[k].replace(" [", "\n[") for k in kept] for row in rows])


def _aside(head: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """Return the equivalents of each cause that has some, in a line."""
    k = head.index(ASIDE) if ASIDE in head else None
    said = [f"{row[0]}: {row[k]}" for row in rows if k is not None and row[k] != "-"]
    return [f"{ASIDE} of {'; of '.join(said)}"] if said else []
