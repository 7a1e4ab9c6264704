"""Which recordings a new study's trials are made of: several files a trial, and what is odd about their times."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from fes_pin.data.errors import InputError
from fes_pin.data.new_recording import Proposal, quantities_held
from fes_pin.data.numbers import number_in
from fes_pin.data.recorded.free_part import free_from
from fes_pin.data.recorded.parts import HOLES, RESTARTS, holes, restarts
from fes_pin.data.recorded.view import FITTED, INTEGRATED
from fes_pin.data.schema import MEANT, RigSchema
from fes_pin.data.table import MIN_ROWS, STEP_TOLERANCE, check_times
from fes_pin.data.units import factor_of

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
    if any(one.source for one in proposals):
        return _of_sheets(proposals, schema, stated)
    by_path = {one.recording.path: one for one in proposals}
    groups = _stated(tuple(by_path), stated) if stated else _by_name(proposals, schema)
    if not groups:
        first, *others = proposals
        return [
            FilesOfTrial({"": one}, one)
            for one in (replace(first, said=first.said + _quantities_or_trials(proposals)), *others)
        ]
    return [files_of_trial({source: by_path[path] for source, path in files.items()}, schema) for files in groups]


def _of_sheets(proposals: Sequence[Proposal], schema: RigSchema, stated: Mapping[str, str]) -> list[FilesOfTrial]:
    """Trials of which workbooks hold a quantity a sheet, and those of other files."""
    found: dict[tuple[Path, str], dict[str, Proposal]] = defaultdict(dict)
    for one in proposals:
        found[one.recording.path, one.sheet][one.source] = one
    if stated:
        raise InputError("expected none of a workbook that holds one quantity a sheet", column="--source")
    return [FilesOfTrial(f, f[""]) if "" in f else files_of_trial(f, schema) for f in found.values()]


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
        of_it = [p for p in paths if pattern and (p.match(pattern) or p.with_suffix("").match(pattern))]
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
    found = {quantities_held(one, some, schema) for one, some in zip(proposals, words, strict=True)}
    alike = len(found) == 1 or all(is_whole(one, schema) for one in found)
    if alike or len({len(some) for some in words}) > 1:
        return []
    return next((trials for k in range(len(words[0])) if (trials := _apart_in(k, paths, words))), [])


def _quantities_or_trials(proposals: Sequence[Proposal]) -> tuple[str, ...]:
    """What is said of files that are taken as trials, and may as well be quantities of one trial: no header tells.

    They hold one column without a name next to the same times, and their names differ by more than a number.
    """
    clocks = [(one.recording.columns, one.candidates.get("time_s", ())[:1]) for one in proposals]
    times = [[columns[n] for n in clock if n in columns] for columns, clock in clocks]  # texts are no columns
    words = {re.sub(r"\d+", "", one.recording.path.stem) for one in proposals}
    is_bare = all(one.form and not one.form.header_row and len(one.recording.columns) == 2 for one in proposals)
    if len(words) < 2 or not is_bare or not all(times) or any(not np.array_equal(t, times[0]) for t in times):
        return ()
    names = " and ".join(one.recording.path.name for one in proposals[1:4])
    taken = f"it and {names} have the same times and one column without a name each, and are taken as a trial each"
    return (f"{taken}; where they are quantities of one trial, say --source NAME=FILE of each",)


def _apart_in(place: int, paths: Sequence[Path], words: Sequence[Sequence[str]]) -> list[dict[str, Path]]:
    """Files by trial and source, where names differ in one word, at a place, that each trial has in the same ways."""
    trials: dict[tuple[str, ...], dict[str, Path]] = defaultdict(dict)
    for path, some in zip(paths, words, strict=True):
        trials[(*some[:place], *some[place + 1 :])][some[place]] = path
    sources = {tuple(sorted(files)) for files in trials.values()}
    known = next(iter(sources))
    is_apart = len(sources) == 1 and len(known) > 1 and all(word.isalpha() for word in known)
    return [*trials.values()] if is_apart else []


def is_whole(found: frozenset[str], schema: RigSchema) -> bool:
    """Return whether a file with these columns is a trial by itself."""
    found |= {n for n, source in INTEGRATED.items() if source in found}
    kinds = ({schema.outputs[kind], *schema.motion(kind)[:1]} for kind in schema.outputs)
    is_moved = not schema.inputs_required or bool(found & set(schema.inputs))
    return is_moved and any(needed <= found for needed in kinds)


def files_of_trial(files: Mapping[str, Proposal], schema: RigSchema) -> FilesOfTrial:
    """Several files as those of one trial, by their sources.

    Raises
    ------
    InputError
        Their sheets differ.
    """
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
    sheets = dict.fromkeys(one.sheet for one in files.values())
    if len(sheets) > 1:
        raise InputError(f"expected the same sheet in each file of a trial, found {', '.join(sheets)}", file=first.path)
    return FilesOfTrial(files, Proposal(whole, None, candidates, units, sheet=next(iter(sheets))))


def _meant(source: str, one: Proposal, schema: RigSchema) -> dict[str, tuple[str, ...]]:
    """The only column of a file in addition to its time, where the file's name says what it holds."""
    time = one.candidates["time_s"][:1]
    others = tuple(n for n in one.recording.columns if n not in time)
    if len(others) != 1 or not time or any(names for c, names in one.candidates.items() if c != "time_s"):
        return {}
    return {c: others for c in schema.columns if c != "time_s" and source in MEANT.get(c, frozenset())}


