"""Which recordings a new study's trials are made of: several files a trial, and what is odd about their times."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from fes_pin.data.errors import InputError
from fes_pin.data.recorded.free_part import free_from
from fes_pin.data.recorded.parts import HOLES, RESTARTS, holes, restarts
from fes_pin.data.recorded.sniff import Proposal
from fes_pin.data.recorded.view import FITTED, INTEGRATED
from fes_pin.data.schema import MEANT, RigSchema
from fes_pin.data.table import MIN_ROWS, STEP_TOLERANCE, check_times

APART = "."
"""Between the name of a source and that of its column."""


@dataclass(frozen=True)
class FilesOfTrial:
    """The files that make one trial, and what they seem to hold together.

    Attributes
    ----------
    files
        By the name of the source; "" of one file alone.
    proposal
        Of all of them: names of columns begin with that of their source.
    """

    files: Mapping[str, Proposal]
    proposal: Proposal

    @property
    def path(self) -> Path:
        """The first file."""
        return self.proposal.recording.path

    @property
    def is_joined(self) -> bool:
        """Whether it has several files."""
        return "" not in self.files


def grouped_files(proposals: Sequence[Proposal], schema: RigSchema, stated: Mapping[str, str]) -> list[FilesOfTrial]:
    """Which files make a trial together: those that `--source` says, else those that their names show; else each alone.

    Files are sources of one trial where their names differ in one word alone, each trial has a file of each word,
    files hold different quantities, and one of them is no trial by itself.

    Parameters
    ----------
    stated
        By the name of a source the pattern of its files.

    Raises
    ------
    InputError
        A pattern of no file, a file of no pattern, trials that do not have a file of each source.
    """
    proposals = [_with_time(one) for one in proposals]
    by_path = {one.recording.path: one for one in proposals}
    groups = _stated(tuple(by_path), stated) if stated else _by_name(proposals, schema)
    if not groups:
        return [FilesOfTrial({"": one}, one) for one in proposals]
    return [_joined({source: by_path[path] for source, path in files.items()}, schema) for files in groups]


def _with_time(proposal: Proposal) -> Proposal:
    """The time of columns without names is the first of them that rises in equal steps."""
    recording, form = proposal.recording, proposal.form
    if (form is not None and form.header_row) or proposal.candidates.get("time_s"):
        return proposal
    nameless = recording.columns if form else [n for n in recording.columns if re.search(r"\.\d+$", n)]
    found = next((n for n in nameless if _rises(recording.columns[n])), None)
    return replace(proposal, candidates={**proposal.candidates, "time_s": (found,)}) if found else proposal


def _rises(values: np.ndarray) -> bool:
    steps = np.diff(values)
    usual = float(np.median(steps))
    return bool(usual > 0.0 and np.mean(np.abs(steps - usual) <= STEP_TOLERANCE * usual) > 0.9)


def _stated(paths: Sequence[Path], stated: Mapping[str, str]) -> list[dict[str, Path]]:
    found: dict[str, list[Path]] = {}
    for source, pattern in stated.items():
        of_it = [p for p in paths if fnmatchcase(p.name, pattern) or fnmatchcase(p.stem, pattern)]
        if not of_it:
            raise InputError(f"expected a pattern of one of the files, found {pattern!r}", column=f"--source {source}")
        found[source] = of_it
    if left := [p for p in paths if sum(p in some for some in found.values()) != 1]:
        raise InputError("expected each file to be of one --source", file=left[0])
    if len({len(some) for some in found.values()}) > 1:
        counts = ", ".join(f"{source} {len(some)}" for source, some in found.items())
        raise InputError(f"expected as many files of each source, found {counts}", column="--source")
    return [dict(zip(found, files, strict=True)) for files in zip(*found.values(), strict=True)]


def _by_name(proposals: Sequence[Proposal], schema: RigSchema) -> list[dict[str, Path]]:
    """Files by trial and source, as their names show; none where each is a trial of its own."""
    paths = [one.recording.path for one in proposals]
    words = [re.findall(r"[a-z]+|\d+|[^a-z\d]+", path.stem.lower()) for path in paths]
    found = {_quantities(one, some, schema) for one, some in zip(proposals, words, strict=True)}
    alike = len(found) == 1 or all(_is_whole(one, schema) for one in found)
    if alike or len({len(some) for some in words}) > 1:
        return []
    for place in range(len(words[0])):
        trials: dict[tuple[str, ...], dict[str, Path]] = defaultdict(dict)
        for path, some in zip(paths, words, strict=True):
            trials[(*some[:place], *some[place + 1 :])][some[place]] = path
        sources = {tuple(sorted(files)) for files in trials.values()}
        known = next(iter(sources))
        if len(sources) == 1 and len(known) > 1 and all(word.isalpha() for word in known):
            return list(trials.values())
    return []


def _quantities(proposal: Proposal, of_name: Sequence[str], schema: RigSchema) -> frozenset[str]:
    """The rig's columns that a file seems to hold, by the names of its columns, else by its own."""
    found = {n for n, names in proposal.candidates.items() if names and n != "time_s"}
    return frozenset(found or {n for n in schema.columns if MEANT.get(n, frozenset()) & set(of_name)})


def _is_whole(found: frozenset[str], schema: RigSchema) -> bool:
    """Return whether a file with these columns is a trial by itself."""
    found |= {n for n, source in INTEGRATED.items() if source in found}
    kinds = ({schema.outputs[kind], *schema.motion(kind)[:1]} for kind in schema.outputs)
    is_moved = not schema.inputs_required or bool(found & set(schema.inputs))
    return is_moved and any(needed <= found for needed in kinds)


