"""URDF templates of the commonest one-joint rigs, to be written and then improved upon by hand."""

from __future__ import annotations

from fes_pin.data.errors import InputError

_URDF = """<?xml version="1.0"?>
<!-- {what} Position 0: {zero}. {axis}
     Written by `fes-pin new-study`: better values of mass, centre (origin) and inertia about it go in below. -->
<robot name="{name}">
  <link name="base"/>
  <link name="{link}">
    <inertial>
      <origin xyz="0 0 {height}"/>
      <mass value="{mass}"/>
      <inertia ixx="{across}" ixy="0" ixz="0" iyy="{across}" iyz="0" izz="{along}"/>
    </inertial>
  </link>
  <joint name="{joint}" type="{kind}">
    <parent link="base"/>
    <child link="{link}"/>
    <axis xyz="{direction}"/>
{limit}  </joint>
</robot>
"""
LIMIT = '    <limit lower="-100" upper="100" effort="1e6" velocity="1e6"/>\n'
_SWING = "Positive turns about +y (a hanging arm swings to -x)."


def pendulum(length_m: float, mass_kg: float, upright: bool = False) -> str:
    """URDF of a mass at the end of a light arm.

    Parameters
    ----------
    length_m, mass_kg
        From the pivot to the mass's centre; the mass.
    upright
        Whether position 0 is the mass standing above the pivot; else it hangs there.

    Raises
    ------
    InputError
        A length or mass that is not above 0.
    """
    _check(length=length_m, mass=mass_kg)
    what = f"A pendulum: {mass_kg:g} kg at {length_m:g} m on an arm without mass."
    return _turning("pendulum", what, mass_kg, length_m, 0.0, upright)


def rod(length_m: float, mass_kg: float, upright: bool = False) -> str:
    """URDF of a uniform thin rod that turns about its end; its inertia about its middle is m L^2 / 12.

    Raises
    ------
    InputError
        A length or mass that is not above 0.
    """
    _check(length=length_m, mass=mass_kg)
    what = f"A uniform rod of {length_m:g} m and {mass_kg:g} kg that turns about its end."
    return _turning("rod", what, mass_kg, length_m / 2.0, mass_kg * length_m**2 / 12.0, upright)


def slide(mass_kg: float) -> str:
    """URDF of a carriage on a level rail.

    Raises
    ------
    InputError
        A mass that is not above 0.
    """
    _check(mass=mass_kg)
    moves = ("Positive moves along +x.", "carriage", "rail", "prismatic", "1 0 0", LIMIT)
    return _filled("slide", f"A carriage of {mass_kg:g} kg on a level rail.", "where you say", mass_kg, 0.0, 0.0, moves)


def _turning(name: str, what: str, mass: float, centre: float, about_centre: float, upright: bool) -> str:
    zero, height = ("upright", centre) if upright else ("hanging straight down", -centre)
    turns = (_SWING, "arm", "pivot", "continuous", "0 1 0", "")
    return _filled(name, what, zero, mass, height, about_centre, turns)


def _filled(name: str, what: str, zero: str, mass: float, height: float, across: float, moves: tuple[str, ...]) -> str:
    """The template with numbers, and with words on how its joint moves: axis, link, joint, kind, direction, limit."""
    words = dict(zip(("axis", "link", "joint", "kind", "direction", "limit"), moves, strict=True))
    numbers = {"mass": float(mass), "height": float(height), "across": float(across), "along": 0.0}
    return _URDF.format(name=name, what=what, zero=zero, **numbers, **words)


def _check(**numbers: float) -> None:
    for name, value in numbers.items():
        if not 1e-6 < value < 1e6:
            unit = "m" if name == "length" else "kg"
            raise InputError(f"expected a {name} above 0 {unit}, found {value:g}", column=name)
