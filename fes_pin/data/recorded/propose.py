"""Which column of a recording is probably which of the rig's, and in which unit: from names, never from numbers."""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from fes_pin.data.errors import InputError
from fes_pin.data.recorded.formats import is_text, read_recording
from fes_pin.data.recorded.sniff import sniff
from fes_pin.data.recorded.text import TextForm, read_text_recording
from fes_pin.data.schema import MEANT, RigSchema, without_unit
from fes_pin.data.table import Table
from fes_pin.data.units import UNITS, known_unit, quantities_of, split_header


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
    """

    recording: Table
    form: TextForm | None
    candidates: Mapping[str, tuple[str, ...]]
    units: Mapping[str, str]


def propose(path: Path, schema: RigSchema, revolute: bool | None) -> Proposal:
    """What a file seems to hold for a rig.

    Raises
    ------
    InputError
        The file cannot be read, or holds no numbers.
    """
    form, stated = sniff(path) if is_text(path) else (None, {})
    if form is None:
        recording = read_recording(path)
        units = dict(recording.units)
    else:
        recording = _numbers(path, form)
        units = {name: stated[k] for k, name in enumerate(recording.names) if stated.get(k)}
    for name in recording.columns:
        units.setdefault(name, split_header(name)[1])
    named = {c: tuple(_candidates(c, recording.columns, units, revolute)) for c in schema.columns}
    named = _without_doubles(named)
    candidates = {c: found or _by_unit(c, named, units, revolute) for c, found in named.items()}
    return Proposal(recording, form, _without_doubles(candidates), units)


def _numbers(path: Path, form: TextForm) -> Table:
    """A text file's columns of numbers; columns of words or of dates are among its names only."""
    names = read_text_recording(path, form, ()).names
    for _ in names:
        try:
            return read_text_recording(path, form, names)
        except InputError as error:
            if error.column not in names:
                raise
            names = tuple(n for n in names if n != error.column)
    return read_text_recording(path, form, names)


def _candidates(
    column: str, names: Sequence[str] | Mapping[str, object], units: Mapping[str, str], revolute: bool | None
) -> Iterator[str]:
    quantities = quantities_of(column, revolute)
    for name in names:
        bare, _ = split_header(name)
        unit = units.get(name, "")
        if unit and known_unit(unit, quantities) is None and known_unit(unit, tuple(UNITS)) is not None:
            continue  # another quantity
        words = _words(bare)
        if name == column or without_unit(column) == "_".join(words) or words & MEANT.get(column, frozenset()):
            yield name


def _by_unit(
    column: str, named: Mapping[str, tuple[str, ...]], units: Mapping[str, str], revolute: bool | None
) -> tuple[str, ...]:
    """Columns that no word of theirs gives away and whose unit is one of this quantity: `Kniewinkel [deg]`."""
    taken = {name for names in named.values() for name in names}
    quantities = quantities_of(column, revolute)
    return tuple(n for n, unit in units.items() if unit and n not in taken and known_unit(unit, quantities))


def _words(name: str) -> frozenset[str]:
    """Lower-case words of a name: `Motor Torque`, `motorTorque`, `knee.angle`."""
    apart = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name)
    return frozenset(w for w in re.split(r"[^a-z0-9]+", apart.lower()) if w)


def _without_doubles(candidates: Mapping[str, tuple[str, ...]]) -> dict[str, tuple[str, ...]]:
    """A name that is the only candidate of one column is none of another's."""
    out = dict(candidates)
    for _ in out:
        sole = {names[0]: c for c, names in out.items() if len(names) == 1}
        out = {c: tuple(n for n in names if sole.get(n, c) == c) for c, names in out.items()}
    return out
