"""Leans that bounded inputs hold or catch, in each falling mode: by constant stimulation, and in time.

A constant input holds the posture itself, and a lean where it balances gravity in every falling mode, for as long as
the muscles last (`attainable`). Inputs that change in time catch more: the null-controllable region of the linear body.

The starts that bounded inputs can catch are a convex set: the growing parts of the falling modes that an integral of
bounded inputs meets (T. Hu, Z. Lin, L. Qiu, "Stabilization of exponentially unstable linear systems with saturating
actuators", IEEE Trans. Autom. Control 46:973-979, 2001). For one falling mode alone it is exact in closed form, -max F
< mu z < -min F (`modal_bound`); with several, which the same inputs must catch together, within limits on every mode
and on the centre of pressure, it is a linear program over inputs that are held between pulses (`catchable`). What no
plan catches beyond the modal bound is lost to any stimulation; between the two a finer plan may do more.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import numpy as np

from fes_pin.body.inputs import Inputs
from fes_pin.body.linear_body import LinearBody
from fes_pin.body.modes import Mode
from fes_pin.body.plans import SETTLE_DEG, Plans
from fes_pin.data.errors import InputError
from fes_pin.data.numbers import number, positive_number, truth
from fes_pin.data.show import Tabulated


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
        positive, negative = self.lean_deg.T.tolist()
        return {"mode": [mode.name for mode in self.falling], "positive_deg": positive, "negative_deg": negative}

    @property
    def least_lean_deg(self) -> float:
        """The smallest of the leans, 0 where the posture cannot be held, infinite where nothing falls."""
        least = float(np.nan_to_num(self.lean_deg, nan=0.0, posinf=np.inf).min(initial=np.inf))
        return least if getattr(self, self._able) else 0.0


@dataclass(frozen=True, eq=False)
class HeldLeans(Leans):
    """Return the leans that inputs within their bounds can hold; see `Leans`.

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
    linear: LinearBody, inputs, gravity: bool = True, settle_deg: float = SETTLE_DEG, balance: bool = True
) -> HeldLeans:
    """Return the leans that constant inputs can hold, by linear programs.

    Parameters
    ----------
    linear
        From `linearize`, with or without braces.
    inputs
        `Inputs`, `Nerves`, or names of joints.
    gravity
        Whether the posture's weight (C) must be carried; otherwise only deviations count.
    settle_deg
        How far from the posture swinging modes may settle; infinite: they are ignored. Neutral modes are let drift.
    balance
        Whether each foot's centre of pressure must lie on its sole; without gravity there is none to ask for.

    Raises
    ------
    InputError
        Inputs that are none; `settle_deg` is not positive.
    """
    inputs, settle_deg = Inputs.of(inputs, linear), positive_number(settle_deg, "settle_deg", infinite=True)
    plans = Plans.held(linear, inputs, settle_deg, truth(balance, "balance"), truth(gravity, "gravity"))
    leans, errors, holds = greatest_leans(plans)
    effort = _least_effort(plans) if holds else None
    named = {} if effort is None else dict(zip(inputs.names, effort.tolist(), strict=True))
    return HeldLeans(plans.modes.falling, leans, errors, effort is not None, named)


def greatest_leans(plans: Plans) -> tuple[np.ndarray, np.ndarray, bool]:
    """Greatest lean in each falling mode, both ways, and its error, degrees, (k, 2) each; and whether the posture
    itself is kept: if it is not, leans are NaN.
    """
    still, falls = np.zeros(len(plans.modes)), plans.leans
    upright = plans.program(still, still)
    able = upright.solve().x is not None
    leans, errors = np.full((len(falls), 2), np.nan), np.zeros((len(falls), 2))
    for i, way in np.ndindex(leans.shape) if able else ():
        leant = plans.program((1.0 - 2.0 * way) * falls[i], still)
        leans[i, way], errors[i, way] = upright.towards(leant).solve().greatest
    return leans, errors, able


def _least_effort(plans: Plans) -> np.ndarray | None:
    """The input that holds the posture with the least greatest share of its bounds; None if none does."""
    still, n = np.zeros(len(plans.modes)), plans.inputs.n
    held, eye = plans.program(still, still), np.eye(n)
    span = np.where(np.isfinite(plans.inputs.upper), plans.inputs.upper, 1.0)
    share = np.block([[eye, -span[:, None]], [-eye, -span[:, None]]])
    most = held.widened([1.0], np.zeros(len(held.b_ub)), np.zeros(len(held.b_eq)))
    limited = replace(most, A_ub=np.vstack([most.A_ub, share]), b_ub=np.append(most.b_ub, np.zeros(len(share))))
    found = limited.solve()
    return None if found.x is None else found.x[:-1]


