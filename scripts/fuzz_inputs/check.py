"""One call of the command line in a process of its own, and whether it kept the rules.

Exit code 0, or 2 with one line on standard error and nothing on standard output; no traceback, no end by a signal,
within its time, and nothing written outside the folder or file that it was given, whatever is spoilt.
"""

from __future__ import annotations

import contextlib
import functools
import importlib
import io
import math
import os
import re
import resource
import signal
import sys
import tempfile
import time
import traceback
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from fes_pin.data.outputs import RECORD

SECONDS = 30
"""Of processor time that one call may take that fits models."""
READING_SECONDS = 10
"""Of processor time that one call may take that only reads."""
MEMORY = 12 << 30
"""Bytes of addresses that a process may have."""
PATIENCE = 600.0
"""Seconds that a call may take where the machine is shared."""
WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND
CHANGES = {"os.mkdir", "os.rename", "os.remove", "os.rmdir", "os.symlink", "os.link", "os.chmod", "os.truncate"}
MOVES = {"os.rename", "os.symlink", "os.link"}
REMOVALS = {"os.remove", "os.rmdir"}
NO_FOLDER = -1
"""Replaces the descriptor of the folder that a removed path is relative to, where none was given."""
PARTIAL = ".fes_pin-"
"""What is not whole yet has a name that begins so, beside its destination."""
IMPORTED = ("scipy.signal", "fes_pin.data.new_study", "fes_pin.data.new_body_study", "fes_pin.diagnosis.testable")
"""What commands import once they are asked."""
WARNING = re.compile(r"\b\w*Warning: ")
SPARE = 97
"""Exit code for an exception that the command let through."""


@dataclass(frozen=True)
class Answer:
    """What a call did."""

    code: int
    out: str
    err: str
    seconds: float
    strays: tuple[str, ...]

    def faults(self, written: bool, given: Sequence[str] = ()) -> list[str]:
        """Rules that were broken; `written` says whether the call left anything behind, `given` what it was asked."""
        found = [f"wrote outside: {s}" for s in self.strays]
        if self.code in {-signal.SIGXCPU, -signal.SIGKILL}:
            return [*found, "did not end in time"]
        if self.code not in (0, 2):
            return [*found, f"exit code {self.code}: {self.err.strip().splitlines()[-1:]}"]
        if "Traceback" in self.err:
            found.append("a traceback")
        if WARNING.search(self.err):
            found.append("a warning of Python")
        if self.code == 2:
            if given and not _has_place(self.err, given):
                found.append(f"an error that names no file and no option: {self.err.strip()}")
            if len(self.err.strip().splitlines()) != 1:
                found.append(f"{len(self.err.strip().splitlines())} lines on standard error")
            if self.out.strip():
                found.append("something on standard output before an error")
            if written:
                found.append("something written before an error")
        return found


Ask = Callable[[Sequence[str], Sequence[Path], Path, int], Answer]
"""What calls the command line: see `call`."""


def _has_place(line: str, given: Sequence[str]) -> bool:
    """True for an error that names a file or folder that was given or lies in one, an option, or is one of usage."""
    return any(Path(word).name in line for word in given if "/" in word) or "--" in line or "[/" in line


def call(arguments: Sequence[str], allowed: Sequence[Path], scratch: Path, seconds: int = SECONDS) -> Answer:
    """Run `fes-pin` with these arguments in a fork of this process.

    Parameters
    ----------
    allowed
        Where it may write.
    scratch
        Its folder for what is temporary.
    """
    streams = Streams()
    began = time.monotonic()
    child = os.fork()
    if child == 0:
        os._exit(call_here(arguments, allowed, scratch, streams, seconds))
    code = None
    while code is None:
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            code = os.waitstatus_to_exitcode(status)
        elif time.monotonic() - began > PATIENCE:
            os.kill(child, signal.SIGKILL)
            _, status = os.waitpid(child, 0)
            code = -signal.SIGKILL
        else:
            time.sleep(0.003)
    try:
        return streams.answer(code, time.monotonic() - began)
    finally:
        streams.close()


def warm_up(folder: Path) -> None:
    """Ask once in this process, of a study that is not there: a fork then has what a call imports and is made of."""
    import typer.main  # noqa: PLC0415

    from fes_pin.cli.main import main  # noqa: PLC0415

    for name in IMPORTED:
        importlib.import_module(name)
    typer.main.get_command = functools.cache(typer.main.get_command)  # type: ignore[assignment]
    sys.argv = ["fes-pin", "check", str(folder / "missing")]
    with contextlib.redirect_stderr(io.StringIO()), contextlib.suppress(SystemExit):
        main()


