"""Nerves: which joints a stimulated nerve turns, and how strongly, at a posture."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from fes_pin.body.joints import JOINT_NAMES, names_of
from fes_pin.data.errors import InputError
from fes_pin.data.numbers import between, shortened, truth
from fes_pin.data.read_only import ReadOnly
from fes_pin.muscles.muscles import MuscleTable, angles_of, standard_muscles

STRENGTH_FACTOR = 1.8
"""A given strength is known to this factor: two standard deviations between healthy people either way (a coefficient of
variation of 15 to 30 %, Anderson et al. 2007, table 3), and how far another model (Rajagopal et al. 2016) lies off."""
HEALTHY, PARALYSED = 1.0, 0.5
"""Strength: the healthy young man whom the table describes; paralysed muscle, where nothing better is known."""
PARALYSED_BAND = 0.3, 0.7
"""Strength of paralysed muscle that is stimulated: 0.34 in the quadriceps of trained people (Neuromodulation 13:50-57,
2010, doi 10.1111/j.1525-1403.2009.00245.x); cross-sections of leg muscles are 0.45 to 0.8 of other people's half a year
after the injury (Castro et al. 1999, Eur. J. Appl. Physiol. 80:373-378), less later."""
STRONGEST, SHORTEST, LONGEST = 10.0, 0.1, 3.0
"""Limits of strength and height, in multiples of the table's."""
SUBJECT_MASS, SUBJECT_HEIGHT = 72.6, 1.80
"""The adult whose legs the table describes, kg and m."""


def nerve_names(names: Iterable[str]) -> tuple[str, ...]:
    """Names that are given as one or several, as a tuple; those of a set by the alphabet.

    Raises
    ------
    InputError
        None is given, or something else.
    """
    found = tuple(names_of(names)) if isinstance(names, Iterable) else (names,)
    if not found or not all(isinstance(name, str) for name in found):
        what = "none is named" if not found else f"got {shortened(names)}"
        raise InputError(f"nerves are given by their names, and {what}")
    return found


