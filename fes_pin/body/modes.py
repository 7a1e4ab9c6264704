"""Modes of a linearized body: how it falls and swings when nothing acts on it.

The 19 eigenpairs of A^-1 B come from the symmetric generalized problem B phi = mu A phi with phi' A phi = 1. The
paper's three properties follow: the 38 eigenvalues of F are +-sqrt(mu); its eigenvectors are (phi, +-sqrt(mu) phi);
and A^-1 B is similar to the symmetric Q = A^(-1/2) B A^(-1/2), which Jacobi's rotations diagonalize.
"""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from fes_pin.body.joints import side_of
from fes_pin.data.named import NamedArray
from fes_pin.data.show import Tabulated

NEUTRAL_RATE = 1e-3
"""Below this rate, 1/s, a mode neither falls nor swings within a quarter of an hour."""
_PLANES = (  # fore-aft, sideways, turning
    ("flexion", "dorsiflexion", "extension"),
    ("adduction", "inversion", "bending"),
    ("rotation",),
)
_VERBS = {  # in each of the planes
    "fall": ("fall forward or back", "fall sideways", "twist away"),
    "swing": ("swing forward and back", "swing sideways", "twist to and fro"),
    "neutral": ("drift forward or back", "drift sideways", "drift in rotation"),
}


@dataclass(frozen=True, eq=False)
class Mode(Tabulated):
    """One way in which the body falls or swings.

    Parameters
    ----------
    value
        Eigenvalue of A^-1 B, 1/s2: positive falls, negative swings.
    shape
        Eigenvector with shape' A shape = 1: (n,), by joint name as in `mode.shape["right_hip_flexion"]`.
    joint_names
        Its joints.
    participation
        Share of each joint in the mode, by |shape_j (A shape)_j|: (n,) by joint name, sums to 1.
    name
        For a person: "fall sideways about the stance ankle, 0.24 s to double".
    """

    value: float
    shape: NamedArray = field(repr=False)
    joint_names: tuple[str, ...] = field(repr=False)
    participation: NamedArray = field(repr=False)
    name: str = ""

    def __post_init__(self) -> None:
        for name in ("shape", "participation"):
            object.__setattr__(self, name, NamedArray(getattr(self, name), self.joint_names))
        self._freeze()

    _index = "joint"

    def _table(self) -> dict[str, Any]:
        shape, share = self.one_degree.tolist(), self.participation.tolist()
        return {"joint": list(self.joint_names), "one_degree_rad": shape, "participation": share}

    def __str__(self) -> str:
        return self.name

    @property
    def kind(self) -> str:
        """`fall`, `swing` or `neutral`."""
        return kind_of(self.value)

    @property
    def rate(self) -> float:
        """Rate of growth when it falls, angular frequency when it swings, 1/s."""
        return float(np.sqrt(abs(self.value)))

    @property
    def time_constant(self) -> float:
        """Time in which a fall grows e-fold, s; infinite for other modes."""
        return 1.0 / self.rate if self.kind == "fall" else np.inf

    @property
    def doubling_time(self) -> float:
        """Time in which a fall doubles, s; infinite for other modes."""
        return np.log(2.0) * self.time_constant

    @property
    def frequency(self) -> float:
        """Frequency of a swing, Hz; 0 for other modes."""
        return self.rate / (2.0 * np.pi) if self.kind == "swing" else 0.0

    @property
    def joints(self) -> dict[str, float]:
        """Joints by share, greatest first."""
        order = np.argsort(-self.participation)
        return {self.joint_names[i]: float(self.participation[i]) for i in order}

    @property
    def one_degree(self) -> NamedArray:
        """The shape scaled so that the joint that moves most moves by one degree: (n,) rad by joint name."""
        return self.shape * np.radians(1.0) / np.abs(self.shape).max()


