"""What a recording seems to hold for a rig: which of its columns could be each of the rig's, in which unit.

Columns are known from names and units, never from numbers.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from fes_pin.data.channels import CHARGE, WIDTH
from fes_pin.data.errors import InputError, listed
from fes_pin.data.recorded.form import TextForm
from fes_pin.data.recorded.formats import is_text, read_recording
from fes_pin.data.recorded.header import Header
from fes_pin.data.recorded.nested import by_length, is_nested
from fes_pin.data.recorded.parts import Ends, end_at_once, ends_of
from fes_pin.data.recorded.sheets import is_spreadsheet, sheets_of
from fes_pin.data.recorded.sniff import sniffed
from fes_pin.data.recorded.text import read_text_recording
from fes_pin.data.schema import IMPOSED, MEANT, RigSchema, without_unit
from fes_pin.data.table import Table
from fes_pin.data.units import known_unit, may_be, quantities_of, split_header, words_of

WANTED = frozenset(
    {"setpoint", "target", "goal", "desired", "demand", "demanded", "soll"}
    | {"command", "commanded", "cmd", "reference", "ref"}
)
"""Words for what a controller wants, which is no reading."""
READINGS = ("position", "velocity", "angle_rad", "force_n", "torque_nm", "length_m")
"""Columns that are read: an effort may be a command, and a stimulus is one."""
PULSES = (WIDTH.column, CHARGE.column, "stim")
"""Columns of pulses that nothing but a stimulator gives."""
OTHERS = frozenset(
    {"acc", "accel", "acceleration", "temp", "temperature", "temperatur", "efficiency", "power", "constant"}
)
"""Words for quantities that no rig reads."""
RATES = {"dot": "velocity", "ddot": "acceleration"}
"""What the end of a name makes of an angle or a position: `theta_dot`, `thetaDot`, `alpha_ddot`."""
_NUMBERED = re.compile(r"([a-z]{3,})\d+$")
_ENDING = re.compile(r"(.*?)(?:(d?dot)\d*)?$")


@dataclass(frozen=True)
class Renamed:
    """The columns of a trial among others that stand next to it.

    Parameters
    ----------
    name
        Of the table of sources that says how they are read.
    called
        The file's names of them, by those of the first trial.
    names
        All columns of the file.
    """

    name: str
    called: Mapping[str, str]
    names: tuple[str, ...]


@dataclass(frozen=True)
class Proposal:
    """What a file seems to hold.

    Parameters
    ----------
    recording
        The file with all of its columns that are numbers.
    form
        Of a text file; None of another.
    candidates
        Names of columns that could be each of the rig's.
    units
        Unit of each of the file's columns as its name or the file itself states it; "" where neither does.
    rate_hz
        Of the samples, where lines above the numbers state it.
    said
        What is odd about the file and how it is taken, a sentence each.
    sheet
        Of a spreadsheet that has several.
    source
        What the sheet is called as a source of a trial, where each sheet holds one quantity of it.
    renamed
        Of a trial with others next to it in the columns of one file; None of others.
    """

    recording: Table
    form: TextForm | None
    candidates: Mapping[str, tuple[str, ...]]
    units: Mapping[str, str]
    rate_hz: float | None = None
    said: tuple[str, ...] = ()
    sheet: str = ""
    source: str = ""
    renamed: Renamed | None = None


def proposals_of(
    path: Path, schema: RigSchema, revolute: bool | None, stated: Mapping[str, Any], chosen: Collection[str] = ()
) -> list[Proposal]:
    """What the recordings in a file seem to hold, as `propose`: one, or sheets of a spreadsheet.

    Sheets may hold one quantity each of the same trials, and be alike. Of others those with most rows are taken.

    Raises
    ------
    InputError
        As `propose`; several sheets whose columns have no names, so that none says what it holds.
    """
    sheets = sheets_of(path) if is_spreadsheet(path) else ()
    if "sheet" in stated:
        return [_of_sheet(propose(path, schema, revolute, stated, chosen), str(stated["sheet"]))]
    if len(sheets) < 2:
        return [propose(path, schema, revolute, stated, chosen)]
    alike: dict[Any, list[Proposal]] = defaultdict(list)
    for sheet in sheets:
        with suppress(InputError):  # a title page, a drawing
            one = _of_sheet(propose(path, schema, revolute, {**stated, "sheet": sheet}, chosen), sheet)
            alike[one.recording.names, one.form, quantities_held(one, words_of(sheet), schema)].append(one)
    if not alike:
        raise InputError(f"expected rows of numbers in one of its sheets, {listed(sheets)}", file=path)
    if apart := _one_quantity_each([one for some in alike.values() for one in some], schema):
        return apart
    return _alike_sheets(path, max(alike.values(), key=lambda some: sum(len(one.recording) for one in some)), sheets)


def _alike_sheets(path: Path, taken: Sequence[Proposal], sheets: Sequence[str]) -> list[Proposal]:
    """Sheets of a spreadsheet that hold the same columns, as trials; which are taken and which are left is said."""
    names, form = [one.sheet for one in taken], taken[0].form or TextForm()
    if names[1:] and not form.names and not form.header_row:
        message = f"{listed(names)} hold columns without names: expected --sheet NAME, or --names where they are alike"
        raise InputError(message, file=path)
    left = [sheet for sheet in sheets if sheet not in names]
    words = f"{listed(names)} of its {len(sheets)} sheets {'are trials' if names[1:] else 'is a trial'}"
    said = words + (f", not {listed(left)}: without numbers, or with other columns" if left else "")
    return [replace(taken[0], said=(*taken[0].said, said)), *taken[1:]]


def _one_quantity_each(sheets: Sequence[Proposal], schema: RigSchema) -> list[Proposal]:
    """Sheets that hold different quantities of what was recorded at once, as sources of a trial; none of others."""
    longest = max(sheets, key=lambda one: len(one.recording))
    held = {one.sheet: quantities_held(one, words_of(one.sheet), schema) for one in sheets}
    found = [one for one in sheets if held[one.sheet] and end_at_once(ends_in(one), ends_in(longest))]
    each = [held[one.sheet] for one in found]
    if len(found) < 2 or sum(map(len, each)) > len(frozenset().union(*each)):
        return []
    out: dict[str, Proposal] = {}
    for place, one in enumerate(found, 1):
        meant = sorted(words_of(one.sheet) & {w for c in held[one.sheet] for w in MEANT.get(c, ())})
        source = next((word for word in meant if word not in out), f"sheet{place}")
        out[source] = _as_source(one, source)
    left = [one.sheet for one in sheets if one not in found]
    first, *others = out.values()
    said = f"{listed([one.sheet for one in found])} of its sheets hold one quantity each of what was recorded at once"
    return [replace(first, said=(*first.said, said + (f", not {listed(left)}" if left else ""))), *others]


def _as_source(one: Proposal, source: str) -> Proposal:
    """A sheet as a source of a trial; a unit in the name of the sheet is that of its columns but for the time."""
    form, unit = replace(one.form or TextForm(), sheet=one.sheet), split_header(one.sheet)[1]
    time = one.candidates["time_s"]
    units = {n: u or (unit if n not in time else "") for n, u in one.units.items()}
    return replace(one, form=form, sheet="", source=source, units=units)


def quantities_held(proposal: Proposal, of_name: Collection[str], schema: RigSchema) -> frozenset[str]:
    """The rig's columns that a file seems to hold, by the names of its columns, else by the words of its own."""
    found = {n for n, names in proposal.candidates.items() if names and n != "time_s"}
    return frozenset(found or {n for n in schema.columns if MEANT.get(n, frozenset()) & set(of_name)})


