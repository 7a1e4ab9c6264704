"""The fewest nerves, and the fewest nerves with braces, that control every falling mode: exact search, with prices.

Two questions, two answers. *Constant* stimulation must balance gravity in the lean itself, as long as the lean is held.
Stimulation *over time* must only bring the body back to rest; that needs fewer nerves, and is what "fewest" means
unless the other is asked for.
"""

import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fes_pin.body.catchable import attainable, catchable, lean_text, plans_of
from fes_pin.body.controllability import modal_controllability
from fes_pin.body.inputs import Inputs
from fes_pin.body.joints import SIDES, known_joint, names_of
from fes_pin.body.linear_body import LinearBody
from fes_pin.body.plans import SETTLE_DEG, Plans
from fes_pin.body.programs import Demand, smallest
from fes_pin.data.errors import InputError
from fes_pin.data.numbers import all_known, known_word, number, positive_number, truth, whole

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

MOST_SETS = 64
"""Sets of the smallest size that are compared by price; where there are more, the answer says so (ours: a search of
minutes)."""
STIMULATIONS = ("over_time", "constant")
"""Kinds of stimulation of a set: any course within the bounds, or constant."""


@dataclass(frozen=True)
class MinimalSet:
    """A smallest set of inputs for a choice of braces.

    Parameters
    ----------
    inputs, braces
        Names of both.
    free_joints, locked_joints, falls
        Joints that still move, joints that all braces lock, how many modes fall.
    energy
        Least integral of u'u that catches 1 degree in the worst falling mode, with the other falls held: s for nerves.
    condition
        Of that task: how much dearer the dearest combination of leans is than the cheapest.
    stimulation
        `over_time` or `constant`.
    lean_deg
        Smallest lean in any falling mode and direction that is caught (over time) or held (constantly), degrees, at
        nominal strength.
    lean_band_deg
        The same if all strengths are less or more by the factor they are known to.
    error_deg
        By how much rounding may have moved the three.
    equals
        How many sets of this size do for these braces: they were all priced, so that the first one is the cheapest.
        `MOST_SETS` where there may be more: the first one is then the cheapest of these.
    """

    inputs: tuple[str, ...]
    braces: tuple[str, ...]
    free_joints: int
    locked_joints: int
    falls: int
    energy: float
    condition: float
    stimulation: str
    lean_deg: float
    lean_band_deg: tuple[float, float]
    error_deg: float = 0.0
    equals: int = 1

    def __str__(self) -> str:
        low, high = self.lean_band_deg
        further = f"further braces: {', '.join(self.braces) or 'none'}"
        what = {"over_time": "catches", "constant": "holds"}[self.stimulation]
        able = f"{what} a lean of {lean_text(self.lean_deg)} [{lean_text(low)}, {lean_text(high)}] deg"
        able = able if self.falls else "nothing falls, and the posture is held"
        price = f"; energy {self.energy:.2g} s, condition {self.condition:.1e}" if self.falls else ""
        if self.equals > 1:
            price += f"; {'at least ' * (self.equals == MOST_SETS)}{self.equals} sets of this size do"
        count = f"{len(self.inputs):2d} nerves ({self.locked_joints} joints locked, {self.falls} falls)"
        return f"{count}: {', '.join(self.inputs) or '-'}; {further}; {able}{price}"


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
    stimulation: str = "over_time",
    balance: bool = True,
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
        Each falling mode must be caught, or held, this far off, both ways, by inputs within their bounds.
    together
        True: with every other fall controlled at the same time by the same set. False: one mode at a time, the others
        let be (Brammer's test with strength, the bound of `modal_bound`): no smaller set does, however stimulated; this
        one does in principle, with an energy that the answer shows.
    gravity
        Whether the set must also carry the posture's weight (C).
    settle_deg
        How far modes may be from the posture (see `fes_pin.body.catchable`). Only with `together`.
    alternatives
        How many sets of the smallest size to return for each choice of braces; the cheapest first.
    strength_factor
        Strengths are known to this factor: the band of `lean_band_deg`.
    stimulation
        `over_time`: the body is brought back to rest by inputs that change (`fes_pin.body.catchable`); `constant`: a
        constant input holds the lean (`fes_pin.body.catchable`).
    balance
        Whether each foot's centre of pressure must lie on its sole. Only with `together` and `gravity`.

    Returns
    -------
    list of MinimalSet
        One or more per choice of braces for which a set exists; fewest nerves first, then fewest braces, then least
        energy. Exact: no smaller set meets the demands (integer programs by HiGHS, each proved optimal); over time,
        of plans as `fes_pin.body.plans` divides them. Of all sets of the smallest size the cheapest are returned, of
        the first `MOST_SETS` where there are more (`equals` says how many were compared).

    Raises
    ------
    InputError
        Unknown brace, joint or stimulation, negative number, a lean that is not positive and finite.
    """
    lean = positive_number(lean_deg, "lean_deg")
    asked = _Question(lean, together, gravity, settle_deg, stimulation, balance, strength_factor)
    max_braces, alternatives = whole(max_braces, "max_braces"), whole(alternatives, "alternatives", 1)
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
            sets = [inputs.select(names) for names in _smallest(braced, inputs, asked, max(MOST_SETS, alternatives))]
            prices = [modal_controllability(braced, each).fall_energy[0].max(initial=0.0) for each in sets]
            order = sorted(range(len(sets)), key=lambda i: (float(f"{prices[i]:.9g}"), sets[i].names))
            for i in order[:alternatives]:
                found.append(replace(_priced(braced, sets[i], chosen, asked), equals=len(sets)))
    return sorted(found, key=lambda s: (len(s.inputs), len(s.braces), float(f"{s.energy:.9g}"), s.inputs, s.braces))


def pareto(sets: Iterable[MinimalSet]) -> list[MinimalSet]:
    """Return the sets that no other beats in both nerves and braces; of equal ones the cheapest."""
    order = sorted(sets, key=lambda s: (len(s.braces), len(s.inputs), s.energy))
    best = {len(found.braces): found for found in reversed(order)}
    front: list[MinimalSet] = []
    for count in sorted(best):
        if not front or len(best[count].inputs) < len(front[-1].inputs):
            front.append(best[count])
    return front


def _orthoses(braces: Iterable[str] | Mapping[str, Sequence[str]]) -> dict[str, tuple[str, ...]]:
    if isinstance(braces, Mapping):
        return {str(name): tuple(map(known_joint, names_of(joints))) for name, joints in braces.items()}
    names = names_of(braces)
    all_known(names, ORTHOSES, "brace")
    return {name: ORTHOSES[name] for name in names}


@dataclass(frozen=True)
class _Question:
    """Requirements on a set."""

    lean_deg: float
    together: bool
    gravity: bool
    settle_deg: float
    stimulation: str
    balance: bool
    strength_factor: float

    def __post_init__(self) -> None:
        known_word(self.stimulation, STIMULATIONS, "stimulation")
        if number(self.strength_factor, "strength_factor") < 1.0:
            raise InputError(f"must be 1 or more, got {self.strength_factor}", column="strength_factor")
        for name in ("together", "gravity", "balance"):
            truth(getattr(self, name), name)
        positive_number(self.settle_deg, "settle_deg", infinite=self.stimulation == "constant")


def _smallest(linear: LinearBody, inputs: Inputs, asked: _Question, alternatives: int) -> list[tuple[str, ...]]:
    """Names of the inputs of the smallest sets."""
    if asked.together and asked.stimulation == "over_time":
        plans = plans_of(linear, inputs, asked.settle_deg, asked.balance, gravity=asked.gravity)
    else:
        plans = Plans.held(linear, inputs, asked.settle_deg, asked.balance, asked.gravity)
    rows, needs = _in_turn(plans, asked.lean_deg)
    if plans.steady and asked.together and len(plans.leans):
        # balance and leans in k modes need k inputs; inputs that only pull, around no load at all, k + 1
        alone = not plans.constant[plans.modes.kinds == "fall"].any() and not inputs.lower.any()
        rows, needs = np.vstack([rows, np.ones(inputs.n)]), np.append(needs, len(plans.leans) + alone)
    # the body is held upright, and leant in each falling mode, both ways
    still, leans = np.zeros(len(plans.modes)), asked.lean_deg * plans.leans
    starts = [still, *leans, *-leans] if asked.together else []
    demands = [Demand(plans.program(start, still), plans.owner) for start in starts]
    found = smallest(inputs.n, rows, needs, demands, alternatives)
    return [tuple(name for name, z in zip(inputs.names, chosen, strict=True) if z) for chosen in found]


def _in_turn(plans: Plans, lean_deg: float) -> tuple[np.ndarray, np.ndarray]:
    """Rows that every set must cover: in every falling mode the pulls reach a lean both ways, on their own."""
    fall = plans.modes.kinds == "fall"
    gains = plans.gains[fall]
    size = np.abs(gains).max(axis=1, initial=0.0)
    size = np.where(size > 1e-12, size, 1.0)
    down, up = plans.inputs.pushes(gains / size[:, None])
    constant, load = plans.constant[fall] / size, (plans.modes.values * plans.modes.degree)[fall] * lean_deg / size
    needs = np.concatenate([load - constant, load + constant])
    rows = np.minimum(np.vstack([up, -down]), 1e9)
    return rows[needs > 1e-9], needs[needs > 1e-9]


def _priced(linear: LinearBody, inputs: Inputs, chosen: tuple[str, ...], asked: _Question) -> MinimalSet:
    energies, condition = modal_controllability(linear, inputs).fall_energy
    leans, error = [], 0.0
    for factor in (1.0 / asked.strength_factor, 1.0, asked.strength_factor):
        scaled = inputs.scaled(factor)
        able = (
            attainable(linear, scaled, asked.gravity, asked.settle_deg, asked.balance)
            if asked.stimulation == "constant" or not asked.together
            else catchable(linear, scaled, asked.settle_deg, asked.balance, gravity=asked.gravity)
        )
        leans.append(able.least_lean_deg)
        error = max(error, float(able.error_deg.max(initial=0.0)))
    low, lean, high = leans
    counts = linear.n, len(linear.braced), len(energies)
    energy, stimulation = float(energies.max(initial=0.0)), asked.stimulation if asked.together else "constant"
    return MinimalSet(inputs.names, chosen, *counts, energy, condition, stimulation, lean, (low, high), error)