def _joined(files: Mapping[str, Proposal], schema: RigSchema) -> FilesOfTrial:
    columns: dict[str, np.ndarray] = {}
    units: dict[str, str] = {}
    candidates: dict[str, tuple[str, ...]] = dict.fromkeys(schema.columns, ())
    for source, one in files.items():
        columns |= {f"{source}{APART}{n}": v for n, v in one.recording.columns.items()}
        units |= {f"{source}{APART}{n}": u for n, u in one.units.items()}
        for column, names in {**one.candidates, **_meant(source, one, schema)}.items():
            if column != "time_s":
                candidates[column] += tuple(f"{source}{APART}{n}" for n in names)
    first = next(iter(files.values())).recording
    names = tuple(f"{source}{APART}{n}" for source, one in files.items() for n in one.recording.names)
    whole = replace(first, names=names, columns=columns)
    return FilesOfTrial(files, Proposal(whole, None, candidates, units))


def _meant(source: str, one: Proposal, schema: RigSchema) -> dict[str, tuple[str, ...]]:
    """The only column of a file in addition to its time, where the file's name says what it holds."""
    time = one.candidates["time_s"][:1]
    others = tuple(n for n in one.recording.columns if n not in time)
    if len(others) != 1 or not time or any(names for c, names in one.candidates.items() if c != "time_s"):
        return {}
    return {c: others for c in schema.columns if c != "time_s" and source in MEANT.get(c, frozenset())}


def view_keys(
    files: FilesOfTrial, time: Mapping[str, np.ndarray], rate_hz: float | None, stated: Mapping[str, Any]
) -> tuple[dict[str, Any], list[str]]:
    """Keys of the `[[trial]]` of some files that say which part of them it is, and what is odd about their times.

    Parameters
    ----------
    time
        Of each source, s, shape (n,).
    rate_hz
        At which it will be resampled.
    stated
        Keys that a person gave; `split = "none"` leaves the recording whole.

    Returns
    -------
    (keys, sentences)
    """
    keys: dict[str, Any] = {k: v for k, v in stated.items() if v not in ("none", {})}
    name, said = files.path.name, list[str]()
    main = next(iter(time.values()))
    if not {"split", "from", "to"} & set(stated):
        split, sentence = _split(files, main, rate_hz)
        keys |= {"split": split} if split else {}
        said += [f"{name}: {sentence}"] if split else []
    if files.is_joined:
        said.append(f"{' and '.join(one.recording.path.name for one in files.files.values())} are one trial")
        first, *others = time
        apart = [n for n in others if len(time[n]) != len(main) or not np.allclose(time[n], main, atol=1e-9)]
        offsets = {**dict.fromkeys(apart, FITTED), **stated.get("offset_s", {})}
        if unknown := [n for n in stated.get("offset_s", {}) if n not in others]:
            message = f"expected a source other than the first, {first}: {', '.join(others)}"
            raise InputError(message, column=f"--offset {unknown[0]}")
        keys |= {"offset_s": offsets} if offsets else {}
    return keys, said


def _split(files: FilesOfTrial, time: np.ndarray, rate_hz: float | None) -> tuple[str, str]:
    """At what a recording must be split, and why; "" of one that is one trial."""
    rows = next(iter(files.files.values())).recording.rows
    if len(again := restarts(time)):
        return RESTARTS, f"{len(again) + 1} recordings in one file: time starts again in row {rows[again[0]]}"
    if len(found := holes(time, 1.0 / rate_hz if rate_hz else None)):
        count, longest = f"{len(found)} hole{'s' * (len(found) > 1)}", 1e3 * float(np.diff(time).max())
        return HOLES, f"{count}, the longest {longest:.4g} ms: {len(found) + 1} trials"
    return "", ""


def rate_of(time: np.ndarray, split: str, half_digit: float) -> float | None:
    """The rate at which a recording is resampled as its times are not equally spaced, Hz; None where they are.

    It is that of the usual step, to the three digits that jitter leaves.

    Parameters
    ----------
    time
        Of what the trial takes of its recording, s, shape (n,).
    split
        At what it is cut into trials: a step from one to the next is none of either.
    half_digit
        Half of the last digit that times were printed with, s.
    """
    places = {RESTARTS: restarts, HOLES: holes}.get(split, lambda _: np.zeros(0, dtype=int))(time)
    parts = [one for one in np.split(time, places) if len(one) >= MIN_ROWS]
    if not parts or not all((np.diff(one) > 0.0).all() for one in parts):  # which its reader refuses, NaN too
        return None
    try:
        for one in parts:
            check_times(one, lambda *_: InputError("uneven"), half_digit=half_digit)
    except InputError:
        steps = np.diff(time)
        return float(f"{1.0 / float(np.median(steps[steps > 0.0])):.3g}")
    return None


def free_part(name: str, time: np.ndarray, position: np.ndarray) -> tuple[dict[str, float], list[str]]:
    """The beginning of the free motion of a rig that nothing drives, as a key, and a sentence."""
    begin = free_from(time, position)
    if begin is None:
        return {}, []
    at = float(f"{begin:.6g}")
    return {"from": at}, [f"{name}: rest, a push by hand, free motion: the free part from {at:g} s is used"]


def offsets_of(said: Mapping[str, str]) -> dict[str, float | str]:
    """Offsets of clocks as `--offset SOURCE=SECONDS` or `SOURCE=fit` states them.

    Raises
    ------
    InputError
        Anything else.
    """
    from fes_pin.data.numbers import number_in  # noqa: PLC0415 - numbers are checked where they are read

    error = {name: partial(InputError, column=f"--offset {name}") for name in said}
    return {name: text if text == FITTED else number_in(text, error[name]) for name, text in said.items()}
