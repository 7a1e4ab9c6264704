"""What all commands share: bad input is one line on standard error and exit code 2, with nothing printed before."""

from __future__ import annotations

import io
import os
import sys
from contextlib import redirect_stdout
from typing import Any, TextIO

import typer
from typer.core import TyperGroup

from fes_pin.data.errors import InputError

USAGE_ERROR: Any = next(kind for kind in typer.BadParameter.__mro__ if kind.__name__ == "ClickException")
"""What typer raises for a command line that it cannot read; it exports only classes below this one."""


class Held(io.StringIO):
    """Standard output kept back until the command has come to its end, or releases it."""

    def __init__(self, stream: TextIO) -> None:
        super().__init__()
        self.stream, self.is_released = stream, False

    def write(self, text: str, /) -> int:
        return self.stream.write(text) if self.is_released else super().write(text)

    def flush(self) -> None:
        if self.is_released:
            self.stream.flush()

    def isatty(self) -> bool:
        return self.stream.isatty()

    def release(self) -> None:
        """Print what was kept back, and from now on everything at once.

        Raises
        ------
        InputError
            Standard output takes no more: the disk behind it is full.
        """
        kept, self.is_released = "" if self.is_released else self.getvalue(), True
        try:
            self.write(kept)
            self.flush()
        except BrokenPipeError:
            raise
        except OSError as error:
            raise InputError(f"standard output cannot be written: {error.strerror}") from None


def release_output() -> None:
    """Print at once what the command has said so far, and what follows: for a command that waits for a person."""
    if isinstance(sys.stdout, Held):
        sys.stdout.release()


class Commands(TyperGroup):
    """A group of commands of which each ends with its output, or with one line and exit code 2."""

    def main(self, args: Any = None, *, standalone_mode: bool = True, **given: Any) -> Any:  # type: ignore[override]
        """Run the command line, as typer's own; it ends by SystemExit unless `standalone_mode` is False."""
        if not standalone_mode:
            return super().main(args, standalone_mode=False, **given)
        with redirect_stdout(Held(sys.stdout)) as held:
            code = self._run(held, args, given)
        raise SystemExit(code)

    def _run(self, held: Held, args: Any, given: dict[str, Any]) -> int:
        try:
            code = super().main(args, standalone_mode=False, **given)
            held.release()
            return code if isinstance(code, int) else 0
        except InputError as error:
            return _refuse(f"fes-pin: {error}")
        except USAGE_ERROR as error:
            return _refuse(_in_one_line(error))
        except typer.Abort:
            return 1
        except BrokenPipeError:  # what reads has gone; no second error when the interpreter closes the stream
            os.dup2(os.open(os.devnull, os.O_WRONLY), held.stream.fileno())
            return 1
        except BaseException:
            held.release()
            raise


def _refuse(line: str) -> int:
    typer.echo(line, err=True)
    return 2


def _in_one_line(error: Any) -> str:
    """Which command, what is wrong with its words, and where more is said."""
    context: Any = getattr(error, "ctx", None)
    command = "fes-pin" if context is None else context.command_path
    words = " ".join(error.format_message().split()).rstrip(".")
    if words.lower() == "missing command":
        words += f"; expected one of {', '.join(context.command.list_commands(context))}"
    return f"{command}: {words[:1].lower() + words[1:]} ({command} --help says more)"
