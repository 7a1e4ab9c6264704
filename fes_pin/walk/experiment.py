"""The next experiment of walking or standing: the simple trial that distinguishes two causes best."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fes_pin.data.read_only import ReadOnly
from fes_pin.data.results import Plan
from fes_pin.infer.levels import STRONG_EVIDENCE
from fes_pin.infer.search import SearchResult
from fes_pin.walk.designs import Designs
from fes_pin.walk.dynamics import about, required
from fes_pin.walk.models import WalkFit, WalkModels
from fes_pin.walk.motion import Motion
from fes_pin.walk.walk_trial import WalkTrial

NEXT_FILE = "next_trial.csv"
CARRIED_KG = 10.0
"""Load that is carried in the trial that is proposed."""
SLOWER = 0.6
"""Share of the usual speed in the trial that is proposed."""


@dataclass(frozen=True)
class NextWalk(Plan, ReadOnly):
    """A trial to do next.

    Attributes
    ----------
    why, separates
        As of `Plan`.
    conditions
        Conditions of the trial, as a `[[trial]]` table; None where no simple trial separates them.
    coordinates
        Columns of the motion to make: `time_s`, `q_<coordinate>`.
    """

    conditions: dict[str, float] | None
    coordinates: dict[str, np.ndarray] | None

    def trial_record(self) -> dict[str, Any] | None:
        """Return the trial as JSON files have it; its motion is in `NEXT_FILE`."""
        if self.conditions is None:
            return None
        return {"coordinates": NEXT_FILE, "file": NEXT_FILE, "kind": "motion", **self.conditions}


def next_walk(models: WalkModels, found: SearchResult[WalkFit], cause: str) -> NextWalk | None:
    """Return the trial that separates a cause from its nearest rival of another name; None if it has no rival."""
    designs, best = models.designs, found.best
    own = {n for n in best.names if designs.forms[n].cause == cause}
    near = [(r.criterion, set(r.names) - set(best.names), n) for n in own for r in models.near_rivals(found, n)]
    rivals = [(criterion, new, gone) for criterion, (new,), gone in near if designs.forms[new].cause != cause]
    if not rivals:
        return None
    _, new, gone = min(rivals)
    pair = (cause, designs.forms[new].cause)
    signal = models.sizes(best)[gone]
    scores = {}
    for name, make in _TRIALS.items():
        trial = make(designs.as_read.trials[0])
        mine, its = (designs.forms[n].columns(trial) for n in (gone, new))
        scores[name] = _separation(designs, mine @ signal, its, designs.plausible((new,)), best)
    name = max(scores, key=lambda n: scores[n])
    if scores[name] < STRONG_EVIDENCE:
        why = (
            f"{pair[0]} and {pair[1]} look alike in standing, in slower walking and under a known weight: "
            "weigh the plates with known masses, or measure the body by other means"
        )
        return NextWalk(why, pair, None, None)
    first = designs.recordings[0]
    time, columns = first.time, {n: c for n, c in first.coordinates.items() if n.startswith("q_")}
    time, columns, conditions = _program(name, time - time[0], columns, first.session.belt_speed_mps)
    why = f"{_WORDS[name]} (it separates {pair[0]} from {pair[1]} by {np.sqrt(scores[name]):.1f} standard deviations)"
    return NextWalk(why, pair, conditions, {"time_s": time, **columns})


def _program(
    name: str, time: np.ndarray, columns: dict[str, np.ndarray], belt_speed_mps: float
) -> tuple[np.ndarray, dict[str, np.ndarray], dict[str, float]]:
    if name == "slower":
        return time / SLOWER, columns, {"belt_speed_mps": SLOWER * belt_speed_mps}
    if name == "stand":
        still = {
            n: np.full_like(c, float(np.mean(c)) if n.startswith("q_pelvis_t") else 0.0) for n, c in columns.items()
        }
        return time, still, {"belt_speed_mps": 0.0}
    return time, columns, {"belt_speed_mps": belt_speed_mps}


def _trial(old: WalkTrial, motion: Motion, load: dict[str, np.ndarray], extra: np.ndarray | None = None) -> WalkTrial:
    """Return a trial whose plates measure what its motion requires, divided between the feet, plus `extra` (n, 6)."""
    needed = required(motion)
    if extra is not None:
        needed = needed + extra
    feet = {side: share[:, None] * needed for side, share in load.items()}
    loaded = {side: share > 0.0 for side, share in load.items()}
    plates = replace(old.plates, feet=feet, loaded=loaded, way=0.0 * old.plates.way)
    return WalkTrial(old.name, motion, plates)


def _shares(old: WalkTrial) -> dict[str, np.ndarray]:
    up = {side: np.clip(w[:, 2], 0.0, None) for side, w in old.plates.feet.items()}
    total = np.maximum(up["left"] + up["right"], 1.0)
    return {side: v / total for side, v in up.items()}


def _stand(old: WalkTrial) -> WalkTrial:
    motion = old.motion
    still = replace(motion, q=motion.q[:1].repeat(len(motion.time), axis=0), v=0.0 * motion.v, a=0.0 * motion.a)
    one = np.ones(len(motion.time))
    return _trial(old, still, {"left": 0.0 * one, "right": one})


def _slower(old: WalkTrial) -> WalkTrial:
    slow = replace(old.motion, v=SLOWER * old.motion.v, a=SLOWER**2 * old.motion.a)
    return _trial(old, slow, _shares(old))


def _carry(old: WalkTrial) -> WalkTrial:
    trunk = old.regressors["trunk"] @ (CARRIED_KG * old.parameters["trunk"] / old.parameters["trunk"][0])
    return _trial(old, old.motion, _shares(old), about(trunk, -old.centre))


_TRIALS: dict[str, Callable[[WalkTrial], WalkTrial]] = {"stand": _stand, "slower": _slower, "carry": _carry}
_WORDS = {
    "stand": "stand still on one plate",
    "slower": f"walk at {100 * SLOWER:.0f} % of the speed",
    "carry": f"carry a known weight of {CARRIED_KG:g} kg at the trunk",
}


def _separation(designs: Designs, signal: np.ndarray, rival: np.ndarray, prior: np.ndarray, best: WalkFit) -> float:
    """Return the squared distance of a signal (n, 6) from the span of a rival (n, 6, p), in units of the noise."""
    columns = np.concatenate([signal[:, :, None], rival], axis=2)
    _, rows, _ = designs.strides.windows[0]
    white = designs.noise.rotated(designs.strides.first(columns[rows])) / np.sqrt(best.fitted.variance)
    y, x = white[0].ravel(), white[1:].reshape(len(prior), -1).T * prior
    values = np.linalg.solve(x.T @ x + np.eye(x.shape[1]), x.T @ y)
    return float(np.sum((y - x @ values) ** 2))
