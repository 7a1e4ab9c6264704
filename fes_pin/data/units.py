"""Units that recordings come in, and what they are in the study format's own.

A table and no units library: a study holds a dozen quantities, every factor of `units.csv` is exact by definition, and
headers write units as no library reads them: `Torque_Nm` is a newton metre, which a units library takes for a
nanometre.
"""

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import groupby
from operator import itemgetter
from pathlib import Path

from fes_pin.data.schema import MEANT, without_unit
from fes_pin.data.table import own_table

_TABLE = own_table(Path(__file__).with_name("units.csv"))
UNITS: Mapping[str, Mapping[str, float]] = {
    quantity: {row["unit"]: float(row["factor"]) for row in rows}
    for quantity, rows in groupby(_TABLE, itemgetter("quantity"))
}
"""Factor to the study format's own unit (SI; microseconds for pulse widths), by quantity and unit."""
INCH, POUND = UNITS["length"]["in"], UNITS["force"]["lbf"]
"""Inch in m, pound-force in N."""
_SPELLINGS: dict[str, str] = {}
"""Other spellings, as measuring systems write them, in the form that `_plain` leaves."""

CURRENTS = frozenset({"current", "amps", "ampere", "amperes", "strom", "courant", "corrente", "corriente"})
"""Words for an electric current: no effort without a scale, and no pulse width."""
SPEEDS = MEANT["velocity"] - {"rate"}
"""Words for a speed: one in Hz is turns a second, while a rate in Hz is one of pulses or samples."""
LONGEST = 12
"""Characters of the longest unit in a row that also has known ones; `revolutions` has 11."""
SPELT_OUT = 4
"""Characters that a name has more of which is itself a unit: `Microseconds`, but not `in` or `rev`."""
_IN_NAMES = tuple(q for q in UNITS if q not in ("pressure", "power", "temperature", "counts", "pulses"))
"""Quantities whose units are looked for at the end of names; the others are words or numbers: `bar`, channel `1`."""

_BY_SUFFIX = {"s": "time", "us": "pulse width", "rad": "angle", "m": "length", "n": "force", "nm": "torque"}
_HELD = {*_BY_SUFFIX.values(), "angular rate", "speed", "pulses"}
_BY_SUFFIX |= {"ma": "current", "uc": "charge", "hz": "frequency"}
_OF_A_JOINT = {"position": ("angle", "length"), "velocity": ("angular rate", "speed"), "effort": ("torque", "force")}


def _plain(unit: str) -> str:
    """A unit without what writers vary: case, spaces, dots, signs of multiplication, ways to say "per second"."""
    text = unit.strip().replace("µ", "u").replace("μ", "u").replace("°", "deg").replace("º", "deg").lower()
    text = re.sub(r"(?<=[a-z])[\s.*·⋅]*s\^?(?:-1|⁻¹)$|\s*(?:/|\bper\b)\s*(?:s|sec|seconds?)$", "/s", text)
    text = re.sub(r"[\s.*·⋅^_-]", "", text)
    return _SPELLINGS.get(text, text)


_SPELLINGS.update((other, _plain(row["unit"])) for row in _TABLE for other in row["also"].split())
_KNOWN = {quantity: {_plain(unit): unit for unit in units} for quantity, units in UNITS.items()}


def quantities_of(column: str, revolute: bool | None = None) -> tuple[str, ...]:
    """Quantities that a rig's column can hold.

    Parameters
    ----------
    column
        As the study format names it.
    revolute
        Whether a joint turns (True) or slides (False); None if that is not known yet.

    Returns
    -------
    tuple of str
        Of `UNITS`; empty for a column of somebody's own whose name says no unit.
    """
    stem = column.split("_", maxsplit=1)[0]
    if column == "stim":
        return ("pulses",)
    if column in _OF_A_JOINT or (stem in _OF_A_JOINT and without_unit(column) == column):
        both = _OF_A_JOINT[stem]
        return both if revolute is None else both[:1] if revolute else both[1:]
    suffix = column.rpartition("_")[2]
    return (_BY_SUFFIX[suffix],) if suffix in _BY_SUFFIX and suffix != column else ()