def ends_in(one: Proposal) -> Ends:
    """Ends of a recording in its first column of times, in rows where it has none."""
    times = (one.recording.columns[n] for n in one.candidates["time_s"])
    known = [time[np.isfinite(time)] for time in times if np.isfinite(time).sum() > 1]
    return ends_of(known[0] if known else np.arange(float(len(one.recording))))


def _of_sheet(one: Proposal, sheet: str) -> Proposal:
    """A proposal of a sheet, which its trial states; its form is that of other sheets too."""
    return replace(one, form=one.form and replace(one.form, sheet=""), sheet=sheet)


def propose(
    path: Path,
    schema: RigSchema,
    revolute: bool | None,
    stated: Mapping[str, Any] = MappingProxyType({}),
    chosen: Collection[str] = (),
) -> Proposal:
    """What a file seems to hold for a rig.

    Parameters
    ----------
    stated
        What a person says of the form of a text file, by its keys.
    chosen
        What a person says of columns: a name begins it.

    Raises
    ------
    InputError
        The file cannot be read, or holds no numbers.
    """
    recording, form, units, header = _read(path, stated, chosen)
    return as_seen(recording, form, units, schema, revolute, header.rate_hz, header.said)


def _read(
    path: Path, stated: Mapping[str, Any], chosen: Collection[str] = ()
) -> tuple[Table, TextForm | None, Mapping[str, str], Header]:
    """The columns of numbers of a file, the form of a text, the units that are stated apart, and its header."""
    if is_text(path):
        form, header = sniffed(path, stated)
        recording = _numbers(path, form)
        units = {name: header.units[k] for k, name in enumerate(recording.names) if k in header.units}
        return recording, form, {**recording.units, **units}, header
    sheet = str(stated.get("sheet", ""))
    names, rate_hz, said = by_length(path, chosen, sheet) if is_nested(path) else (None, None, ())
    recording = read_recording(path, TextForm(sheet=sheet), names)
    return recording, None, recording.units, Header(rate_hz=rate_hz, said=said)


