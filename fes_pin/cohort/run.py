"""A cohort from its studies, each with a name in it, to its tables and its page.

A run that was killed goes on where it was.
"""

import time
from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fes_pin.cohort.one import STATE, Answer, Store, Work, diagnose_one
from fes_pin.cohort.processes import Task, in_processes, on_cluster
from fes_pin.cohort.tables import ERRORS, Row, advice_of, cohort_html, named_in, tables_of, title_of
from fes_pin.data.errors import InputError
from fes_pin.data.outputs import Outputs
from fes_pin.data.results import Saveable
from fes_pin.data.table import SUFFIXES, table_bytes
from fes_pin.infer.result import shown
from fes_pin.models.catalogue import load_library
from fes_pin.verdict.ask import OF_ALL, OF_WALKS
from fes_pin.workers import Progress

STUDY = "study.toml"


def find_studies(places: Sequence[Path]) -> dict[str, Path]:
    """Every study that is named or lies beneath a folder that is named, by its name in the cohort, in order of names.

    A study is called by its folder, and where two folders have one name by as many of the folders above as tell them
    apart: `anna-knee`, `ben-knee`.

    Raises
    ------
    InputError
        A place that is not there, or holds no study.
    """
    found: dict[Path, None] = {}
    for place in places:
        folder = place.parent if place.name == STUDY else place
        if not folder.is_dir():
            raise InputError("no such folder; expected a study, or a folder that holds studies", file=place)
        own = [folder] if (folder / STUDY).exists() else sorted(p.parent for p in folder.rglob(STUDY))
        if not own:
            raise InputError(f"expected a study, or a folder that holds studies; no {STUDY} in it", file=place)
        found.update(dict.fromkeys(p.resolve() for p in own))
    return dict(sorted(_named(list(found)).items()))


def _named(folders: Sequence[Path]) -> dict[str, Path]:
    parts = [tuple(p for p in f.parts if p not in ("/", "\\")) for f in folders]
    count = Counter(own[-d:] for own in parts for d in range(1, len(own) + 1))
    ends = [next((own[-d:] for d in range(1, len(own)) if count[own[-d:]] == 1), own) for own in parts]
    names = ["-".join(end) or "study" for end in ends]
    many = Counter(names)
    return {_unique(n, k, many): f for k, (n, f) in enumerate(zip(names, folders, strict=True))}


def _unique(name: str, number: int, count: Counter[str]) -> str:
    safe = "".join(c if c.isalnum() or c in "-_.+" else "_" for c in name).lstrip(".")
    return safe if safe and count[name] == 1 else f"{safe}-{number + 1}"


@dataclass(frozen=True, eq=False, repr=False)
class Cohort(Saveable):
    """Results of the studies; each table is a sequence of rows, by the columns of its CSV file."""

    studies: Sequence[Row]
    causes: Sequence[Row]
    pooled: Sequence[Row]
    prevalence: Sequence[Row]

    @property
    def failed(self) -> list[Row]:
        """Studies that could not be diagnosed."""
        return [r for r in self.studies if r["verdict"] == "failed"]

    def record(self) -> dict[str, Any]:
        """The tables as lists of rows, numbers as printed; None for what is not known."""
        return {
            n: [{k: shown(v) if isinstance(v, float) else v for k, v in r.items() if k != "wall_s"} for r in rows]
            for n, rows in vars(self).items()
        }

    def columns(self) -> dict[str, list[Any]]:
        """The table of `to_frame`, by columns: `studies`."""
        return {n: [r[n] for r in self.studies] for n in HEADS["studies"]}

    def as_table(self) -> tuple[str, Sequence[str], Sequence[Sequence[str]], Sequence[str]]:
        """Title, head, rows and notes of the table that is printed."""
        good = len(self.studies) - len(self.failed)
        rows = [(r["cause"], named_in(r, good), f"{r['share_percent']:.0f} %") for r in self.prevalence]
        notes = [f"failed: {r['study']}: {r['error']}" for r in self.failed]
        return (
            repr(self),
            ("cause", "studies", "share"),
            rows,
            [*notes, f"next: {advice_of(self.studies, self.causes)}"],
        )

    def __repr__(self) -> str:
        return title_of(self.studies)


