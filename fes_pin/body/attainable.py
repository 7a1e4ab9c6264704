"""What constant stimulation within its bounds can hold: the posture itself, and a lean in each falling mode.

A constant input holds a lean where it balances gravity in every falling mode. Inputs that change in time catch more
(see `fes_pin.body.catchable`); what is here says what can be held for as long as the muscles last.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import numpy as np

from fes_pin.body.balance import balance as _balance
from fes_pin.body.inputs import Inputs
from fes_pin.body.linear_body import LinearBody
from fes_pin.body.modes import Mode
from fes_pin.body.programs import LinearProgram
from fes_pin.data.numbers import positive_number, truth
from fes_pin.data.tabulated import Tabulated

SETTLE_DEG = 10.0
"""How far a swinging mode may hang from the posture and still count as the posture: ours; linear models reach no
further. The answers depend on it: it is an option of the command."""


@dataclass(frozen=True)
class HoldingDemands:
    """What a constant input u must do, one row a mode, scaled so that the largest gain of a row is 1.

    Falling modes must be balanced: gains u = target (minus `load` for one degree of lean). Swinging modes may settle
    anywhere within `SETTLE_DEG` of the posture: settle_low <= settle_gains u <= settle_high. Neutral modes are let
    drift. Each foot's centre of pressure lies on its sole: ground_gains u <= ground_room (minus `ground_load` for one
    degree).
    """

    falling: tuple[Mode, ...]
    gains: np.ndarray
    target: np.ndarray
    load: np.ndarray
    settle_gains: np.ndarray
    settle_low: np.ndarray
    settle_high: np.ndarray
    ground_gains: np.ndarray
    ground_room: np.ndarray
    ground_load: np.ndarray
    inputs: Inputs

    def program(self, i: int = 0, degrees: float = 0.0) -> LinearProgram:
        """The inputs that meet the demands when falling mode i leans by so many degrees; their cost is nothing."""
        target, room = self.target.copy(), self.ground_room.copy()
        if degrees:
            target[i] -= self.load[i] * degrees
            room -= self.ground_load[:, i] * degrees
        return LinearProgram(
            cost=np.zeros(self.inputs.n),
            A_ub=np.vstack([self.settle_gains, -self.settle_gains, self.ground_gains]),
            b_ub=np.concatenate([self.settle_high, -self.settle_low, room]),
            A_eq=self.gains,
            b_eq=target,
            lower=self.inputs.lower,
            upper=self.inputs.upper,
        )


def demands(
    linear: LinearBody,
    inputs: Inputs,
    gravity: bool = True,
    settle_deg: float = SETTLE_DEG,
    balance: bool = True,
) -> HoldingDemands:
    """The demands of a posture on a set of inputs.

    Parameters
    ----------
    gravity
        Whether the posture's weight (C) must be carried; otherwise only deviations count.
    settle_deg
        See `SETTLE_DEG`; infinite: swinging modes are ignored.
    balance
        Whether each foot's centre of pressure must lie on its sole; without gravity there is none to ask for.

    Raises
    ------
    InputError
        `settle_deg` is not positive.
    """
    settle_deg = positive_number(settle_deg, "settle_deg", infinite=True)
    found = linear.modes()
    kinds, degree = found.kinds, found.degree
    gains = found.shapes.T @ inputs.on(linear)
    constant = found.shapes.T @ linear.C * truth(gravity, "gravity")
    size = np.abs(gains).max(axis=1, initial=0.0)
    size = np.where(size > 1e-12, size, 1.0)
    fall, hang = kinds == "fall", kinds == "swing"
    swing = hang & np.isfinite(settle_deg)
    room = -found.values * degree * (settle_deg if np.isfinite(settle_deg) else 0.0)
    ground = _balance(linear, found) if truth(balance, "balance") and gravity else None
    rows = np.zeros((0, len(found))) if ground is None else ground.at_rest
    shares = np.zeros((0, linear.n)) if ground is None else ground.per_torque
    hanging = rows[:, hang] / -found.values[hang]  # a swing hangs at F / -mu
    torques = hanging @ found.shapes[:, hang].T + shares
    return HoldingDemands(
        falling=found.falling,
        gains=gains[fall] / size[fall, None],
        target=-constant[fall] / size[fall],
        load=(found.values * degree)[fall] / size[fall],
        settle_gains=gains[swing] / size[swing, None],
        settle_low=(-constant - room)[swing] / size[swing],
        settle_high=(-constant + room)[swing] / size[swing],
        ground_gains=torques @ inputs.on(linear),
        ground_room=np.zeros(0) if ground is None else -ground.constant - torques @ linear.C,
        ground_load=rows[:, fall] * degree[fall],
        inputs=inputs,
    )


@dataclass(frozen=True, eq=False)
class Leans(Tabulated):
    """Base of what inputs can do with leans, one row a falling mode.

    Parameters
    ----------
    falling
        The falling modes.
    lean_deg
        Greatest lean in each mode, degrees of the mode's greatest joint, in the positive and in the negative direction
        of the shape; (k, 2). NaN where not even the posture is kept.
    error_deg
        By how much rounding and the solver's tolerances may have moved each of them; (k, 2).
    """

    falling: tuple[Mode, ...] = field(repr=False)
    lean_deg: np.ndarray
    error_deg: np.ndarray = field(repr=False)

    _index = "mode"
    _able: ClassVar[str]
    """The field that says whether the posture itself is kept."""

    def _table(self) -> dict[str, Any]:
        names = [mode.name for mode in self.falling]
        return {
            "mode": names,
            "positive_deg": self.lean_deg[:, 0].tolist(),
            "negative_deg": self.lean_deg[:, 1].tolist(),
        }

    @property
    def least_lean_deg(self) -> float:
        """The smallest of the leans, 0 where the posture cannot be held, infinite where nothing falls."""
        least = float(np.nan_to_num(self.lean_deg, nan=0.0, posinf=np.inf).min(initial=np.inf))
        return least if getattr(self, self._able) else 0.0


@dataclass(frozen=True, eq=False)
class HeldLeans(Leans):
    """What inputs within their bounds can hold; see `Leans`.

    Each lean is the greatest, with every other fall balanced, that inputs can still hold against gravity. No constant
    input holds a greater one; inputs that change in time may catch it (`fes_pin.body.catchable`).

    Parameters
    ----------
    holds
        Whether some constant input balances gravity in every falling mode at once while the others settle near the
        posture.
    effort
        That input with the least greatest share of its bounds: by name; empty if it does not hold.
    """

    holds: bool
    effort: Mapping[str, float]

    _able = "holds"

    def __str__(self) -> str:
        if not self.holds:
            return "the posture cannot be held by these inputs, stimulated constantly"
        lines = ["the posture can be held; greatest lean that constant stimulation holds, degrees one way / the other:"]
        for mode, (one, other) in zip(self.falling, self.lean_deg, strict=True):
            lines.append(f"  {mode.name:80s} {lean_text(one):>5s} / {lean_text(other)}")
        return "\n".join(lines)


def lean_text(degrees: float) -> str:
    """A lean for a person: beyond 45 degrees a linear model says nothing."""
    return "> 45" if degrees > 45.0 else f"{degrees:.1f}"


def attainable(
    linear: LinearBody,
    inputs,
    gravity: bool = True,
    settle_deg: float = SETTLE_DEG,
    balance: bool = True,
) -> HeldLeans:
    """What constant inputs can hold, by linear programs.

    Parameters
    ----------
    linear
        From `linearize`, with or without braces.
    inputs
        `Inputs`, `Nerves`, or names of joints.
    gravity, settle_deg, balance
        As `demands` takes them.

    Raises
    ------
    InputError
        Inputs that are none; `settle_deg` is not positive.
    """
    inputs = Inputs.of(inputs, linear)
    wanted = demands(linear, inputs, gravity, settle_deg, balance)
    effort = _least_effort(wanted)
    leans, errors = greatest_leans(wanted.program(), wanted.program, len(wanted.falling), effort is not None)
    named = {} if effort is None else dict(zip(inputs.names, effort.tolist(), strict=True))
    return HeldLeans(wanted.falling, leans, errors, effort is not None, named)


def greatest_leans(
    upright: LinearProgram, leant: Callable[[int, float], LinearProgram], count: int, able: bool
) -> tuple[np.ndarray, np.ndarray]:
    """Greatest lean in each falling mode, both ways, and its error, degrees: (count, 2) each; NaN where none is `able`.

    Parameters
    ----------
    upright, leant
        The program of the posture, and that of a mode that leans by so many degrees.
    """
    leans, errors = np.full((count, 2), np.nan), np.zeros((count, 2))
    for i, way in np.ndindex(leans.shape) if able else ():
        leans[i, way], errors[i, way] = upright.towards(leant(i, 1.0 - 2.0 * way)).solve().greatest
    return leans, errors


def _least_effort(wanted: HoldingDemands) -> np.ndarray | None:
    """The input that holds the posture with the least greatest share of its bounds; None if none does."""
    held, eye = wanted.program(), np.eye(wanted.inputs.n)
    span = np.where(np.isfinite(wanted.inputs.upper), wanted.inputs.upper, 1.0)
    share = np.block([[eye, -span[:, None]], [-eye, -span[:, None]]])
    most = held.widened([1.0], np.zeros(len(held.b_ub)), np.zeros(len(held.b_eq)))
    limited = replace(most, A_ub=np.vstack([most.A_ub, share]), b_ub=np.append(most.b_ub, np.zeros(len(share))))
    found = limited.solve()
    return None if found.x is None else found.x[:-1]
