"""From wanted joint torques to recruitments and pulse widths, in one call."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

from fes_pin.allocation.allocation import Allocation
from fes_pin.allocation.allocator import Allocator
from fes_pin.data.read_only import key_of


def allocate(
    torque: Any, nerves: Any, q: Any = None, previous: Any = None, *, solver: str = "daqp", **options: Any
) -> Allocation:
    """Pulse widths for a wanted joint torque.

    Parameters
    ----------
    torque
        Wanted joint torque, N m, by joint name (absent: 0). An array without names, (joints,), is in the order of
        `nerves.joints`, which is no body's.
    nerves, q
        `Nerves` and the posture by joint name, rad; or torque at full recruitment, N m (see `Allocator`).
    previous
        Recruitments in force until now, 0 to 1, by channel or (n,), for `rate` and `change`; 0 by default, whatever was
        asked before.
    solver
        See `Allocator.__call__`.
    options
        See `fes_pin.allocation.problem.Options`.

    Raises
    ------
    InputError
        Bad input of any kind, in one line.

    Examples
    --------
    >>> from fes_pin.muscles.nerves import Nerves
    >>> print(allocate({"left_ankle_dorsiflexion": -400.0}, Nerves(["left_tibial"])))
    """
    program = allocator_for(nerves, q, options)
    return program(torque, program.at_rest if previous is None else previous, solver=solver)


@dataclass(frozen=True, slots=True)
class Asked:
    """Moment arms and options, equal where their values are."""

    key: Any
    nerves: Any = field(compare=False)
    q: Any = field(compare=False)
    options: Any = field(compare=False)


def allocator_for(nerves: Any, q: Any, options: Mapping[str, Any]) -> Allocator:
    """The program for these moment arms and options, made only if it is not among the recent ones."""
    asked = Asked(key_of((nerves, q, options)), nerves, q, options)
    try:
        hash(asked)
    except TypeError:
        return Allocator(nerves, q, **options)
    return recent(asked)


@lru_cache(maxsize=16)
def recent(asked: Asked) -> Allocator:
    """The last programs, so that the next torque of the same kind need not set them up."""
    return Allocator(asked.nerves, asked.q, **asked.options)
