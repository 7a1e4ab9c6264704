"""What environment variables choose; each is read where it is needed, and all of them before a command begins."""

import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from datetime import UTC, datetime
from typing import Any, TypeVar

from fes_pin.data.errors import InputError

Value = TypeVar("Value")
ENGINES = ("llvm", "casadi")
PROCESSORS = ("native", "generic")


def engine() -> str:
    """What models run on: `FES_PIN_ENGINE`, "llvm" for machine code (default) or "casadi" for its virtual machine.

    Raises
    ------
    InputError
        Another name.
    """
    return _one_of("FES_PIN_ENGINE", ENGINES)


def processor() -> str:
    """What machine code is made for: `FES_PIN_CPU`, "native" for this processor (default) or "generic".

    Generic code uses what every processor of the architecture has: on x86-64 neither fused multiply-add nor AVX. It is
    slower, and rounds alike on all of them.

    Raises
    ------
    InputError
        Another name.
    """
    return _one_of("FES_PIN_CPU", PROCESSORS)


def target() -> tuple[str, str]:
    """Name and features of the processor that machine code is made for, in LLVM's words; see `processor`."""
    if processor() == "generic":
        return "generic", ""
    import llvmlite.binding as llvm  # noqa: PLC0415 - only where machine code is made

    return llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten()


def threads() -> int:
    """How many threads to use: `FES_PIN_THREADS`, else one a core, at most 8.

    Raises
    ------
    InputError
        Not a whole number of at least 1.
    """
    chosen = os.environ.get("FES_PIN_THREADS", "").strip()
    if not chosen:
        return max(1, min(8, os.cpu_count() or 1))
    if not re.fullmatch("0*[1-9][0-9]{0,3}", chosen):
        raise InputError(f"expected a whole number from 1 to 9999, found {chosen[:40]!r}", column="FES_PIN_THREADS")
    return int(chosen)


def source_date() -> datetime | None:
    """The moment that replaces the clock: `SOURCE_DATE_EPOCH`, seconds since 1970, UTC; None where it is not set.

    Raises
    ------
    InputError
        Not a whole number of seconds of at most eleven digits (the year 5138).
    """
    chosen = os.environ.get("SOURCE_DATE_EPOCH", "")
    if not re.fullmatch("[0-9]{0,11}", chosen):
        raise InputError(f"expected whole seconds since 1970, found {chosen[:40]!r}", column="SOURCE_DATE_EPOCH")
    return datetime.fromtimestamp(int(chosen), UTC) if chosen else None


def check_settings() -> None:
    """Read every setting, so that a wrong one is said before any work.

    Raises
    ------
    InputError
        As the functions of this module.
    """
    engine()
    processor()
    threads()
    source_date()


@contextmanager
def while_set(variable: ContextVar[Any], value: Value) -> Iterator[Value]:
    """A context variable has the value, which is given, for what is done within."""
    token = variable.set(value)
    try:
        yield value
    finally:
        variable.reset(token)


def _one_of(variable: str, known: tuple[str, ...]) -> str:
    """The value of a variable; the first of those it may have where it is not set."""
    chosen = os.environ.get(variable) or known[0]
    if chosen not in known:
        raise InputError(f"expected {' or '.join(known)}, found {chosen[:40]!r}", column=variable)
    return chosen
