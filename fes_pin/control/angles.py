"""Checks of angles from a caller, with one line that says what was expected."""

import math

from fes_pin.data.errors import InputError
from fes_pin.data.numbers import as_number, shortened

LARGEST_RAD = 2.0 * math.pi
"""An angle in rad is within a turn to either side; beyond that it is probably in degrees."""


def reading(value: object) -> float:
    """A sensor's reading as a float; NaN where there is none.

    Raises
    ------
    InputError
        For what is neither a number nor None.
    """
    found = math.nan if value is None else as_number(value)
    if found is None:
        raise InputError(f"angle_rad: expected one number in rad, or None for no reading, found {shortened(value)}")
    return found


def reference(value: object, ends: tuple[float, float], place: str = "") -> float:
    """A wanted angle as a float.

    Raises
    ------
    InputError
        For what is no number, not finite, or outside of two angles in rad.
    """
    found = value if type(value) is float else as_number(value)
    if found is None or not ends[0] <= found <= ends[1]:
        expected = f"reference_rad{place}: expected {ends[0]:g} to {ends[1]:g} rad"
        raise InputError(f"{expected}, found {shortened(value)}{hint(found)}")
    return found


def hint(angle: float | None) -> str:
    """A few words where a number can hardly be rad."""
    return " (degrees?)" if angle is not None and LARGEST_RAD < abs(angle) <= 360.0 else ""
