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
from fes_pin.data.new_recording import Renamed, Proposal, as_seen
from fes_pin.data.new_view import is_whole
from fes_pin.data.recorded.form import cells_of
from fes_pin.data.recorded.parts import without_empty_end
from fes_pin.data.recorded.regular import LONGEST_GAP
from fes_pin.data.schema import RigSchema
from fes_pin.data.table import MIN_ROWS
from fes_pin.data.units import split_header, stated_unit

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
        The file's names by the words without the number.
    proposal
        What they, and the columns that all sets share, seem to hold.
    renamed
        How the study calls them.
    """

    number: str
    names: Mapping[str, str]
    proposal: Proposal
    renamed: Renamed

    def own(self, column: str) -> list[str]:
        """Names of its own columns that could be one of the rig's."""
        return [n for n in self.proposal.candidates.get(column, ()) if n in self.renamed.called]

    def readings(self) -> list[np.ndarray]:
        """Its own columns of numbers but for its time, each of shape (n,)."""
        columns, time = self.proposal.recording.columns, self.own("time_s")
        return [columns[n] for n in self.renamed.called if n in columns and n not in time]

    def ends(self) -> tuple[float, float, float]:
        """Where it begins and ends, and its usual step: in its own time, in rows where it has none."""
        recording, time = self.proposal.recording, self.own("time_s")
        if len(time) != 1:
            return 0.0, float(len(recording)), 1.0
        values = recording.columns[time[0]]
        return float(values[0]), float(values[-1]), float(np.median(np.abs(np.diff(values))))

    def is_called_trial(self) -> bool:
        """Return whether a word for a trial stands before the number in each name."""
        before = rf"([A-Z]+|[A-Z]?[a-z]+)[^A-Za-z0-9]*{self.number}(?!\d)"
        words = [{w.lower() for w in re.findall(before, name)} for name in self.names.values()]
        return bool(self.number) and all(some & TRIALS for some in words)


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

    def parts(self, one: Proposal) -> list[Proposal]:
        """What each of the trials of a recording seems to hold: several that stand side by side, or one.

        Their columns have the names of the first one; `Proposal.renamed` says what the file calls them.

        Raises
        ------
        InputError
            A person says that trials stand side by side, and they do not.
        """
        if self.split not in (None, COLUMNS):
            return [one]
        found = next((sets for place in PLACES if (sets := self._sets(one, place))), [])
        if not found and self.split == COLUMNS:
            message = "expected names that are the same but for a number, each set of them a trial"
            raise InputError(f"{message}; found {listed(one.recording.names)}", column=f"--split {COLUMNS}")
        chosen = {n for words in self.chosen for n in column_named(words, one.recording.names)}
        others = {n for some in found for n in some.names.values() if n not in some.renamed.called}
        if not found or others & chosen:
            return [one]
        words = " and ".join(listed([*some.names.values()]) for some in found[:2]) + " ..." * (len(found) > 2)
        why = f"--split {COLUMNS} says so" if self.split == COLUMNS else _why(one, found)
        if not why and chosen & {*found[0].names.values()}:  # which the person knows
            return [one]
        if not why:
            either = f"{len(found)} trials side by side or {len(found)} instruments at once"
            said = f"{words} may be {either}: --split {COLUMNS} takes them as trials"
            return [replace(one, said=(*one.said, said))]
        for key, name in found[0].names.items():
            self.called.setdefault(key, name)
        said = f"{len(found)} trials side by side, {words}: {why}; --split none leaves it whole"
        parts = [replace(some.proposal, sheet=one.sheet, renamed=some.renamed) for some in found]
        return [replace(parts[0], said=(*one.said, said)), *parts[1:]]

    def _sets(self, one: Proposal, place: int) -> list[_Set]:
        """Sets of columns that are the same but for the number at a place, each a whole trial; none of others."""
        by_number, shared = _by_number(one.recording.names, place)
        if len(by_number) < 2:
            return []
        numbers = [*by_number] if all(by_number) else [str(k) for k in range(1, len(by_number) + 1)]
        first = {**next(iter(by_number.values())), **self.called}
        found = []
        for trial, (number, names) in zip(numbers, by_number.items(), strict=True):
            renamed = Renamed(f"trial{trial}", {first[k]: name for k, name in names.items()}, one.recording.names)
            found.append(_Set(number, names, self._seen(one, renamed, shared), renamed))
        may_share = self.split == COLUMNS or _are_named(one, found)
        is_one = any(len(some.proposal.recording) < MIN_ROWS for some in found) or _are_copies(found)
        return [] if is_one or not all(self._is_trial(some, shared, may_share) for some in found) else found

    def _seen(self, one: Proposal, renamed: Renamed, shared: Sequence[str]) -> Proposal:
        """What the columns of a set and those that all share seem to hold, down to the last sample of the set."""
        whole, names = one.recording, {**renamed.called, **{n: n for n in shared}}
        own = replace(
            whole,
            names=tuple(names),
            columns={n: whole.columns[its] for n, its in names.items() if its in whole.columns},
            half_digit_of=lambda n: whole.half_digit_of(names.get(n, n)),
        )
        units = {n: one.units[its] for n, its in names.items() if its in one.units}
        return as_seen(without_empty_end(own, shared), one.form, units, self.schema, self.revolute, one.rate_hz)

    def _is_trial(self, some: _Set, shared: Sequence[str], may_share: bool) -> bool:
        """Return whether a set is a whole trial: by its own columns, or with those that all sets share."""
        every = frozenset(c for c, names in some.proposal.candidates.items() if names and c != "time_s")
        own = frozenset(c for c in every if some.own(c))
        if not every and may_share and len(some.readings()) == 1:  # `Trial 1`: the only column next to the time
            return not self.schema.inputs_required and len(shared) <= 1
        return bool(own) and (may_share or own == every) and is_whole(every, self.schema)


