"""Two threads for independent fits: machine code and linear algebra release the interpreter lock."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from typing import TypeVar

from threadpoolctl import threadpool_limits

from fes_pin.settings import threads

In = TypeVar("In")
Out = TypeVar("Out")


@contextmanager
def one_thread_each() -> Iterator[None]:
    """Linear algebra on one thread: the fits are what runs in parallel, and sums keep their order."""
    with threadpool_limits(1):
        yield


def in_parallel(function: Callable[[In], Out], items: Iterable[In]) -> list[Out]:
    """`function` of each item, in their order; the result does not depend on the number of threads."""
    work = list(items)
    if threads() == 1 or len(work) < 2:
        return [function(item) for item in work]
    with ThreadPoolExecutor(threads()) as pool:
        return list(pool.map(function, work))