def rig_held(paths: Sequence[Path], schemas: Iterable[RigSchema], stated: Mapping[str, Any]) -> RigSchema | None:
    """Return the rig without a URDF, of fewest numbers, whose stimulus and reading every file holds; None without one.

    A stimulus is known from a pulse width, a charge or a trigger: a current may be that of a motor. A file that cannot
    be read holds none here: the error is raised where the file is read for its rig.
    """
    try:
        read = [_read(path, stated)[:3] for path in paths]
    except InputError:
        return None
    for schema in sorted((s for s in schemas if s.owner is not None and not s.files), key=lambda s: len(s.constants)):
        free = {c for kind, c in schema.outputs.items() if kind != IMPOSED}
        found = [as_seen(*one, schema, None).candidates for one in read]
        if all(any(c.get(n) for n in PULSES) and any(c.get(n) for n in free) for c in found):
            return schema
    return None


def as_seen(
    recording: Table,
    form: TextForm | None,
    stated: Mapping[str, str],
    schema: RigSchema,
    revolute: bool | None,
    rate_hz: float | None = None,
    said: tuple[str, ...] = (),
) -> Proposal:
    """What columns of numbers seem to hold for a rig, by their names and the units that are stated apart from these."""
    units = dict(stated)
    for name in recording.columns:
        units.setdefault(name, split_header(name)[1])
    named = {c: tuple(_candidates(c, recording.columns, units, revolute)) for c in schema.columns}
    named = _without_doubles(named)
    candidates = {
        c: found if len(found) == 1 else (*found, *_by_unit(c, named, units, revolute)) for c, found in named.items()
    }
    if revolute is not None:  # a torque in newtons wants a scale, and is no other column's
        either = {
            c: tuple(_candidates(c, recording.columns, units, None)) for c, found in candidates.items() if not found
        }
        taken = {name for found in candidates.values() for name in found}
        candidates |= {c: tuple(n for n in found if n not in taken) for c, found in either.items()}
    candidates = {c: _readings(c, _without_copies(found, recording)) for c, found in candidates.items()}
    candidates |= {"time_s": _rising(candidates.get("time_s", ()), recording)}
    return Proposal(recording, form, _without_doubles(candidates), units, rate_hz, said)


def _without_copies(names: Sequence[str], recording: Table) -> tuple[str, ...]:
    """Columns of which no two hold the same numbers, as the times before each channel do; the first of them.

    Columns that hold no number are none of these.
    """
    read, kept = recording.columns, list[str]()
    for name in (n for n in names if n not in read or np.isfinite(read[n]).any()):
        others = [read[other] for other in kept if other in read]
        if name not in read or not any(np.array_equal(read[name], other, equal_nan=True) for other in others):
            kept.append(name)
    return tuple(kept)


def _rising(names: tuple[str, ...], recording: Table) -> tuple[str, ...]:
    """Columns of times without those that hardly ever rise, as dates of too few digits do, where others rise."""
    read = recording.columns
    steps = {n: np.diff(read[n][np.isfinite(read[n])]) for n in names if n in read}
    return tuple(n for n in names if n not in steps or (steps[n].size and np.median(steps[n]) > 0.0)) or names