def known_unit(unit: str, quantities: tuple[str, ...]) -> tuple[str, str] | None:
    """Quantity and standard spelling of a unit among some quantities, None if it is none of theirs."""
    if unit.strip() in ("MN", "Ms", "MNm"):  # mega, which nothing else here distinguishes from milli
        return None
    plain = _plain(unit)
    return next(((q, _KNOWN[q][plain]) for q in quantities if plain in _KNOWN[q]), None)


def is_another(unit: str, column: str, revolute: bool | None = None) -> bool:
    """Return whether a unit is known, and of a quantity that a rig's column cannot hold.

    A motor's current is an effort up to the motor's constant.
    """
    scaled = ("current",) if column == "effort" else ()
    is_own = known_unit(unit, (*quantities_of(column, revolute), *scaled)) is not None
    return bool(unit) and not is_own and known_unit(unit, tuple(UNITS)) is not None


def factor_of(
    unit: str, column: str, revolute: bool | None = None, error: Callable[[str], Exception] = ValueError
) -> float:
    """What a number in a unit is multiplied by to stand in a rig's column.

    Raises
    ------
    Exception
        What `error` makes of a message, for a unit that is none of what this column holds.
    """
    quantities = quantities_of(column, revolute)
    if (found := known_unit(unit, quantities)) is not None:
        return UNITS[found[0]][found[1]]
    expected = [u for q in quantities for u in UNITS[q]]
    if not expected:
        raise error(f"this column holds a quantity without a table of units; expected a scale, found {unit[:40]!r}")
    raise error(f"expected a unit of {' or '.join(quantities)}: {', '.join(expected)}; found {unit[:40]!r}")


def stated_unit(name: str, unit: str = "") -> tuple[str, str]:
    """Quantity and unit that a file states of a column: in `unit`, else in its name; a current that says so has A.

    The quantity is "" of a unit that no table here knows; both are "" where nothing is stated.
    """
    bare, in_name = split_header(name)
    if (text := unit or in_name) and (known := known_unit(text, tuple(UNITS))):
        return known
    if not unit and CURRENTS & words_of(bare):
        return "current", "A"
    return "", unit if unit != in_name else ""  # what stands in brackets in a name need be no unit: `Angle [left]`


def may_be(column: str, name: str, unit: str = "", revolute: bool | None = None) -> bool:
    """Return whether a recorded column may be a rig's: False where it states a unit of another quantity.

    A sensor may log any quantity in volts or counts, and a motor's torque is its current times a constant.
    """
    quantity, stated = stated_unit(name, unit)
    if not quantity or known_unit(unit or stated, quantities_of(column, revolute)) is not None:
        return True
    if turns_a_second(column, name, unit, revolute):
        return True
    return quantity in ("voltage", "counts", "share") or (quantity == "current" and column == "effort")


def turns_a_second(column: str, name: str, unit: str = "", revolute: bool | None = None) -> bool:
    """Return whether a recorded column is the speed of what turns, in Hz: `Motor speed [Hz]`, but not `Pulse rate`."""
    if column != "velocity" or revolute is False or stated_unit(name, unit) != ("frequency", "Hz"):
        return False
    return bool(SPEEDS & words_of(split_header(name)[0]))


def words_of(name: str) -> frozenset[str]:
    """Lower-case words of a name: `Motor Torque`, `motorTorque`, `knee.angle`."""
    apart = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name)
    return frozenset(w for w in re.split(r"[^a-z0-9]+", apart.lower()) if w)


def bare_unit(cell: str) -> str:
    """The unit that a cell of a row of units states; "" of one that has none."""
    bare = cell.strip("[](){} ")
    return "" if bare in ("-", "1", "*") else bare


