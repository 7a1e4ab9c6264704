"""Runs studies side by side; each answer is one line of a store, so that a run that was broken off goes on."""

from __future__ import annotations

import hashlib
import json
import sys
import tempfile
import time
from collections.abc import Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import ExitStack
from dataclasses import asdict
from pathlib import Path

import fes_pin as fp
from fes_pin.data.sources import code_hash
from harness import regression as regressions
from harness.generator import Item, Truth, generator_of
from harness.row import Row, judged

TRUTH = "truth.json"


def rows_of(file: Path | None, code: str | None) -> dict[str, Row]:
    """Rows of a store by key, the last of each; none of a file that is not there.

    Parameters
    ----------
    code
        Hash of the code that made them; None for any.
    """
    if file is None or not file.exists():
        return {}
    lines = file.read_text(encoding="utf-8").splitlines()
    rows = [Row.of(json.loads(line)) for line in lines]
    return {row.key: row for row in rows if code in (None, row.code)}


def run(
    name: str, items: Sequence[Item], store: Path | None, studies: Path | None, workers: int, regression: bool = False
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
    regression
        The answers are those of `harness.regression` instead of the package's.
    """
    done = rows_of(store, _code(regression))
    todo = [item for item in items if item.key not in done]
    began = time.monotonic()
    for count, row in enumerate(_answers(name, todo, studies, workers, regression), 1):
        done[row.key] = row
        if store:
            store.parent.mkdir(parents=True, exist_ok=True)
            with store.open("a", encoding="utf-8") as file:
                file.write(json.dumps(asdict(row)) + "\n")
        if sys.stderr.isatty():
            left = (time.monotonic() - began) / count * (len(todo) - count) / 60.0
            print(f"\r{name}: {count} of {len(todo)}, {left:.1f} min left  ", end="", file=sys.stderr, flush=True)
    return [done[item.key] for item in items]


def _code(regression: bool) -> str:
    """Hash of the code that answers."""
    if not regression:
        return code_hash()
    return hashlib.sha256(Path(regressions.__file__).read_bytes()).hexdigest()


def _answers(name: str, todo: Sequence[Item], studies: Path | None, workers: int, regression: bool) -> Iterable[Row]:
    if workers < 2:
        yield from (answered(name, item, studies, regression) for item in todo)
        return
    with ProcessPoolExecutor(workers) as pool:
        for one in as_completed([pool.submit(answered, name, item, studies, regression) for item in todo]):
            yield one.result()


def answered(name: str, item: Item, studies: Path | None = None, regression: bool = False) -> Row:
    """Make a study, or read it where it was made before, ask for its answer, and judge that."""
    generator = generator_of(name)
    with ExitStack() as stack:
        scratch = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="accuracy")))
        folder = studies / name / item.key if studies else scratch / "study"
        if not (folder / TRUTH).exists():
            (scratch / "made").mkdir()
            study, truth = generator.make(item, scratch / "made")
            fp.write_study(study, folder)
            (folder / TRUTH).write_text(json.dumps(asdict(truth)), encoding="utf-8")
        truth = Truth(**json.loads((folder / TRUTH).read_text(encoding="utf-8")))
        known = {"study": _hashed(folder), "code": _code(regression)}
        study = fp.read_study(folder)
        began = time.process_time()
        try:
            found = regressions.regressed(study) if regression else generator.ask(study)
        except Exception as error:
            said = f"{type(error).__name__}: {error}"
            return Row(item.key, item.hidden, truth.part or item.part, item.outside, error=said, **known)
        seconds = time.process_time() - began
    return judged(item, truth, json.loads(found.to_json()), cpu_s=round(seconds, 2), **known)


def _hashed(folder: Path) -> str:
    digest = hashlib.sha256()
    for path in sorted(p for p in folder.rglob("*") if p.is_file()):
        digest.update(path.relative_to(folder).as_posix().encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()[:16]
