"""Trials in the structures of one file that nests vectors, as a struct array of MATLAB: each is read as a sheet is."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Collection, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import combinations
from pathlib import Path

from fes_pin.data.errors import InputError, listed
from fes_pin.data.new_columns import column_named
from fes_pin.data.new_recording import Proposal, ends_in, proposals_of, propose, quantities_held
from fes_pin.data.recorded.nested import elements_of
from fes_pin.data.recorded.parts import Ends, end_at_once
from fes_pin.data.schema import RigSchema
from fes_pin.data.side_by_side import COLUMNS, TRIALS
from fes_pin.data.wanted import Wanted


def recordings_in(path: Path, schema: RigSchema, wanted: Wanted, chosen: Collection[str]) -> list[Proposal]:
    """What the recordings in a file seem to hold, as `proposals_of`: also structures of one that nests vectors.

    Structures with the same columns are trials where their names say so, or those next to each other do not end at
    once; else they may be instruments that recorded at once. `--split none` leaves the file whole.

    Raises
    ------
    InputError
        As `proposals_of`.
    """
    revolute, stated = wanted.revolute, wanted.form
    names = () if "sheet" in stated or wanted.split == "none" else elements_of(path)
    alike: dict[tuple[tuple[str, ...], frozenset[str]], list[Proposal]] = defaultdict(list)
    for name in names:
        with suppress(InputError):  # settings, vectors of several lengths
            one = propose(path, schema, revolute, {**stated, "sheet": name}, chosen)
            if held := quantities_held(one, (), schema):
                alike[one.recording.names, held].append(replace(one, sheet=name))
    groups = sorted((some for some in alike.values() if some[1:]), key=lambda some: -sum(map(_length, some)))
    found = next((some for some in groups if _why(some, wanted.split)), [])
    if not found or _is_flat(chosen, found[0]):
        return _whole(path, schema, wanted, chosen, groups)
    trials = [one.sheet for one in found]
    said = f"{listed(trials)} are trials: {_why(found, wanted.split)}; --split none leaves the file whole"
    left = [n for n in names if n not in trials and _are_siblings(n, found[0].sheet)]
    said += f"; {listed(left)} have other columns and are left out" if left else ""
    return [replace(found[0], said=(*found[0].said, said)), *found[1:]]


def _length(one: Proposal) -> int:
    return len(one.recording)


def _are_siblings(name: str, other: str) -> bool:
    return name.rpartition(".")[0] == other.rpartition(".")[0]


def _ends(one: Proposal) -> Ends:
    """Ends of a structure in its times, else by the rate that it states, else in rows."""
    if one.candidates["time_s"] or one.rate_hz is None:
        return ends_in(one)
    return 0.0, len(one.recording) / one.rate_hz, 1.0 / one.rate_hz


def _why(some: Sequence[Proposal], split: str | None) -> str:
    """Why structures are trials, and not instruments that recorded at once; "" where nothing says so."""
    if split == COLUMNS:
        return f"--split {COLUMNS} says so"
    if all(_is_called_trial(one.sheet) for one in some):
        return "their names say so"
    siblings = [(a, b) for a, b in combinations(some, 2) if _are_siblings(a.sheet, b.sheet)]
    is_apart = any(not end_at_once(_ends(a), _ends(b)) for a, b in siblings)
    return "they do not end at once" if is_apart else ""


def _is_called_trial(name: str) -> bool:
    """Return whether the last name is a word for a trial, or the one before a number: `data.run2`, `trials.1`."""
    *above, last = name.split(".")
    word = next(iter(above[-1:]), "") if last.isdigit() else last
    return any(w in TRIALS or w.removesuffix("s") in TRIALS for w in re.findall(r"[a-z]+", word.lower()))


def _is_flat(chosen: Collection[str], first: Proposal) -> bool:
    """Return whether a person named a vector by its place in the whole file."""
    others = [words for words in chosen if not column_named(words, first.recording.names)]
    return any("." in words.partition(":")[0] and not words.startswith("rate=") for words in others)


def _whole(
    path: Path, schema: RigSchema, wanted: Wanted, chosen: Collection[str], groups: Sequence[Sequence[Proposal]]
) -> list[Proposal]:
    """The recordings of a file as a whole; said of structures without numbers in their names what else they may be."""
    first, *others = proposals_of(path, schema, wanted.revolute, wanted.form, chosen)
    names = [one.sheet for one in groups[0]] if groups else []
    if not names or any(re.search(r"\d", name) for name in names):  # which `SideBySide` says
        return [first, *others]
    said = f"{listed(names)} may be trials or instruments at once: --split {COLUMNS} takes them as trials"
    return [replace(first, said=(*first.said, said)), *others]
