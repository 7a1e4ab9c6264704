"""URDF files checked before anything else reads them: safe XML, a tree of links, positive masses of what moves."""

import math
import re
from collections.abc import Iterable, Mapping
from decimal import Decimal, InvalidOperation
from pathlib import Path
from xml.etree.ElementTree import Element, ParseError, SubElement, tostring

import numpy as np
from defusedxml import ElementTree
from defusedxml.common import DefusedXmlException

from fes_pin.data.errors import InputError
from fes_pin.data.files import read_bytes
from fes_pin.data.numbers import in_full

MOVING = ("revolute", "continuous", "prismatic", "floating", "planar")
ONE_JOINT = ("revolute", "continuous", "prismatic")
SMALLEST, LARGEST = 1e-9, 1e6
"""Round figures far outside any rig, in SI units: masses and lengths of directions lie between, all else below."""
MOMENTS = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
"""Of an inertia, as URDF names them: the upper triangle of its matrix, row by row."""
ROUNDED = 5e-3
"""Largest error by which a printed moment is taken to be rounded, as a share of the largest: half a unit of the second
digit of 0.10. A moment of one digit, 0.1, is meant so and not rounded."""
SAME = 1e-9
"""Share of the largest principal moment that is rounding of double precision."""
NumbersOf = Mapping[str, tuple[int, float | None]]
PLACE: NumbersOf = {"xyz": (3, 0.0), "rpy": (3, 0.0)}
LINK_NUMBERS: Mapping[str, NumbersOf] = {
    "origin": PLACE,
    "mass": {"value": (1, None)},
    "inertia": {key: (1, None if key[1] == key[2] else 0.0) for key in MOMENTS},
}
JOINT_NUMBERS: Mapping[str, NumbersOf] = {
    "origin": PLACE,
    "axis": {"xyz": (3, None)},
    "limit": {"lower": (1, 0.0), "upper": (1, 0.0), "effort": (1, None), "velocity": (1, None)},
}
DYNAMICS_NUMBERS: Mapping[str, NumbersOf] = {"dynamics": {"damping": (1, math.nan), "friction": (1, math.nan)}}
MIMIC_NUMBERS: Mapping[str, NumbersOf] = {"mimic": {"multiplier": (1, 1.0), "offset": (1, 0.0)}}
"""Elements that bear on the motion, how many numbers each of their attributes holds, and what it is where it is absent;
None where it must be there."""


def moving_joints(path: str | Path, content: bytes | None = None) -> list[tuple[str, str]]:
    """Joints that move by themselves, neither fixed nor mimicking another, in the file's order.

    Parameters
    ----------
    path, content
        The file, and its bytes where they were read before.

    Returns
    -------
    list of (name, type)

    Raises
    ------
    InputError
        Not XML, XML with a document type or entities, not a URDF, links that make no tree, a joint without a usable
        axis or limits, a mass that is not positive, an inertia that no body can have.
    """
    moving = [j for j in _Urdf(path, content).joints if j.get("type") in MOVING and j.find("mimic") is None]
    return [(joint.get("name", ""), joint.get("type", "")) for joint in moving]


def is_revolute(path: str | Path | None) -> bool | None:
    """Return whether the joints that move turn (True) or slide (False); None where some do either, or there is no file.

    Raises
    ------
    InputError
        As `moving_joints`.
    """
    kinds = {kind == "prismatic" for _, kind in moving_joints(path)} if path is not None else set()
    return not kinds.pop() if len(kinds) == 1 else None


def check_one_joint(path: str | Path) -> tuple[str, str]:
    """Name and type of the one moving joint of a `joint` rig.

    Raises
    ------
    InputError
        No or several moving joints, one that has more than one degree of freedom, nothing heavy that it moves, or
        something heavy that moves along by a joint that mimics it.
    """
    joints = moving_joints(path)
    if len(joints) != 1:
        names = f": {', '.join(name for name, _ in joints)}" if joints else ""
        message = f"expected one moving joint, found {len(joints) or 'none'}{names}"
        raise InputError(message, file=path, column="joint")
    name, kind = joints[0]
    if kind not in ONE_JOINT:
        raise InputError(f"expected a revolute, continuous or prismatic joint, found {kind}", file=path, column=name)
    urdf = _Urdf(path)
    if not urdf.moved_mass(name) > 0:
        raise InputError("expected a link with mass beyond this joint", file=path, column=name)
    for joint in urdf.joints:
        if joint.find("mimic") is not None and urdf.moved_mass(joint.get("name", "")) > 0:
            raise urdf.error("expected no mass that moves along with another joint (<mimic>)", joint.get("name", ""))
    return name, kind


