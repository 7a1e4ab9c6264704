"""Studies in processes of this machine. A process that dies takes no other study with it."""

from __future__ import annotations

import multiprocessing
import os
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from functools import partial

from fes_pin.cohort.one import Answer, Work, diagnose_one

STUDIES_EACH = 25
"""Studies that a process diagnoses before a new one takes its place: a bound on what it may have gathered."""
DIED = "the process that diagnosed it died: out of memory, or killed"

Task = tuple[Work, str]


def in_processes(
    tasks: Iterable[Task], workers: int, run: Callable[[Work, str], Answer] = diagnose_one
) -> Iterator[Answer]:
    """Answers as they come; no more studies than processes are under way, and no more answers are held.

    Where a process dies, the studies under way are diagnosed again one by one, so that the one that killed it is known.
    """
    waiting, suspects = deque(tasks), deque[Task]()
    while waiting:
        yield from _until_one_dies(waiting, suspects, workers, run)
        while suspects:
            task = suspects.popleft()
            alone, again = deque([task]), deque[Task]()
            yield from _until_one_dies(alone, again, 1, run)
            if again:
                yield Answer(task[0].name, task[1], {}, DIED, again=True)


def _until_one_dies(
    waiting: deque[Task], suspects: deque[Task], workers: int, run: Callable[[Work, str], Answer]
) -> Iterator[Answer]:
    """Answers until all are there or a process has died; then those under way are suspects."""
    spawn = multiprocessing.get_context("spawn")
    begin = partial(_end_with, os.getpid())
    pool = ProcessPoolExecutor(workers, mp_context=spawn, initializer=begin, max_tasks_per_child=STUDIES_EACH)
    under_way: dict[Future[Answer], Task] = {}
    try:
        while waiting or under_way:
            while waiting and len(under_way) < workers:
                task = waiting.popleft()
                try:
                    under_way[pool.submit(run, *task)] = task
                except BrokenProcessPool:
                    waiting.appendleft(task)
                    suspects.extend(under_way.values())
                    return
            done, _ = wait(under_way, return_when=FIRST_COMPLETED)
            for future in [f for f in done if f.exception() is None]:
                del under_way[future]
                yield future.result()
            if len(under_way) > 0 and any(isinstance(f.exception(), BrokenProcessPool) for f in done):
                suspects.extend(under_way.values())
                return
    finally:
        pool.shutdown(wait=False, cancel_futures=True)


def _end_with(parent: int) -> None:
    """End this process when its parent has died: nobody is left to take its answer."""

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(1.0)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