def run_cohort(
    places: Sequence[Path],
    out: Path,
    *,
    workers: int = 1,
    scheduler: str | None = None,
    seed: int = 0,
    limit: float | None = None,
    library: Sequence[str] = (),
    command: str = "",
    progress: Progress | None = None,
    run: Callable[[Work, str], Answer] = diagnose_one,
    force: bool = False,
) -> Cohort:
    """Diagnose every study that is not diagnosed yet, and write what all of them say together.

    Parameters
    ----------
    places
        Studies, or folders that hold studies.
    out
        Folder for the answers and tables.
    workers
        Processes on this machine.
    scheduler
        Address of a Dask scheduler, whose workers are used instead.
    seed, limit, library
        As `diagnose` takes them.
    command
        The command line that this is run by, for reports and page; "" for a call from Python.
    progress
        Called after each study with the share that is done and a few words; studies of an earlier run are done.
    run
        What diagnoses one study.
    force
        Write over files in `out` that no cohort wrote, or that were changed since.

    Raises
    ------
    InputError
        A place without a study, a folder that cannot be written, a scheduler that does not answer, or not one study
        that could be diagnosed: nothing is written then.
    """
    found = find_studies(places)
    library = tuple(library)
    catalogue = load_library(*library)  # what cannot be read is said before any work
    outputs = Outputs("cohort", force)
    store = Store(out, outputs)
    every = [Work(n, str(f), seed, limit, library, command) for n, f in found.items()]
    todo: list[Task] = [(work, key) for work in every if not store.has(work, key := work.key())]
    outputs.claim(out, ("cohort.html", *(name + suffix for name in HEADS for suffix in SUFFIXES)))
    for work, _ in todo:
        outputs.check(store.place(work.name), (*OF_ALL, *OF_WALKS, STATE))
    tell, began = progress or (lambda _share, _words: None), time.monotonic()
    waiting: list[Answer] = []  # failures, until there is a study that did not fail: else nothing is written
    undone = {work.name for work, _ in todo}
    errors = {name: store.get(name).error for name in found if name not in undone}
    before = len(errors)
    on_it = scheduler if todo else None
    for answer in in_processes(todo, workers, run) if on_it is None else on_cluster(todo, on_it, run):
        waiting.append(answer)
        errors[answer.name] = answer.error
        while waiting and not all(errors.values()):
            store.put(waiting.pop(0))
        done, total = len(errors), len(every)
        left = _left((time.monotonic() - began) / (done - before) * (total - done))
        tell(done / total, f"{done} of {total}, {sum(map(bool, errors.values()))} failed, {left}, {answer.name}")
    if all(errors.values()):
        raise InputError(f"none of {len(found)} studies could be diagnosed; the first: {min(errors.items())[1]}")

    made = Cohort(**tables_of(map(store.get, found), len(catalogue.effects)))  # one is held at a time
    outputs.write(out, _files(made, seed, command))
    return made


IN_MINUTES_S, IN_HOURS_S = 90.0, 5400.0
"""Time left from which on it is printed in minutes, and in hours."""


def _left(seconds: float) -> str:
    """Time left in words."""
    if seconds < IN_MINUTES_S:
        return f"{seconds:.0f} s left"
    return f"{seconds / 60.0:.0f} min left" if seconds < IN_HOURS_S else f"{seconds / 3600.0:.1f} h left"


def _files(made: Cohort, seed: int, command: str) -> dict[str, str | bytes]:
    out: dict[str, str | bytes] = {}
    for name, head in HEADS.items():
        columns = {n: [r[n] for r in getattr(made, name)] for n in head}
        for suffix in SUFFIXES:
            with suppress(InputError):  # Parquet where it can be written
                out[name + suffix] = table_bytes(columns, name + suffix)
    out["cohort.html"] = cohort_html(vars(made), seed, command)
    return out


HEADS = {
    "studies": (
        *(
            "study",
            "verdict",
            "causes",
            "not_testable",
            "unexplained",
            *ERRORS,
            "horizon_s",
            "ceiling_percent",
            "wall_s",
            "error",
        ),
    ),
    "causes": (
        *("study", "cause", "stage", "parameter", "value", "std", "low", "high", "p_value", "false_discovery_rate"),
        *("gain_percent", "gain_low", "gain_high", "equivalents"),
    ),
    "pooled": (
        *("cause", "parameter", "studies", "of", "mean", "low", "high", "between", "next_low", "next_high"),
        *("heterogeneity", "p_alike"),
    ),
    "prevalence": (
        *("cause", "stage", "studies", "certain", "share_percent", "share_low", "share_high"),
        *("median_gain_percent", "alone", "equivalents"),
    ),
}
"""Columns of each table."""
