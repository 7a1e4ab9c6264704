"""Studies on a Dask cluster that is there already; its workers must see the studies under the same paths.

A worker that is lost has its studies diagnosed elsewhere by the scheduler; answers are written here alone.
"""

import re
import socket
import uuid
from collections.abc import Callable, Iterable, Iterator
from itertools import islice
from typing import Any

from fes_pin.cohort.local import DIED, Task
from fes_pin.cohort.one import Answer, Work
from fes_pin.data.errors import InputError
from fes_pin.data.libraries import optional_library

AHEAD = 2
"""Studies that wait at each worker: what bounds the answers that are held."""
PATIENCE_S = "20s"


def on_cluster(tasks: Iterable[Task], address: str, run: Callable[[Work, str], Answer]) -> Iterator[Answer]:
    """Answers as they come.

    Raises
    ------
    InputError
        What is given is no address, dask.distributed is not installed, or no scheduler answers at the address.
    """
    host = re.fullmatch(r"(?:(?:tcp|tls)://)?\[?([^\s/]+?)\]?:\d{1,5}|(?!tcp:|tls:)\w+://\S+", address)
    if host is None:
        raise InputError(
            f"expected the address of a Dask scheduler, as tcp://host:8786, found {address!r}", column="scheduler"
        )
    distributed = optional_library("distributed", "cohort", "a cluster needs dask.distributed")
    try:
        if host[1]:
            socket.getaddrinfo(host[1], None)  # a name that is none is said at once
        client = distributed.Client(address, timeout=PATIENCE_S, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as problem:
        raise InputError(f"no Dask scheduler answers at {address}: {type(problem).__name__}") from None
    session, left = uuid.uuid4().hex[:8], iter(tasks)

    def submitted(task: Task) -> Any:
        future = client.submit(run, *task, key=f"fes-pin-{session}-{task[0].name}", pure=False)
        known[str(future.key)] = task
        return future

    known: dict[str, Task] = {}
    with client:
        slots = max(1, sum(client.nthreads().values())) + AHEAD
        coming = distributed.as_completed([submitted(task) for task in islice(left, slots)], loop=client.loop)
        for future in coming:
            work, key = known.pop(future.key)
            yield _answer(future, work, key)
            future.release()
            for task in islice(left, 1):
                coming.add(submitted(task))


def _answer(future: Any, work: Work, key: str) -> Answer:
    """A result; a study whose workers died, more often than the scheduler allows, is an answer as well."""
    if future.status == "finished":
        found = future.result()
        assert isinstance(found, Answer)
        return found
    problem = future.exception() if future.status == "error" else None
    words = DIED if type(problem).__name__ in ("KilledWorker", "NoneType") else f"{type(problem).__name__}: {problem}"
    return Answer(work.name, key, {}, " ".join(words.split())[:500], again=True)
