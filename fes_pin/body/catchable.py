"""Null-controllable region of the linear body under bounded inputs that change in time.

The starts that bounded inputs can catch are a convex set: the growing parts of the falling modes that an integral of
bounded inputs meets (T. Hu, Z. Lin, L. Qiu, "Stabilization of exponentially unstable linear systems with saturating
actuators", IEEE Trans. Autom. Control 46:973-979, 2001). For one falling mode alone it is exact in closed form, -max F
< mu z < -min F (`modal_bound`); with several, which the same inputs must catch together, within limits on every mode
and on the centre of pressure, it is a linear program over inputs that are held between pulses (`catchable`). What no
plan catches beyond the modal bound is lost to any stimulation; between the two a finer plan may do more.
"""

from dataclasses import dataclass

import numpy as np

from fes_pin.body.attainable import Leans, greatest_leans, lean_text
from fes_pin.body.inputs import Inputs
from fes_pin.body.linear_body import LinearBody
from fes_pin.body.plans import SETTLE_DEG, Plans
from fes_pin.data.errors import InputError
from fes_pin.data.numbers import number, positive_number, truth


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
