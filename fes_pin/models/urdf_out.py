"""An extended joint as URDF: fitted inertia and weight, and damping and dry friction in `<dynamics>`."""

from pathlib import Path
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np
import pinocchio as pin
from defusedxml import ElementTree

from fes_pin.data.errors import InputError
from fes_pin.data.numbers import in_full
from fes_pin.data.urdf import MOMENTS, check_one_joint, inertia_matrix, is_possible, links_beyond, mechanics
from fes_pin.models.effects import CoulombFriction
from fes_pin.models.model import Model
from fes_pin.models.rigs import Joint
from fes_pin.models.rigs.rigid import gravity_coefficients, joint_inertia, load_urdf

SAME = 1e-6
"""Relative difference of inertia and gravity from those that the model was fitted with: another URDF."""


def extended_urdf(model: Model, urdf: str | Path) -> tuple[str, tuple[str, ...], str]:
    """URDF of a fitted joint.

    Masses are scaled so that gravity pulls as fitted; what the inertia about the joint then lacks, or has too much, is
    put on the moving link. Simulators take `<dynamics damping friction>` as viscous and dry friction; others of the
    model's causes URDF has no words for.

    Parameters
    ----------
    model
        Of a joint.
    urdf
        The one that its study names.

    Returns
    -------
    text, left_out, changed
        Of the URDF; names of causes that it does not hold; what else of it is not as it was, in words, "" for nothing.

    Raises
    ------
    InputError
        No model of a joint, another URDF, or a weight that no rigid body has.
    """
    rig = model.rig
    if not isinstance(rig, Joint):
        raise InputError(f"expected a model of a joint, found one of rig {rig.name}")
    name, _ = check_one_joint(urdf)
    body = load_urdf(Path(urdf))
    _check_same(rig, body, urdf)
    root = ElementTree.fromstring(mechanics(urdf))
    joint = next(j for j in root.findall("joint") if j.get("name") == name)
    changed = _scale(root, joint, links_beyond(urdf, name), rig, joint_inertia(body), urdf)
    friction = next((e for e in model.effects if isinstance(e, CoulombFriction)), None)
    dynamics = joint.find("dynamics")
    dynamics = SubElement(joint, "dynamics") if dynamics is None else dynamics
    dynamics.set("damping", in_full(rig.damping))
    dynamics.set("friction", in_full(0.0 if friction is None else friction.torque_nm))
    left_out = tuple(e.name for e in model.effects if e is not friction)
    indent(root)
    return tostring(root, encoding="unicode") + "\n", left_out, changed


def _check_same(rig: Joint, body: pin.Model, urdf: str | Path) -> None:
    cosine, sine = gravity_coefficients(body)
    here = np.array([joint_inertia(body), cosine, sine])
    there = np.array([rig.constants[n] for n in ("inertia", "gravity_cos", "gravity_sin")])
    if not np.allclose(here, there, rtol=SAME, atol=SAME * float(np.abs(there).max())):
        message = f"expected the URDF of the model's study, whose inertia is {there[0]:g}; found one of {here[0]:g}"
        raise InputError(message, file=urdf)


def _scale(root: Element, joint: Element, moving: list[str], rig: Joint, inertia: float, urdf: str | Path) -> str:
    """Scale masses by the weight, and add the remaining inertia about the joint's axis; returns what else was changed.

    Where the inertia is less than that of masses where they are, all lengths of what moves are multiplied by k and the
    masses divided by it: the weight's torque (mass by length) stays, the inertia (mass by length squared) is k times.
    """
    slides = not rig.constants["revolute"]
    weighs = bool(rig.constants["gravity_cos"] or (rig.constants["gravity_sin"] and not slides))
    factor = rig.gravity_scale if weighs and not slides else rig.inertia_scale
    if slides and weighs and not np.isclose(rig.gravity_scale, rig.inertia_scale, rtol=1e-3):
        found = f"inertia_scale {rig.inertia_scale:g} and gravity_scale {rig.gravity_scale:g}"
        raise InputError(f"a sliding mass has one factor for inertia and weight, found {found}", file=urdf)
    if not factor > 0.0:
        raise InputError(f"expected a gravity_scale above 0, found {factor:g}: no mass weighs so", file=urdf)
    if slides or _add(root, joint, moving, (rig.inertia_scale / factor - 1.0) * inertia, urdf):
        _multiply(root, moving, factor, 1.0)
        return ""
    ratio = rig.inertia_scale / factor
    _multiply(root, moving, factor / ratio, ratio)
    return f"lengths of what moves are multiplied by {ratio:.4g}: the mass that weighs as fitted has less inertia there"


def _multiply(root: Element, moving: list[str], mass: float, length: float) -> None:
    """Masses and lengths of what moves by these factors, and inertias as goes with them."""
    for link in root.findall("link"):
        inertial = link.find("inertial")
        if inertial is None or link.get("name") not in moving:
            continue
        weight, inertia = inertial.find("mass"), inertial.find("inertia")
        assert weight is not None and inertia is not None
        weight.set("value", in_full(mass * float(weight.get("value", "0"))))
        for key in MOMENTS:
            inertia.set(key, in_full(mass * length**2 * float(inertia.get(key, "0"))))
        _lengthen(inertial.find("origin"), length)
    for joint in root.findall("joint"):
        parent = joint.find("parent")
        if parent is not None and parent.get("link") in moving:
            _lengthen(joint.find("origin"), length)


def _lengthen(origin: Element | None, factor: float) -> None:
    if origin is not None and origin.get("xyz") and factor != 1.0:
        origin.set("xyz", in_full(*(factor * _vector(origin, "xyz", ""))))


def _vector(element: Element | None, key: str, default: str) -> np.ndarray:
    """The three numbers of an attribute, shape (3,)."""
    return np.array([float(x) for x in (default if element is None else element.get(key, default)).split()])


def _add(root: Element, joint: Element, moving: list[str], extra: float, urdf: str | Path) -> bool:
    """Inertia about the joint's axis on the link that the joint moves, like a rotor's; False if there is not so much.

    It is in units of the believed masses, and is scaled with them.
    """
    links = {link.get("name"): link for link in root.findall("link")}
    bare = links[moving[0]].find("inertial")
    inertia = None if bare is None else bare.find("inertia")
    if bare is None or inertia is None:
        raise InputError("expected a mass on the link that the joint moves", file=urdf, column=moving[0])
    axis, rpy = _vector(joint.find("axis"), "xyz", "1 0 0"), _vector(bare.find("origin"), "rpy", "0 0 0")
    axis = pin.rpy.rpyToMatrix(*rpy).T @ (axis / np.linalg.norm(axis))
    matrix = inertia_matrix(float(inertia.get(key, "0")) for key in MOMENTS) + extra * np.outer(axis, axis)
    if not is_possible(np.linalg.eigvalsh(matrix)):
        return False
    for key, value in zip(MOMENTS, matrix[np.triu_indices(3)], strict=True):
        inertia.set(key, in_full(value))
    return True
