"""Nerves: which joints a stimulated nerve turns, and how strongly, at a posture."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace

import numpy as np

from fes_pin.body.joints import JOINT_NAMES
from fes_pin.data.errors import InputError
from fes_pin.muscles.muscles import MuscleTable, standard_muscles

STRENGTH_FACTOR = 1.8
"""Strengths are known to this factor: how far another accepted model (Rajagopal 2016) lies from this table."""
SUBJECT_MASS, SUBJECT_HEIGHT = 72.6, 1.80
"""The adult whose legs the table describes, kg and m."""


@dataclass(frozen=True)
class Nerves:
    """A choice of nerves (or of single muscles): the channels of a stimulator.

    Parameters
    ----------
    names
        One per channel, with its side: `left_femoral`. All nerves of the table by default; also single muscles
        by their name in the table (`right_soleus`), as an intramuscular electrode reaches them.
    strength
        Factor on all strengths: 1 is the healthy adult of the table; paralysed muscle may have 0.3 to 0.7.
    length
        Factor on all moment arms and lengths (body height over 1.80 m).
    force_length
        Whether strength falls off away from the optimal fibre length (rigid tendon); else it is that at the optimum.
    fatigue
        Factor per name on the strength that is left, 0 (nothing: a dead channel) to 1; absent names are fresh.

    Raises
    ------
    InputError
        Unknown or repeated name, negative strength, length that is not positive, fatigue outside [0, 1].

    Examples
    --------
    >>> Nerves(["left_femoral", "right_tibial"]).torque_matrix({"left_knee_flexion": 0.5}).shape
    (19, 2)
    """

    names: tuple[str, ...] = ()
    strength: float = 1.0
    length: float = 1.0
    force_length: bool = False
    fatigue: dict[str, float] = field(default_factory=dict)
    members: np.ndarray = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        table = standard_muscles()
        known = tuple(dict.fromkeys(table.nerves))
        names = (self.names,) if isinstance(self.names, str) else tuple(self.names) or known
        for name in names:
            if name not in known and name not in table.names:
                raise InputError(f"unknown nerve {name!r}; the nerves are {', '.join(known)}")
        if len(set(names)) < len(names):
            raise InputError("a nerve is named twice")
        if not (np.isfinite(self.strength) and self.strength >= 0.0):
            raise InputError(f"strength must be 0 or more, got {self.strength}")
        if not (np.isfinite(self.length) and self.length > 0.0):
            raise InputError(f"length must be more than 0, got {self.length}")
        for name, left in self.fatigue.items():
            if name not in names:
                raise InputError(f"fatigue names {name!r}, which is not among the nerves")
            if not 0.0 <= left <= 1.0:
                raise InputError(f"fatigue of {name} must lie between 0 (nothing left) and 1 (fresh), got {left}")
        members = np.array(
            [[n in (nerve, m) for n in names] for nerve, m in zip(table.nerves, table.names, strict=True)]
        )
        object.__setattr__(self, "names", names)
        object.__setattr__(self, "members", members.astype(float))

    def __hash__(self) -> int:
        return hash((self.names, self.strength, self.length, self.force_length, tuple(sorted(self.fatigue.items()))))

    @classmethod
    def of_subject(cls, mass_kg: float, height_m: float, names: Iterable[str] = (), **options) -> Nerves:
        """Nerves of an adult of other size: strength as mass, arms as height.

        Raises
        ------
        InputError
            Mass or height is not positive.
        """
        if not (mass_kg > 0.0 and height_m > 0.0):
            raise InputError(f"mass and height must be positive, got {mass_kg} kg and {height_m} m")
        return cls(tuple(names), strength=mass_kg / SUBJECT_MASS, length=height_m / SUBJECT_HEIGHT, **options)

    @classmethod
    def muscles(cls, *nerves: str, **options) -> Nerves:
        """Every single muscle of the given nerves (all of them by default) as a channel of its own."""
        wanted = cls(nerves).names
        table = standard_muscles()
        return cls(tuple(m for m, n in zip(table.names, table.nerves, strict=True) if n in wanted), **options)

    @property
    def table(self) -> MuscleTable:
        """The muscles behind the names."""
        return standard_muscles()

    @property
    def n(self) -> int:
        """Number of channels."""
        return len(self.names)

    @property
    def left_over(self) -> np.ndarray:
        """Strength that fatigue leaves: (n,), 0 to 1."""
        return np.array([self.fatigue.get(name, 1.0) for name in self.names])

    @property
    def strength_band(self) -> tuple[float, float]:
        """Factors between which the true strength lies, on each nerve's strength."""
        return 1.0 / STRENGTH_FACTOR, STRENGTH_FACTOR

    def select(self, names: Iterable[str]) -> Nerves:
        """The same subject with only these nerves."""
        names = tuple(names)
        return replace(self, names=names, fatigue={k: v for k, v in self.fatigue.items() if k in names})

    def tired(self, **left: float) -> Nerves:
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
        force = self.strength * table.strength * np.cos(table.pennation)
        if self.force_length:
            force = force * table.isometric_fraction(q)
        if v is not None:
            force = force * table.velocity_fraction(q, v)
        return force

    def held(self, q=None) -> tuple[str, ...]:
        """One sentence per joint whose moment arms are taken at another angle than `q`, because none are known there.

        Parameters
        ----------
        q
            Joint angles, rad: mapping by joint name or array (..., 19); of many postures the farthest is told.
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
        torque = self.table.moment_arms(q) * (self.length * self.muscle_forces(q, v))[..., None, :]
        return torque @ self.members * self.left_over

    def torque_band(self, q=None) -> tuple[np.ndarray, np.ndarray]:
        """Least and greatest torque matrix under the uncertainty of strength: each (19, n), N m (by magnitude)."""
        low, high = self.strength_band
        torque = self.torque_matrix(q)
        return low * torque, high * torque

    def __str__(self) -> str:
        lines = [
            f"{self.n} channels, strengths known to a factor of {STRENGTH_FACTOR}; torque when full, neutral posture:"
        ]
        matrix = self.torque_matrix()
        for name, column in zip(self.names, matrix.T, strict=True):
            order = np.argsort(-np.abs(column))[:3]
            parts = [f"{JOINT_NAMES[i]} {column[i]:+.0f} N m" for i in order if abs(column[i]) >= 1.0]
            lines.append(f"  {name:28s} {', '.join(parts)}")
        if np.abs(matrix[16:]).max(initial=0.0) > 0.0:
            lines.append("Levers at the trunk are round figures, constant over posture: a sign and a size (SOURCE.md).")
        return "\n".join(lines)
