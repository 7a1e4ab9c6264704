"""Whether the feet carry a linearized body: the centre of pressure as inequalities of its modes, and in words."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from fes_pin.body.gait import STILL
from fes_pin.body.ground import Support, Wrench, centre_of_pressure, ground_wrench, support
from fes_pin.body.joints import SIDES
from fes_pin.body.linear_body import LinearBody
from fes_pin.body.linearize import model_on_slope
from fes_pin.body.modes import Modes


@dataclass(frozen=True)
class Balance:
    """The centre of pressure stays on the soles as long as constant + per_mode eta + per_force F <= 0.

    Rows are divided by the weight: about how far, m, the centre of pressure lies outside an edge of the soles.

    Parameters
    ----------
    constant
        At rest in the posture: (e,).
    per_mode, per_force
        Per modal coordinate eta and per modal force F = phi' (C + D), with eta'' = mu eta + F: (e, r).
    at_rest
        Per modal coordinate of a body that rests there, away from the posture: (e, r).
    """

    constant: np.ndarray
    per_mode: np.ndarray = field(repr=False)
    per_force: np.ndarray = field(repr=False)
    at_rest: np.ndarray = field(repr=False)


def _ground(linear: LinearBody) -> tuple[Support, Wrench]:
    body = linear.body
    q = body.angles(linear.whole_posture, check=False)
    heels = {side: f"{side}_mtp_extension" in linear.held for side in SIDES}
    model = model_on_slope(body, linear.slope, linear.gravity)
    return support(body, q, heels, linear.both_feet), ground_wrench(body, model, q)


def soles_of(linear: LinearBody) -> Support:
    """The area on the ground that carries a linearized body."""
    return _ground(linear)[0]


def balance(linear: LinearBody, found: Modes) -> Balance:
    """The inequalities that keep the centre of pressure on the soles (see `fes_pin.body.ground`).

    Parameters
    ----------
    linear, found
        The body and its modes. A heel carries where its MTP joint is braced; otherwise the forefoot alone does.
    """
    area, wrench = _ground(linear)
    places = [linear.body.joint_names.index(name) for name in linear.joint_names]
    weight = float(np.linalg.norm(wrench.at_rest[:3]))
    rows = area.rows / weight
    angle = rows @ wrench.per_angle[:, places] @ found.shapes
    acceleration = rows @ wrench.per_acceleration[:, places] @ found.shapes
    return Balance(rows @ wrench.at_rest, angle + acceleration * found.values, acceleration, angle)


def place_of_weight(linear: LinearBody) -> tuple[float, str]:
    """How far the weight of the posture at rest lies outside the soles, m (negative inside), and a line that says it.

    An instant of a walk is not a posture to stand in: there the weight may lie outside, and the next step catches it.
    """
    area, wrench = _ground(linear)
    outside = area.outside(centre_of_pressure(wrench.at_rest))
    soles = " and ".join(name.replace("_", " ") for name in area.soles)
    if outside <= 0.0:
        return outside, f"At rest the weight lies {-100 * outside:.1f} cm inside the edge of the {soles}."
    line = f"At rest the weight lies {100 * outside:.1f} cm outside the {soles}: nothing holds the body still here"
    if linear.posture_name and linear.posture_name not in STILL:
        return outside, f"{line}. {linear.posture_name} is an instant of a walk, not a posture to stand in."
    if any(name.endswith("_forefoot") for name in area.soles):
        return outside, f"{line}; foot plates (--brace {area.soles[0].split('_')[0]}_foot_plate) let the heel carry."
    return outside, f"{line}."
