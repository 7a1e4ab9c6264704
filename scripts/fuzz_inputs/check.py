"""One call of the command line in a process of its own, and whether it kept the rules.

Exit code 0, or 2 with one line on standard error and nothing on standard output; no traceback, no end by a signal,
within its time, and nothing written outside the folder or file that it was given, whatever is spoilt.
"""

from __future__ import annotations

import contextlib
import functools
import importlib
import io
import os
import resource
import signal
import sys
import tempfile
import time
import traceback
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from fes_pin.data.outputs import RECORD

SECONDS = 30
"""Of processor time that one call may take that fits models."""
READING_SECONDS = 10
"""Of processor time that one call may take that only reads."""
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

    def faults(self, written: bool) -> list[str]:
        """Rules that were broken; `written` says whether the call left anything behind."""
        found = [f"wrote outside: {s}" for s in self.strays]
        if self.code in {-signal.SIGXCPU, -signal.SIGKILL}:
            return [*found, "did not end in time"]
        if self.code not in (0, 2):
            return [*found, f"exit code {self.code}: {self.err.strip().splitlines()[-1:]}"]
        if "Traceback" in self.err:
            found.append("a traceback")
        if self.code == 2:
            if len(self.err.strip().splitlines()) != 1:
                found.append(f"{len(self.err.strip().splitlines())} lines on standard error")
            if self.out.strip():
                found.append("something on standard output before an error")
            if written:
                found.append("something written before an error")
        return found


def call(arguments: Sequence[str], allowed: Sequence[Path], scratch: Path, seconds: int = SECONDS) -> Answer:
    """Run `fes-pin` with these arguments in a fork of this process.

    Parameters
    ----------
    allowed
        Where it may write.
    scratch
        Where its output is kept; also its folder for what is temporary.
    """
    out, err, strays = (scratch / n for n in ("stdout", "stderr", "strays"))
    for path in (out, err, strays):
        path.write_bytes(b"")
    began = time.monotonic()
    child = os.fork()
    if child == 0:
        resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
        _run(arguments, [p.resolve() for p in allowed], scratch, out, err, strays)
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
    used = time.monotonic() - began
    read = [p.read_text(encoding="utf-8", errors="replace") for p in (out, err, strays)]
    return Answer(code, read[0], read[1], used, tuple(read[2].splitlines()))


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


def _run(arguments: Sequence[str], allowed: Sequence[Path], scratch: Path, out: Path, err: Path, strays: Path) -> None:
    """What the fork does; it never returns."""
    code = SPARE
    try:
        for number, path in ((1, out), (2, err)):
            os.dup2(os.open(path, os.O_WRONLY), number)
        told = os.open(strays, os.O_WRONLY)
        sys.stdout, sys.stderr = open(1, "w", closefd=False), open(2, "w", closefd=False)  # noqa: SIM115
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        tempfile.tempdir = str(scratch)
        _watch([*allowed, scratch.resolve()], told)
        sys.argv = ["fes-pin", *arguments]
        from fes_pin.cli.main import main  # noqa: PLC0415

        main()
        code = 0
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else 0 if end.code is None else 1
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


def _watch(allowed: Sequence[Path], told: int) -> None:
    """Note every file that Python opens to write, makes, moves or removes elsewhere."""

    def hook(event: str, arguments: tuple) -> None:
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
        if str(where) != os.devnull and not any(_is_for(where, a) for a in allowed):
            os.write(told, f"{event} {where}\n".encode(errors="replace"))

    sys.addaudithook(hook)


def _is_for(path: Path, allowed: Path) -> bool:
    """True for what may be written: the path itself, what is in it, what is moved there once it is whole, its note."""
    partial = any(p.parent == allowed.parent and p.name.startswith(PARTIAL) for p in (path, *path.parents))
    return path in (allowed, allowed.parent / RECORD) or allowed in path.parents or partial
