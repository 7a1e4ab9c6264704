"""Models on disk: `model.toml`, complete without other files, and an extended joint as URDF.

URDF takes fitted inertia and weight, and damping and dry friction in `<dynamics>`.
"""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np
import pinocchio as pin
import tomli_w
from defusedxml import ElementTree

from fes_pin.data.errors import InputError
from fes_pin.data.files import write_text
from fes_pin.data.numbers import in_full, instance
from fes_pin.data.schema import NumberKey, one_of
from fes_pin.data.toml import Document, read_toml
from fes_pin.data.urdf import MOMENTS, check_one_joint, inertia_matrix, is_possible, links_beyond, mechanics
from fes_pin.models.catalogue import Catalogue, Source, catalogue_of
from fes_pin.models.effects import CoulombFriction
from fes_pin.models.model import Model
from fes_pin.models.outside import origin
from fes_pin.models.rigs import Joint
from fes_pin.models.rigs.base import Rig
from fes_pin.models.rigs.rigid import gravity_coefficients, joint_inertia, load_urdf
from fes_pin.models.stage import Effect

FORMAT = 1
NEEDS = "needs"
"""Key of a table: the file or module of each cause or rig that is not of this library."""
EACH_TRIAL = "each_trial"
"""Key of an effect whose amplitudes are each trial's own."""


def model_toml(model: Model, further: Mapping[str, Mapping[str, Any]] | None = None) -> str:
    """Return a model as TOML: rig, constants, parameters to the last bit, effects; and further tables.

    Parameters
    ----------
    further
        Tables by name, as `identify.stored.stored_tables` writes them.
    """
    rig = model.rig
    tables: dict[str, Any] = {
        "format": FORMAT,
        "rig": rig.name,
        "fitted": list(rig.fitted_parameters()),
        "constants": {n: float(v) for n, v in rig.constants.items()},
        "nominal": {n: float(getattr(rig, n)) for n in rig.parameters()},
        "effects": {e.name: _effect_table(e) for e in model.effects},
    }
    if rig.session:
        tables["session"] = [list(one) for one in rig.session]
    tables |= further or {}
    parts: tuple[Rig | Effect, ...] = (rig, *model.effects)
    foreign = {one.name: Path(where).name for one in parts if (where := origin(type(one)))}
    return tomli_w.dumps({**tables, NEEDS: foreign} if foreign else tables)


def save_model(model: Model, path: str | Path) -> None:
    """Write `model.toml`, completely or not at all.

    Raises
    ------
    InputError
        If it is no `Model`: the body of a diagnosis of walking is saved as URDF, by its `write`. If the file cannot be
        written, or was read and not written by this process.
    """
    how = ": its write() saves it as URDF, which Body.from_urdf reads" if hasattr(model, "urdf") else ""
    instance(model, Model, "model", how)
    write_text(path, model_toml(model))


def load_model(path: str | Path, *, library: Source | Sequence[Source] | None = None) -> Model:
    """Read a model that `save_model` wrote.

    Parameters
    ----------
    library
        Sources of causes and rigs that are not of this library or of installed packages: see `load_library`.

    Raises
    ------
    InputError
        For another file, or one that needs a library that was not given: names the row, the key and what was expected.
    """
    document, catalogue = read_toml(path), catalogue_of(library)
    kinds = {rig.name: rig for rig in catalogue.rigs}
    found = document.data.get("format")
    if found is None and "model" in document.data:
        raise document.error("model", "of a diagnosis of walking: Body.from_urdf reads the URDF that it names")
    if found != FORMAT or isinstance(found, bool):
        raise document.error("format", f"expected format = {FORMAT}: a model that fes-pin saved")
    name = document.data.get("rig")
    kind = kinds[one_of(name, tuple(kinds), lambda words: document.error("rig", _missing(document, name, words)))]
    nominal: dict[str, Any] = _numbers(document, "nominal", kind.parameters())
    constants, fitted = _numbers(document, "constants", None), document.data.get("fitted", "")
    try:
        model = Model(kind(**nominal, constants=constants, fitted=fitted, session=document.data.get("session", ())))
    except InputError as problem:
        key = f"nominal.{problem.column}" if problem.column in nominal else str(problem.column)
        raise document.error(key, problem.message) from None
    listed = document.table("effects")
    for name in listed:
        try:
            model = model + _effect(document, catalogue, name, listed)
        except InputError as problem:
            if problem.file is not None:
                raise
            within = f".{problem.column}" if problem.column else ""
            raise document.error(f"effects.{name}{within}", problem.message) from None
    return model


def _effect_table(one: Effect) -> dict[str, Any]:
    own = {EACH_TRIAL: True} if one.each_trial else {}
    return {**own, **{n: float(getattr(one, n)) for n in one.parameters()}}


def _missing(document: Document, name: object, otherwise: str) -> str:
    """Return an error message for an unknown cause or rig, with the library that the model states for it."""
    where = document.table(NEEDS).get(name) if isinstance(name, str) else None
    if not isinstance(where, str) or not where:
        return otherwise
    return f"{name} is of {where}; expected library='{'PATH/' if where.endswith('.py') else ''}{where}'"


def _effect(document: Document, catalogue: Catalogue, name: str, listed: dict[str, Any]) -> Effect:
    key = f"effects.{name}"
    try:
        kind = catalogue.effect(name)
    except InputError as problem:
        raise document.error(key, _missing(document, name, problem.message)) from None
    each_trial = document.table(key, listed).pop(EACH_TRIAL, False)
    may = kind.varies or kind.of_record
    if not isinstance(each_trial, bool) or (each_trial and not may):
        raise document.error(f"{key}.{EACH_TRIAL}", f"expected {'true or false' if may else 'none'}")
    return kind(**_numbers(document, key, kind.parameters(), listed), each_trial=each_trial)


def _numbers(
    document: Document, key: str, known: Iterable[str] | None, inside: dict[str, Any] | None = None
) -> dict[str, float]:
    values = document.table(key, inside)
    return document.numbers(key, values, dict.fromkeys(values if known is None else known, NumberKey("")))


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
