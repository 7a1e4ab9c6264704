"""Studies in processes of this machine, or on a Dask cluster that is there already.

A process that dies takes no other study with it. The workers of a cluster must see the studies under the same paths; a
worker that is lost has its studies diagnosed elsewhere by the scheduler. Answers are written here alone.
"""

import multiprocessing
import os
import re
import socket
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, ThreadPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from functools import partial
from itertools import islice
from queue import SimpleQueue

from fes_pin.cohort.one import Answer, Work
from fes_pin.data.errors import InputError, optional_library

STUDIES_EACH = 25
"""Studies that a process diagnoses before a new one takes its place: a bound on what it may have gathered."""
DIED = "the process that diagnosed it died: out of memory, or killed"
DEATHS = ("BrokenProcessPool", "KilledWorker", "NoneType")
"""Errors of a study whose process died, or whose workers died more often than a scheduler allows."""
AHEAD = 2
"""Studies that wait at each worker: what bounds the answers that are held."""
PATIENCE_S = "20s"

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


def on_cluster(tasks: Iterable[Task], address: str, run: Callable[[Work, str], Answer]) -> Iterator[Answer]:
    """Answers as they come.

    Raises
    ------
    InputError
        What is given is no address, dask.distributed is not installed, or no scheduler answers at the address.
    """
    host = re.fullmatch(r"(?:(?:tcp|tls)://)?\[?([^\s/]+?)\]?:\d{1,5}|(?!tcp:|tls:)\w+://\S+", address)
    if host is None:
        message = f"expected the address of a Dask scheduler, as tcp://host:8786, found {address!r}"
        raise InputError(message, column="scheduler")
    distributed = optional_library("distributed", "cohort", "a cluster needs dask.distributed")
    try:
        if host[1]:
            socket.getaddrinfo(host[1], None)  # a name that is none is said at once
        client = distributed.Client(address, timeout=PATIENCE_S, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as problem:
        raise InputError(f"no Dask scheduler answers at {address}: {type(problem).__name__}") from None
    with client:
        workers, at_once = client.get_executor(pure=False), max(1, sum(client.nthreads().values())) + AHEAD
        yield from as_they_come(tasks, lambda task: workers.submit(run, *task), at_once)
