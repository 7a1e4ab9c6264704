"""Which goniometers see which modes, and the fewest that see them all."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np

from fes_pin.body.controllability import RELATIVE_TOLERANCE, _independent
from fes_pin.body.joints import known_joint
from fes_pin.body.linearize import LinearBody
from fes_pin.body.modes import Modes, modes
from fes_pin.data.errors import InputError


@dataclass(frozen=True)
class Observability:
    """What goniometers at some joints see.

    Parameters
    ----------
    modes, sensors
        The modes and the joints with a goniometer.
    gains
        Angle seen per degree of the mode's greatest joint: (modes, sensors).
    observable
        Whether each mode is seen (PBH).
    """

    modes: Modes = field(repr=False)
    sensors: tuple[str, ...]
    gains: np.ndarray = field(repr=False)
    observable: np.ndarray = field(repr=False)

    @property
    def weakest(self) -> float:
        """Angle that the sensors see together, per degree of the worst-seen falling mode."""
        rows = [i for i, mode in enumerate(self.modes) if mode.kind == "fall"]
        return float(np.linalg.norm(self.gains[rows], axis=1).min(initial=np.inf))

    def __str__(self) -> str:
        lines = ["goniometers: " + ", ".join(self.sensors)]
        for mode, row, seen in zip(self.modes, self.gains, self.observable, strict=True):
            lines.append(
                f"  {mode.name:66s} {'seen' if seen else 'NOT seen':9s} {np.linalg.norm(row):8.2g} deg per deg"
            )
        return "\n".join(lines)


def observability(linear: LinearBody, sensors: Iterable[str]) -> Observability:
    """Which modes goniometers at these joints see.

    Raises
    ------
    InputError
        Unknown or braced joint, or none.
    """
    found = modes(linear)
    names = tuple(known_joint(name) for name in ([sensors] if isinstance(sensors, str) else sensors))
    if not names:
        raise InputError("at least one goniometer is needed")
    for name in names:
        if name not in linear.joint_names:
            raise InputError(f"{name!r} is braced: nothing moves there")
    return _seen(linear, found, names)


def _seen(linear: LinearBody, found: Modes, names: Sequence[str]) -> Observability:
    rows = found.shapes[[linear.joint_names.index(name) for name in names]].T
    rows = rows / np.abs(found.shapes).max(axis=0)[:, None]
    rows = np.where(np.abs(rows) > RELATIVE_TOLERANCE, rows, 0.0)
    return Observability(found, tuple(names), rows, _independent(found.values, rows))


def fewest_goniometers(
    linear: LinearBody, candidates: Sequence[str] | None = None, at_least: float = 0.1
) -> tuple[Observability, ...]:
    """All smallest sets of goniometers that see every falling mode; best-seen first.

    Parameters
    ----------
    candidates
        Joints that can carry one; all that move by default.
    at_least
        Angle that the set must see, per degree of each falling mode (a goniometer has noise too).

    Raises
    ------
    InputError
        Unknown joint; or no set sees every fall.
    """
    names = tuple(linear.joint_names if candidates is None else candidates)
    whole = observability(linear, names)
    rows = [i for i, mode in enumerate(whole.modes) if mode.kind == "fall"]
    squared = whole.gains[rows] ** 2
    if not (np.all(whole.observable[rows]) and np.all(squared.sum(axis=1) >= at_least**2)):
        raise InputError(f"these joints do not see every falling mode at {at_least} degrees per degree")
    for size in range(1, len(names) + 1):
        sets = [
            _seen(linear, whole.modes, [names[i] for i in chosen])
            for chosen in itertools.combinations(range(len(names)), size)
            if np.all(squared[:, chosen].sum(axis=1) >= at_least**2)
        ]
        sets = [found for found in sets if np.all(found.observable[rows])]
        if sets:
            return tuple(sorted(sets, key=lambda found: -found.weakest))
    return ()
