"""What a study of each rig must and may hold: keys, columns, units, bounds."""

import math
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from fes_pin.data.errors import KeyFault
from fes_pin.data.numbers import as_number, instance
from fes_pin.data.read_only import ReadOnly
from fes_pin.data.table import own_table

ROLES = ("fit", "held_out")
OF_A_VIEW = ("sources", "from", "to", "at", "split", "derive", "rate", "offset_s", "sheet")
"""Keys of a `[[trial]]` that say which part of which recordings it is."""
ALSO_OF_A_TRIAL = ("file", "kind", "role", "group", "name", "remarks", "low_pass_hz", *OF_A_VIEW)
"""Keys of a `[[trial]]` in addition to its conditions."""
IMPOSED = "imposed"
"""The kind of a trial in which the motion is an input."""
UNITS = (
    *("per_rad", "per_deg", "kgm2", "gm2", "nms", "nmm", "nm", "mps", "kmh", "rad", "deg", "degrees", "degree"),
    *("kg", "mg", "lb", "mm", "cm", "km", "m", "kn", "mn", "n", "ms", "us", "ns", "min", "s", "khz", "hz"),
    *("ma", "ua", "uc", "nc", "mv", "v", "g"),
)


MEANT: Mapping[str, frozenset[str]] = {
    row["column"]: frozenset(row["words"].split()) for row in own_table(Path(__file__).with_name("column_words.csv"))
}
"""Words for what a column holds, as measuring systems name it."""


@dataclass(frozen=True)
class NumberKey:
    """A number that a table of the study holds: its unit and its bounds."""

    unit: str
    lower: float = -math.inf
    strict: bool = True
    required: bool = True

    def check(self, value: object, error: Callable[[str], Exception] = ValueError) -> float:
        """The number itself.

        Raises
        ------
        Exception
            What `error` makes of a message, for what is not a number, not finite, or out of bounds.
        """
        number = as_number(value)
        if number is None:
            raise error(f"expected a number{self._unit()}, found {_kind_of(value)}")
        if not math.isfinite(number):
            raise error(f"expected a finite number{self._unit()}, found {_short(value)}")
        if number < self.lower or (self.strict and number == self.lower):
            bound = ("above" if self.strict else "of at least") + f" {self.lower:g}"
            raise error(f"expected a number {bound}{self._unit()}, found {_short(value)}")
        return number

    def _unit(self) -> str:
        return f" in {self.unit}" if self.unit else ""


def positive(unit: str, required: bool = True) -> NumberKey:
    """A number above 0."""
    return NumberKey(unit, 0.0, True, required)


def not_negative(unit: str, required: bool = True) -> NumberKey:
    """A number of at least 0."""
    return NumberKey(unit, 0.0, False, required)


def any_number(unit: str, required: bool = True) -> NumberKey:
    """A finite number."""
    return NumberKey(unit, required=required)


