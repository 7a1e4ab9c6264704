"""What constant stimulation within its bounds can hold: the posture itself, and a lean in each falling mode.

A constant input holds a lean where it balances gravity in every falling mode. Inputs that change in time catch more
(see `fes_pin.body.catchable`); what is here says what can be held for as long as the muscles last.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from fes_pin.body.balance import balance as _balance
from fes_pin.body.inputs import Inputs
from fes_pin.body.linear_body import LinearBody
from fes_pin.body.modes import Mode
from fes_pin.body.programs import LinearProgram, ProgramAnswer
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

    @property
    def limits(self) -> np.ndarray:
        """Rows of the inequalities: settling both ways, then the ground."""
        return np.vstack([self.settle_gains, -self.settle_gains, self.ground_gains])

    def case(self, i: int = 0, degrees: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
        """Target of the falling modes, (k,), and limits of the inequalities when mode i leans by so many degrees."""
        target, room = self.target.copy(), self.ground_room.copy()
        if degrees:
            target[i] -= self.load[i] * degrees
            room -= self.ground_load[:, i] * degrees
        return target, np.concatenate([self.settle_high, -self.settle_low, room])


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
    )


class Leans(Tabulated):
    """Base of what inputs can do with leans, one row a falling mode."""

    falling: tuple[Mode, ...]
    lean_deg: np.ndarray

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
    """What inputs within their bounds can hold.

    Parameters
    ----------
    falling
        The falling modes.
    holds
        Whether some constant input balances gravity in every falling mode at once while the others settle near the
        posture.
    effort
        That input with the least greatest share of its bounds: by name; empty if it does not hold.
    lean_deg
        Greatest lean in each mode, with every other fall balanced, that inputs can still hold against gravity: degrees
        of the mode's greatest joint, in the positive and in the negative direction of the shape; (k, 2). NaN where the
        posture cannot be held at all. No constant input holds a greater lean; inputs that change in time may catch it
        (`fes_pin.body.catchable`).
    error_deg
        By how much rounding and the solver's tolerances may have moved each of them; (k, 2).
    """

    falling: tuple[Mode, ...] = field(repr=False)
    holds: bool
    effort: Mapping[str, float]
    lean_deg: np.ndarray
    error_deg: np.ndarray = field(repr=False)

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
    effort = _least_effort(wanted, inputs)
    leans = np.full((len(wanted.falling), 2), np.nan)
    errors = np.zeros_like(leans)
    if effort is not None:
        for i in range(len(wanted.falling)):
            for way, sign in enumerate((1.0, -1.0)):
                leans[i, way], errors[i, way] = _greatest_lean(wanted, inputs, i, sign)
    named = {} if effort is None else dict(zip(inputs.names, effort.tolist(), strict=True))
    return HeldLeans(wanted.falling, effort is not None, named, leans, errors)


def _solve(
    wanted: HoldingDemands,
    inputs: Inputs,
    cost: np.ndarray,
    balance: np.ndarray,
    limit: np.ndarray,
    further: np.ndarray,
) -> ProgramAnswer:
    """Linear program over (u, s): the posture's demands with s times two columns in them; further rows <= 0."""
    target, room = wanted.case()
    return LinearProgram(
        cost=cost,
        A_ub=np.vstack([np.column_stack([wanted.limits, limit]), further]),
        b_ub=np.concatenate([room, np.zeros(len(further))]),
        A_eq=np.column_stack([wanted.gains, balance]),
        b_eq=target,
        lower=np.append(inputs.lower, 0.0),
        upper=np.append(inputs.upper, np.inf),
    ).solve()


def _least_effort(wanted: HoldingDemands, inputs: Inputs) -> np.ndarray | None:
    span = np.where(np.isfinite(inputs.upper), inputs.upper, 1.0)
    eye = np.eye(inputs.n)
    share = np.block([[eye, -span[:, None]], [-eye, -span[:, None]]])
    cost = np.append(np.zeros(inputs.n), 1.0)
    nothing = np.zeros(len(wanted.target)), np.zeros(len(wanted.limits))
    found = _solve(wanted, inputs, cost, *nothing, share)
    return None if found.x is None else found.x[:-1]


def _greatest_lean(wanted: HoldingDemands, inputs: Inputs, i: int, sign: float) -> tuple[float, float]:
    """Degrees of lean in mode i that can be held, and their error: mu eta + phi'(C + Q u) = 0 in every falling mode."""
    push = np.zeros(len(wanted.target))
    push[i] = sign * wanted.load[i]
    tilt = np.concatenate([np.zeros(2 * len(wanted.settle_gains)), sign * wanted.ground_load[:, i]])
    cost = np.append(np.zeros(inputs.n), -1.0)
    lean, error = _solve(wanted, inputs, cost, push, tilt, np.zeros((0, inputs.n + 1))).greatest
    return (lean if np.isnan(lean) else max(0.0, lean)), error
