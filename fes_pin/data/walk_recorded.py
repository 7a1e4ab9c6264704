"""A recorded walk while its conventions are tested: its coordinates, its plates, and when somebody stands on them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

Arrays = dict[str, np.ndarray]
SIDES = {"r": "right", "l": "left"}
ENOUGH_S, FEWEST = 0.3, 10
"""s and samples; of less nothing is tested (a single support lasts 0.4 s)."""
STANDS = 0.2
"""Share of its largest vertical force above which a foot counts as standing: its centre of pressure is exact there."""
GRAVITY = 9.81
"""Standard gravity as the paper rounds it, m/s2 (eq. 7)."""
LOADED_N = 20.0
"""A foot stands where its vertical force is above this: the usual threshold on instrumented treadmills."""
SWINGS = 0.2
"""Share of the time that a foot which steps is in the air, at least: it swings for 0.4 of a stride (J. Perry, Gait
Analysis, 1992). The load of one who sways by a quarter of the weight each way is within `LOADED_N` of its least for
less than 0.16."""
LEAST = 0.05
"""Quantile that is taken as the least reading: a few samples may be spikes (a round figure)."""


@dataclass
class RecordedWalk:
    """A walk, as far as its conventions are known; each test of one changes what the next reads.

    Attributes
    ----------
    time, moves
        (n,) s; `q_<coordinate>` and rates, (n,).
    push_time, plates
        (m,) s; by plate `Fx` ... `copx` ... `Tz`, (m,).
    stated
        Conventions that the study states; see `fes_pin.data.walk_conventions.checked_conventions`.
    said
        What was taken otherwise than the study format has it, a sentence each.
    """

    time: np.ndarray
    moves: Arrays
    push_time: np.ndarray
    plates: dict[str, Arrays]
    stated: Mapping[str, Any]
    said: list[str] = field(default_factory=list)

    @cached_property
    def rows(self) -> np.ndarray:
        """Samples of the motion in whose time plates were recorded, shape (k,)."""
        return np.flatnonzero((self.time >= self.push_time[0]) & (self.time <= self.push_time[-1]))

    @cached_property
    def long(self) -> bool:
        """Whether it lasts long enough to be tested."""
        rows = self.rows
        return len(rows) >= FEWEST and float(self.time[rows[-1]] - self.time[rows[0]]) >= ENOUGH_S

    def plate(self, label: str, kind: str) -> np.ndarray:
        """A vector of a plate at the motion's times: (n, 3)."""
        columns = (self.plates[label][f"{kind}{c}"] for c in "xyz")
        return np.stack([np.interp(self.time, self.push_time, c) for c in columns], axis=1)

    def load(self, label: str) -> np.ndarray:
        """A plate's vertical force at the motion's times, less what it reads in the air: (n,), 0 where it has none."""
        up = self.plates[label]["Fy"]
        level = level_in_the_air(up, np.sum([p["Fy"] for p in self.plates.values()], axis=0))
        load = np.interp(self.time, self.push_time, up - level)
        within = np.isin(np.arange(len(self.time)), self.rows)
        return np.where(within & (load > LOADED_N), load, 0.0)

    def standing(self, label: str) -> np.ndarray:
        """Samples in which somebody stands on a plate: (n,) bool; none of one that carries too little."""
        load = self.load(label)
        on = load > STANDS * load.max()
        return on if np.sum(on) >= FEWEST else np.zeros(len(on), dtype=bool)

    def steps(self, label: str) -> Iterator[np.ndarray]:
        """Samples of each stance on a plate: (n,) bool."""
        on = self.standing(label)
        ends = np.flatnonzero(np.diff(np.r_[False, on, False].astype(int)))
        rows = np.arange(len(on))
        for start, stop in zip(ends[::2], ends[1::2], strict=True):
            if stop - start >= FEWEST // 2:
                yield (rows >= start) & (rows < stop)

    def scale(self, kinds: str, factor: float) -> None:
        """Scale columns of all plates: `F`, `cop` or `T`, or one of them with its axis."""
        for plate in self.plates.values():
            for name in plate:
                if name.startswith(kinds):
                    plate[name] = factor * plate[name]


def vectors_of(plate: Mapping[str, np.ndarray], kind: str) -> np.ndarray:
    """Columns x, y and z of a plate's `F`, `cop` or `T` (m,): (m, 3)."""
    return np.stack([plate[f"{kind}{c}"] for c in "xyz"], axis=1)


def level_in_the_air(up: np.ndarray, total: np.ndarray) -> float:
    """Return the vertical force that a plate reads while its foot is in the air, N; 0 of a foot that does not step.

    Parameters
    ----------
    up, total
        Vertical force of this plate and of both, (n,) N. A foot that steps carries half of the mean total at least.
    """
    least = up < np.quantile(up, LEAST) + LOADED_N
    level = float(np.median(up[least]))
    return level if np.mean(least) > SWINGS and 2.0 * (np.max(up) - level) > np.mean(total) else 0.0


def level_distance(vectors: np.ndarray) -> np.ndarray:
    """Lengths of vectors (n, 3) without their height: (n,)."""
    return np.hypot(vectors[:, 0], vectors[:, 2])
