"""Runs studies side by side; each answer is one line of a store, so that a run that was broken off goes on."""

from __future__ import annotations

import hashlib
import json
import signal
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import ExitStack, contextmanager
from dataclasses import asdict
from functools import partial
from importlib import import_module, util
from pathlib import Path
from typing import Any

import numpy as np

import fes_pin as fp
from fes_pin.data.sources import code_hash
from harness import never_worse
from harness.generator import Generator, Item, Truth
from harness.generators import generator_of
from harness.row import Row, judged
from harness.table import is_worse

TRUTH = "truth.json"
REGRESSION, TEN_LINES, EFFORT = "regression", "ten lines", "effort"
ESTIMATORS = {
    REGRESSION: ("harness.regression", "regressed"),
    TEN_LINES: ("harness.ten_lines", "solved"),
    EFFORT: ("harness.effort_alone", "search_effort"),
}
"""What answers instead of a diagnosis: the module that holds it, which is imported where it answers, and its name."""
GRACE = 3.0
"""An answer that has not come after so many times its limit, and as many tens of seconds, is an error."""


def rows_of(file: Path | None, code: str | None) -> dict[str, Row]:
    """Rows of a store by key, the last of each; none of a file that is not there.

    Parameters
    ----------
    code
        Hash of the code that made them; None for any.
    """
    rows = [Row.of(line) for line in lines_of_store(file)]
    return {row.key: row for row in rows if code in (None, row.code)}


def lines_of_store(file: Path | None) -> list[dict[str, Any]]:
    """The lines of a store, read; none of a file that is not there."""
    if file is None or not file.exists():
        return []
    return [json.loads(line) for line in file.read_text(encoding="utf-8").splitlines()]


def run(
    name: str,
    items: Sequence[Item],
    store: Path | None,
    studies: Path | None,
    workers: int,
    by: str = "",
    limit: float | None = None,
    withholds: bool = False,
) -> list[Row]:
    """Answers to the studies of a generator, in their order; those that the store has of this code are not made again.

    Parameters
    ----------
    name
        Of the generator.
    store
        File of one line an answer; nothing is stored without.
    studies
        Folder where the studies are kept, and taken from where they are there; by default none is kept.
    by
        One of `ESTIMATORS`, which answers instead of the package.
    limit
        Seconds that the search of an answer may take.
    withholds
        See `answered`.
    """
    done = rows_of(store, code_of(by, limit))
    todo = [item for item in items if item.key not in done]
    began = time.monotonic()
    one = partial(answered, name, studies=studies, by=by, limit=limit, withholds=withholds)
    for count, row in enumerate(each_of(one, todo, workers), 1):
        done[row.key] = row
        if store:
            store.parent.mkdir(parents=True, exist_ok=True)
            with store.open("a", encoding="utf-8") as file:
                file.write(json.dumps(asdict(row)) + "\n")
        if sys.stderr.isatty():
            left = (time.monotonic() - began) / count * (len(todo) - count) / 60.0
            print(f"\r{name}: {count} of {len(todo)}, {left:.1f} min left  ", end="", file=sys.stderr, flush=True)
    return [done[item.key] for item in items]


def code_of(by: str, limit: float | None) -> str:
    """Hash of the code that answers, with the limit of time that it had."""
    if by in (REGRESSION, TEN_LINES):
        found = util.find_spec(ESTIMATORS[by][0])
        return hashlib.sha256(Path(str(found and found.origin)).read_bytes()).hexdigest()
    return code_hash() if limit is None or by else f"{code_hash()} {limit:g} s"


def estimator_of(by: str) -> Callable[[fp.Study], Any]:
    """What answers instead of a diagnosis."""
    module, name = ESTIMATORS[by]
    answers: Callable[[fp.Study], Any] = getattr(import_module(module), name)
    return answers


