"""Trials that stand side by side in the columns of one file or sheet: `angle_1, torque_1, angle_2, torque_2`.

Columns whose names are the same but for a number are trials, or instruments that recorded at once. Each set must be a
whole trial. Then words for a trial decide (`trial 1`, also above the names), or their ends: what is recorded at once
ends at once.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from fes_pin.data.errors import InputError, listed
from fes_pin.data.new_columns import column_named
from fes_pin.data.new_recording import Proposal, Renamed, as_seen
from fes_pin.data.new_view import APART, FilesOfTrial, files_of_trial, is_whole
from fes_pin.data.recorded.form import cells_of
from fes_pin.data.recorded.parts import end_at_once, ends_of, without_empty_end
from fes_pin.data.schema import RigSchema
from fes_pin.data.table import MIN_ROWS
from fes_pin.data.units import speed_of_trial, split_header, stated_unit, without_speed

COLUMNS = "columns"
"""What `--split` says of a file whose trials stand side by side."""
TRIALS = frozenset(
    {"trial", "run", "rep", "repetition", "test", "take", "measurement", "recording", "attempt", "swing", "session"}
    | {"versuch", "messung", "durchgang", "wiederholung", "essai", "mesure", "prova", "misura", "ensayo", "prueba"}
)
"""Words for a trial; some are German, French, Italian or Spanish, as in `column_words.csv`."""
AGAIN = -1
"""In the place of a number: that of a name that comes again, `Angle#2`."""
PLACES = (AGAIN, 0, 1)
"""Which number of a name may be that of a trial: of `trial1_emg2` the first, of `emg2_trial1` the second."""


@dataclass(frozen=True)
class _Set:
    """Columns that have one number.

    Parameters
    ----------
    number
        "" of names without one, next to others with one.
    names
        The files' names by the words without the number.
    first
        Names that those of the first trial have, which all are called by.
    trial
        What they, and the columns that all sets share, seem to hold.
    """

    number: str
    names: Mapping[str, str]
    first: frozenset[str]
    trial: FilesOfTrial

    def readings(self) -> list[np.ndarray]:
        """Its own columns of numbers but for its times, each of shape (n,)."""
        return [
            v for one in self.trial.files.values() for n, v in _own(one).items() if n not in one.candidates["time_s"]
        ]

    def ends(self) -> tuple[float, float, float]:
        """Where it begins and ends, and its usual step: in its own time, in rows where it has none."""
        one = next(iter(self.trial.files.values()))
        times = [values for name, values in _own(one).items() if name in one.candidates["time_s"]]
        if len(times) != 1:
            return 0.0, float(len(one.recording)), 1.0
        return ends_of(times[0])

    def is_called_trial(self) -> bool:
        """Return whether a word for a trial stands before the number in each name that holds it, or it is a speed."""
        if all(map(speed_of_trial, self.names.values())):
            return True
        names = [re.sub(r"#\d+$", "", name) for name in self.names.values()]
        before = rf"([A-Z]+|[A-Z]?[a-z]+)[^A-Za-z0-9]*0*{self.number}(?!\d)"
        words = [
            [w.lower() for w in re.findall(before, n)] for n in names if re.search(rf"(?<!\d)0*{self.number}(?!\d)", n)
        ]
        return bool(self.number and words) and all(TRIALS.intersection(some) for some in words)


class SideBySide:
    """Finds trials that stand side by side in the columns of recordings.

    Parameters
    ----------
    schema, revolute
        Of the rig; see `propose`.
    split
        What a person said of where recordings are split: `COLUMNS`, or something else, which leaves columns together.
    chosen
        What a person says of columns; a name that is not of the first trial leaves columns together.
    """

    def __init__(
        self, schema: RigSchema, revolute: bool | None, split: str | None, chosen: Collection[str] = ()
    ) -> None:
        self.schema, self.revolute, self.split, self.chosen = schema, revolute, split, chosen
        self.called: dict[str, str] = {}
        """The names of the first trial of all recordings, by their words without the number."""

    def trials(self, one: FilesOfTrial) -> list[FilesOfTrial]:
        """The trials of a recording: several that stand side by side, or the recording itself.

        Their columns have the names of the first one; `Proposal.renamed` says what each file calls them.

        Raises
        ------
        InputError
            A person says that trials stand side by side, and they do not.
        """
        if self.split not in (None, COLUMNS):
            return [one]
        every = one.proposal.recording.names
        found = next((sets for place in PLACES if (sets := self._sets(one, place))), [])
        is_one = one.proposal.form is None and one.proposal.sheet  # of the structures of a file
        if not found and self.split == COLUMNS and not is_one:
            message = "expected names that are the same but for a number, each set of them a trial"
            raise InputError(f"{message}; found {listed(every)}", column=f"--split {COLUMNS}")
        chosen = {n for words in self.chosen for n in column_named(words, every)}
        others = {n for some in found for n in some.names.values()} - set(self.called.values())
        if not found or chosen & others.difference(found[0].first):
            return [one]
        why = f"--split {COLUMNS} says so" if self.split == COLUMNS else _why(one, found)
        if not why and chosen & found[0].first:  # which the person knows
            return [one]
        return self._as_trials(one, found, why)

    def _as_trials(self, one: FilesOfTrial, found: Sequence[_Set], why: str) -> list[FilesOfTrial]:
        """Sets of columns as trials, and why they are; the recording with a question where nothing says so."""
        words = " and ".join(listed([*some.names.values()]) for some in found[:2]) + " ..." * (len(found) > 2)
        if not why:
            either = f"{len(found)} trials side by side or {len(found)} instruments at once"
            return [_saying(one, f"{words} may be {either}: --split {COLUMNS} takes them as trials")]
        for key, name in found[0].names.items():
            self.called.setdefault(key, name)
        said = f"{len(found)} trials side by side, {words}: {why}; --split none leaves it whole"
        return [_saying(found[0].trial, said), *(some.trial for some in found[1:])]

    def _sets(self, one: FilesOfTrial, place: int) -> list[_Set]:
        """Sets of columns that are the same but for the number at a place, each a whole trial; none of others."""
        by_number, shared = _by_number(one.proposal.recording.names, place)
        if len(by_number) < 2:
            return []
        numbers = [*by_number] if all(by_number) else [str(k) for k in range(1, len(by_number) + 1)]
        first = {**next(iter(by_number.values())), **self.called}
        found = []
        for trial, (number, names) in zip(numbers, by_number.items(), strict=True):
            called = {first[k]: name for k, name in names.items()}
            found.append(_Set(number, names, frozenset(called), self._seen(one, f"trial{trial}", called, shared)))
        may_share = self.split == COLUMNS or _are_named(one, found)
        if any(len(some.trial.proposal.recording) < MIN_ROWS for some in found):
            return []
        are_trials = all(self._is_trial(some, shared, may_share) for some in found)
        return found if are_trials and not _are_copies(found) else []

    def _seen(self, one: FilesOfTrial, trial: str, called: Mapping[str, str], shared: Sequence[str]) -> FilesOfTrial:
        """What the columns of a set and those that all share seem to hold, by the names of the first set."""
        files = {}
        for source, proposal in one.files.items():
            before, table = (f"{source}{APART}", f"{source}_{trial}") if source else ("", trial)
            its = {
                n.removeprefix(before): name.removeprefix(before) for n, name in called.items() if n.startswith(before)
            }
            also = [n.removeprefix(before) for n in shared if n.startswith(before)]
            files[source] = self._of_file(proposal, Renamed(table, its, proposal.recording.names), also)
        return FilesOfTrial(files, files[""]) if "" in files else files_of_trial(files, self.schema)

    def _of_file(self, one: Proposal, renamed: Renamed, shared: Sequence[str]) -> Proposal:
        """What some columns of a file seem to hold, down to the last sample of those that are not shared."""
        whole, names = one.recording, {**renamed.called, **{n: n for n in shared}}
        own = replace(
            whole,
            names=tuple(names),
            columns={n: whole.columns[its] for n, its in names.items() if its in whole.columns},
            half_digit_of=lambda n: whole.half_digit_of(names.get(n, n)),
        )
        units = {n: one.units[its] for n, its in names.items() if its in one.units}
        seen = as_seen(
            without_empty_end(own, shared), one.form, units, self.schema, self.revolute, one.rate_hz, one.said
        )
        return replace(seen, sheet=one.sheet, renamed=renamed)

    def _is_trial(self, some: _Set, shared: Sequence[str], may_share: bool) -> bool:
        """Return whether a set is a whole trial: by its own columns, or with those that all sets share."""
        held = {c: set(names) for c, names in some.trial.proposal.candidates.items() if names and c != "time_s"}
        own = [c for c, names in held.items() if names & some.first]
        if not held and may_share and len(some.readings()) == 1:  # `Trial 1`: the only column next to the time
            return not self.schema.inputs_required and len(shared) <= 1
        return bool(own) and (may_share or len(own) == len(held)) and is_whole(frozenset(held), self.schema)


def _own(one: Proposal) -> dict[str, np.ndarray]:
    """Columns of numbers, each of shape (n,), that a set does not share with others."""
    called = one.renamed.called if one.renamed is not None else {}
    return {n: v for n, v in one.recording.columns.items() if n in called}


def _saying(one: FilesOfTrial, said: str) -> FilesOfTrial:
    """Files of a trial with a sentence about them, which the first of them has."""
    (source, first), *others = one.files.items()
    first = replace(first, said=(*first.said, said))
    return FilesOfTrial({source: first, **dict(others)}, one.proposal if source else first)


def _by_number(names: Sequence[str], place: int) -> tuple[dict[str, dict[str, str]], list[str]]:
    """By number, and by the words without it, names of which there are the same of each number; and all others."""
    found: dict[str, dict[str, str]] = defaultdict(dict)
    again = {name.rpartition("#")[0] for name in names if re.search(r"#\d+$", name)}
    for name in names:
        number, rest = _apart(name, place)
        number = number or "1" * (name in again)
        if rest in found[number]:
            return {}, []
        found[number][rest] = name
    plain = found.pop("", {})
    keys = dict.fromkeys(next(iter(found.values()), {})).keys()
    ordered = {number: found[number] for number in sorted(found, key=int)}
    if keys <= set(plain):  # `Angle, Angle#2`: the first has no number
        ordered = {"": {k: plain.pop(k) for k in keys}, **ordered}
    is_alike = not keys & set(plain) and all(set(some) == keys for some in found.values())
    return (ordered, [*plain.values()]) if is_alike else ({}, [])


def _apart(name: str, place: int) -> tuple[str, str]:
    """The number at a place in a name, "" of one without, and its other words, with the unit."""
    again = re.match(r"(.+)#(\d+)$", name)
    base, number = (again[1], again[2]) if again else (name, "")
    if place == AGAIN:
        return number, base
    if place == 0 and (speed := speed_of_trial(base)):
        return str(int(speed[1])), without_speed(base, speed).lower()
    bare, unit = split_header(base) if stated_unit(base)[0] else (base, "")
    found = [*re.finditer(r"\d+", bare)][place : place + 1]
    rest = f"{bare[: found[0].start()]} {bare[found[0].end() :]}" if found else bare
    words = re.findall(r"[^\W_]+", rest.lower())
    return str(int(found[0][0])) if found and words else number, " ".join([*words, unit.lower()]).strip()


def _are_copies(found: Sequence[_Set]) -> bool:
    """Return whether two sets hold the same numbers."""
    pairs = combinations([some.readings() for some in found], 2)
    return any(all(map(np.array_equal, one, other)) for one, other in pairs if len(one) == len(other))


def _are_named(one: FilesOfTrial, found: Sequence[_Set]) -> bool:
    """Return whether a word for a trial stands in the names of all sets, or above the first column of each."""
    if all(some.is_called_trial() for some in found):
        return True
    proposal = one.proposal
    if proposal.form is None or proposal.form.header_row < 2:
        return False
    form, names = replace(proposal.form, sheet=proposal.sheet or proposal.form.sheet), proposal.recording.names
    firsts = [min(map(names.index, some.names.values())) for some in found]
    lines = ([*cells_of(line, form), *[""] * len(names)] for line in form.lines(one.path)[: form.header_row - 1])
    return any(all(set(re.findall(r"[a-z]+", cells[k].lower())) & TRIALS for k in firsts) for cells in lines)


def _why(one: FilesOfTrial, found: Sequence[_Set]) -> str:
    """Why sets of columns are trials, and not instruments that recorded at once; "" where nothing says so."""
    if _are_named(one, found):
        return "their names say so"
    pairs = combinations([some.ends() for some in found], 2)
    return "" if all(map(end_at_once, *zip(*pairs, strict=True))) else "they do not end at once"
