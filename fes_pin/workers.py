"""Two threads for independent fits (machine code and linear algebra release the interpreter lock), and their time."""

import math
import threading
import time
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager
from contextvars import ContextVar, copy_context
from typing import TypeVar

from numpy.linalg import LinAlgError
from threadpoolctl import OpenBLASController, threadpool_limits

from fes_pin.settings import threads, while_set

Progress = Callable[[float, str], None]
"""Report of a long search: the share that is done, and what is being done."""
In = TypeVar("In")
Out = TypeVar("Out")


class _Limit(AbstractContextManager[None]):
    """The limit on the threads of linear algebra, which is one for the whole process, while somebody needs it.

    Any thread may be the first user or the last. Newer releases of threadpoolctl let one thread alone set OpenBLAS's
    pool, and pass over in silence what others ask for: each change here begins with a new claim to it.
    """

    def __init__(self) -> None:
        self._lock, self._users = threading.Lock(), 0
        self._limits: threadpool_limits | None = None

    def __enter__(self) -> None:
        """Linear algebra on one thread from the first user on."""
        with self._lock:
            if self._users == 0:
                _claim_pool()
                self._limits = threadpool_limits(1)
            self._users += 1

    def __exit__(self, *_: object) -> None:
        """As it was before the first user, after the last."""
        with self._lock:
            self._users -= 1
            if self._users == 0 and self._limits is not None:
                _claim_pool()
                self._limits.restore_original_limits()
                _claim_pool()


def _claim_pool() -> None:
    """Let the next thread that sets OpenBLAS's pool do so, whichever it is."""
    if hasattr(OpenBLASController, "clear_controlling_thread"):
        OpenBLASController.clear_controlling_thread(force=True)


_LIMIT = _Limit()


def one_thread_each() -> AbstractContextManager[None]:
    """Linear algebra on one thread: the fits are what runs in parallel, and sums keep their order.

    Where several threads ask for it, it holds until the last has ended.
    """
    return _LIMIT


_IS_ONE_OF_MANY: ContextVar[bool] = ContextVar("is_one_of_many", default=False)


def in_parallel(function: Callable[[In], Out], items: Iterable[In]) -> list[Out]:
    """`function` of each item, in their order; the result does not depend on the number of threads.

    Work that is itself one of several parallel tasks runs in its own thread alone.
    """
    work = list(items)
    if threads() == 1 or len(work) < 2 or _IS_ONE_OF_MANY.get():
        return [function(item) for item in work]

    def in_one_thread(item: In) -> Out:
        _IS_ONE_OF_MANY.set(True)
        return function(item)

    contexts = [copy_context() for _ in work]  # the limit of time holds in every thread
    with ThreadPoolExecutor(threads()) as pool:
        return list(pool.map(lambda context, item: context.run(in_one_thread, item), contexts, work))


_STOPS: ContextVar[list[float] | None] = ContextVar("stops", default=None)


class OutOfTime(Exception):
    """Raised by work that was begun within a limit of time, once that has passed.

    The innermost `noting_stops` notes it.
    """

    def __init__(self) -> None:
        super().__init__("a limit of time has passed")
        if (stops := _STOPS.get()) is not None:
            stops.append(time.monotonic())


def noting_stops() -> AbstractContextManager[list[float]]:
    """The times at which a limit of time ended work that is done within, in a list that grows; empty where none did."""
    return while_set(_STOPS, list[float]())


_END: ContextVar[float] = ContextVar("end", default=math.inf)


def time_limit(seconds: float) -> AbstractContextManager[float]:
    """Let what calls `check_time` go on for so long; infinity for as long as it takes."""
    return while_set(_END, time.monotonic() + seconds)


def seconds_left() -> float:
    """Until the end of the innermost `time_limit`; infinity without one."""
    return _END.get() - time.monotonic()


def check_limit() -> None:
    """End the work here if its time is over.

    Raises
    ------
    OutOfTime
        Past the end of the innermost `time_limit`.
    """
    if time.monotonic() > _END.get():
        raise OutOfTime


def attempted(ask: Callable[[], Out], otherwise: Out, seconds: float | None = None) -> Out:
    """Return what is asked; `otherwise` where time is over, or where it meets numbers that cannot be calculated with.

    Parameters
    ----------
    seconds
        Limit of time; by default that of the innermost `time_limit`.
    """
    try:
        with time_limit(seconds_left() if seconds is None else seconds):
            return ask()
    except (ArithmeticError, LinAlgError, OutOfTime):
        return otherwise
