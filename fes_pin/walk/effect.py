"""Causes of errors in a model of walking, and the forms that each can take."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial
from typing import ClassVar, NamedTuple

import numpy as np
import pinocchio as pin

from fes_pin.body.joints import SIDES
from fes_pin.infer.keys import Key
from fes_pin.walk.walk_trial import WalkTrial

STAGE = "body"
"""Stage of these causes."""
AXES = ("forward", "left", "up")

UNITS = {"n": "N", "share": ""}
"""Units that the end of a parameter's name writes otherwise."""

SegmentChange = Callable[[dict[str, np.ndarray]], dict[str, np.ndarray]]
"""Function of the segments' ten mass parameters: their changes per unit of each parameter, (10, p) by segment."""


@dataclass(frozen=True)
class Form:
    """One way in which a cause may act.

    Attributes
    ----------
    cause
        Its canonical name.
    site
        Where or how it acts, in a few words.
    parameters
        Names of its columns, which end in their units.
    plausible
        A large but possible size of every parameter; a form that is not significant at this size is not testable.
    columns
        Residual (measured - required) per unit of each parameter: (n, 6, p).
    shifts
        Whether the parameter is a shift of the plates' clock, which is estimated by repeated linearization.
    positive
        Whether a negative value has no meaning.
    ordinary
        Standard deviation of the parameter where nothing is wrong: an ordinary error of every session is no cause.
    reads
        Numbers of the forces of `Stated.air_n` that its only parameter changes by as much.
    segments
        The change of segments' mass parameters; None of a form that changes none.
    """

    cause: str
    site: str
    parameters: tuple[str, ...]
    plausible: float
    columns: Callable[[WalkTrial], np.ndarray] = field(repr=False, compare=False)
    shifts: bool = False
    positive: bool = False
    ordinary: float = 0.0
    reads: tuple[int, ...] = ()
    segments: SegmentChange | None = field(default=None, repr=False, compare=False)

    @property
    def units(self) -> tuple[str, ...]:
        """Units of the parameters."""
        ends = (n.rpartition("_")[2] for n in self.parameters)
        return tuple(UNITS.get(end, end) for end in ends)

    @property
    def label(self) -> str:
        """Cause and site: its name among all forms."""
        return str(Key(self.cause, self.site))

    @property
    def place(self) -> tuple[str, str]:
        """Cause and site without the form that it has there."""
        return self.cause, self.site.split(",")[0]


class WalkEffect:
    """A physical effect that a model of walking lacks, or an error of its measurements.

    A subclass describes it in its docstring and lists its forms. Each form is linear in its parameters.

    Attributes
    ----------
    name
        The canonical name of the cause.
    vector
        Symbol in the equation whose parts are the parameters; "" where the equation has these themselves.
    """

    name: ClassVar[str]
    vector: ClassVar[str] = ""
    rigs: ClassVar[tuple[str, ...]] = ("body",)

    @classmethod
    def forms(cls) -> Iterator[Form]:
        """Yield every form, the simplest first."""
        raise NotImplementedError


SITES: dict[str, tuple[str, ...]] = {
    "trunk": ("trunk",),
    "pelvis": ("pelvis",),
    **{f"both {part}s": tuple(f"{side}_{part}" for side in SIDES) for part in ("thigh", "shank")},
    "both feet": tuple(f"{side}_{part}" for side in SIDES for part in ("hindfoot", "forefoot")),
    **{f"{side} {part}": (f"{side}_{part}",) for part in ("thigh", "shank") for side in SIDES},
    **{f"{side} foot": tuple(f"{side}_{part}" for part in ("hindfoot", "forefoot")) for side in SIDES},
}
"""Sites at which a segment's parameters may be wrong: one segment, or the same segment of both legs."""


PLATES: dict[str, tuple[str, ...]] = {"both plates": SIDES, **{f"{side} plate": (side,) for side in SIDES}}
"""Sites at which plates may be wrong, with the sides of their feet."""


def segment_form(cause: str, site: str, parameters: tuple[str, ...], plausible: float, change: SegmentChange) -> Form:
    """Return a form that changes segments' mass parameters, with columns of Pinocchio's regressors times the change."""
    return Form(cause, site, parameters, plausible, partial(_regressed, change=change), segments=change)


def _regressed(trial: WalkTrial, change: SegmentChange) -> np.ndarray:
    return np.sum([trial.regressors[s] @ d for s, d in change(trial.motion.parameters).items()], axis=0)


ROUNDED = 1e-3
"""Share by which rounded moments of inertia may miss the triangle inequality."""


class Segment(NamedTuple):
    """Mass, kg, centre (3,), m, and central inertia (3, 3), kg m2, of a segment, in the frame of its link."""

    mass: float
    lever: np.ndarray
    inertia: np.ndarray


def changed_segment(believed: np.ndarray, change: np.ndarray) -> Segment:
    """Return a segment whose mass, first moment and central inertia are changed by what forms are linear in.

    The ten parameters have the inertia about the joint, which is quadratic in the place of the centre. The central
    inertia is what a body is held to: the part of the change that the centre's way makes is left out of it.

    Parameters
    ----------
    believed, change
        Ten mass parameters, and the sum of their changes.
    """
    one = pin.Inertia.FromDynamicParameters(believed)
    moved = (change[1:4] - one.lever * change[0]) / one.mass
    c, d = pin.skew(one.lever), pin.skew(moved)
    xx, xy, yy, xz, yz, zz = change[4:]
    about_joint = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    central = one.inertia + about_joint - change[0] * c.T @ c - one.mass * (c.T @ d + d.T @ c)
    mass = one.mass + change[0]
    return Segment(mass, (one.mass * one.lever + change[1:4]) / (mass or 1.0), central)


def is_of_a_body(segment: Segment) -> bool:
    """Return whether a body can have a mass and moments of inertia: both positive, none above the sum of the others."""
    moments = np.linalg.eigvalsh(segment.inertia)
    return bool(segment.mass > 0.0 < moments[0] and moments[2] <= (moments[0] + moments[1]) * (1.0 + ROUNDED))
