"""Parts of all commands: help, needs of options, and bad input as one line on standard error and exit code 2."""

import io
import math
import os
import re
import sys
import warnings
from collections.abc import Callable, Mapping
from contextlib import redirect_stdout
from contextvars import ContextVar
from functools import wraps
from inspect import Parameter, Signature, signature
from typing import Annotated, Any, TextIO, TypeVar

import typer
from typer.core import TyperCommand, TyperGroup

from fes_pin.data.as_read import one_command
from fes_pin.data.errors import InputError
from fes_pin.data.outputs import claims_held
from fes_pin.settings import while_set

USAGE_ERROR: Any = next(kind for kind in typer.BadParameter.__mro__ if kind.__name__ == "ClickException")
"""Error of typer for a command line that it cannot read; it exports only subclasses of this one."""

VOICE: ContextVar[int] = ContextVar("VOICE", default=0)
"""Level of messages in addition to the answer: -1 with --quiet, 1 with --verbose."""
F = TypeVar("F", bound=Callable[..., Any])


def needs(**rules: str) -> Callable[[F], F]:
    """A decorator that says when options of a command have a meaning: where they have none they are input errors.

    Parameters
    ----------
    rules
        By parameter the parameters of which one must be given as well ("rate width"), or none after "not".
    """

    return _noting("rules", rules)


def python_names(**words: str) -> Callable[[F], F]:
    """Say which words of a command line give what errors name as an argument of Python: `horizon_s="--horizon"`."""

    return _noting("words", words)


def _noting(what: str, notes: dict[str, str]) -> Callable[[F], F]:
    def noted(command: F) -> F:
        command.__dict__.setdefault(what, {}).update(notes)
        return command

    return noted


def remark(text: str) -> None:
    """Say something besides the answer, on standard error; nothing with --quiet."""
    if VOICE.get() >= 0:
        complain(text)


def complain(text: str) -> None:
    """Say what is wrong, on standard error; `typer.echo` would take UTF-8 for the encoding of an ASCII console."""
    print(text, file=sys.stderr, flush=True)


class Held(io.StringIO):
    """Standard output kept back until the command has come to its end, or releases it."""

    def __init__(self, stream: TextIO) -> None:
        super().__init__()
        self.stream, self.is_released, self.is_silent = stream, False, False

    def write(self, text: str, /) -> int:
        if self.is_silent:
            return len(text)
        return self.stream.write(text) if self.is_released else super().write(text)

    @property
    def encoding(self) -> str:  # type: ignore[override]
        """That of the stream, by which tables are drawn in signs that it has."""
        return self.stream.encoding

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


class Command(TyperCommand):
    """A command whose help is printed as it was written."""

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Print the help: what stands in brackets is no markup."""
        from rich.markup import escape

        one: Any
        for one in (self, *self.params):
            one.help = escape(getattr(one, "help", None) or "")
        super().format_help(ctx, formatter)


class App(typer.Typer):
    """A group of commands that have -h, -q and -v, reject options that they would ignore, and name them in errors."""

    def __init__(self, **given: Any) -> None:
        super().__init__(cls=Commands, context_settings={"help_option_names": ["-h", "--help"]}, **given)

    def command(self, name: str | None = None, **given: Any) -> Any:
        """Add a function as a command, as typer's own."""
        register = super().command(name, **{"cls": Command, **given})

        def add(command: F) -> F:
            register(_run_by_group(command))
            return command

        return add


def _shared(
    ctx: typer.Context,
    quiet: Annotated[
        bool, typer.Option("--quiet", "-q", help="No progress, no remarks; with --out only errors.")
    ] = False,
    verbose: Annotated[
        bool, typer.Option("--verbose", "-v", help="Progress as lines where no bar is watched.")
    ] = False,
) -> None:
    """The parameters of every command."""


def _run_by_group(command: Callable[..., Any]) -> Callable[..., Any]:
    """The command with what all commands share before and after it."""

    @wraps(command)
    def run(ctx: typer.Context, quiet: bool, verbose: bool, **given: Any) -> Any:
        words = {one.name: _word(one) for one in ctx.command.params if one.name is not None}
        if quiet and verbose:
            raise InputError("does not go with --verbose", column="--quiet")
        for name, value in given.items():
            for one in value if isinstance(value, tuple | list) else (value,):
                if isinstance(one, float) and not math.isfinite(one):
                    raise InputError(f"expected a finite number, found {one:g}", column=words[name])
        _check_needs(ctx, words, getattr(command, "rules", {}))
        if quiet and str(given.get("out") or "-") != "-" and isinstance(sys.stdout, Held):
            sys.stdout.is_silent = True
        try:
            with while_set(VOICE, verbose - quiet):
                return command(**given)
        except InputError as error:
            raise _in_options(error, words, getattr(command, "words", {})) from error

    each = [p for one in (command, _shared) for p in signature(one, eval_str=True).parameters.values()]
    parameters = [p.replace(kind=Parameter.KEYWORD_ONLY) for p in each]
    vars(run)["__signature__"] = Signature(parameters)
    run.__annotations__ = {p.name: p.annotation for p in parameters}
    return run


