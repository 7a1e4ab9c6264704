"""What a study of each rig must and may hold: keys, columns, units, bounds."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from difflib import get_close_matches

RIGS = ("ankle", "muscle", "joint", "body")
KINDS = ("motion", "isometric")
ROLES = ("fit", "held_out")
UNITS = (
    *("per_rad", "per_deg", "kgm2", "gm2", "nms", "nmm", "nm", "mps", "kmh", "rad", "deg", "degrees", "degree"),
    *("kg", "mg", "lb", "mm", "cm", "km", "m", "kn", "mn", "n", "ms", "us", "ns", "min", "s", "khz", "hz"),
    *("ma", "ua", "mv", "v", "g"),
)


MEANT: Mapping[str, set[str]] = {
    "effort": {
        "torque",
        "force",
        "moment",
        "tau",
        "motor",
        "command",
        "commanded",
        "drive",
        "actuation",
        "current",
        "u",
    },
    "position": {"angle", "theta", "q", "phi", "displacement", "encoder", "x", "pos"},
    "velocity": {"speed", "rate", "omega", "qd", "dq", "v", "vel"},
    "pulse_width_us": {
        "pulse",
        "width",
        "pw",
        "pulsewidth",
        "stimulus",
        "stimulation",
        "duration",
        "charge",
        "current",
    },
    "stim": {"pulse", "pulses", "trigger", "stimulus", "stimulation", "sync"},
    "angle_rad": {"theta", "q", "position", "goniometer", "ankle"},
    "force_n": {"force", "load", "tension", "cell", "f"},
}
"""Other words for what a column holds, as measuring systems name it."""


@dataclass(frozen=True)
class Number:
    """A number that a table of the study holds: its unit and its bounds."""

    unit: str
    lower: float = -math.inf
    strict: bool = True
    required: bool = True

    def check(self, value: object) -> float:
        """The number itself.

        Raises
        ------
        ValueError
            Not a number, not finite, or out of bounds.
        """
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise ValueError(f"expected a number{self._unit()}, found {_kind_of(value)}")
        try:
            number = float(value)
        except OverflowError:
            number = math.inf
        if not math.isfinite(number):
            raise ValueError(f"expected a finite number{self._unit()}, found {_short(value)}")
        if number < self.lower or (self.strict and number == self.lower):
            bound = ("above" if self.strict else "of at least") + f" {self.lower:g}"
            raise ValueError(f"expected a number {bound}{self._unit()}, found {_short(value)}")
        return number

    def _unit(self) -> str:
        return f" in {self.unit}" if self.unit else ""


def _positive(unit: str, required: bool = True) -> Number:
    return Number(unit, 0.0, True, required)


def _not_negative(unit: str, required: bool = True) -> Number:
    return Number(unit, 0.0, False, required)


def _any(unit: str, required: bool = True) -> Number:
    return Number(unit, required=required)


@dataclass(frozen=True)
class RigSchema:
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
        Columns of which a trial holds one; for a joint none is needed.
    optional
        Other columns that have a meaning. A column that has none is refused.
    """

    constants: Mapping[str, Number]
    start: Mapping[str, Number]
    conditions: Mapping[str, Number]
    default_kind: str
    outputs: Mapping[str, str]
    inputs: tuple[str, ...] = ()
    inputs_required: bool = True
    optional: tuple[str, ...] = ()
    passive: Mapping[str, Number] | None = None
    files: Mapping[str, bool] | None = None

    @property
    def columns(self) -> tuple[str, ...]:
        """Every column that has a meaning for this rig, time first."""
        return ("time_s", *self.inputs, *dict.fromkeys(self.outputs.values()), *self.optional)


_START_S = {"start_s": _any("s", required=False)}

SCHEMAS: Mapping[str, RigSchema] = {
    "ankle": RigSchema(
        constants={
            "foot_mass_kg": _positive("kg"),
            "com_distance_m": _positive("m"),
            "moment_arm_m": _positive("m"),
            "force_scale_n": _positive("N"),
            "threshold_us": _not_negative("us"),
            "saturation_us": _positive("us"),
        },
        passive={"f0_n": _not_negative("N"), "f1_per_rad": _not_negative("1/rad"), "theta_r_rad": _any("rad")},
        start={
            "gain": _positive(""),
            "time_constant_s": _positive("s"),
            "inertia_kgm2": _positive("kg m2"),
            "damping_nms": _not_negative("N m s"),
        },
        conditions={"load_kg": _not_negative("kg", False), "angle_rad": _any("rad", False), **_START_S},
        default_kind="motion",
        outputs={"motion": "angle_rad", "isometric": "force_n"},
        inputs=("pulse_width_us",),
    ),
    "muscle": RigSchema(
        constants={"threshold_us": _not_negative("us", False), "saturation_us": _positive("us", False)},
        start={"gain": _positive(""), "time_constant_s": _positive("s")},
        conditions=_START_S,
        default_kind="isometric",
        outputs={"isometric": "force_n"},
        inputs=("pulse_width_us", "stim"),
    ),
    "joint": RigSchema(
        constants={},
        files={"urdf": True},
        start={
            "inertia_scale": _positive(""),
            "damping": _not_negative("N m s/rad or N s/m"),
            "gravity_scale": _not_negative("", False),
        },
        conditions={"position0": _any("rad or m", False), "velocity0": _any("rad/s or m/s", False), **_START_S},
        default_kind="motion",
        outputs={"motion": "position"},
        inputs=("effort",),
        inputs_required=False,
        optional=("velocity",),
    ),
    "body": RigSchema(
        constants={"mass_kg": _positive("kg", False), "height_m": _positive("m", False)},
        files={"segments": False, "urdf": False},
        start={},
        conditions={"belt_speed_mps": _any("m/s", False), **_START_S},
        default_kind="motion",
        outputs={"motion": "ground_reaction"},
        inputs=("coordinates",),
    ),
}