def stated_of_joint(path: str | Path) -> dict[str, float]:
    """What a URDF states of its one moving joint, of `damping`, dry `friction` and the actuator's limit of `effort`.

    URDF needs a limit where a joint has ends, also of one without an actuator: a limit of 0 is no limit, and what is
    written for "any", 1e6, is above whatever acts.

    Returns
    -------
    dict
        In N m s/rad or N s/m, and N m or N; only what is stated.

    Raises
    ------
    InputError
        As `check_one_joint`; a damping or friction below 0.
    """
    name, _ = check_one_joint(path)
    return _Urdf(path).stated(name)


def mechanics(path: str | Path) -> str:
    """URDF text of a file's links and joints alone, every number checked, so that a parser accepts it.

    Shapes, materials and whatever else a URDF may hold do not bear on how it moves, and are left out. Joints that mimic
    another are fixed: `check_one_joint` accepts them only where they move no mass.

    Raises
    ------
    InputError
        As `moving_joints`.
    """
    return _Urdf(path).mechanics()


def links_beyond(path: str | Path, joint: str) -> list[str]:
    """Names of the links beyond a joint, the one that it moves first.

    Raises
    ------
    InputError
        As `moving_joints`.
    """
    return _Urdf(path).beyond(joint)


def inertia_matrix(moments: Iterable[float]) -> np.ndarray:
    """The matrix, shape (3, 3), of an inertia's `MOMENTS`."""
    upper = np.zeros((3, 3))
    upper[np.triu_indices(3)] = list(moments)
    return np.asarray(upper + np.triu(upper, 1).T)


def lacking(principal: np.ndarray) -> float:
    """Return by how much the largest of three principal moments exceeds the sum of the others, but for rounding.

    No body has such moments: each is the mean square distance from an axis. 0 for moments that a body can have.
    """
    low, middle, high = np.sort(principal)
    return max(float(high - middle - low) - SAME * float(abs(high)), 0.0)


def is_possible(principal: np.ndarray) -> bool:
    """Return whether a moment is negative in none of the principal directions, in ascending order, but for rounding."""
    return bool(principal[0] >= -SAME * abs(principal).max())


def impossible_inertias(path: str | Path) -> list[InputError]:
    """Inertias of links that move which no body has: a principal moment is above the sum of the two others.

    Moments are rounded to the digits that are printed, so that a thin plate may seem to lack a little. What such
    rounding explains is possible; see `ROUNDED`. Links that do not move are not judged, as nothing depends on them.

    Returns
    -------
    list of InputError
        One a link, with its row, to be raised or said.

    Raises
    ------
    InputError
        As `moving_joints`.
    """
    return _Urdf(path).impossible()


def check_inertias(path: str | Path) -> None:
    """Refuse a URDF by the first of its `impossible_inertias`.

    Raises
    ------
    InputError
        There is one; or as `moving_joints`.
    """
    for error in impossible_inertias(path):
        raise error


def _digits(text: str) -> float:
    """Half a unit of the last digit of a printed number; 0 of one that is exactly 0."""
    try:
        number = Decimal(text.strip())
    except InvalidOperation:
        return 0.0
    exponent = number.as_tuple().exponent
    return 0.5 * 10.0**exponent if number and isinstance(exponent, int) else 0.0


