"""Parameters of a model and what is random about it, made more likely by Fisher scoring.

In parameters and in logarithms of what is random, with e_k = r_k / sqrt(V_k) the innovations over their deviations,
less what noise foretells of itself, e_i and V_i their derivatives and the variances' by differences, in which the
filter's gains go with the parameters, and N_k the noise of what is read n_k times in a row (`identify.likelihood`):

    g_i = sum e e_i + V_i / (2 V) - (1 - 1 / n) N_i / (2 N)
    I_ij = sum s_i s_j + V_i V_j / (2 n V^2),    s_i = e_i + e V_i / (2 V),    which is r_i / sqrt(V) of white noise

Source: Kristensen, Madsen and Jorgensen, Parameter estimation in stochastic grey-box models, Automatica 40 (2004).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from fes_pin.identify.problem import WORTH, Unknowns

LITTLE = 0.1
"""Fall of twice the log-likelihood with which turns end: a third of a standard deviation of one parameter."""
STEPS = (1e-3, 0.03)
"""Steps of the differences in logarithms: the second where the first promises what no step keeps, as where the cost is
rough: that of a filter which takes for linear what bends sharply."""
DEVIATIONS = 10.0
"""How many deviations of a parameter, as far as it is known with gains as they are, count as one of a logarithm: a
difference is then 0.01 of them, or 0.3."""
LONGEST_MOVE = 1.5
"""Longest step of a logarithm: randomness changes by a factor of 4.5 at most before parameters move again."""
TURN = 2
"""Steps of what is random before parameters move again."""


Point = tuple[Mapping[str, float], Unknowns, Mapping[str, float]]
"""Values of parameters, unknowns of each trial, and what is random by name."""


@dataclass(frozen=True)
class Told:
    """What was seen, all trials end to end, each of shape (m,); and its cost.

    Innovations over their deviations, variances, 1 - 1 / n; and of what was told before, the noise in its variance.
    """

    cost: float
    innovations: np.ndarray
    variances: np.ndarray
    noise: np.ndarray
    again: np.ndarray

    @classmethod
    def joined(cls, parts: Sequence[Told]) -> Told:
        """What several sets of trials tell, end to end."""
        return cls(
            float(sum(p.cost for p in parts)),
            np.concatenate([p.innovations for p in parts]),
            np.concatenate([p.variances for p in parts]),
            np.concatenate([p.noise for p in parts]),
            np.concatenate([p.again for p in parts]),
        )


class Foretelling(Protocol):
    """A problem that foretells its trials at any point."""

    @property
    def limits(self) -> Mapping[str, tuple[float, float]]:
        """Of its parameters."""

    @property
    def randomness(self) -> Mapping[str, float]:
        """What is random, by name."""

    @property
    def randomness_limits(self) -> Mapping[str, tuple[float, float]]:
        """How small and how large that may become."""

    @property
    def abreast(self) -> int:
        """How many points are tried in one run."""

    def told(self, points: Sequence[Point]) -> list[Told]:
        """Every trial as foretold at each of several points."""


@dataclass(frozen=True)
class Reached:
    """Where steps have led to.

    Attributes
    ----------
    values, randomness
        Those that moved.
    gained
        By how much the cost has fallen.
    held
        Parameters that a bound holds there.
    left
        What a further step would gain.
    converged
        False where steps ran out.
    """

    values: dict[str, float]
    randomness: dict[str, float]
    gained: float
    held: tuple[str, ...]
    left: float
    converged: bool


@dataclass(frozen=True)
class _Slopes:
    """Gradient and expected information of half the cost at a point, with what is held by a bound there."""

    gradient: np.ndarray
    information: np.ndarray
    held: np.ndarray

    def step(self, damping: float) -> np.ndarray:
        """What to take away."""
        return _damped_step(self.information, self.gradient, ~self.held, damping)

    def promised(self, step: np.ndarray) -> float:
        """By how much a step lowers the cost, if it is the parabola that it seems to be."""
        return float(2.0 * self.gradient @ step - step @ self.information @ step)


class _Scale:
    """Where parameters and randomness are on an axis each: in `DEVIATIONS` of them, and in logarithms."""

    def __init__(
        self, problem: Foretelling, values: Mapping[str, float], sizes: Mapping[str, float], random: bool
    ) -> None:
        self.units = {n: DEVIATIONS / size for n, size in sizes.items() if 0.0 < size < math.inf}
        self.random = dict(problem.randomness) if random else {}
        limits = problem.randomness_limits if random else {}
        self.limits = problem.limits
        ends = [[self.limits[n][k] / u for n, u in self.units.items()] for k in (0, 1)]
        self.low, self.high = (
            np.array([*e, *(math.log(limits[n][k]) for n in self.random)]) for k, e in enumerate(ends)
        )
        here = [*(values[n] / u for n, u in self.units.items()), *(math.log(v) for v in self.random.values())]
        self.here = np.clip(here, self.low, self.high)

    def values(self, z: np.ndarray) -> dict[str, float]:
        """The parameters at a point: exactly at a bound that one has come to."""
        out = {}
        for (name, unit), v, low, high in zip(self.units.items(), z, self.low, self.high, strict=False):
            ends = self.limits[name]
            out[name] = ends[0] if v <= low else ends[1] if v >= high else float(v * unit)
        return out

    def randomness(self, z: np.ndarray) -> dict[str, float]:
        """What is random there."""
        return {n: float(np.exp(v)) for n, v in zip(self.random, z[len(self.units) :], strict=True)}

    def held(self, z: np.ndarray, gradient: np.ndarray) -> np.ndarray:
        """What a bound holds where the cost has a gradient."""
        return np.asarray(((z <= self.low) & (gradient > 0)) | ((z >= self.high) & (gradient < 0)))

    def end(self, z: np.ndarray, step: np.ndarray) -> np.ndarray:
        """Where a step leads, no longer than `LONGEST_MOVE` of what is random."""
        longest = float(np.abs(step[len(self.units) :]).max(initial=0.0))
        return np.asarray(np.clip(z - step * min(1.0, LONGEST_MOVE / max(longest, 1e-300)), self.low, self.high))


def climb(
    problem: Foretelling,
    values: Mapping[str, float],
    unknowns: Unknowns,
    sizes: Mapping[str, float],
    steps: int,
    random: bool = True,
) -> Reached:
    """Go down the cost, until what a step has missed of its promise is `LITTLE`: no further one gains more.

    Parameters
    ----------
    problem, values, unknowns
        Where to begin.
    sizes
        Of each parameter that moves, one over its deviation as far as it is known with gains as they are.
    steps
        At most.
    random
        Whether what is random moves.
    """
    scale = _Scale(problem, values, sizes, random)

    def at_all(many: np.ndarray) -> list[Told]:
        return problem.told([({**values, **scale.values(z)}, unknowns, scale.randomness(z)) for z in many])

    return _Climb(scale, at_all, problem.abreast).run(steps)


class _Climb:
    """A way down the cost, from where a scale begins."""

    def __init__(self, scale: _Scale, at_all: Callable[[np.ndarray], list[Told]], abreast: int) -> None:
        self.scale, self.at_all, self.abreast = scale, at_all, abreast
        self.z, self.lengths, self.damping = scale.here, list(STEPS), 1e-3
        self.now, *self.moved = at_all(np.vstack([self.z, self._beside()]))
        self.held, self.left = np.zeros(len(self.z), dtype=bool), 0.0

    def _widths(self) -> np.ndarray:
        """Of differences along each axis: away from a bound."""
        return np.where(self.z + self.lengths[0] > self.scale.high, -self.lengths[0], self.lengths[0])

    def _beside(self) -> np.ndarray:
        """The points of differences, one a row."""
        return np.asarray(self.z + np.diag(self._widths()))

    def run(self, steps: int) -> Reached:
        """Take so many steps at most."""
        begin, scale = self.now.cost, self.scale
        done = not math.isfinite(begin)
        while not done and steps > 0:
            before = self.now.cost
            done = self._step()
            steps -= self.now.cost < before
            if not done and steps > 0:
                self.moved = self.at_all(self._beside())
        held = tuple(n for n, h in zip(scale.units, self.held, strict=False) if h)
        fallen = begin - self.now.cost if math.isfinite(begin) else 0.0
        return Reached(scale.values(self.z), scale.randomness(self.z), fallen, held, self.left, done)

    def _step(self) -> bool:
        """Go down once, or look at longer differences; True where there is nothing left to gain."""
        gradient, information = _scored(self.now, self.moved, self._widths())
        lost = ~(np.isfinite(gradient) & np.isfinite(np.diag(information)))  # a prediction runs away beside it
        gradient[lost], information[lost], information[:, lost] = 0.0, 0.0, 0.0
        self.held = self.scale.held(self.z, gradient)
        slopes = _Slopes(gradient, information, self.held | lost)
        self.left = slopes.promised(slopes.step(0.0))
        if self.left < LITTLE:
            return True
        dampings = self.damping * 10.0 ** np.arange(1 + len(self.z))
        ends = np.array([self.scale.end(self.z, slopes.step(d)) for d in dampings])
        found = _first_below(self.now, ends, self.at_all, self.abreast)
        if found is None:
            done = self.left < WORTH or len(self.lengths) == 1
            self.lengths = self.lengths[1:] or self.lengths
            return done and not self._leap()
        k, end, after = found
        step, gained = self.z - end, self.now.cost - after.cost
        self.left = abs(gained - slopes.promised(step))
        self.held = self.scale.held(end, gradient - information @ step)
        self.z, self.now, self.damping = end, after, max(0.3 * float(dampings[k]), 1e-6)
        return min(gained, self.left) < LITTLE

    def _leap(self) -> bool:
        """Go as far as a step may in one logarithm of what is random; False if that leads nowhere.

        Where a prediction goes another way at every change of its gains, as of friction that flips, slopes are of that.
        """
        axes = np.eye(len(self.z))[len(self.scale.units) :] * LONGEST_MOVE
        ends = np.array([np.clip(self.z + m, self.scale.low, self.scale.high) for m in (*axes, *-axes)])
        told = [one for k in range(0, len(ends), self.abreast) for one in self.at_all(ends[k : k + self.abreast])]
        best = min(range(len(told)), key=lambda k: told[k].cost, default=None)
        if best is None or not told[best].cost < self.now.cost - WORTH:
            return False
        self.z, self.now, self.lengths = ends[best], told[best], list(STEPS)
        return True


def _first_below(
    now: Told, ends: np.ndarray, at_all: Callable[[np.ndarray], list[Told]], abreast: int
) -> tuple[int, np.ndarray, Told] | None:
    """The lowest of the first points in a run that has one below: its place, itself, and what it tells."""
    for k in range(0, len(ends), abreast):
        after = at_all(ends[k : k + abreast])
        best = int(np.argmin([one.cost for one in after]))
        if after[best].cost < now.cost:
            return k + best, ends[k + best], after[best]
    return None


@np.errstate(over="ignore", invalid="ignore")
def _scored(now: Told, moved: Sequence[Told], widths: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Gradient and expected information of half the cost, from differences of such widths; see the module."""
    e, v, width = now.innovations, now.variances, widths[:, None]
    de = (np.array([m.innovations for m in moved]) - e) / width
    dv = (np.array([m.variances for m in moved]) - v) / width / v
    gradient = de @ e + 0.5 * dv.sum(axis=1)
    s = de + 0.5 * e * dv
    if (held := np.flatnonzero(now.again)).size:
        dn = np.array([m.noise / now.noise - 1.0 for m in moved]) / width
        gradient = gradient - 0.5 * dn @ now.again[held]
    return gradient, s @ s.T + 0.5 * ((1.0 - now.again) * dv) @ dv.T


def _damped_step(information: np.ndarray, gradient: np.ndarray, free: np.ndarray, damping: float) -> np.ndarray:
    """A step of what is free."""
    step = np.zeros(len(gradient))
    if free.any():
        inner = information[np.ix_(free, free)]
        inner = inner + np.diag(damping * np.diag(inner) + 1e-9)
        step[free] = np.linalg.lstsq(inner, gradient[free], rcond=1e-12)[0]
    return step