@dataclass(frozen=True)
class WantedView:
    """What a person said of the part of a recording that a trial is.

    Parameters
    ----------
    ends
        Of `from` and `to` those that were said, s.
    split
        At what it is cut; "none" leaves it whole, None where nothing was said.
    offsets
        Of the clocks of sources.
    rate_hz
        At which all trials are resampled, Hz.
    derived
        Columns that are integrated, and of which.
    is_regular
        Whether the times of all trials are made equal steps already.
    """

    ends: Mapping[str, float]
    split: str | None
    offsets: Mapping[str, float | str]
    rate_hz: float | None
    derived: Mapping[str, str]
    is_regular: bool


def trial_view(
    files: FilesOfTrial, times: Mapping[str, Mapping[str, Any]], position: str | None, wanted: WantedView
) -> tuple[dict[str, Any], list[str]]:
    """Keys of the `[[trial]]` of some files that say which part of them it is, and what is odd about their times.

    Parameters
    ----------
    times
        For each source what its table says of `time_s`.
    position
        The column of the position of a rig that nothing drives; None of others.

    Returns
    -------
    (keys, sentences)
    """
    seconds = {source: _seconds(one, times[source]) for source, one in files.files.items()}
    main, name = next(iter(seconds.values())), files.path.name
    keys, said = dict[str, Any](wanted.ends), list[str]()
    split, sentence = _split(files, main, wanted)
    keys |= {"split": split} if split not in ("", "none") else {}
    said += [f"{name}: {sentence}"] if sentence else []
    if files.is_joined:
        paths = dict.fromkeys(one.recording.path.name for one in files.files.values())
        said += [f"{' and '.join(paths)} are one trial"] if len(paths) > 1 else []
        offsets = _offsets(seconds, wanted.offsets)
        keys |= {"offset_s": offsets} if offsets else {}
    recorded = files.proposal.recording.columns.get(position or "")  # none of words, which their reader refuses
    if recorded is not None and not keys:
        free, more = free_part(name, main, recorded)
        keys, said = free, [*said, *more]
    keys |= {"derive": dict(wanted.derived)} if wanted.derived else {}
    if not wanted.is_regular and (rate_hz := _own_rate(files, times, main, keys)):
        keys["rate"] = rate_hz
    return keys, said


def _offsets(seconds: Mapping[str, np.ndarray], stated: Mapping[str, float | str]) -> dict[str, float | str]:
    """Offsets of the sources whose times are not those of the first one: as stated, else fitted."""
    (first, main), *others = seconds.items()
    if odd := [n for n in stated if n not in dict(others)]:
        message = f"expected a source other than the first, {first}: {', '.join(dict(others))}"
        raise InputError(message, column=f"--offset {odd[0]}")
    apart = [n for n, time in others if len(time) != len(main) or not np.allclose(time, main, atol=1e-9)]
    return {**dict.fromkeys(apart, FITTED), **stated}


def _seconds(one: Proposal, time: Mapping[str, Any]) -> np.ndarray:
    """Times of one file, s, shape (n,); none of a column that is no numbers, which its reader refuses."""
    if "rate_hz" in time:
        return np.arange(len(one.recording)) / float(time["rate_hz"])
    return _factor(time) * one.recording.columns.get(time["name"], np.zeros(0))


def _factor(time: Mapping[str, Any]) -> float:
    """What recorded times are multiplied by to be in s."""
    return float(time.get("scale", 1.0)) * factor_of(time.get("unit", "s"), "time_s")


def _own_rate(
    files: FilesOfTrial, times: Mapping[str, Mapping[str, Any]], time: np.ndarray, view: Mapping[str, Any]
) -> float | None:
    """The rate of a trial whose times, those of its first file, are not equally spaced, Hz; None of one whose are."""
    source, one = next(iter(files.files.items()))
    time = time[(time >= view.get("from", -np.inf)) & (time <= view.get("to", np.inf))]
    if "rate_hz" in times[source] or not len(time):
        return None
    half_digit = abs(_factor(times[source])) * one.recording.half_digit_of(times[source]["name"])
    return rate_of(time, str(view.get("split", "")), half_digit)


def _split(files: FilesOfTrial, time: np.ndarray, wanted: WantedView) -> tuple[str, str]:
    """At what a recording is split, as a person said, else as it must be, and why; "" of one that is one trial."""
    if wanted.ends or wanted.split is not None:
        return wanted.split or "", ""
    rate_hz = wanted.rate_hz
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
    error = {name: partial(InputError, column=f"--offset {name}") for name in said}
    return {name: text if text == FITTED else number_in(text, error[name]) for name, text in said.items()}
