"""What bounded inputs can hold: the posture itself, and a lean in each falling mode."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy import optimize

from fes_pin.body.inputs import Inputs
from fes_pin.body.linearize import LinearBody
from fes_pin.body.modes import Mode, modes
from fes_pin.data.errors import InputError

SETTLE_DEG = 10.0
"""How far a swinging mode may hang from the posture and still count as the posture: ours; linear models reach no
further."""


@dataclass(frozen=True)
class Demands:
    """What an input must do, one row a mode, scaled so that the largest gain of a row is 1.

    Falling modes must be balanced: gains u = target (minus `load` for one degree of lean). Swinging modes may settle
    anywhere within `SETTLE_DEG` of the posture: settle_low <= settle_gains u <= settle_high. Neutral modes are let
    drift.
    """

    falling: tuple[Mode, ...]
    gains: np.ndarray
    target: np.ndarray
    load: np.ndarray
    settle_gains: np.ndarray
    settle_low: np.ndarray
    settle_high: np.ndarray

    def leaning(self, i: int, degrees: float) -> np.ndarray:
        """Target of the falling modes when mode i leans by so many degrees, (k,)."""
        target = self.target.copy()
        target[i] -= self.load[i] * degrees
        return target


def demands(linear: LinearBody, inputs: Inputs, gravity: bool = True, settle_deg: float = SETTLE_DEG) -> Demands:
    """The demands of a posture on a set of inputs.

    Parameters
    ----------
    gravity
        Whether the posture's weight (C) must be carried; otherwise only deviations count.
    settle_deg
        See `SETTLE_DEG`; infinite: swinging modes are ignored.

    Raises
    ------
    InputError
        `settle_deg` is not positive.
    """
    if not settle_deg > 0.0:
        raise InputError(f"must be positive, got {settle_deg}", column="settle_deg")
    found = modes(linear)
    kinds = np.array([mode.kind for mode in found])
    degree = np.radians(1.0) / np.abs(found.shapes).max(axis=0)
    gains = found.shapes.T @ inputs.on(linear)
    constant = found.shapes.T @ linear.C * gravity
    size = np.abs(gains).max(axis=1, initial=0.0)
    size = np.where(size > 1e-12, size, 1.0)
    fall, swing = kinds == "fall", (kinds == "swing") & np.isfinite(settle_deg)
    room = -found.values * degree * settle_deg
    return Demands(
        falling=found.falling,
        gains=gains[fall] / size[fall, None],
        target=-constant[fall] / size[fall],
        load=(found.values * degree)[fall] / size[fall],
        settle_gains=gains[swing] / size[swing, None],
        settle_low=(-constant - room)[swing] / size[swing],
        settle_high=(-constant + room)[swing] / size[swing],
    )


@dataclass(frozen=True)
class Attainable:
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
        of the mode's greatest joint, in the positive and in the negative direction of the shape; (k, 2). From a
        greater lean at rest the body is lost. NaN where the posture cannot be held at all.
    """

    falling: tuple[Mode, ...] = field(repr=False)
    holds: bool
    effort: dict[str, float]
    lean_deg: np.ndarray

    @property
    def least_lean_deg(self) -> float:
        """The smallest of the leans, 0 where the posture cannot be held, infinite where nothing falls."""
        return float(np.nan_to_num(self.lean_deg, nan=0.0, posinf=np.inf).min(initial=np.inf)) if self.holds else 0.0

    def __str__(self) -> str:
        if not self.holds:
            return "the posture cannot be held by these inputs"
        lines = ["the posture can be held; greatest lean before it is lost, degrees one way / the other:"]
        for mode, (one, other) in zip(self.falling, self.lean_deg, strict=True):
            lines.append(f"  {mode.name:80s} {lean_text(one):>5s} / {lean_text(other)}")
        return "\n".join(lines)


def lean_text(degrees: float) -> str:
    """A lean for a person: beyond 45 degrees a linear model says nothing."""
    return "> 45" if degrees > 45.0 else f"{degrees:.1f}"


def attainable(linear: LinearBody, inputs, gravity: bool = True, settle_deg: float = SETTLE_DEG) -> Attainable:
    """What inputs can hold, by linear programs.

    Parameters
    ----------
    linear
        From `linearize`, with or without braces.
    inputs
        `Inputs`, `Nerves`, or names of joints.
    gravity, settle_deg
        As `demands` takes them.

    Raises
    ------
    InputError
        Inputs that are none.
    """
    inputs = Inputs.of(inputs, linear)
    wanted = demands(linear, inputs, gravity, settle_deg)
    effort = _least_effort(wanted, inputs)
    leans = np.full((len(wanted.falling), 2), np.nan)
    if effort is not None:
        for i in range(len(wanted.falling)):
            leans[i] = [_greatest_lean(wanted, inputs, i, sign) for sign in (1.0, -1.0)]
    named = {} if effort is None else dict(zip(inputs.names, effort.tolist(), strict=True))
    return Attainable(wanted.falling, effort is not None, named, leans)


def _solve(wanted: Demands, inputs: Inputs, cost: np.ndarray, extra: np.ndarray, more_rows: np.ndarray | None = None):
    """Linear program over (u, s): balance with s times `extra` in it; cost and further rows <= 0 given."""
    rows = [np.column_stack([sign * wanted.settle_gains, np.zeros(len(wanted.settle_gains))]) for sign in (1.0, -1.0)]
    limits = [wanted.settle_high, -wanted.settle_low]
    if more_rows is not None:
        rows.append(more_rows)
        limits.append(np.zeros(len(more_rows)))
    return optimize.linprog(
        cost,
        A_ub=np.vstack(rows),
        b_ub=np.concatenate(limits),
        A_eq=np.column_stack([wanted.gains, extra]) if len(extra) else None,
        b_eq=wanted.target if len(extra) else None,
        bounds=[*zip(inputs.lower, inputs.upper, strict=True), (0.0, None)],
    )


def _least_effort(wanted: Demands, inputs: Inputs) -> np.ndarray | None:
    span = np.where(np.isfinite(inputs.upper), inputs.upper, 1.0)
    eye = np.eye(inputs.n)
    share = np.block([[eye, -span[:, None]], [-eye, -span[:, None]]])
    found = _solve(wanted, inputs, np.append(np.zeros(inputs.n), 1.0), np.zeros(len(wanted.target)), share)
    return found.x[:-1] if found.status == 0 else None


def _greatest_lean(wanted: Demands, inputs: Inputs, i: int, sign: float) -> float:
    """Degrees of lean in mode i that can be held: mu eta + phi'(C + Q u) = 0 there, balance elsewhere."""
    push = np.zeros(len(wanted.target))
    push[i] = sign * wanted.load[i]
    found = _solve(wanted, inputs, np.append(np.zeros(inputs.n), -1.0), push)
    if found.status == 3:
        return np.inf
    return max(0.0, float(found.x[-1])) if found.status == 0 else np.nan
