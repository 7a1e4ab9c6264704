"""URDF templates of the commonest one-joint rigs, to be written and then improved upon by hand."""

from pathlib import Path

from fes_pin.data.errors import InputError

_URDF = Path(__file__).with_name("one_joint.urdf").read_text("utf-8")
LIMIT = '    <limit lower="-{reach}" upper="{reach}" effort="1e6" velocity="1e6"/>\n'
_WRITTEN = """
     Written by `fes-pin new-study`: better values of mass, centre (origin) and inertia about it go in below."""
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
    what = f"A carriage of {mass_kg:g} kg on a level rail. Position 0: where you say."
    return slide_urdf("slide", f"{what} Positive moves along +x.{_WRITTEN}", mass_kg, 0.0, 100.0)


def wheel(inertia_kgm2: float) -> str:
    """URDF of a balanced wheel or rotor, on which gravity has no lever.

    Raises
    ------
    InputError
        An inertia that is not above 0.
    """
    _check(inertia=inertia_kgm2)
    what = f"A balanced wheel of {inertia_kgm2:g} kg m2 about its axis. Positive turns about +y."
    return arm_urdf("wheel", f"{what}{_WRITTEN}", 1.0, 0.0, inertia_kgm2, inertia_kgm2)


def _turning(name: str, what: str, mass: float, centre: float, about_centre: float, upright: bool) -> str:
    zero, height = ("upright", centre) if upright else ("hanging straight down", -centre)
    return arm_urdf(name, f"{what} Position 0: {zero}. {_SWING}{_WRITTEN}", mass, height, about_centre)


def arm_urdf(name: str, what: str, mass_kg: float, height_m: float, across_kgm2: float, along_kgm2: float = 0.0) -> str:
    """URDF of an arm on a pivot along y.

    Parameters
    ----------
    name, what
        Of the robot; what a person is to know of it.
    mass_kg, height_m
        Its mass, and how far above the pivot its centre is at position 0.
    across_kgm2, along_kgm2
        Its inertia about its centre, across the arm and along it.
    """
    numbers = {"mass": mass_kg, "height": height_m, "across": across_kgm2, "along": along_kgm2}
    words = {"link": "arm", "joint": "pivot", "kind": "continuous", "direction": "0 1 0", "limit": ""}
    return _URDF.format(name=name, what=what, **{n: float(v) for n, v in numbers.items()}, **words)


def slide_urdf(name: str, what: str, mass_kg: float, inertia_kgm2: float, reach_m: float) -> str:
    """URDF of a carriage that moves along x, so far either way."""
    numbers = {"mass": mass_kg, "height": 0.0, "across": inertia_kgm2, "along": inertia_kgm2}
    words = {"link": "carriage", "joint": "rail", "kind": "prismatic", "direction": "1 0 0"}
    limit = LIMIT.format(reach=f"{reach_m:g}")
    return _URDF.format(name=name, what=what, limit=limit, **{n: float(v) for n, v in numbers.items()}, **words)


def _check(**numbers: float) -> None:
    for name, value in numbers.items():
        if not 1e-6 < value < 1e6:
            unit = {"length": "m", "mass": "kg"}.get(name, "kg m2")
            raise InputError(f"expected a {name} above 0 {unit}, found {value:g}", column=name)