@dataclass(frozen=True, eq=False)
class CaughtLeans(Leans):
    """From which leans at rest inputs within their bounds can bring the body to rest again; see `Leans`.

    Each lean is the greatest, the other modes upright, that a plan catches.

    Parameters
    ----------
    rests
        Whether there is any rest within the limits that constant inputs keep.
    bound_deg
        What no stimulation of these inputs catches, whatever its course (`modal_bound`); (k, 2).
    """

    rests: bool
    bound_deg: np.ndarray

    _able = "rests"

    def __str__(self) -> str:
        if not self.rests:
            return "the body cannot be brought to rest near the posture by these inputs"
        lines = ["greatest lean that stimulation over time catches, degrees one way / the other (no course: beyond):"]
        for mode, lean, bound in zip(self.falling, self.lean_deg, self.bound_deg, strict=True):
            caught = " / ".join(f"{lean_text(x):>5s}" for x in np.nan_to_num(lean))
            lines.append(f"  {mode.name:80s} {caught}  ({' / '.join(lean_text(x) for x in bound)})")
        return "\n".join(lines)


def modal_bound(linear: LinearBody, inputs, gravity: bool = True) -> np.ndarray:
    """Leans at rest beyond which no stimulation of these inputs catches a falling mode, were it the only one.

    Parameters
    ----------
    linear
        From `linearize`, at rest.
    inputs
        `Inputs`, `Nerves`, or names of joints.
    gravity
        Whether the posture's weight counts.

    Returns
    -------
    bound
        Degrees of the mode's greatest joint, in the positive and in the negative direction of the shape; (k, 2).

    Raises
    ------
    InputError
        Inputs that are none.
    """
    inputs = Inputs.of(inputs, linear)
    found = linear.modes()
    fall = found.kinds == "fall"
    shapes, values = found.shapes[:, fall], found.values[fall]
    gains, constant = shapes.T @ inputs.on(linear), shapes.T @ linear.C * gravity
    least, most = (constant + push.sum(axis=1) for push in inputs.pushes(gains))
    share = np.maximum(np.column_stack([-least, most]), 0.0) / values[:, None]
    return share / found.degree[fall, None]


def catchable(
    linear: LinearBody,
    inputs,
    settle_deg: float = SETTLE_DEG,
    balance: bool = True,
    rest_deg: float | None = None,
    gravity: bool = True,
) -> CaughtLeans:
    """From which leans inputs that change in time bring the body to rest, by linear programs over a horizon.

    Parameters
    ----------
    linear
        From `linearize`, at rest and without damping.
    inputs
        `Inputs`, `Nerves`, or names of joints.
    settle_deg
        No mode goes further than this from the posture, on the way and at rest.
    balance
        Whether each foot's centre of pressure must lie on its sole, at all times.
    rest_deg
        How far from the posture falling modes may come to rest; `settle_deg` by default, 0 for the posture itself.
    gravity
        Whether the posture's weight must be carried; otherwise only deviations count.

    Raises
    ------
    InputError
        Inputs that are none; `settle_deg` not positive and finite; damping or motion.
    """
    inputs = Inputs.of(inputs, linear)
    plans = plans_of(linear, inputs, settle_deg, balance, rest_deg, gravity)
    leans, errors, rests = greatest_leans(plans)
    return CaughtLeans(plans.modes.falling, leans, errors, rests, modal_bound(linear, inputs, gravity=gravity))


def plans_of(
    linear: LinearBody,
    inputs: Inputs,
    settle_deg: float,
    balance: bool = True,
    rest_deg: float | None = None,
    gravity: bool = True,
) -> Plans:
    """The plans of a body's inputs, after a look at what is given.

    Raises
    ------
    InputError
        `settle_deg` not positive and finite, `rest_deg` negative; damping or motion.
    """
    if not linear.conservative:
        raise InputError("what inputs catch is asked of a body at rest without damping")
    if rest_deg is not None and number(rest_deg, "rest_deg") < 0.0:
        raise InputError(f"must not be negative, got {rest_deg}", column="rest_deg")
    balance, gravity = truth(balance, "balance"), truth(gravity, "gravity")
    return Plans(linear, inputs, positive_number(settle_deg, "settle_deg"), balance, rest_deg, gravity)
