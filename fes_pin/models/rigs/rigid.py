"""One-joint rigid bodies from Pinocchio: inertia and gravity as numbers that expressions can use."""

import math
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from fes_pin.data.errors import InputError
from fes_pin.data.urdf import mechanics

URDF_FOLDERS = (Path(__file__).parents[2] / "urdf", Path(__file__).parents[3] / "urdf")


def urdf_path(name: str) -> Path:
    """A URDF that travels with the package, in the wheel or in a checkout."""
    for folder in URDF_FOLDERS:
        if (folder / name).is_file():
            return folder / name
    raise FileNotFoundError(f"no {name} among {[str(f) for f in URDF_FOLDERS]}")


def load_urdf(path: Path) -> pin.Model:
    """Pinocchio's model of a URDF, with gravity along -z.

    Raises
    ------
    InputError
        As `fes_pin.data.urdf.moving_joints`, or if Pinocchio cannot read it.
    """
    try:
        model = pin.buildModelFromXML(mechanics(path))
    except InputError:
        raise
    except (ValueError, RuntimeError) as error:
        raise InputError(f"Pinocchio cannot read this URDF: {' '.join(str(error).split())}", file=path) from None
    model.gravity.linear = np.array([0.0, 0.0, -9.81])
    return model


@cache
def _ankle_rig() -> pin.Model:
    return load_urdf(urdf_path("ankle_rig.urdf"))


def point_foot(mass_kg: float, com_distance_m: float) -> pin.Model:
    """The ankle rig's URDF with the foot as a point mass so far from the joint."""
    model = _ankle_rig().copy()
    direction = model.inertias[1].lever / np.linalg.norm(model.inertias[1].lever)
    model.inertias[1] = pin.Inertia(mass_kg, com_distance_m * direction, np.zeros((3, 3)))
    return model


def configuration(model: pin.Model, position: float) -> np.ndarray:
    """Pinocchio's q of a one-joint model at a position: an angle, (cos, sin) of it for a continuous joint."""
    return np.array([position]) if model.nq == 1 else np.array([math.cos(position), math.sin(position)])


def _gravity(model: pin.Model, data: Any, position: float) -> float:
    return float(pin.computeGeneralizedGravity(model, data, configuration(model, position))[0])


def gravity_coefficients(model: pin.Model) -> tuple[float, float]:
    """A and B of a one-joint model's gravity torque A cos(q) + B sin(q), N m.

    A prismatic joint feels A cos(tilt) + B sin(tilt), N, with tilt the angle by which its axis is raised: A the weight
    along the axis, B across it. Gravity stands on the left-hand side of M(q) a + g(q) = tau, as in Pinocchio.
    """
    data = model.createData()
    along = _gravity(model, data, 0.0)
    if joint_is_revolute(model):
        return along, _gravity(model, data, math.pi / 2)
    weight = joint_inertia(model) * float(np.linalg.norm(model.gravity.linear))
    return along, math.sqrt(max(weight * weight - along * along, 0.0))


def joint_inertia(model: pin.Model) -> float:
    """The 1 x 1 mass matrix of a one-joint model, kg m2 or kg: constant."""
    return float(pin.crba(model, model.createData(), configuration(model, 0.0))[0, 0])


def joint_is_revolute(model: pin.Model) -> bool:
    """Return whether a joint is revolute or continuous; False for a prismatic one."""
    return "P" not in model.joints[1].shortname().removeprefix("JointModel")[:2]
