"""Causes of a nerve in the unit of the stimulus: their classes are written for pulse widths in microseconds.

A threshold may as well sit at another amplitude. The cause then has the same name, equation and code, and parameters in
mA, by name too: `shift_us` is `shift_ma` there. Steps and bounds scale by the size of a microsecond there.
"""

import dataclasses
from functools import cache
from typing import Any, cast

import numpy as np

from fes_pin.data.channels import CHANNELS, WIDTH, Channel
from fes_pin.models.parameters import ParameterInfo, parameter
from fes_pin.models.stage import Effect, Grids, Measured

WIDEST_US = 1000.0
"""Pulse width that grids of causes are written for: the saturation of Dombre, Fournier and Coiffet, section II."""
_METHODS = ("apply", "rate", "update", "slack", "rest", "smallest")


def in_channel(kind: type[Effect], channel: Channel | None) -> type[Effect]:
    """Return the class of a cause for a stimulus; the class itself where it has no pulse widths."""
    return kind if channel in (None, WIDTH) else _in_channel(*_KEY(kind, channel))


_KEY = cast(Any, lambda *key: key)  # classes are hashable, which mypy does not see of those of dataclasses


@cache
def _in_channel(kind: Any, channel: Channel) -> Any:
    widths = {n: one for n, one in kind.parameters().items() if one.unit.split("/")[0] == "us"}
    if not widths:
        return kind
    new = {n: _renamed(n, channel) if n in widths else n for n in kind.parameters()}
    fields = [
        (new[n], float, parameter(_scaled(getattr(kind, n), n in widths, channel), **vars(_info(one, channel))))
        for n, one in kind.parameters().items()
    ]
    namespace = _namespace(kind, channel, new, widths)
    made = dataclasses.make_dataclass(kind.__name__, fields, bases=(Effect,), namespace=namespace, frozen=True)
    made.__module__ = kind.__module__  # whose constants are in its equations
    return made


def _namespace(kind: type[Effect], channel: Channel, new: dict[str, str], widths: Any) -> dict[str, Any]:
    own = {n: v for n, v in vars(kind).items() if not n.startswith("__") and not callable(v) and n not in new}
    own = {n: v for n, v in own.items() if not isinstance(v, classmethod | staticmethod | property)}

    def as_widths(self: Effect) -> Any:
        made = object.__new__(kind)
        vars(made).update({old: getattr(self, name) for old, name in new.items()}, each_trial=self.each_trial)
        return made

    def method(name: str) -> Any:
        return lambda self, *given: getattr(kind, name)(as_widths(self), *given)

    def limits(self: Effect, measured: Measured) -> Any:
        return {new[n]: pair for n, pair in kind.limits(as_widths(self), measured).items()}

    def grids(cls: type[Effect], measured: Measured) -> Grids:
        share = float(np.max(measured.get(channel.column, np.zeros(1)))) / WIDEST_US
        known = {new[n]: (n in widths, many) for n, many in kind.grids(measured).items()}
        return {n: tuple(v * share for v in many) if scales else many for n, (scales, many) in known.items()}

    words = (kind.__doc__ or "").replace("pulse width", channel.words)
    own |= {name: method(name) for name in _METHODS if name in vars(kind)}
    own |= {"limits": limits, "grids": classmethod(grids), "__doc__": words}
    name = f"{kind.__qualname__}_{channel.suffix}"
    again = (kind, channel.column)
    return {**own, "__qualname__": name, "__reduce__": lambda self: (_made, (*again, dict(vars(self))))}


def _made(kind: type[Effect], column: str, values: dict[str, Any]) -> Effect:
    return in_channel(kind, CHANNELS[column])(**values)


def _renamed(name: str, channel: Channel) -> str:
    return name.replace("_us", f"_{channel.suffix}")


def _scaled(value: float, scales: bool, channel: Channel) -> float:
    return value * channel.per_us if scales else value


def _info(one: ParameterInfo, channel: Channel) -> ParameterInfo:
    first, slash, per = one.unit.partition("/")
    if first != "us":
        return one
    size, grid = channel.per_us, tuple(v * channel.per_us for v in one.grid)
    bounds: dict[str, Any] = {"lower": one.lower * size, "upper": one.upper * size, "scale": one.scale * size}
    bounds["grid"] = grid
    return dataclasses.replace(one, unit=f"{channel.unit}{slash}{per}", **bounds)