def each_of(ask: Callable[[Any], Any], items: Sequence[Any], workers: int) -> Iterable[Any]:
    """What a function makes of each, as they come, in so many processes."""
    if workers < 2:
        yield from map(ask, items)
        return
    with ProcessPoolExecutor(workers) as pool:
        for one in as_completed([pool.submit(ask, item) for item in items]):
            yield one.result()


@contextmanager
def ended_after(limit: float | None) -> Iterator[None]:
    """Raise `TimeoutError` where work does not end by itself; see `GRACE`. Nothing is limited without a limit."""
    if limit is None:
        yield
        return
    seconds = GRACE * (limit + 10.0)

    def end(*_: Any) -> None:
        raise TimeoutError(f"no answer after {seconds:g} s")

    before = signal.signal(signal.SIGALRM, end)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def answered(
    name: str,
    item: Item,
    studies: Path | None = None,
    by: str = "",
    limit: float | None = None,
    withholds: bool = False,
) -> Row:
    """Make a study, or read it where it was made before, ask for its answer, and judge that.

    Parameters
    ----------
    withholds
        Withhold trials from the answer, and compare the errors of its model on them with those of others.
    """
    generator = generator_of(name)
    with ExitStack() as stack:
        scratch = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="accuracy")))
        folder = studies / name / item.key if studies else scratch / "study"
        if not (folder / TRUTH).exists():
            made(generator, item, folder)
        truth = Truth(**json.loads((folder / TRUTH).read_text(encoding="utf-8")))
        known = {"study": _hashed(folder), "code": code_of(by, limit)}
        study, unseen = never_worse.withheld(fp.read_study(folder)) if withholds else (fp.read_study(folder), ())
        began = time.process_time()
        try:
            with ended_after(limit):
                found = estimator_of(by)(study) if by else generator.ask(study, **limited(limit))
        except Exception as error:
            said = f"{type(error).__name__}: {error}"
            return Row(item.key, item.hidden, truth.part or item.part, item.outside, error=said, **known)
        seconds = time.process_time() - began
        known["unseen"] = unseen_percent(found, truth)
        if withholds:
            known["against"] = never_worse.errors_against(study, found, unseen)
            if is_worse(known["against"]) and not item.outside:
                known["true"] = never_worse.errors_of_truth(study, item.hidden, truth.parameters, unseen)
    return judged(item, truth, json.loads(found.to_json()), cpu_s=round(seconds, 2), **known)


def made(generator: Generator, item: Item, folder: Path, **more: Any) -> None:
    """Make a study, and write it and what is true of it into a folder; `more` is what its generator makes it with."""
    with tempfile.TemporaryDirectory(prefix="accuracy") as scratch:
        study, truth = generator.make(item, Path(scratch), **more)
        fp.write_study(study, folder)
        (folder / TRUTH).write_text(json.dumps(asdict(truth)), encoding="utf-8")


def limited(limit: float | None) -> dict[str, float]:
    """The option of an answer that may take so long."""
    return {} if limit is None else {"limit": limit}


def unseen_percent(found: Any, truth: Truth) -> float | None:
    """E of an answer's model on the trial that nobody was shown, percent; infinite where it predicts no number."""
    if not (one := truth.unseen) or not (hasattr(found, "model") or hasattr(found, "predicted")):
        return None
    columns = {n: np.array(v) for n, v in one["columns"].items()}
    measured = columns[one["output"]]
    trial = fp.Trial("unseen", one["kind"], columns, np.arange(len(measured)) * one["dt"], one["conditions"])
    try:
        own = hasattr(found, "predicted")
        predicted = found.predicted(trial) if own else fp.predict(found.model, trial)[one["output"]]
    except (ValueError, ArithmeticError):
        return float("inf")
    squares = np.sum((measured - predicted) ** 2) / np.sum((measured - measured.mean()) ** 2)
    return float(100.0 * squares) if np.isfinite(squares) else float("inf")


def _hashed(folder: Path) -> str:
    digest = hashlib.sha256()
    for path in sorted(p for p in folder.rglob("*") if p.is_file()):
        digest.update(path.relative_to(folder).as_posix().encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()[:16]