def _readings(column: str, names: tuple[str, ...]) -> tuple[str, ...]:
    """Columns of a reading without those that say what was wanted of it, where others say what it was."""
    if column not in READINGS:
        return names
    words = {n: words_of(n) for n in names}
    return tuple(n for n, found in words.items() if not (WANTED & found or {"set", "point"} <= found)) or names


def _numbers(path: Path, form: TextForm) -> Table:
    """A text file's columns of numbers; columns of words are among its names only."""
    names = read_text_recording(path, form, ()).names
    while True:
        try:
            return read_recording(path, form, names)
        except InputError as error:
            if error.column not in names:
                raise
            names = tuple(n for n in names if n != error.column)


def _candidates(
    column: str, names: Sequence[str] | Mapping[str, object], units: Mapping[str, str], revolute: bool | None
) -> Iterator[str]:
    if column in names and may_be(column, column, units.get(column, ""), revolute):
        yield column  # a name that is the rig's own needs no words
        return
    names = [n for n in names if n not in _of_quaternions(names)]
    words = {n: _said(n) for n in names if may_be(column, n, units.get(n, ""), revolute)}
    found = [n for n, some in words.items() if without_unit(column) == "_".join(some) or _means(some, column)]
    yield from found or [n for n, some in words.items() if _means(_without_numbers(some), column)]


def _said(name: str) -> frozenset[str]:
    """Words of a name; of `theta_dot` that of a rate, instead of the angle's."""
    words = words_of(split_header(name)[0])
    apart = frozenset(part for word in words if (found := _ENDING.match(word)) for part in found.groups() if part)
    rates = {RATES[word] for word in apart & RATES.keys()}
    moves = {word for word in apart if _without_numbers(frozenset({word})) & MEANT["position"]}
    rest = apart - moves - RATES.keys()
    is_rate = rates and (moves or (rest and not rest & frozenset().union(*MEANT.values())))
    return rest | rates if is_rate else words


def _of_quaternions(names: Collection[str]) -> set[str]:
    """Columns x, y, z and w of one name, `imu.x` or `qx`: parts of a quaternion, which are no angles."""
    parts: dict[str, dict[str, str]] = defaultdict(dict)
    for name in names:
        if name[:-1] and name[-1].lower() in "xyzw":
            parts[name[:-1]][name[-1].lower()] = name
    return {name for four in parts.values() if len(four) == len("xyzw") for name in four.values()}


def _without_numbers(words: frozenset[str]) -> frozenset[str]:
    """Words without the numbers of channels: EMG2, Torque1."""
    return words | {found[1] for found in map(_NUMBERED.match, words) if found}


def _means(words: frozenset[str], column: str) -> bool:
    """Return whether words are for a rig's column; an axis or a letter is for none where a word is for another.

    `Force_x` and `F_x` are no positions, nor is `AccX`.
    """
    meant = words & MEANT.get(column, frozenset())
    if not meant or words & OTHERS:
        return False
    long = {word for word in words if len(word) > 1}
    is_force = column not in ("effort", "force_n") and words & (MEANT["effort"] | MEANT["force_n"])
    return bool(meant & long) or not (is_force or any(long & others for others in MEANT.values()))


def _by_unit(
    column: str, named: Mapping[str, tuple[str, ...]], units: Mapping[str, str], revolute: bool | None
) -> tuple[str, ...]:
    """Columns that no word of theirs gives away and whose unit is one of this quantity: `Kniewinkel [deg]`."""
    taken = {name for names in named.values() for name in names}
    quantities = quantities_of(column, revolute)
    return tuple(n for n, unit in units.items() if unit and n not in taken and known_unit(unit, quantities))


def _without_doubles(candidates: Mapping[str, tuple[str, ...]]) -> dict[str, tuple[str, ...]]:
    """A name that is the only candidate of one column is none of another's."""
    out = dict(candidates)
    for _ in out:
        sole = {names[0]: c for c, names in out.items() if len(names) == 1}
        out = {c: tuple(n for n in names if sole.get(n, c) == c) for c, names in out.items()}
    return out