def call_here(
    arguments: Sequence[str], allowed: Sequence[Path], scratch: Path, streams: Streams, seconds: int = SECONDS
) -> int:
    """Run `fes-pin` in this process, which is not to be used for anything else afterwards but for further calls.

    A call that takes more than its processor time ends the process by SIGXCPU.

    Returns
    -------
    int
        Its exit code; `SPARE` of one that let an exception through, which is printed.
    """
    _watch(streams.strays)
    code = SPARE
    streams.take()
    try:
        _limit(seconds)
        tempfile.tempdir = str(scratch)
        sys.argv = ["fes-pin", *arguments]
        from fes_pin.cli.main import main  # noqa: PLC0415

        _ALLOWED[:] = [*(p.resolve() for p in allowed), scratch.resolve()]
        with warnings.catch_warnings():  # each call shows its own, as a new process would
            main()
        code = 0
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else 0 if end.code is None else 1
    except BaseException:
        traceback.print_exc()
    finally:
        _ALLOWED.clear()
        sys.stdout.flush()
        sys.stderr.flush()
    return code


class Streams:
    """Standard output and error of calls, and what they wrote elsewhere, in files that have no name."""

    def __init__(self) -> None:
        self.out, self.err, self.strays = (os.memfd_create(n) for n in ("out", "err", "strays"))
        self.own = os.dup(2)

    def take(self) -> None:
        """Let this process write into them, from their beginnings."""
        sys.stdout.flush()
        sys.stderr.flush()
        for number in (self.out, self.err, self.strays):
            os.ftruncate(number, 0)
            os.lseek(number, 0, os.SEEK_SET)
        os.dup2(self.out, 1)
        os.dup2(self.err, 2)
        sys.stdout, sys.stderr = open(1, "w", closefd=False), open(2, "w", closefd=False)  # noqa: SIM115

    def give_back(self) -> None:
        """Let this process print errors where it did before."""
        os.dup2(self.own, 2)
        sys.stderr = open(2, "w", closefd=False)  # noqa: SIM115

    def answer(self, code: int, seconds: float) -> Answer:
        """What a call did that ended with a code."""
        files = (self.out, self.err, self.strays)
        out, err, strays = (os.pread(n, os.fstat(n).st_size, 0).decode("utf-8", "replace") for n in files)
        return Answer(code, out, err, seconds, tuple(strays.splitlines()))

    def close(self) -> None:
        """Give them back."""
        for number in (self.out, self.err, self.strays, self.own):
            os.close(number)


def _limit(seconds: int) -> None:
    """Set the processor time and memory that this process may still take, and let it leave no core."""
    used = resource.getrusage(resource.RUSAGE_SELF)
    _, most = resource.getrlimit(resource.RLIMIT_CPU)
    resource.setrlimit(resource.RLIMIT_CPU, (math.ceil(used.ru_utime + used.ru_stime) + seconds, most))
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


_ALLOWED: list[Path] = []
"""Where the call that runs may write; empty between calls."""


@functools.cache
def _watch(told: int) -> None:
    """Note every file that a call opens to write, makes, moves or removes elsewhere."""

    def hook(event: str, arguments: tuple) -> None:
        if not _ALLOWED:
            return
        if (
            event == "open" and isinstance(arguments[0], str | bytes) and (arguments[2] or 0) & WRITING
        ) or event in CHANGES:
            path = arguments[1] if event in MOVES else arguments[0]
        else:
            return
        if event in REMOVALS and arguments[1] != NO_FOLDER:
            path = os.path.join(os.readlink(f"/proc/self/fd/{arguments[1]}"), os.fsdecode(path))
        if isinstance(path, int) or (event == "os.mkdir" and os.path.isdir(path)):  # a folder that is there stays
            return
        where = Path(os.path.realpath(os.fsdecode(path)))
        if str(where) != os.devnull and not any(_is_for(where, a) for a in _ALLOWED):
            os.write(told, f"{event} {where}\n".encode(errors="replace"))

    sys.addaudithook(hook)


def _is_for(path: Path, allowed: Path) -> bool:
    """True for what may be written: the path itself, what is in it, what is moved there once it is whole, its note."""
    partial = any(p.parent == allowed.parent and p.name.startswith(PARTIAL) for p in (path, *path.parents))
    return path in (allowed, allowed.parent / RECORD) or allowed in path.parents or partial
