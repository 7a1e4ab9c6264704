"""Whether the feet carry a linearized body: the centre of pressure as inequalities of its modes, and in words."""

from dataclasses import dataclass, field

import numpy as np
import pinocchio as pin
from scipy.linalg import block_diag

from fes_pin.body.each_foot import share_of_second, without_free
from fes_pin.body.gait import STILL
from fes_pin.body.ground import SupportPolygon, Wrench, centre_of_pressure, ground_wrench, second_foot, support
from fes_pin.body.joints import SIDES
from fes_pin.body.linear_body import LinearBody
from fes_pin.body.linearize import model_on_slope
from fes_pin.body.modes import ModeSet


@dataclass(frozen=True)
class GroundRows:
    """Each foot's centre of pressure stays on its sole as long as these are not above 0.

    constant + per_mode eta + per_force F + per_torque (C + D), with eta'' = mu eta + F and F = phi' (C + D).

    Rows are divided by the weight: about how far, m, the centre of pressure lies outside an edge of a sole, for a foot
    that bears it all. On one foot the motion alone determines it, on two the torques determine each foot's share.

    Parameters
    ----------
    constant
        At rest in the posture: (e,).
    per_mode, per_force
        Per modal coordinate eta and per modal force F: (e, r).
    per_torque
        Per joint torque beyond what holds the posture, C + D: (e, n).
    at_rest
        Per modal coordinate of a body that rests there, away from the posture: (e, r).
    """

    constant: np.ndarray
    per_mode: np.ndarray = field(repr=False)
    per_force: np.ndarray = field(repr=False)
    per_torque: np.ndarray = field(repr=False)
    at_rest: np.ndarray = field(repr=False)


def _area(linear: LinearBody, sides: tuple[str, ...]) -> SupportPolygon:
    q = linear.body.angles(linear.whole_posture, check=False)
    return support(linear.body, q, {side: f"{side}_mtp_extension" in linear.held for side in SIDES}, sides)


def soles_of(linear: LinearBody) -> SupportPolygon:
    """The area on the ground that carries a linearized body: of all feet together."""
    return _area(linear, SIDES if linear.both_feet else (linear.body.stance,))


def model_of(linear: LinearBody) -> tuple[pin.Model, np.ndarray]:
    """The whole body's model with the gravity of its slope, and the posture with what braces hold, rad."""
    posture = linear.body.angles(linear.whole_posture, check=False)
    return model_on_slope(linear.body, linear.slope, linear.gravity), posture


def _carried(linear: LinearBody) -> tuple[list[tuple[SupportPolygon, Wrench]], np.ndarray]:
    """Each foot's sole and wrench, by the joints that move; and how the wrenches' rows depend on what is free."""
    model, q = model_of(linear)
    places = [linear.body.joint_names.index(name) for name in linear.joint_names]
    total = ground_wrench(model, q).on(places)
    if not linear.both_feet:
        return [(soles_of(linear), total)], np.zeros((6, 0))
    first, second = sorted(SIDES, key=lambda side: side != linear.body.stance)
    taken, free = share_of_second(linear, second_foot(linear.body, model, q))
    feet = [(_area(linear, (first,)), total - taken), (_area(linear, (second,)), taken)]
    return feet, np.vstack([-free, free])


def balance(linear: LinearBody, found: ModeSet) -> GroundRows:
    """The inequalities that keep each foot's centre of pressure on its sole (see `fes_pin.body.each_foot`).

    Parameters
    ----------
    linear, found
        The body and its modes. A heel carries where its MTP joint is braced; otherwise the forefoot alone does.
    """
    feet, free = _carried(linear)
    weight = sum(np.linalg.norm(wrench.at_rest[:3]) for _, wrench in feet)
    rows = block_diag(*[area.rows for area, _ in feet]) / weight
    rows = without_free(rows @ free) @ rows
    constant, angle, acceleration, torque = (
        rows @ np.concatenate([getattr(wrench, name) for _, wrench in feet])
        for name in ("at_rest", "per_angle", "per_acceleration", "per_torque")
    )
    angle, acceleration = angle @ found.shapes, acceleration @ found.shapes
    return GroundRows(constant, angle + acceleration * found.values, acceleration, torque, angle)


def place_of_weight(linear: LinearBody) -> tuple[float, str]:
    """Return the distance of the weight at rest from the soles, m (negative inside), and a line that states it.

    An instant of a walk is not a posture to stand in: there the weight may lie outside, and the next step catches it.
    """
    area, wrench = soles_of(linear), ground_wrench(*model_of(linear))
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
