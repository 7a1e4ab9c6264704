"""Studies in processes of this machine. A process that dies takes no other study with it."""

import multiprocessing
import os
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, ThreadPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from functools import partial
from itertools import islice
from queue import SimpleQueue

from fes_pin.cohort.one import Answer, Work

STUDIES_EACH = 25
"""Studies that a process diagnoses before a new one takes its place: a bound on what it may have gathered."""
DIED = "the process that diagnosed it died: out of memory, or killed"
DEATHS = ("BrokenProcessPool", "KilledWorker", "NoneType")
"""Errors of a study whose process died, or whose workers died more often than a scheduler allows."""

Task = tuple[Work, str]


def as_they_come(tasks: Iterable[Task], begin: Callable[[Task], Future[Answer]], at_once: int) -> Iterator[Answer]:
    """Yield answers as they come; at most `at_once` studies are under way, and no more answers are held.

    A study whose process died is an answer as well.
    """
    left = iter(tasks)
    under_way = {begin(task): task for task in islice(left, at_once)}
    while under_way:
        for future in wait(under_way, return_when=FIRST_COMPLETED).done:
            yield _answer(future, *under_way.pop(future))
            under_way |= {begin(task): task for task in islice(left, 1)}


def _answer(future: Future[Answer], work: Work, key: str) -> Answer:
    problem = None if (lost := future.cancelled()) else future.exception()
    if problem is None and not lost:
        return future.result()
    words = DIED if type(problem).__name__ in DEATHS else f"{type(problem).__name__}: {problem}"
    return Answer(work.name, key, {}, " ".join(words.split())[:500], again=True)


def in_processes(tasks: Iterable[Task], workers: int, run: Callable[[Work, str], Answer]) -> Iterator[Answer]:
    """Yield answers as they come.

    Each process is a pool of its own, so that one that dies takes its study alone with it.
    """
    idle = SimpleQueue[ProcessPoolExecutor]()
    for _ in range(workers):
        idle.put(_process())

    def answer(task: Task) -> Answer:
        process = idle.get()
        try:
            return process.submit(run, *task).result()
        except BrokenProcessPool:
            process = _process()
            raise
        finally:
            idle.put(process)

    threads = ThreadPoolExecutor(workers)
    try:
        yield from as_they_come(tasks, lambda task: threads.submit(answer, task), workers)
    finally:
        threads.shutdown(wait=False, cancel_futures=True)
        while not idle.empty():
            idle.get().shutdown(wait=False)


def _process() -> ProcessPoolExecutor:
    """A process, which begins with its first study."""
    spawn, begin = multiprocessing.get_context("spawn"), partial(_end_with, os.getpid())
    return ProcessPoolExecutor(1, mp_context=spawn, initializer=begin, max_tasks_per_child=STUDIES_EACH)


def _end_with(parent: int) -> None:
    """End this process when its parent has died: nobody is left to take its answer."""

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(1.0)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