class _Urdf:
    """The parts of one URDF, checked as they are read."""

    def __init__(self, path: str | Path, content: bytes | None = None) -> None:
        self.path = path
        content = read_bytes(path) if content is None else content
        self.lines = content.decode("utf-8", errors="replace").split("\n")
        self.root = self._parse(content)
        if self.root.tag != "robot":
            raise InputError(f"expected a URDF with the root <robot>, found <{self.root.tag[:40]}>", file=path, row=1)
        self.links = self._named("link")
        self.joints = list(self._named("joint").values())
        if not self.links:
            raise InputError("expected at least one <link>", file=path)
        self.ends: dict[str, list[str]] = {}  # parent and child of each joint
        self.parent: dict[str, str] = {}
        for joint in self.joints:
            self._check_joint(joint)
        self._check_tree()
        moving = [self.beyond(joint.get("name", "")) for joint in self.joints if joint.get("type") in MOVING]
        moved = {link for links in moving for link in links}
        self.masses = {name: self._mass(name, link) if name in moved else 0.0 for name, link in self.links.items()}

    def error(self, message: str, name: str) -> InputError:
        named = re.compile(rf"""name\s*=\s*["']{re.escape(name)}["']""")
        row = next((i for i, line in enumerate(self.lines, 1) if named.search(line)), None)
        return InputError(message, file=self.path, row=row, column=name)

    def _parse(self, content: bytes) -> Element:
        try:
            return ElementTree.fromstring(content, forbid_dtd=True)
        except DefusedXmlException:
            message = "expected XML without a document type, entities or external references"
            raise InputError(message, file=self.path) from None
        except ParseError as error:
            reason = str(error).split(":")[0]
            raise InputError(f"not XML: {reason}", file=self.path, row=error.position[0]) from None
        except (ValueError, LookupError, RecursionError) as error:
            raise InputError(f"not XML that can be read: {error}", file=self.path) from None

    def _named(self, tag: str) -> dict[str, Element]:
        found: dict[str, Element] = {}
        for element in self.root.findall(tag):
            name = element.get("name", "")
            if not name.strip():
                raise InputError(f"expected a name for every <{tag}>", file=self.path, column=tag)
            if name in found:
                raise self.error(f"this {tag} is there twice", name)
            found[name] = element
        return found

    def _mass(self, name: str, link: Element) -> float:
        inertial = link.find("inertial")
        if inertial is None:
            return 0.0
        numbers = self._read(inertial, LINK_NUMBERS, name)
        (value,) = numbers.get("mass", {}).get("value", (math.nan,))
        if not value > 0:
            raise self.error(f"expected a mass above 0 kg, found {f'{value:g}' if 'mass' in numbers else 'none'}", name)
        if not SMALLEST <= value <= LARGEST:
            raise self.error(f"expected a mass between {SMALLEST:g} and {LARGEST:g} kg, found {value:g}", name)
        if "inertia" not in numbers:
            raise self.error("expected an <inertia> together with the mass", name)
        principal = np.linalg.eigvalsh(inertia_matrix(m for (m,) in numbers["inertia"].values()))
        if not is_possible(principal):
            raise self.error(f"expected an inertia that is positive, found a principal one of {principal[0]:g}", name)
        return value

    def stated(self, name: str) -> dict[str, float]:
        """Return what is stated of a joint; see `stated_of_joint`."""
        joint = next(j for j in self.joints if j.get("name") == name)
        found = self._read(joint, DYNAMICS_NUMBERS, name).get("dynamics", {})
        out = {key: value for key, (value,) in found.items() if not math.isnan(value)}
        for key, value in out.items():
            if value < 0.0:
                raise self.error(f"expected {key} of <dynamics> of at least 0, found {value:g}", name)
        (most,) = self._read(joint, JOINT_NUMBERS, name).get("limit", {}).get("effort", (0.0,))
        return {**out, **({"effort": most} if most > 0.0 else {})}

    def impossible(self) -> list[InputError]:
        """Return the errors of `impossible_inertias`."""
        out = []
        for name in (n for n, mass in self.masses.items() if mass):
            element = next(self.links[name].iterfind("inertial/inertia"))
            matrix = inertia_matrix(float(element.get(key, "0")) for key in MOMENTS)
            principal, directions = np.linalg.eigh(matrix)
            most = ROUNDED * float(principal[2])
            rounded = inertia_matrix(min(_digits(element.get(key, "0")), most) for key in MOMENTS)
            # first order: trace - 2 v' I v with v the axis of the largest moment
            slopes = np.abs(np.eye(3) - 2.0 * np.outer(directions[:, 2], directions[:, 2]))
            if lacking(principal) > float(np.sum(slopes * rounded)):
                found = ", ".join(f"{one:.4g}" for one in principal)
                message = f"no body has the principal moments {found} kg m2: the largest is above the sum of the others"
                out.append(self.error(message, name))
        return out

    def _check_joint(self, joint: Element) -> None:
        name, kind = joint.get("name", ""), joint.get("type")
        if kind not in (*MOVING, "fixed"):
            raise self.error(f"expected a joint type, one of {', '.join((*MOVING, 'fixed'))}; found {kind}", name)
        ends = []
        for tag in ("parent", "child"):
            end = joint.find(tag)
            link = "" if end is None else end.get("link", "")
            if link not in self.links:
                raise self.error(f"expected a <{tag}> that is a link of this file, found {link[:40]!r}", name)
            ends.append(link)
        if ends[1] in self.parent or ends[0] == ends[1]:
            raise self.error(f"expected a tree, but link {ends[1]!r} has several parents or is its own", name)
        self.ends[name], self.parent[ends[1]] = ends, ends[0]
        numbers = self._read(joint, JOINT_NUMBERS, name)
        if kind in (*ONE_JOINT, "planar") and "axis" in numbers:
            self._check_axis(numbers["axis"]["xyz"], name)
        if kind in ("revolute", "prismatic") and "limit" not in numbers:
            raise self.error(f"expected a <limit>, as this joint is {kind}", name)
        self._check_mimic(joint, name)

    def _check_axis(self, xyz: tuple[float, ...], name: str) -> None:
        if not any(xyz):
            raise self.error("expected an <axis> that is not zero", name)
        if not SMALLEST <= math.hypot(*xyz) <= LARGEST:
            raise self.error(f"expected an <axis> of length 1, found {math.hypot(*xyz):g}", name)

    def _check_mimic(self, joint: Element, name: str) -> None:
        mimic = joint.find("mimic")
        if mimic is None:
            return
        leader = mimic.get("joint", "")
        if leader == name or not any(other.get("name") == leader for other in self.joints):
            raise self.error(f"expected a <mimic> of another joint of this file, found {leader[:40]!r}", name)
        self._read(joint, MIMIC_NUMBERS, name)

    def mechanics(self) -> str:
        """Links and joints as text; see the function of this name."""
        robot = Element("robot", name=self.root.get("name") or "robot")
        for name, link in self.links.items():
            one = SubElement(robot, "link", name=name)
            if (inertial := link.find("inertial")) is not None and self.masses[name]:
                self._write(SubElement(one, "inertial"), inertial, LINK_NUMBERS, name)
        for joint in self.joints:
            name = joint.get("name", "")
            kind = "fixed" if joint.find("mimic") is not None else joint.get("type", "")
            one = SubElement(robot, "joint", name=name, type=kind)
            for tag, end in zip(("parent", "child"), self.ends[name], strict=True):
                SubElement(one, tag, link=end)
            self._write(one, joint, JOINT_NUMBERS, name)
        return tostring(robot, encoding="unicode")

    def _write(self, parent: Element, source: Element, table: Mapping[str, NumbersOf], name: str) -> None:
        """Elements of a table with those of its attributes that are in the source; an inertia with all."""
        for tag, numbers in self._read(source, table, name).items():
            there = source.find(tag)
            given = [key for key in numbers if tag == "inertia" or (there is not None and key in there.attrib)]
            SubElement(parent, tag, {key: in_full(*numbers[key]) for key in given})

    def _read(
        self, parent: Element, table: Mapping[str, NumbersOf], name: str
    ) -> dict[str, dict[str, tuple[float, ...]]]:
        """Numbers of the elements of a table that are there, by element and attribute."""
        found = {tag: parent.find(tag) for tag in table}
        return {
            tag: {key: self._numbers(element, key, name, *about) for key, about in table[tag].items()}
            for tag, element in found.items()
            if element is not None
        }

    def _check_tree(self) -> None:
        roots = [name for name in self.links if name not in self.parent]
        if len(roots) != 1:
            raise InputError(f"expected one root link, found {len(roots)}", file=self.path, column="link")
        for link in self.links:
            if roots[0] not in self._ancestry(link):
                raise self.error("expected a tree of links, found a loop", link)

    def moved_mass(self, joint: str) -> float:
        """Mass of all links beyond a joint, kg."""
        return sum(self.masses[link] for link in self.beyond(joint))

    def beyond(self, joint: str) -> list[str]:
        """Links beyond a joint, the one that it moves first."""
        first = self.ends[joint][1]
        return [first, *(link for link in self.links if link != first and first in self._ancestry(link))]

    def _ancestry(self, link: str) -> set[str]:
        found = set[str]()
        while link not in found:
            found.add(link)
            link = self.parent.get(link, link)
        return found

    def _numbers(self, element: Element, key: str, name: str, count: int, default: float | None) -> tuple[float, ...]:
        text = element.get(key)
        if text is None and default is not None:
            return (default,) * count
        try:
            values = () if "_" in (text or "") else tuple(float(part) for part in (text or "").split())
        except ValueError:
            values = ()
        if len(values) != count or not all(map(math.isfinite, values)):
            found = "nothing" if text is None else repr(text[:40])
            wanted = "a finite number" if count == 1 else f"{count} finite numbers"
            raise self.error(f"expected {wanted} as {key} of <{element.tag}>, found {found}", name)
        if element.tag != "limit" and max(map(abs, values)) > LARGEST:
            message = f"expected {key} of <{element.tag}> below {LARGEST:g} in SI units, found {text!r:.40}"
            raise self.error(message, name)
        return values