def check_conditions(
    rig: str, kind: str, conditions: Mapping[str, object], error: Callable[[str, str], Exception]
) -> dict[str, float]:
    """Conditions of one trial as numbers.

    Parameters
    ----------
    rig, kind
        Of the trial.
    conditions
        Values by key.
    error
        Makes the exception for a key and a message.

    Raises
    ------
    Exception
        What `error` makes, for an unknown key, a key that is missing, or a value that is not the number it must be.
    """
    known = SCHEMAS[rig].conditions
    numbers = {}
    for key, value in conditions.items():
        if key not in known:
            raise error(key, unknown(key, [*known, "file", "kind", "role"]))
        try:
            numbers[key] = known[key].check(value)
        except ValueError as problem:
            raise error(key, str(problem)) from None
    if rig == "ankle":
        _check_ankle(kind, numbers, error)
    return numbers


def _check_ankle(kind: str, conditions: Mapping[str, float], error: Callable[[str, str], Exception]) -> None:
    if kind == "motion" and "load_kg" not in conditions:
        raise error("load_kg", "missing; expected the load in kg, as this is a motion trial")
    if kind == "isometric" and "angle_rad" not in conditions:
        raise error("angle_rad", "missing; expected the angle in rad that this isometric trial is held at")
    if kind == "motion" and "angle_rad" in conditions:
        raise error("angle_rad", "expected in isometric trials only, and this is a motion trial")


def unknown(name: str, known: Iterable[str]) -> str:
    """What to say of an unknown name: another unit, a likely typo, or what is known."""
    known = list(known)
    same = [candidate for candidate in known if quantity(candidate) == quantity(name)]
    if same:
        return f"wrong unit or none; expected {same[0]}"
    close = get_close_matches(name.lower(), known, n=1, cutoff=0.75)
    if close:
        return f"unknown; did you mean {close[0]}?"
    return f"unknown; expected {'one of ' if len(known) > 1 else ''}{', '.join(known)}" if known else "unknown"


def unread(name: str, known: Iterable[str]) -> str:
    """What to say of a column that a rig does not read: the name that it knows the quantity by, and all that it knows.

    A column that is passed over in silence may be the input under another name, and its absence then a model's error.
    """
    known = list(known)
    words = set(name.lower().replace("-", "_").split("_"))
    meant = [k for k in known if words & MEANT.get(k, set())]
    near = meant or get_close_matches(quantity(name), known, n=1, cutoff=0.5)
    hint = f"did you mean {near[0]}? " if near else ""
    return f"unknown; {hint}this rig reads {', '.join(known)}: name the column so, or take it out"


def is_like(name: str, known: Iterable[str], cutoff: float = 0.8) -> bool:
    """Whether an unknown name is another unit or a likely typo of a known one."""
    known = list(known)
    same = any(quantity(name) == quantity(each) for each in known)
    return same or bool(get_close_matches(name.lower(), known, n=1, cutoff=cutoff))


def quantity(name: str) -> str:
    """The name without its unit: `angle_rad` -> `angle`."""
    name = name.strip().lower()
    for unit in UNITS:
        if name.endswith(f"_{unit}") and len(name) > len(unit) + 1:
            return name[: -len(unit) - 1]
    return name


def one_of(value: object, known: tuple[str, ...]) -> str:
    """The value, if it is one of these words.

    Raises
    ------
    ValueError
        If not.
    """
    if isinstance(value, str) and value in known:
        return value
    found = f"{value[:40]!r}" if isinstance(value, str) else _kind_of(value)
    raise ValueError(f"expected one of {', '.join(known)}; found {found}")


def _kind_of(value: object) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return f"the text {value[:40]!r}"
    words = {dict: "a table", list: "a list", type(None): "nothing"}
    return words.get(type(value), f"a {type(value).__name__}")


def _short(value: int | float) -> str:
    if isinstance(value, int) and value.bit_length() > 100:
        return "an integer of many digits"
    return repr(value)
