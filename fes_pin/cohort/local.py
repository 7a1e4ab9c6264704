"""Studies in processes of this machine. A process that dies takes no other study with it."""

import multiprocessing
import os
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, ThreadPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from functools import partial
from itertools import islice
from queue import SimpleQueue

from fes_pin.cohort.one import Answer, Work

STUDIES_EACH = 25
"""Studies that a process diagnoses before a new one takes its place: a bound on what it may have gathered."""
DIED = "the process that diagnosed it died: out of memory, or killed"

Task = tuple[Work, str]


def in_processes(tasks: Iterable[Task], workers: int, run: Callable[[Work, str], Answer]) -> Iterator[Answer]:
    """Answers as they come; no more studies than processes are under way, and no more answers are held.

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
            return Answer(task[0].name, task[1], {}, DIED, again=True)
        finally:
            idle.put(process)

    threads, left = ThreadPoolExecutor(workers), iter(tasks)
    under_way = {threads.submit(answer, task) for task in islice(left, workers)}
    try:
        while under_way:
            done, under_way = wait(under_way, return_when=FIRST_COMPLETED)
            under_way |= {threads.submit(answer, task) for task in islice(left, len(done))}
            yield from (future.result() for future in done)
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
