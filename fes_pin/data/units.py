"""Units that recordings come in, and what they are in the study format's own.

A table and no units library: a study holds a dozen quantities, every factor of `units.csv` is exact by definition, and
headers write units as no library reads them: `Torque_Nm` is a newton metre, which a units library takes for a
nanometre.
"""

import re
from collections.abc import Callable, Mapping
from itertools import groupby
from operator import itemgetter
from pathlib import Path

from fes_pin.data.schema import without_unit
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

_BY_SUFFIX = {"s": "time", "us": "pulse width", "rad": "angle", "m": "length", "n": "force", "nm": "torque"}
_BY_SUFFIX |= {"ma": "current", "uc": "charge", "hz": "frequency"}
_OF_A_JOINT = {"position": ("angle", "length"), "velocity": ("angular rate", "speed"), "effort": ("torque", "force")}


def _plain(unit: str) -> str:
    """A unit without what writers vary: case, spaces, dots, signs of multiplication."""
    text = unit.strip().replace("µ", "u").replace("μ", "u").replace("°", "deg").replace("º", "deg").lower()
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


def unit_in_name(name: str, column: str, revolute: bool | None = None) -> str:
    """The unit in brackets behind a name, where it is one of the quantity of a rig's column; "" where there is none."""
    found = _BRACKETED.match(name.strip())
    known = known_unit(found["unit"], quantities_of(column, revolute)) if found and found["unit"] else None
    return known[1] if known else ""


def own_unit(column: str, revolute: bool | None = None) -> str:
    """The unit that the study format has in a column; "" where it has none."""
    units = [next(iter(UNITS[q])) for q in quantities_of(column, revolute)]
    return " or ".join(u for u in units if u != "1")


_CAPITALS = re.compile(r"^(?P<name>.*[a-z])(?P<unit>[A-Z]{2,})$")
"""A unit in capitals behind a word: `ForceKG`."""
_LETTERS = ("a",)
"""Units that in a name are letters, as those of channels, but for behind a stroke: `force_a`, `I/A`."""
_BRACKETED = re.compile(r"^(?P<name>.*?)\s*[\[(<{]\s*(?P<unit>[^\])>}]*?)\s*[\])>}]\s*$")


def split_header(header: str) -> tuple[str, str]:
    """Name and unit that a header seems to hold: `Angle_deg`, `Torque [Nm]`, `t/ms`, `Winkel (°)`.

    Returns
    -------
    (name, unit)
        The unit is empty where the header names none that is known.
    """
    text = header.strip().strip("\"'")
    found = _BRACKETED.match(text)
    if found and found["unit"]:
        return found["name"].strip(), found["unit"]
    for separator in ("/", "_", " ", "-", "."):
        name, at, unit = text.rpartition(separator)
        if separator == "_" and at and "_" in name and unit.lower() in ("s",):  # rad_s, m_s: per second
            before, _, per = name.rpartition("_")
            if before and known_unit(f"{per}/{unit}", tuple(UNITS)):
                return before, f"{per}/{unit}"
        if at and name and known_unit(unit, tuple(UNITS)) and (separator == "/" or unit.lower() not in _LETTERS):
            return name.strip(), unit
    if len(text) > len("hertz") and known_unit(text, tuple(UNITS)):  # a unit written out: `MilliAmpere`
        return text, text
    found = _CAPITALS.match(text)
    if found and known_unit(found["unit"], tuple(UNITS)):
        return found["name"], found["unit"]
    return text, ""
