"""Angles from a caller, checked; and a wanted angle as a stream of numbers, made smooth enough to be followed."""

import math
from collections.abc import Sequence
from operator import mul

import numpy as np

from fes_pin.control.dynamics import PULSE_S
from fes_pin.data.errors import InputError
from fes_pin.data.numbers import as_number, shortened

LARGEST_RAD = 2.0 * math.pi
"""An angle in rad is within a turn to either side; beyond that it is probably in degrees."""
HALF_WINDOW = 4
"""Pulses that a step is spread over, to each side: 89 ms, about two time constants of the muscle."""
LOOKAHEAD = HALF_WINDOW + 2
"""Pulses ahead that the window reads: the smoothed angle's second difference one pulse ahead needs them."""
_LENGTH = 2 * LOOKAHEAD
_BELL = np.hanning(2 * HALF_WINDOW + 3)[1:-1]
BELL: list[float] = (_BELL / _BELL.sum()).tolist()
"""Weights of the smoothing, by pulse; they add up to 1."""


def read(value: object) -> float:
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


def checked(value: object, ends: tuple[float, float], place: str = "") -> float:
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


def trajectory(reference_rad: object, ends: tuple[float, float]) -> list[float]:
    """A trajectory as plain numbers, one angle per pulse.

    Raises
    ------
    InputError
        For what is no row of angles, or an angle outside of two, with the pulse that it stands at.
    """
    if isinstance(reference_rad, np.ndarray) and reference_rad.ndim == 1:
        reference_rad = reference_rad.tolist()
    if not isinstance(reference_rad, (list, tuple)) or not len(reference_rad):
        raise InputError("reference_rad: expected a row of angles in rad, one per pulse")
    return [checked(value, ends, f", pulse {k}") for k, value in enumerate(reference_rad)]


def coming(reference_rad: object, ends: tuple[float, float]) -> tuple[list[float], bool]:
    """What a caller wants in one pulse: an angle and False, or the angles of this pulse and of at most `LOOKAHEAD` next
    ones and True.

    Raises
    ------
    InputError
        As `trajectory`.
    """
    if isinstance(reference_rad, (list, tuple)) or (isinstance(reference_rad, np.ndarray) and reference_rad.ndim):
        return trajectory(reference_rad[: LOOKAHEAD + 1], ends), True
    return [checked(reference_rad, ends)], False


class ReferenceWindow:
    """The reference from 5 pulses ago to 6 ahead.

    Parameters
    ----------
    rest_rad
        What it holds at first.
    """

    def __init__(self, rest_rad: float) -> None:
        self.values = [rest_rad] * _LENGTH

    def take(self, wanted: Sequence[float], preview: bool, lowest: float, highest: float) -> None:
        """Go on by one pulse.

        Parameters
        ----------
        wanted
            With preview: the angles of this pulse and the next ones, of which the last is held. Without: one angle,
            taken for the farthest pulse ahead.
        lowest, highest
            Angles are held between these.
        """
        values = self.values
        values.append(values[-1])
        del values[0]
        k = LOOKAHEAD - 1 if preview else _LENGTH - 1
        for value in wanted:
            values[k] = lowest if value < lowest else highest if value > highest else value
            k += 1
        values[k:] = [values[k - 1]] * (_LENGTH - k)

    def now(self) -> tuple[float, float, float, float, float, float]:
        """Angle, rate and acceleration now, then the same a pulse ahead; rad and s."""
        n = len(BELL)
        before, now, ahead, beyond = [sum(map(mul, BELL, self.values[k : k + n])) for k in range(4)]
        half, square = 0.5 / PULSE_S, 1.0 / PULSE_S**2
        this_pulse = now, half * (ahead - before), square * (ahead - 2.0 * now + before)
        return *this_pulse, ahead, half * (beyond - now), square * (beyond - 2.0 * ahead + now)