def _by_number(names: Sequence[str], place: int) -> tuple[dict[str, dict[str, str]], list[str]]:
    """By number, and by the words without it, names of which there are the same of each number; and all others."""
    found: dict[str, dict[str, str]] = defaultdict(dict)
    for name in names:
        number, rest = _apart(name, place)
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
    """The number at a place in a name, "" of one without, and the words that are left, with the unit."""
    if place == AGAIN:
        again = re.match(r"(.+)#(\d+)$", name)
        return (again[2], again[1]) if again else ("", name)
    bare, unit = split_header(name) if stated_unit(name)[0] else (name, "")
    found = [*re.finditer(r"\d+", bare)][place : place + 1]
    rest = f"{bare[: found[0].start()]} {bare[found[0].end() :]}" if found else bare
    words = re.findall(r"[^\W_]+", rest.lower())
    return found[0][0] if found and words else "", " ".join([*words, unit])


def _are_copies(found: Sequence[_Set]) -> bool:
    """Return whether two sets hold the same numbers."""
    pairs = combinations([some.readings() for some in found], 2)
    return any(all(map(np.array_equal, one, other)) for one, other in pairs if len(one) == len(other))


def _are_named(one: Proposal, found: Sequence[_Set]) -> bool:
    """Return whether a word for a trial stands in the names of all sets, or above the first column of each."""
    if all(some.is_called_trial() for some in found):
        return True
    if one.form is None or one.form.header_row < 2:
        return False
    names = one.recording.names
    firsts = [min(map(names.index, some.names.values())) for some in found]
    form = replace(one.form, sheet=one.sheet or one.form.sheet)
    above = form.lines(one.recording.path)[: form.header_row - 1]
    lines = ([*cells_of(line, form), *[""] * len(names)] for line in above)
    return any(all(set(re.findall(r"[a-z]+", cells[k].lower())) & TRIALS for k in firsts) for cells in lines)


def _why(one: Proposal, found: Sequence[_Set]) -> str:
    """Why sets of columns are trials, and not instruments that recorded at once; "" where nothing says so."""
    if _are_named(one, found):
        return "their names say so"
    ends = [some.ends() for some in found]
    gap = LONGEST_GAP * max(step for _, _, step in ends)
    apart = [
        (abs(a[0] - b[0]) <= gap < abs(a[1] - b[1])) or max(a[0], b[0]) >= min(a[1], b[1])
        for a, b in combinations(ends, 2)
    ]
    return "they begin at once and end apart" if any(apart) else ""