@dataclass(frozen=True, eq=False)
class Nerves(ReadOnly):
    """A choice of nerves (or of single muscles): the channels of a stimulator.

    Parameters
    ----------
    names
        One per channel, at least one, with its side: `left_femoral`. None: all nerves of the table. Also single muscles
        by their name in the table (`right_soleus`), as an intramuscular electrode reaches them.
    strength
        Factor on all strengths: 1 is the healthy young man of the table. Not given: `PARALYSED`, and the band is
        that of paralysed muscle.
    length
        Factor on all moment arms and lengths (body height over 1.80 m).
    force_length
        Whether strength falls off away from the optimal fibre length; else it is that at the optimum everywhere.
    fatigue
        Factor per name on the strength that is left, 0 (nothing: a dead channel) to 1; absent names are fresh.
    size
        Factor on all strengths in addition to `strength`, which is that of an adult of this size (body mass over
        72.6 kg).

    Raises
    ------
    InputError
        No name, an unknown or repeated one, strength, length or size of no body, fatigue outside [0, 1].

    Examples
    --------
    >>> Nerves(["left_femoral", "right_tibial"]).torque_matrix({"left_knee_flexion": 0.5}).shape
    (19, 2)
    """

    names: tuple[str, ...] | Any = None  # a tuple once it is built
    strength: float | None = None
    length: float = 1.0
    force_length: bool = True
    fatigue: Mapping[str, float] = field(default_factory=dict)
    size: float = 1.0
    members: np.ndarray = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        table = standard_muscles()
        known = tuple(dict.fromkeys(table.nerves))
        if not isinstance(self.fatigue, Mapping):
            raise InputError("fatigue is given as the share of strength that each nerve still has, by name")
        names = known if self.names is None else nerve_names(self.names)
        for name in names:
            if name not in known and name not in table.names:
                raise InputError(f"unknown nerve {name!r}; the nerves are {', '.join(known)}")
        if len(set(names)) < len(names):
            raise InputError("a nerve is named twice")
        between(self.assumed_strength, 0.0, STRONGEST, "strength (1: a healthy adult)")
        between(self.size, 0.0, STRONGEST, "size (1: the table's adult)")
        between(self.length, SHORTEST, LONGEST, "length (1: the table's adult)")
        for name, left in self.fatigue.items():
            if name not in names:
                raise InputError(f"fatigue names {name!r}, which is not among the nerves")
            between(left, 0.0, 1.0, f"fatigue of {name} (0: nothing left, 1: fresh)")
        each = zip(table.nerves, table.names, strict=True)
        members = np.array([[n in (nerve, m) for n in names] for nerve, m in each], dtype=float)
        vars(self).update(names=names, members=members)
        truth(self.force_length, "force_length")
        self._freeze()

    @classmethod
    def of_subject(
        cls,
        mass_kg: float,
        height_m: float,
        names: Iterable[str] | None = None,
        strength: float | None = None,
        **options,
    ) -> "Nerves":
        """Nerves of an adult of other size: strength as mass, arms as height.

        Parameters
        ----------
        mass_kg, height_m
            Of the adult.
        names, options
            See `Nerves`.
        strength
            Of a healthy adult's of that size; not given: that of paralysed muscle, see `Nerves`.

        Raises
        ------
        InputError
            Mass, height or strength of no body.
        """
        size = between(mass_kg, 0.0, STRONGEST * SUBJECT_MASS, "mass_kg") / SUBJECT_MASS
        length = between(height_m, SHORTEST * SUBJECT_HEIGHT, LONGEST * SUBJECT_HEIGHT, "height_m") / SUBJECT_HEIGHT
        return cls(names, strength=strength, length=length, size=size, **options)

    @classmethod
    def muscles(cls, *nerves: str, **options) -> "Nerves":
        """Every single muscle of the given nerves (all of them by default) as a channel of its own."""
        wanted = (cls(nerves) if nerves else cls()).names
        table = standard_muscles()
        return cls(tuple(m for m, n in zip(table.names, table.nerves, strict=True) if n in wanted), **options)

    @property
    def table(self) -> MuscleTable:
        """The muscles behind the names."""
        return standard_muscles()

    @property
    def joints(self) -> tuple[str, ...]:
        """The 19 joints in the order of the torque matrix: that of arrays without names, and of no body's."""
        return JOINT_NAMES

    @property
    def n(self) -> int:
        """Number of channels."""
        return len(self.names)

    @property
    def left_over(self) -> np.ndarray:
        """Strength that fatigue leaves: (n,), 0 to 1."""
        return np.array([self.fatigue.get(name, 1.0) for name in self.names])

    @property
    def assumed_strength(self) -> float:
        """The strength given, else that of paralysed muscle."""
        return PARALYSED if self.strength is None else self.strength

    @property
    def strength_band(self) -> tuple[float, float]:
        """Factors on the assumed strength between which the true one lies."""
        if self.strength is None:
            return PARALYSED_BAND[0] / PARALYSED, PARALYSED_BAND[1] / PARALYSED
        return 1.0 / STRENGTH_FACTOR, STRENGTH_FACTOR

    def select(self, names: Iterable[str]) -> "Nerves":
        """The same subject with only these of its nerves.

        Raises
        ------
        InputError
            No name, or one that is not among these nerves.
        """
        names = nerve_names(names)
        for name in names:
            if name not in self.names:
                raise InputError(f"{name!r} is not among the nerves {', '.join(self.names)}")
        return replace(self, names=names, fatigue={k: v for k, v in self.fatigue.items() if k in names})

    def tired(self, **left: float) -> "Nerves":
        """The same nerves with this much strength left, by name."""
        return replace(self, fatigue={**self.fatigue, **left})

    def muscle_forces(self, q=None, v=None) -> np.ndarray:
        """Force along its tendon of every muscle of the table at full recruitment: (..., m) N.

        Parameters
        ----------
        q, v
            Joint angles, rad, and rates, rad/s: mapping by joint name or array (..., 19). Without rates: isometric.
        """
        table = self.table
        force = self.assumed_strength * self.size * table.strength
        force = force * (table.isometric_fraction(q) if self.force_length else np.cos(table.pennation))
        if v is not None:
            force = force * table.velocity_fraction(q, v)
        return force

    def held(self, q=None) -> tuple[str, ...]:
        """One sentence per joint whose moment arms are taken at another angle than `q`, because none are known there.

        Parameters
        ----------
        q
            Joint angles, rad: mapping by joint name or array (..., 19); of many postures the farthest is reported.
        """
        return self.table.held(q)

    def torque_matrix(self, q=None, v=None) -> np.ndarray:
        """Joint torque per channel at full recruitment: (..., 19, n), N m; joints in the order of `JOINT_NAMES`.

        Moment arms at the posture times strength, summed over the muscles of a nerve.

        Parameters
        ----------
        q
            Joint angles, rad: mapping by joint name (absent joints 0), or array (..., 19). None: neutral.
        v
            Joint rates, rad/s, likewise; with them the force-velocity relation acts.

        Raises
        ------
        InputError
            Unknown joint, wrong shape, or an angle that is not a number.
        """
        if v is not None:
            shapes = angles_of(q).shape, angles_of(v).shape
            if shapes[0][:-1] != shapes[1][:-1] and min(map(len, shapes)) > 1:
                raise InputError(f"rates of shape {shapes[1]} do not go with angles of shape {shapes[0]}")
        torque = self.table.moment_arms(q) * (self.length * self.muscle_forces(q, v))[..., None, :]
        return torque @ self.members * self.left_over

    def torque_band(self, q=None) -> tuple[np.ndarray, np.ndarray]:
        """Least and greatest torque matrix within the band of strength: each (19, n), N m (by magnitude)."""
        low, high = self.strength_band
        torque = self.torque_matrix(q)
        return low * torque, high * torque

    def assumed(self, q=None) -> str:
        """Return the strength and the posture that torques are taken at, in words."""
        low, high = (self.assumed_strength * factor for factor in self.strength_band)
        kind = "paralysed muscle" if self.strength is None else "as given"
        strength = f"{self.assumed_strength:g} of a healthy adult's strength ({kind}; {low:.2g} to {high:.2g})"
        degrees = np.broadcast_to(np.rad2deg(0.0 if q is None else angles_of(q)), len(JOINT_NAMES))
        bent = [f"{name} {angle:.3g}" for name, angle in zip(JOINT_NAMES, degrees, strict=True) if angle]
        posture = f"posture in degrees: {', '.join(bent)}, else 0" if bent else "neutral posture"
        return f"{strength}, {posture}"

    def __str__(self) -> str:
        lines = [f"{self.n} channels, {self.assumed()}; torque when full:"]
        matrix = self.torque_matrix()
        for name, column in zip(self.names, matrix.T, strict=True):
            order = np.argsort(-np.abs(column))[:3]
            parts = [f"{JOINT_NAMES[i]} {column[i]:+.0f} N m" for i in order if abs(column[i]) >= 1.0]
            lines.append(f"  {name:28s} {', '.join(parts)}")
        if np.abs(matrix[16:]).max(initial=0.0) > 0.0:
            lines.append("Levers at the trunk are round figures, constant over posture: a sign and a size (SOURCE.md).")
        return "\n".join(lines)