@dataclass(frozen=True, eq=False)
class ModeSet(Tabulated):
    """All modes of a body, fastest fall first, fastest swing last.

    Parameters
    ----------
    modes
        The n of them.
    values
        Eigenvalues of A^-1 B, falling order: (n,) 1/s2.
    shapes
        Eigenvectors in columns, shapes' A shapes = 1: (n, r), r = n on one foot.
    conservative
        False where damping or motion is left out here; `LinearBody.poles` then includes them.
    """

    modes: tuple[Mode, ...]
    values: np.ndarray = field(repr=False)
    shapes: np.ndarray = field(repr=False)
    conservative: bool = True

    @cached_property
    def kinds(self) -> np.ndarray:
        """`fall`, `swing` or `neutral` by mode: (n,) text."""
        return np.array([mode.kind for mode in self.modes])

    @cached_property
    def degree(self) -> np.ndarray:
        """Modal coordinate of one degree of each mode's greatest joint: (n,)."""
        return np.radians(1.0) / np.abs(self.shapes).max(axis=0)

    _index = "mode"

    def _table(self) -> dict[str, Any]:
        return {
            "mode": [mode.name for mode in self.modes],
            "kind": self.kinds.tolist(),
            "value_per_s2": self.values.tolist(),
            "doubling_s": [mode.doubling_time for mode in self.modes],
            "frequency_hz": [mode.frequency for mode in self.modes],
            "greatest_joint": [next(iter(mode.joints)) for mode in self.modes],
        }

    def __iter__(self):
        return iter(self.modes)

    def __len__(self) -> int:
        return len(self.modes)

    def __getitem__(self, i: int) -> Mode:
        return self.modes[i]

    @property
    def falling(self) -> tuple[Mode, ...]:
        """The unstable modes."""
        return tuple(mode for mode in self.modes if mode.kind == "fall")

    def __str__(self) -> str:
        lines = [f"{len(self)} modes, {len(self.falling)} of them fall"]
        if not self.conservative:
            lines.append("(without damping and rates: see poles)")
        for i, mode in enumerate(self.modes, 1):
            top = ", ".join(f"{name} {100 * share:.0f} %" for name, share in list(mode.joints.items())[:3])
            lines.append(f"{i:3d}  {mode.name:66s} {top}")
        return "\n".join(lines)


def kind_of(value: float) -> str:
    """`fall`, `swing` or `neutral` by an eigenvalue of A^-1 B."""
    if abs(value) < NEUTRAL_RATE**2:
        return "neutral"
    return "fall" if value > 0.0 else "swing"


def _plane(share: np.ndarray, names: tuple[str, ...]) -> int:
    each = [(float(s), name.rsplit("_", 1)[1]) for s, name in zip(share, names, strict=True)]
    totals = [sum(s for s, motion in each if motion in motions) for motions in _PLANES]
    return totals.index(max(totals))


def _region(name: str, stance: str) -> str:
    side = side_of(name)
    if side is None:
        return "back"
    part = name.split("_")[1]
    place = {"mtp": "toe joint"}.get(part, part)
    return f"{'stance' if side == stance else 'swing'} {place}"


def mode_name(value: float, share: np.ndarray, names: tuple[str, ...], stance: str) -> str:
    """A mode for a person: what it does, about which joints, and how fast."""
    regions: dict[str, float] = {}
    for s, name in zip(share, names, strict=True):
        region = _region(name, stance)
        regions[region] = regions.get(region, 0.0) + float(s)
    order = sorted(regions, key=regions.__getitem__, reverse=True)
    where = order[0] if len(order) < 2 or regions[order[1]] < 0.5 * regions[order[0]] else f"{order[0]} and {order[1]}"
    kind = kind_of(value)
    text = f"{_VERBS[kind][_plane(share, names)]} about the {where}"
    rate = np.sqrt(abs(value))
    if kind == "fall":
        return f"{text}, {np.log(2.0) / rate:.2g} s to double"
    return f"{text}, {rate / (2.0 * np.pi):.2f} Hz" if kind == "swing" else text
