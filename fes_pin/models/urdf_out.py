"""An extended joint as URDF: fitted inertia and weight, and damping and dry friction in `<dynamics>`."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pinocchio as pin

from fes_pin.data.errors import InputError
from fes_pin.data.files import read_bytes
from fes_pin.data.numbers import in_full
from fes_pin.data.urdf import (
    MOMENTS,
    check_inertias,
    check_one_joint,
    inertia_matrix,
    is_possible,
    lacking,
    links_beyond,
)
from fes_pin.data.urdf_text import Tag, XmlText
from fes_pin.models.effects.coulomb_friction import STATED, CoulombFriction
from fes_pin.models.model import Model
from fes_pin.models.rigs import Joint
from fes_pin.models.rigs.rigid import gravity_coefficients, joint_inertia, load_urdf

SAME = 1e-6
"""Relative difference of inertia and gravity from those that the model was fitted with: another URDF."""


def extended_urdf(model: Model, urdf: str | Path) -> tuple[bytes, tuple[str, ...], str]:
    """URDF of a fitted joint: the file that its study names, with the numbers that were fitted in their places.

    Masses are scaled so that gravity pulls as fitted; what the inertia about the joint then lacks, or has too much, is
    put on the moving link. Simulators take `<dynamics damping friction>` as viscous and dry friction; others of the
    model's causes URDF has no words for. Everything else, shapes, transmissions, comments and white space among it,
    stays to the byte.

    Parameters
    ----------
    model
        Of a joint.
    urdf
        The one that its study names.

    Returns
    -------
    content, left_out, changed
        Of the file; names of causes that it does not hold; what else of it is not as it was, in words, "" for nothing.

    Raises
    ------
    InputError
        No model of a joint, another URDF, an inertia that no body has, or a weight that no rigid body has.
    """
    rig = model.rig
    if not isinstance(rig, Joint):
        raise InputError(f"expected a model of a joint, found one of rig {rig.name}")
    name, _ = check_one_joint(urdf)
    check_inertias(urdf)
    body = load_urdf(Path(urdf))
    _check_same(rig, body, urdf)
    text = _Numbers(read_bytes(urdf), name, links_beyond(urdf, name))
    changed = _scale(text, rig, joint_inertia(body), urdf)
    friction = next((e for e in model.effects if isinstance(e, CoulombFriction)), None)
    beyond = 0.0 if friction is None else friction.torque_nm
    text.set_dynamics(rig.damping, max(rig.constants.get(STATED, 0.0) + beyond, 0.0))
    left_out = tuple(e.name for e in model.effects if e is not friction)
    return text.changed(), left_out, changed


class _Numbers(XmlText):
    """A URDF whose numbers are changed; one that stays what it is keeps its digits.

    Parameters
    ----------
    content, name, moving
        Of the file; of the joint; names of the links that it moves, the next one first.
    """

    def __init__(self, content: bytes, name: str, moving: Sequence[str]) -> None:
        super().__init__(content)
        links = {link.get("name"): link for link in self.root.all("link")}
        self.joint = next(j for j in self.root.all("joint") if j.get("name") == name)
        self.first = links[moving[0]].find("inertial")
        self.inertials = [one for n in moving if (one := links[n].find("inertial")) is not None]
        within = (j for j in self.root.all("joint") if (p := j.find("parent")) and p.get("link") in moving)
        self.origins = [o for one in (*self.inertials, *within) if (o := one.find("origin")) is not None]

    def put(self, tag: Tag, key: str, *values: float, default: str = "0") -> None:
        """Write numbers of an attribute where they differ from what it says."""
        if tuple(float(x) for x in tag.get(key, default).split()) != tuple(map(float, values)):
            self.set(tag, key, in_full(*values))

    def set_dynamics(self, damping: float, friction: float) -> None:
        """Write damping and dry friction of the joint, in an element of their own where it has none yet."""
        there = self.joint.find("dynamics")
        if there is not None:
            self.put(there, "damping", damping)
            self.put(there, "friction", friction)
        elif damping or friction:
            self.append(self.joint, f'<dynamics damping="{in_full(damping)}" friction="{in_full(friction)}"/>')


def _check_same(rig: Joint, body: pin.Model, urdf: str | Path) -> None:
    cosine, sine = gravity_coefficients(body)
    here = np.array([joint_inertia(body), cosine, sine])
    there = np.array([rig.constants[n] for n in ("inertia", "gravity_cos", "gravity_sin")])
    if not np.allclose(here, there, rtol=SAME, atol=SAME * float(np.abs(there).max())):
        message = f"expected the URDF of the model's study, whose inertia is {there[0]:g}; found one of {here[0]:g}"
        raise InputError(message, file=urdf)


def _scale(text: _Numbers, rig: Joint, inertia: float, urdf: str | Path) -> str:
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
    extra = 0.0 if slides else (rig.inertia_scale / factor - 1.0) * inertia
    added = _with(text, extra, urdf) if extra else {}
    if added is not None:
        _multiply(text, factor, 1.0, added)
        return ""
    ratio = rig.inertia_scale / factor
    _multiply(text, factor / ratio, ratio, {})
    return f"lengths of what moves are multiplied by {ratio:.4g}: the mass that weighs as fitted has less inertia there"


def _multiply(text: _Numbers, mass: float, length: float, first: dict[str, float]) -> None:
    """Masses and lengths of what moves by these factors, and inertias as goes with them; `first` are moments of the
    link next to the joint that take the place of its own before that.
    """
    for inertial in text.inertials:
        weight, inertia = inertial.find("mass"), inertial.find("inertia")
        assert weight is not None and inertia is not None
        text.put(weight, "value", mass * float(weight.get("value")))
        for key in MOMENTS:
            believed = first.get(key) if inertial is text.first else None
            moment = float(inertia.get(key, "0")) if believed is None else believed
            text.put(inertia, key, mass * length**2 * moment)
    for origin in text.origins if length != 1.0 else ():
        text.put(origin, "xyz", *(length * _vector(origin, "xyz", "0 0 0")), default="0 0 0")


def _vector(tag: Tag | None, key: str, default: str) -> np.ndarray:
    """The three numbers of an attribute, shape (3,)."""
    return np.array([float(x) for x in (default if tag is None else tag.get(key, default)).split()])


def _with(text: _Numbers, extra: float, urdf: str | Path) -> dict[str, float] | None:
    """Moments of the link next to the joint with more inertia about the joint's axis; None if no body has them.

    They are in units of the believed masses, and are scaled with them. What is added is like a rotor's: about the axis
    alone, or where no body has that sum, of a disc, which has half as much about its diameters. It adds to the inertia
    about the axis what is asked either way.
    """
    inertia = None if text.first is None else text.first.find("inertia")
    if text.first is None or inertia is None:
        link = text.joint.find("child")
        missing = "expected a mass on the link that the joint moves"
        raise InputError(missing, file=urdf, column="" if link is None else link.get("link"))
    axis = _vector(text.joint.find("axis"), "xyz", "1 0 0")
    rpy = _vector(text.first.find("origin"), "rpy", "0 0 0")
    axis = pin.rpy.rpyToMatrix(*rpy).T @ (axis / np.linalg.norm(axis))
    along, believed = np.outer(axis, axis), inertia_matrix(float(inertia.get(key, "0")) for key in MOMENTS)
    rounding = lacking(np.linalg.eigvalsh(believed))
    for across in (0.0, 0.5):
        matrix = believed + extra * (along + across * (np.eye(3) - along))
        principal = np.linalg.eigvalsh(matrix)
        if is_possible(principal) and lacking(principal) <= rounding:
            return dict(zip(MOMENTS, matrix[np.triu_indices(3)].tolist(), strict=True))
    return None