@dataclass(frozen=True)
class RigSchema(ReadOnly):
    """The keys of one rig's tables and the columns of its trials.

    Parameters
    ----------
    constants, passive, start
        Numbers of `[rig]`, `[rig.passive]`, `[start]`, by key.
    files
        Keys of `[rig]` that name a file; the value says whether the file must be there.
    conditions
        Numbers of a `[[trial]]`, by key.
    default_kind
        The kind of a trial that names none.
    outputs
        The measured column, by kind of trial.
    inputs
        Columns of which a trial holds one; for a joint none is needed, and for an imposed motion. A width and an
        amplitude of pulses may both be there, and their rate in addition: see `data.stimulus`.
    optional
        Other columns that have a meaning. A column that has none is an error.
    imposed
        Columns that hold the motion in a trial of the kind "imposed": the position, which must be there, and what else
        of it may have been measured. Such a trial has them as inputs; without them the rig has no such trials.
    either
        Constants that must all be there if no file is.
    start_may_be_known
        True if a value of `[start]` may stand in `[rig]` instead: it is known then, and not fitted.
    needed
        By kind of trial the conditions that it must state, each with what is expected, in words.
    only
        Conditions that one kind of trial alone states, with that kind.
    stated
        Returns values of `start` that files, by their keys, state: they are taken where a study leaves them out.
    recordings
        Keys of a `[[trial]]` that name its files.
    check_files
        Raises `InputError` for files, by their keys, that are not what this rig needs.
    name
        Of the rig.
    owner
        The class that models it, which this chapter only carries; None if there is no model of a single trial.
    """

    constants: Mapping[str, NumberKey]
    start: Mapping[str, NumberKey]
    conditions: Mapping[str, NumberKey]
    default_kind: str
    outputs: Mapping[str, str]
    inputs: tuple[str, ...] = ()
    inputs_required: bool = True
    optional: tuple[str, ...] = ()
    imposed: tuple[str, ...] = ()
    passive: Mapping[str, NumberKey] = field(default_factory=dict)
    files: Mapping[str, bool] = field(default_factory=dict)
    either: tuple[str, ...] = ()
    start_may_be_known: bool = False
    needed: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    only: Mapping[str, str] = field(default_factory=dict)
    recordings: tuple[str, ...] = ("file",)
    check_files: Callable[[Mapping[str, Any]], object] | None = None
    stated: Callable[[Mapping[str, Any]], Mapping[str, float]] | None = None
    name: str = ""
    owner: Any = None

    def stimuli(self, kind: str) -> tuple[str, ...]:
        """The input columns of a kind of trial, of which it holds one, without a motion that it may impose."""
        return tuple(n for n in self.inputs if n != self.outputs[kind])

    def motion(self, kind: str) -> tuple[str, ...]:
        """The columns that a kind of trial holds its imposed motion in; none of a kind that imposes none."""
        return self.imposed if kind == IMPOSED else ()

    def is_driven_or_read(self, columns: Collection[str]) -> bool:
        """Return whether a trial with these columns may be of either kind: its effort drives the rig, or is read."""
        effort = self.outputs.get(IMPOSED)
        return effort in self.inputs and effort in columns and self.imposed[0] in columns

    def driving(self, kind: str, columns: Collection[str]) -> tuple[str, ...]:
        """Return those of a trial's columns that drive the rig: a stimulus, and an imposed motion."""
        return tuple(n for n in (*self.stimuli(kind), *self.motion(kind)) if n in columns)

    @property
    def columns(self) -> tuple[str, ...]:
        """Every column that has a meaning for this rig, time first."""
        return tuple(dict.fromkeys(n for kind in self.outputs for n in self.columns_of(kind)))

    def columns_of(self, kind: str) -> tuple[str, ...]:
        """Every column that has a meaning in a kind of trial, time first."""
        if kind == IMPOSED:
            named = (*self.stimuli(kind), *self.imposed, self.outputs[kind])
        else:
            free = (n for one, n in self.outputs.items() if one != IMPOSED)
            named = (*self.inputs, *free, *self.optional)
        return ("time_s", *dict.fromkeys(named))

    def kind_of(self, kind: object, error: KeyFault) -> str:
        """The kind of a trial of this rig; the rig's default if it names none.

        Raises
        ------
        InputError
            Made by `error` from the key and a message, for a kind that the rig does not have.
        """
        if kind is None:
            return self.default_kind
        if not isinstance(kind, str) or kind not in self.outputs:
            found = f"{kind[:40]!r}" if isinstance(kind, str) else f"a {type(kind).__name__}"
            expected = f"{'one of ' if len(self.outputs) > 1 else ''}{', '.join(self.outputs)}"
            raise error("kind", f"expected {expected} for rig {self.name}, found {found}")
        return kind

    def left_out(self, files: Mapping[str, Any], known: Collection[str]) -> dict[str, float]:
        """Start values that a study does not give and its files state, by key.

        Parameters
        ----------
        files
            By key.
        known
            Keys of `start` that are given, or known.

        Raises
        ------
        InputError
            If a file cannot be read.
        """
        missing = [key for key, number in self.start.items() if number.required and key not in known]
        stated = self.stated(files) if missing and files and self.stated is not None else {}
        return {key: stated[key] for key in missing if key in stated}

    @property
    def known_constants(self) -> dict[str, NumberKey]:
        """The keys of a study's [rig]: the rig's constants, and where it may be so its start values that are known."""
        start = self.start if self.start_may_be_known else {}
        return {**self.constants, **{k: replace(n, required=False) for k, n in start.items()}}


START_S = {"start_s": any_number("s", required=False)}
"""A condition of any rig: when a trial began in the session."""

BODY = RigSchema(
    name="body",
    constants={"mass_kg": positive("kg", False), "height_m": positive("m", False)},
    files={"segments": False, "urdf": False},
    either=("mass_kg", "height_m"),
    start={},
    conditions={"belt_speed_mps": any_number("m/s", False), **START_S},
    default_kind="motion",
    outputs={"motion": "ground_reaction"},
    inputs=("coordinates",),
    recordings=("coordinates", "ground_reaction"),
)
"""The walking body: two recordings a trial, at rates of their own, and no model of a single trial."""

Rigs = Mapping[str, RigSchema]
"""What a study of each rig must and may hold, by the rig's name."""

_FINDERS: list[Callable[[], Rigs]] = []


def rigs_from(finder: Callable[[], Rigs]) -> None:
    """Have rigs found by a function, when they are first asked for: this chapter knows no model, models know it."""
    _FINDERS.append(finder)


def known_rigs(more: Rigs | None = None) -> dict[str, RigSchema]:
    """Every rig that there is, and `more`."""
    found = {name: schema for finder in _FINDERS for name, schema in finder().items()}
    return {**found, **instance({} if more is None else more, Mapping, "rigs"), BODY.name: BODY}


def schema_of(rig: str | RigSchema, error: Callable[[str], Exception] = ValueError) -> RigSchema:
    """What a study of a rig must and may hold.

    Raises
    ------
    Exception
        What `error` makes of a message, if there is no rig of that name.
    """
    if isinstance(rig, RigSchema):
        return rig
    known = known_rigs()
    return known[one_of(rig, tuple(known), error)]


