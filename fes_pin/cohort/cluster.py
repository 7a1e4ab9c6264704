"""Studies on a Dask cluster that is there already; its workers must see the studies under the same paths.

A worker that is lost has its studies diagnosed elsewhere by the scheduler; answers are written here alone.
"""

import re
import socket
from collections.abc import Callable, Iterable, Iterator

from fes_pin.cohort.local import Task, as_they_come
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
    with client:
        workers, at_once = client.get_executor(pure=False), max(1, sum(client.nthreads().values())) + AHEAD
        yield from as_they_come(tasks, lambda task: workers.submit(run, *task), at_once)
