"""Parameters: fields of dataclasses with unit, null, bounds and scale in their metadata."""

import dataclasses
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache, partial
from typing import Any, Concatenate, ParamSpec

from fes_pin.data.errors import InputError
from fes_pin.data.schema import NumberKey, any_number
from fes_pin.models.maths import is_expression

P = ParamSpec("P")
_KEY = "fes_pin"
ROUNDING = 1e-12
"""Share of a bound by which a value may lie beyond it: sums of double precision end so near it, and no nearer."""
ANY_NUMBER = any_number("")
ROTARY = {"q": "rad", "y": "rad", "effort": "N m"}
"""Units of a revolute joint."""
SLIDING = {"q": "m", "y": "m", "effort": "N"}
"""Units of a prismatic joint."""
HELD = {"q": "m", "y": "N", "effort": "N"}
"""Units of a muscle, whose force is read."""


@dataclass(frozen=True, repr=False)
class ParameterInfo:
    """The description of a parameter: all but its value.

    Attributes
    ----------
    unit
        Unit as printed; "" for a pure number. {q}, {y} and {effort} are replaced by the rig's units: see `in_units`.
    null
        Value at which an effect vanishes; None for a nominal parameter, and for a shape parameter, which has a meaning
        only where the effect acts.
    lower, upper
        Physical bounds.
    scale
        A step that matters: the size in which a search thinks.
    grid
        Start values for a search, in order; for a shape parameter also what a screen tries.
    fitted
        False for a discrete choice, which a search enumerates and never moves.
    optional
        True for a refinement of the form: it stays at its null (or default) until data demand it.
    rigs
        The rigs on which a refinement is tried; empty for all of its effect's.
    times
        The amplitude that a shape is a factor of: what acts is linear in the amplitude and in their product.
    words
        What the sentence of a cause says of it in addition where its value is not the null; or a function of the value.
    """

    unit: str = ""
    null: float | None = None
    lower: float = -math.inf
    upper: float = math.inf
    scale: float = 1.0
    grid: tuple[float, ...] = ()
    fitted: bool = True
    optional: bool = False
    rigs: tuple[str, ...] = ()
    times: str = ""
    words: str | Callable[[float], str] = ""

    def __repr__(self) -> str:
        rotary, sliding = (self.in_units(units).unit or "a pure number" for units in (ROTARY, SLIDING))
        unit = rotary if rotary == sliding else f"{rotary} ({sliding} of a slide)"
        absent = "" if self.null is None else f", absent at {self.null:g}"
        return f"ParameterInfo: {unit} in [{self.lower:g}, {self.upper:g}]{absent}"

    def holds(self, value: float) -> bool:
        """Whether a value is within the bounds, or beyond one by no more than rounding, as a fit may end at it."""
        bound = self.nearest(value)
        return value == bound or math.isclose(value, bound, rel_tol=ROUNDING, abs_tol=ROUNDING * self.scale)

    def said(self, value: float) -> str:
        """What the sentence of a cause says of the parameter at a value other than its null."""
        return self.words(value) if callable(self.words) else self.words

    def nearest(self, value: float) -> float:
        """The value within the bounds that is nearest to one."""
        return min(max(value, self.lower), self.upper)

    def in_units(self, units: Mapping[str, str]) -> "ParameterInfo":
        """The same with the unit that it has on a rig.

        Parameters
        ----------
        units
            Of the position `q`, of the reading `y` and of the `effort`.
        """
        return dataclasses.replace(self, unit=self.unit.format_map(units)) if "{" in self.unit else self


def _field_of(about: Callable[P, ParameterInfo]) -> Callable[Concatenate[float, P], Any]:
    def parameter(default: float, *args: P.args, **attributes: P.kwargs) -> Any:
        """A dataclass field that is a parameter, by its default and the attributes of `ParameterInfo` by name."""
        return dataclasses.field(default=default, metadata={_KEY: about(*args, **attributes)})

    return parameter


parameter = _field_of(ParameterInfo)


def refinement(default: float, **attributes: Any) -> Any:
    """A parameter that is a refinement of the form: switched off at its default."""
    return parameter(default, null=default, optional=True, **attributes)


def parameters_of(thing: Any) -> dict[str, ParameterInfo]:
    """Name and description of every parameter of a dataclass or an instance of one, in order."""
    return dict(_parameters_of(thing if isinstance(thing, type) else type(thing)))


@cache
def _parameters_of(kind: type) -> dict[str, ParameterInfo]:
    return {f.name: f.metadata[_KEY] for f in dataclasses.fields(kind) if _KEY in f.metadata}


def checked_number(value: Any, name: str, key: NumberKey = ANY_NUMBER) -> float:
    """A number that somebody gave, also one of NumPy's.

    Raises
    ------
    InputError
        Not a number, not finite, or out of its bounds; names it by `name`.
    """
    return key.check(value, partial(InputError, column=name))


def check_parameters(thing: Any, keys: Mapping[str, NumberKey] | None = None) -> None:
    """Make sure that the parameters of a rig or an effect are within their bounds; expressions of CasADi may be any.

    Parameters
    ----------
    keys
        What a study may state of some of them, by name: this is as possible as what is within the bounds of a fit.

    Raises
    ------
    InputError
        For one that is not, with its name.
    """
    kind: type = type(thing)
    for name, info in _parameters_of(kind).items():
        value = getattr(thing, name)
        if (type(value) is float and info.lower <= value <= info.upper) or is_expression(value):
            continue
        number = checked_number(value, name)
        if keys and name in keys and not info.holds(number):
            checked_number(number, name, keys[name])
        elif not info.holds(number):
            raise InputError(f"expected a number from {info.lower:g} to {info.upper:g}, found {number:g}", column=name)