def check_conditions(
    schema: RigSchema, kind: str, conditions: Mapping[str, object], error: KeyFault
) -> dict[str, float]:
    """Conditions of one trial as numbers.

    Parameters
    ----------
    schema, kind
        Of the rig, and of the trial.
    conditions
        Values by key.
    error
        Makes the exception for a key and a message.

    Raises
    ------
    InputError
        What `error` makes, for an unknown key, a key that is missing, or a value that is not the number it must be.
    """
    numbers = checked_numbers(conditions, schema.conditions, error, ALSO_OF_A_TRIAL)
    for key, words in schema.needed.get(kind, {}).items():
        if key not in numbers:
            raise error(key, f"missing; expected {words}")
    for key, one in schema.only.items():
        if key in numbers and kind != one:
            raise error(key, f"expected in {one} trials only, and this is a {kind} trial")
    return numbers


def checked_numbers(
    table: Mapping[str, Any], known: Mapping[str, NumberKey], error: KeyFault, also: tuple[str, ...] = ()
) -> dict[str, float]:
    """Numbers of a table by key.

    Parameters
    ----------
    table
        Its values.
    known
        What it may hold.
    error
        Makes the exception for a key and a message.
    also
        Other keys that it might hold, named when a key is unknown.

    Raises
    ------
    InputError
        What `error` makes, for an unknown key, a missing one, or a value that is not the number it must be.
    """
    numbers = {}
    for key, value in table.items():
        check_known([key], known, error, also)
        numbers[key] = known[key].check(value, partial(error, key))
    for key, number in known.items():
        if number.required and key not in numbers:
            raise error(key, f"missing; expected a number{f' in {number.unit}' if number.unit else ''}")
    return numbers


def number_or_none(value: object, number: NumberKey, key: str, error: KeyFault) -> float | None:
    """A number that may be missing.

    Raises
    ------
    InputError
        What `error` makes of the key and a message, for a value that is not the number it must be.
    """
    return None if value is None else number.check(value, partial(error, key))


def check_known(names: Iterable[str], known: Collection[str], error: KeyFault, also: Iterable[str] = ()) -> None:
    """Refuse a name that is none of those known.

    Parameters
    ----------
    error
        Makes the exception for a name and a message.
    also
        Names that are not among them here, and may have been meant.

    Raises
    ------
    InputError
        What `error` makes.
    """
    for name in names:
        if name not in known:
            raise error(name, unknown(str(name), (*known, *also)))


def unknown(name: str, known: Iterable[str]) -> str:
    """What to say of an unknown name: another unit, a likely typo, or what is known."""
    known = list(known)
    if same := [candidate for candidate in known if without_unit(candidate) == without_unit(name)]:
        return f"wrong unit or none; expected {same[0]}"
    if close := get_close_matches(name.lower(), known, n=1, cutoff=0.75):
        return f"unknown; did you mean {close[0]}?"
    return f"unknown; expected {'one of ' if len(known) > 1 else ''}{', '.join(known)}" if known else "unknown"


def unread(name: str, known: Iterable[str]) -> str:
    """What to say of a column that a rig does not read: the name that it knows the quantity by, and all that it knows.

    A column that is passed over in silence may be the input under another name, and its absence then a model's error.
    """
    known = list(known)
    words = set(name.lower().replace("-", "_").split("_"))
    meant = [k for k in known if words & MEANT.get(k, set())]
    near = meant or get_close_matches(without_unit(name), known, n=1, cutoff=0.5)
    hint = f"did you mean {near[0]}? " if near else ""
    return f"unknown; {hint}this rig reads {', '.join(known)}: name the column so, or take it out"


def is_like(name: str, known: Iterable[str], cutoff: float = 0.8) -> bool:
    """Return whether an unknown name is another unit or a likely typo of a known one."""
    known = list(known)
    same = any(without_unit(name) == without_unit(each) for each in known)
    return same or bool(get_close_matches(name.lower(), known, n=1, cutoff=cutoff))


def without_unit(name: str) -> str:
    """The name without its unit: `angle_rad` -> `angle`."""
    name = name.strip().lower()
    for unit in UNITS:
        if name.endswith(f"_{unit}") and len(name) > len(unit) + 1:
            return name[: -len(unit) - 1]
    return name


def one_of(value: object, known: tuple[str, ...], error: Callable[[str], Exception] = ValueError) -> str:
    """The value, if it is one of these words.

    Raises
    ------
    Exception
        What `error` makes of a message, if not.
    """
    if isinstance(value, str) and value in known:
        return value
    found = f"{value[:40]!r}" if isinstance(value, str) else _kind_of(value)
    raise error(f"expected one of {', '.join(known)}; found {found}")


def _kind_of(value: object) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return f"the text {value[:40]!r}"
    words = {dict: "a table", list: "a list", type(None): "nothing"}
    return words.get(type(value), f"a {type(value).__name__}")


def _short(value: object) -> str:
    if isinstance(value, int) and value.bit_length() > 100:
        return "an integer of many digits"
    return repr(value.item() if isinstance(value, np.generic) else value)