def are_units(cells: Sequence[str], names: Sequence[str] = ()) -> bool:
    """Return whether cells are a row of units: all in brackets, or all known, or below names half of them.

    Parameters
    ----------
    names
        The row of names that it belongs to, where that is known; units may then be of no table here (counts, LSB).
    """
    stated = [(k, unit) for k, cell in enumerate(cells) if (unit := bare_unit(cell))]
    if not stated:
        return False
    if all(cell.strip()[:1] in ("[", "(", "{") for cell in cells if cell.strip()):
        return True
    known = [(k, unit) for k, unit in stated if known_unit(unit, tuple(UNITS))]
    if len(known) == len(stated):
        return True
    if len(names) != len(cells) or any(len(unit) > LONGEST for _, unit in stated):
        return False
    return 2 * len(known) >= len(stated) or any(is_unit_of(unit, names[k]) for k, unit in known)


def is_unit_of(unit: str, name: str) -> bool:
    """True of a unit that measures what a word of a name is for: `ms` of `Time`."""
    columns = (column for column, words in MEANT.items() if words & words_of(name))
    return any(known_unit(unit, quantities_of(column)) for column in columns)


def own_unit(column: str, revolute: bool | None = None) -> str:
    """The unit that the study format has in a column; "" where it has none."""
    units = [next(iter(UNITS[q])) for q in quantities_of(column, revolute)]
    return " or ".join(u for u in units if u != "1")


def _ends_a_name(unit: str) -> bool:
    """True of a unit at the end of a name; one letter there may be an index, but for a rig's units: `leg_a`."""
    known = known_unit(unit, _IN_NAMES)
    return known is not None and (known[0] in _HELD or len(unit) > 1 or not unit.isalnum())


_NUMBER_WITH_UNIT = re.compile(r"(?:^|(?<=[\s(\[_@-]))(\d+)\s?([^\s\d,;()\[\]_]+)(?=$|[\s)\],;_])")


def speed_of_trial(name: str) -> re.Match[str] | None:
    """A whole number with the unit of a speed in a name that says how fast a trial was: `60 deg/s`, `Torque 60 deg/s`.

    Behind a word for a speed, `gyro 1 deg/s`, or a number of one digit without a word for a quantity, it is the unit.
    """
    found = _NUMBER_WITH_UNIT.search(name)
    if found is None or known_unit(found[2], ("angular rate",)) is None:
        return None
    words = words_of(without_speed(name, found))
    meant = {column for column, some in MEANT.items() if some & words}
    return found if "velocity" not in meant and (meant or not words or "at" in words or len(found[1]) > 1) else None


def without_speed(name: str, speed: re.Match[str]) -> str:
    """A name without the speed of its trial."""
    return re.sub(r"[(\[]\s*[)\]]", "", f"{name[: speed.start()]}{name[speed.end() :]}").strip(" _,;@-")


_BRACKETED = re.compile(r"^(?P<name>.*?)\s*[\[(<{]\s*(?P<unit>[^\])>}]*?)\s*[\])>}]\s*$")


def split_header(header: str) -> tuple[str, str]:
    """Name and unit that a header seems to hold: `Angle_deg`, `Torque [Nm]`, `t/ms`, `Winkel (°)`.

    Returns
    -------
    (name, unit)
        The unit is empty where the header names none that is known.
    """
    text = re.sub(r"#\d+$", "", header.strip().strip("\"'"))  # the second of that name
    if speed := speed_of_trial(text):
        return split_header(rest) if (rest := without_speed(text, speed)) else (text, "")
    found = _BRACKETED.match(text)
    if found and found["unit"]:
        return found["name"].strip(), found["unit"]
    return next(((name.strip(), unit) for name, unit in _apart(text) if name and _ends_a_name(unit)), (text, ""))


def _apart(text: str) -> Iterator[tuple[str, str]]:
    """Ways to part a text into a name and what may be a unit at its end; the name is "" where there is none."""
    for separator in "/_ -.":
        name, _, unit = text.rpartition(separator)
        if separator in "/_" and unit.lower() in ("s", "sec"):  # rad_s, m/s: per second
            before, _, per = (name.replace(" ", separator) if separator == "/" else name).rpartition(separator)
            yield before, f"{per}/{unit}"
        yield name, unit
    if len(text) > SPELT_OUT:  # Microseconds
        yield text, text
    if camel := re.match(r"^(.*[a-z])([A-Z][A-Za-z]+)$", text):  # CurrentKG, angleDeg
        yield camel[1], camel[2]
