"""The fewest nerves, and the fewest nerves with braces, that control every falling mode: exact search, with prices."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import optimize

from fes_pin.body.attainable import SETTLE_DEG, Demands, attainable, demands, lean_text
from fes_pin.body.controllability import controllability
from fes_pin.body.inputs import Inputs
from fes_pin.body.joints import SIDES, known_joint
from fes_pin.body.linearize import LinearBody
from fes_pin.data.errors import InputError

ORTHOSES: dict[str, tuple[str, ...]] = {
    **{f"{side}_{name}": tuple(f"{side}_{joint}" for joint in joints) for side in SIDES for name, joints in {
        "foot_plate": ("mtp_extension",),
        "ankle_foot_orthosis": ("ankle_dorsiflexion", "ankle_inversion", "ankle_rotation"),
        "knee_lock": ("knee_flexion",),
        "hip_guide": ("hip_adduction", "hip_rotation"),
        "hip_lock": ("hip_flexion",),
    }.items()},
    "corset": ("lumbar_extension", "lumbar_bending", "lumbar_rotation"),
}  # fmt: skip
"""What an orthosis locks. A hip guide leaves flexion free, as a hip guidance orthosis does; a corset joins trunk and
pelvis."""

_CUTS_A_ROUND = 4


@dataclass(frozen=True)
class MinimalSet:
    """A smallest set of inputs for a choice of braces.

    Parameters
    ----------
    inputs, braces
        Names of both.
    free_joints, falls
        Joints that still move, and how many modes fall.
    energy
        Least integral of u'u that catches 1 degree in the worst falling mode, with the other falls held: s for nerves.
    condition
        Of that task: how much dearer the dearest combination of leans is than the cheapest.
    lean_deg
        Smallest lean in any falling mode and direction that can be held, degrees, at nominal strength.
    lean_band_deg
        The same if all strengths are less or more by the factor they are known to.
    """

    inputs: tuple[str, ...]
    braces: tuple[str, ...]
    free_joints: int
    falls: int
    energy: float
    condition: float
    lean_deg: float
    lean_band_deg: tuple[float, float]

    def __str__(self) -> str:
        low, high = self.lean_band_deg
        braces = ", ".join(self.braces) or "none"
        return (
            f"{len(self.inputs):2d} nerves, {len(self.braces)} braces ({self.falls} falls): "
            f"{', '.join(self.inputs) or '-'}; braces: {braces}; "
            f"energy {self.energy:.2g} s, condition {self.condition:.1e}, "
            f"holds a lean of {lean_text(self.lean_deg)} [{lean_text(low)}, {lean_text(high)}] deg"
        )


def minimal_sets(
    linear: LinearBody,
    inputs,
    *,
    braces: Iterable[str] | Mapping[str, Sequence[str]] = (),
    max_braces: int = 0,
    lean_deg: float = 1.0,
    together: bool = True,
    gravity: bool = True,
    settle_deg: float = SETTLE_DEG,
    alternatives: int = 1,
    strength_factor: float = 1.8,
) -> list[MinimalSet]:
    """Smallest sets of inputs that control every falling mode, for each choice of braces up to a number.

    Parameters
    ----------
    linear
        The body at a posture.
    inputs
        Candidates: `Nerves`, `Inputs`, or names of joints.
    braces
        Names out of `ORTHOSES`, or a mapping from a name to the joints that it locks.
    max_braces
        At most so many of them at once; every combination is tried.
    lean_deg
        Each falling mode must be held this far off, both ways, by inputs within their bounds.
    together
        True: with every other fall held at the same time by the same set. False: one mode at a time, the others let be
        (Brammer's test with strength: what could do in principle, at a price that the answer shows).
    gravity
        Whether the set must also carry the posture's weight (C).
    settle_deg
        How far swinging modes may hang from the posture (see `fes_pin.body.attainable`). Only with `together`.
    alternatives
        How many sets of the smallest size to find for each choice of braces; the cheapest first.
    strength_factor
        Strengths are known to this factor: the band of `lean_band_deg`.

    Returns
    -------
    list of MinimalSet
        One or more per choice of braces for which a set exists; fewest nerves first, then fewest braces, then least
        energy. Exact: no smaller set meets the demands (integer programs by HiGHS, each proved optimal).

    Raises
    ------
    InputError
        Unknown brace or joint, negative number, a lean that is not positive.
    """
    if not lean_deg > 0.0:
        raise InputError(f"must be positive, got {lean_deg}", column="lean_deg")
    if max_braces < 0 or alternatives < 1 or not strength_factor >= 1.0:
        raise InputError("max_braces must be 0 or more, alternatives 1 or more, strength_factor 1 or more")
    inputs = Inputs.of(inputs, linear)
    orthoses = _orthoses(braces)
    found = []
    for count in range(max_braces + 1):
        for chosen in itertools.combinations(orthoses, count):
            locked = [joint for name in chosen for joint in orthoses[name] if joint in linear.joint_names]
            if count and (not locked or any(not set(orthoses[n]) & set(linear.joint_names) for n in chosen)):
                continue
            if len(set(locked)) == linear.n:
                continue
            braced = linear.brace(list(dict.fromkeys(locked))) if locked else linear
            wanted = demands(braced, inputs, gravity, settle_deg)
            for names in _smallest(inputs, wanted, lean_deg, together, alternatives):
                found.append(
                    _priced(
                        braced,
                        inputs.select(names),
                        chosen,
                        gravity=gravity,
                        settle_deg=settle_deg,
                        strength_factor=strength_factor,
                    )
                )
    return sorted(found, key=lambda s: (len(s.inputs), len(s.braces), s.energy, s.inputs, s.braces))


def pareto(sets: Iterable[MinimalSet]) -> list[MinimalSet]:
    """Of many sets those that no other beats in nerves and braces both; the cheapest of equals."""
    best: dict[int, MinimalSet] = {}
    for found in sorted(sets, key=lambda s: (len(s.braces), len(s.inputs), s.energy)):
        best.setdefault(len(found.braces), found)
    front: list[MinimalSet] = []
    for count in sorted(best):
        if not front or len(best[count].inputs) < len(front[-1].inputs):
            front.append(best[count])
    return front


def _orthoses(braces: Iterable[str] | Mapping[str, Sequence[str]]) -> dict[str, tuple[str, ...]]:
    if isinstance(braces, Mapping):
        return {str(name): tuple(known_joint(joint) for joint in joints) for name, joints in braces.items()}
    names = [braces] if isinstance(braces, str) else list(braces)
    for name in names:
        if name not in ORTHOSES:
            raise InputError(f"unknown brace {name!r}; known are {', '.join(ORTHOSES)}")
    return {name: ORTHOSES[name] for name in names}


def _smallest(
    inputs: Inputs, wanted: Demands, lean_deg: float, together: bool, alternatives: int
) -> list[tuple[str, ...]]:
    """Smallest sets: a covering program in z (input chosen or not), to which demands add the rows that they lack.

    Where the chosen inputs fail a demand, inputs are added as long as it still fails: of what is then left out every
    set must hold at least one. Such rows hold for every answer, so the first choice that meets all demands is a
    smallest one.
    """
    if not wanted.falling:
        return [()]
    cuts, needs = _in_turn(wanted, inputs, lean_deg)
    everything = np.ones(inputs.n, dtype=bool)
    k = len(wanted.falling)
    cases = (
        [wanted.target, *(wanted.leaning(i, s * lean_deg) for i in range(k) for s in (1.0, -1.0))] if together else []
    )
    if not np.all(cuts.sum(axis=1) >= needs) or not all(_met(wanted, inputs, everything, case) for case in cases):
        return []
    rows, bounds = list(cuts), list(needs)
    if together:  # balance and leans in k modes need k inputs; inputs that only pull, around no load at all, k + 1
        alone = not wanted.target.any() and not inputs.lower.any()
        rows.append(np.ones(inputs.n))
        bounds.append(float(k + alone))
    found: list[tuple[str, ...]] = []
    excluded: list[np.ndarray] = []
    while len(found) < alternatives:
        chosen = _cover(np.array(rows), np.array(bounds), excluded)
        if chosen is None or (found and chosen.sum() > len(found[0])):
            break
        missing = [case for case in cases if not _met(wanted, inputs, chosen, case)]
        for case in missing[:_CUTS_A_ROUND]:
            rows.append(_still_lacking(wanted, inputs, chosen, case))
            bounds.append(1.0)
        if not missing:
            found.append(tuple(name for name, z in zip(inputs.names, chosen, strict=True) if z))
            excluded.append(chosen)
    return found


def _in_turn(wanted: Demands, inputs: Inputs, lean_deg: float) -> tuple[np.ndarray, np.ndarray]:
    """Rows that every set must cover: in every falling mode the pulls reach a lean both ways, on their own."""
    up = np.maximum(wanted.gains * inputs.upper, wanted.gains * inputs.lower)
    down = np.maximum(-wanted.gains * inputs.upper, -wanted.gains * inputs.lower)
    needs = np.concatenate([wanted.target + wanted.load * lean_deg, -wanted.target + wanted.load * lean_deg])
    rows = np.nan_to_num(np.vstack([up, down]), nan=0.0, posinf=1e9)
    return _tidy(rows, needs)


def _tidy(rows: np.ndarray, needs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """More than enough is enough: entries above the need count as the need, and each row is scaled to a need of 1."""
    keep = needs > 1e-9
    rows, needs = rows[keep], needs[keep]
    return np.minimum(rows / needs[:, None], 1.0), np.ones(len(needs))


def _cover(rows: np.ndarray, needs: np.ndarray, excluded: list[np.ndarray]) -> np.ndarray | None:
    """Fewest columns that cover the rows, other than the excluded choices; None if there is no such choice."""
    m = rows.shape[1]
    constraints = [optimize.LinearConstraint(rows, lb=needs * (1.0 - 1e-9))]
    if excluded:
        constraints.append(optimize.LinearConstraint(np.array(excluded), ub=[e.sum() - 1 for e in excluded]))
    answer = optimize.milp(np.ones(m), constraints=constraints, integrality=np.ones(m), bounds=optimize.Bounds(0, 1))
    return np.round(answer.x).astype(bool) if answer.status == 0 else None


def _met(wanted: Demands, inputs: Inputs, chosen: np.ndarray, target: np.ndarray) -> bool:
    """Whether the chosen inputs within their bounds meet one demand."""
    gains, settle = wanted.gains[:, chosen], wanted.settle_gains[:, chosen]
    if not chosen.any():
        settled = np.all(wanted.settle_low <= 0.0) and np.all(wanted.settle_high >= 0.0)
        return bool(settled and np.abs(target).max(initial=0.0) < 1e-9)
    found = optimize.linprog(
        np.zeros(gains.shape[1]),
        A_ub=np.vstack([settle, -settle]),
        b_ub=np.concatenate([wanted.settle_high, -wanted.settle_low]),
        A_eq=gains,
        b_eq=target,
        bounds=np.column_stack([inputs.lower[chosen], inputs.upper[chosen]]),
    )
    return found.status == 0


def _still_lacking(wanted: Demands, inputs: Inputs, chosen: np.ndarray, target: np.ndarray) -> np.ndarray:
    """Inputs of which at least one is needed: (m,) 0 or 1. The chosen are grown to a largest set that fails the
    demand."""
    grown = chosen.copy()
    for j in np.flatnonzero(~chosen):
        grown[j] = True
        if _met(wanted, inputs, grown, target):
            grown[j] = False
    return (~grown).astype(float)


def _priced(
    linear: LinearBody,
    inputs: Inputs,
    chosen: tuple[str, ...],
    *,
    gravity: bool,
    settle_deg: float,
    strength_factor: float,
) -> MinimalSet:
    energies, condition = controllability(linear, inputs).fall_energy
    leans = [
        attainable(linear, inputs.scaled(factor), gravity, settle_deg).least_lean_deg
        for factor in (1.0 / strength_factor, 1.0, strength_factor)
    ]
    return MinimalSet(
        inputs=inputs.names,
        braces=tuple(chosen),
        free_joints=linear.n,
        falls=len(energies),
        energy=float(energies.max(initial=0.0)),
        condition=condition,
        lean_deg=leans[1],
        lean_band_deg=(leans[0], leans[2]),
    )
