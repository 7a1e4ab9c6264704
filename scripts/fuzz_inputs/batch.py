"""Many cases in one process: a case then takes what its call takes, and no fork of a large process."""

from __future__ import annotations

import multiprocessing
import os
import signal
import time
import traceback
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from multiprocessing.connection import Connection
from pathlib import Path

from fuzz_inputs.cases import Result
from fuzz_inputs.check import PATIENCE, Answer, Ask, Streams, call, call_here

MOST = 1000
"""Cases of one process: what it keeps in memory ends with it."""
Run = Callable[[int, Ask], Result]


def in_batches(numbers: Sequence[int], run: Run) -> Iterator[Result]:
    """Run cases in forks of this process, up to `MOST` in each.

    Parameters
    ----------
    run
        One case by its number, by what calls the command line.

    Yields
    ------
    Result
        Of each case. One that broke a rule is run again in a fork of its own, and its faults say so: one that such a
        fork does not have depends on the calls before it.
    """
    left = list(numbers)
    while left:
        receiver, sender = multiprocessing.Pipe(duplex=False)
        child = os.fork()
        if child == 0:
            _work(left[:MOST], run, sender)
        sender.close()
        done = 0
        try:
            while receiver.poll(PATIENCE):
                result = receiver.recv()
                done += 1
                yield _again(result, run, left[done - 1]) if result.faults else result
            os.kill(child, signal.SIGKILL)
        except EOFError:
            pass
        code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        left = left[done:]
        if code != 0:
            yield _again(None, run, left.pop(0), code)


def _again(first: Result | None, run: Run, number: int, code: int = 0) -> Result:
    alone = run(number, call)
    if first is None:
        return replace(alone, faults=[f"ended its process, exit code {code}", *alone.faults])
    of_batch = [f"{fault} (not in a process of its own)" for fault in first.faults if fault not in alone.faults]
    return replace(alone, faults=[*alone.faults, *of_batch])


def _work(numbers: Sequence[int], run: Run, sender: Connection) -> None:
    """What a fork does; it never returns."""
    streams = Streams()

    def ask(arguments: Sequence[str], allowed: Sequence[Path], scratch: Path, seconds: int) -> Answer:
        began = time.monotonic()
        code = call_here(arguments, allowed, scratch, streams, seconds)
        return streams.answer(code, time.monotonic() - began)

    code = 1
    try:
        for number in numbers:
            sender.send(run(number, ask))
        sender.close()
        code = 0
    except BaseException:
        streams.give_back()
        traceback.print_exc()
    finally:
        os._exit(code)