def _check_needs(ctx: typer.Context, words: Mapping[str, str], rules: Mapping[str, str]) -> None:
    """Refuse options that another one, or its absence, leaves no meaning."""
    said = [name for name in words if getattr(ctx.get_parameter_source(name), "name", "DEFAULT") != "DEFAULT"]
    given = {name for name in said if ctx.params.get(name) not in (None, (), [])}
    for name, rule in rules.items():
        others = rule.removeprefix("not ").split()
        there = [n for n in others if n in given]
        if name in given and bool(there) == rule.startswith("not "):
            options = " or ".join(words[n] for n in there or others)
            raise InputError(f"{'does not go' if there else 'goes only'} with {options}", column=words[name])


def _word(one: Any) -> str:
    """Return the name of a parameter on the command line: its option, or an argument in capitals."""
    return max(one.opts, key=len) if one.param_type_name == "option" else one.name.upper()


def _in_options(error: InputError, own: Mapping[str, str], renamed: Mapping[str, str]) -> InputError:
    """An error with options of the command line in place of arguments of Python."""
    column, message = error.column, error.message.replace("force=True", "--force")
    if error.file is None and column is not None:
        column = renamed.get(column, own.get(column, column))
    if renamed:
        message = re.sub(rf"\b({'|'.join(map(re.escape, renamed))})\b", lambda found: renamed[found[0]], message)
    return InputError(message, file=error.file, row=error.row, column=column)


class Commands(TyperGroup):
    """A group of commands of which each ends with its output, or with one line and exit code 2."""

    def main(self, args: Any = None, *, standalone_mode: bool = True, **given: Any) -> Any:  # type: ignore[override]
        """Run the command line, as typer's own; it ends by SystemExit unless `standalone_mode` is False."""
        if not standalone_mode:
            return super().main(args, standalone_mode=False, **given)
        _make_streams_whole()
        with warnings.catch_warnings(), one_command(), claims_held(), redirect_stdout(Held(sys.stdout)) as held:
            # a line of code that overflowed tells a person nothing: what is not finite is judged where it is used;
            # -W, and filters that are set, come first
            warnings.filterwarnings("ignore", category=RuntimeWarning, append=True)
            code = self._run(held, args, given)
        raise SystemExit(code)

    def _run(self, held: Held, args: Any, given: dict[str, Any]) -> int:
        is_done = False
        try:
            code = super().main(args, standalone_mode=False, **given)
            is_done = True
            held.release()
            return code if isinstance(code, int) else 0
        except InputError as error:
            code = _refuse(f"fes-pin: {error}")
            return _give_up(held.stream) if is_done else code
        except USAGE_ERROR as error:
            return _refuse(_in_one_line(error))
        except typer.Abort:
            return 1
        except BrokenPipeError:  # what reads has gone
            return _give_up(held.stream)
        except BaseException:
            held.release()
            raise


def _give_up(stream: TextIO) -> int:
    """Print no more, and no second error when the interpreter closes the stream; files may be written already."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
    return 1


def name_files_in_utf8() -> None:
    """Start again where Python takes names of files for ASCII (LC_ALL=C PYTHONUTF8=0), as a study names them in UTF-8.

    What is printed is in the encoding that the streams had.
    """
    if sys.getfilesystemencoding() in ("ascii", "us-ascii"):
        console = getattr(sys.stdout or sys.stderr, "encoding", None) or "ascii"
        known = {**os.environ, "PYTHONIOENCODING": os.environ.get("PYTHONIOENCODING") or console}
        os.execve(sys.executable, [sys.executable, "-X", "utf8", *sys.orig_argv[1:]], known)


def _make_streams_whole() -> None:
    """Let what is printed to a closed stream go nowhere, and signs that a stream lacks become escapes, as `\\u65e5`."""
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        stream = getattr(sys, name)
        if stream is None:
            setattr(sys, name, open(os.devnull, mode, encoding="utf-8"))  # noqa: SIM115 - for good
        elif hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")


def _refuse(line: str) -> int:
    complain(line)
    return 2


def _in_one_line(error: Any) -> str:
    """Which command, what is wrong with its words, and where more is said."""
    context: Any = getattr(error, "ctx", None)
    command = "fes-pin" if context is None else context.command_path
    words = " ".join(error.format_message().split()).rstrip(".")
    if words.lower() == "missing command":
        words += f"; expected one of {', '.join(context.command.list_commands(context))}"
    return f"{command}: {words[:1].lower() + words[1:]} ({command} --help says more)"
