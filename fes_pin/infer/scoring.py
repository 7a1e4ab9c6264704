"""Parameters of a model and of its noise, made more likely by Fisher scoring.

In parameters and in logarithms of those of the noise, with e_k = r_k / sqrt(V_k) the innovations over their deviations,
less what noise predicts of itself, e_i and V_i their derivatives and the variances' by differences, in which the
filter's gains change with the parameters, and N_k the noise of what is read n_k times in a row
(`identify.likelihood`):

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

from fes_pin.infer.optimize import WORTH
from fes_pin.infer.problem import Problem, Unknowns

LITTLE = 0.1
"""Fall of twice the log-likelihood with which alternation ends: a third of a standard deviation of one parameter."""
STEPS = (1e-3, 0.03)
"""Steps of the differences in logarithms: the second where the first predicts a gain that no step has, as where a cost
is rough: that of a filter which takes for linear what bends sharply."""
DEVIATIONS = 10.0
"""How many deviations of a parameter, as far as it is known with gains as they are, count as one of a logarithm: a
difference is then 0.01 of them, or 0.3."""
LONGEST_MOVE = 1.5
"""Longest step of a logarithm: noise changes by a factor of 4.5 at most before parameters move again."""


Point = tuple[Mapping[str, float], Unknowns, Mapping[str, float]]
"""Values of parameters, unknowns of each trial, and parameters of the noise by name."""


@dataclass(frozen=True)
class Evaluation:
    """What was measured at a point, all trials end to end, each array of shape (m,); and its cost.

    Innovations over their deviations, variances, 1 - 1 / n; and of repeated readings, the noise in their variance.
    """

    cost: float
    innovations: np.ndarray
    variances: np.ndarray
    noise: np.ndarray
    again: np.ndarray

    @classmethod
    def joined(cls, parts: Sequence[Evaluation]) -> Evaluation:
        """Those of several sets of trials, end to end."""
        arrays = ([getattr(p, n) for p in parts] for n in ("innovations", "variances", "noise", "again"))
        return cls(float(sum(p.cost for p in parts)), *(np.concatenate(each) for each in arrays))


class NoisyProblem(Problem, Protocol):
    """A problem whose noise has parameters of its own."""

    @property
    def noise_parameters(self) -> Mapping[str, float]:
        """Those of the noise that may change, by name."""

    @property
    def noise_limits(self) -> Mapping[str, tuple[float, float]]:
        """How small and how large each may become."""

    def evaluate(self, points: Sequence[Point]) -> list[Evaluation]:
        """One-step predictions of all trials at each of several points."""

    def noise_step(self, values: Mapping[str, float], unknowns: Unknowns) -> float:
        """Improve the noise in place, parameters held; returns by how much that lowers the cost."""

    def set_noise(self, parameters: Mapping[str, float]) -> None:
        """Change parameters of the noise, in place."""


@dataclass(frozen=True)
class Reached:
    """Where steps have led to.

    Attributes
    ----------
    values, noise
        Parameters of the model and of the noise that moved.
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
    noise: dict[str, float]
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

    def predicted(self, step: np.ndarray) -> float:
        """By how much a step lowers the cost, if it is the parabola that it seems to be."""
        return float(2.0 * self.gradient @ step - step @ self.information @ step)


class _Scale:
    """Where parameters and those of the noise are on an axis each: in `DEVIATIONS` of them, and in logarithms."""

    def __init__(
        self, problem: NoisyProblem, values: Mapping[str, float], sizes: Mapping[str, float], with_noise: bool
    ) -> None:
        self.units = {n: DEVIATIONS / size for n, size in sizes.items() if 0.0 < size < math.inf}
        self.of_noise = dict(problem.noise_parameters) if with_noise else {}
        limits = problem.noise_limits if with_noise else {}
        self.limits = problem.limits
        ends = [[self.limits[n][k] / u for n, u in self.units.items()] for k in (0, 1)]
        self.low, self.high = (
            np.array([*e, *(math.log(limits[n][k]) for n in self.of_noise)]) for k, e in enumerate(ends)
        )
        here = [*(values[n] / u for n, u in self.units.items()), *(math.log(v) for v in self.of_noise.values())]
        self.here = np.clip(here, self.low, self.high)

    def values(self, z: np.ndarray) -> dict[str, float]:
        """The parameters at a point: exactly at a bound that one has come to."""
        out = {}
        for (name, unit), v, low, high in zip(self.units.items(), z, self.low, self.high, strict=False):
            ends = self.limits[name]
            out[name] = ends[0] if v <= low else ends[1] if v >= high else float(v * unit)
        return out

    def noise(self, z: np.ndarray) -> dict[str, float]:
        """Parameters of the noise there."""
        return {n: float(np.exp(v)) for n, v in zip(self.of_noise, z[len(self.units) :], strict=True)}

    def held(self, z: np.ndarray, gradient: np.ndarray) -> np.ndarray:
        """What a bound holds where the cost has a gradient."""
        return np.asarray(((z <= self.low) & (gradient > 0)) | ((z >= self.high) & (gradient < 0)))

    def end(self, z: np.ndarray, step: np.ndarray) -> np.ndarray:
        """Where a step leads, no longer than `LONGEST_MOVE` in the noise."""
        longest = float(np.abs(step[len(self.units) :]).max(initial=0.0))
        return np.asarray(np.clip(z - step * min(1.0, LONGEST_MOVE / max(longest, 1e-300)), self.low, self.high))


def fisher_scoring(
    problem: NoisyProblem,
    values: Mapping[str, float],
    unknowns: Unknowns,
    sizes: Mapping[str, float],
    steps: int,
    with_noise: bool = True,
) -> Reached:
    """Lower the cost, until what a step has missed of its predicted gain is `LITTLE`: no further one gains more.

    Parameters
    ----------
    problem, values, unknowns
        Where to begin.
    sizes
        Of each parameter that moves, one over its deviation as far as it is known with gains as they are.
    steps
        At most.
    with_noise
        Whether the noise moves.
    """
    scale = _Scale(problem, values, sizes, with_noise)

    def at_all(many: np.ndarray) -> list[Evaluation]:
        return problem.evaluate([({**values, **scale.values(z)}, unknowns, scale.noise(z)) for z in many])

    return _Scoring(scale, at_all, problem.batch).run(steps)


class _Scoring:
    """A way down the cost, from where a scale begins."""

    def __init__(self, scale: _Scale, at_all: Callable[[np.ndarray], list[Evaluation]], batch: int) -> None:
        self.scale, self.at_all, self.batch = scale, at_all, batch
        self.z, self.lengths, self.damping = scale.here, list(STEPS), 1e-3
        self.now, *self.moved = at_all(np.vstack([self.z, self._neighbours()]))
        self.held, self.left = np.zeros(len(self.z), dtype=bool), 0.0

    def _widths(self) -> np.ndarray:
        """Of differences along each axis: away from a bound."""
        return np.where(self.z + self.lengths[0] > self.scale.high, -self.lengths[0], self.lengths[0])

    def _neighbours(self) -> np.ndarray:
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
                self.moved = self.at_all(self._neighbours())
        held = tuple(n for n, h in zip(scale.units, self.held, strict=False) if h)
        fallen = begin - self.now.cost if math.isfinite(begin) else 0.0
        return Reached(scale.values(self.z), scale.noise(self.z), fallen, held, self.left, done)

    def _step(self) -> bool:
        """Go down once, or look at longer differences; True where there is nothing left to gain."""
        gradient, information = _scored(self.now, self.moved, self._widths())
        lost = ~(np.isfinite(gradient) & np.isfinite(np.diag(information)))  # a prediction runs away there
        gradient[lost], information[lost], information[:, lost] = 0.0, 0.0, 0.0
        self.held = self.scale.held(self.z, gradient)
        slopes = _Slopes(gradient, information, self.held | lost)
        self.left = slopes.predicted(slopes.step(0.0))
        if self.left < LITTLE:
            return True
        dampings = self.damping * 10.0 ** np.arange(1 + len(self.z))
        ends = np.array([self.scale.end(self.z, slopes.step(d)) for d in dampings])
        found = _first_below(self.now, ends, self.at_all, self.batch)
        if found is None:
            done = self.left < WORTH or len(self.lengths) == 1
            self.lengths = self.lengths[1:] or self.lengths
            return done and not self._leap()
        k, end, after = found
        step, gained = self.z - end, self.now.cost - after.cost
        self.left = abs(gained - slopes.predicted(step))
        self.held = self.scale.held(end, gradient - information @ step)
        self.z, self.now, self.damping = end, after, max(0.3 * float(dampings[k]), 1e-6)
        return min(gained, self.left) < LITTLE

    def _leap(self) -> bool:
        """Go as far as a step may in one logarithm of the noise; False if that leads nowhere.

        Where a prediction goes another way at every change of its gains, as of friction that flips, slopes are of that.
        """
        axes = np.eye(len(self.z))[len(self.scale.units) :] * LONGEST_MOVE
        ends = np.array([np.clip(self.z + m, self.scale.low, self.scale.high) for m in (*axes, *-axes)])
        tried = [one for k in range(0, len(ends), self.batch) for one in self.at_all(ends[k : k + self.batch])]
        best = min(range(len(tried)), key=lambda k: tried[k].cost, default=None)
        if best is None or not tried[best].cost < self.now.cost - WORTH:
            return False
        self.z, self.now, self.lengths = ends[best], tried[best], list(STEPS)
        return True


def _first_below(
    now: Evaluation, ends: np.ndarray, at_all: Callable[[np.ndarray], list[Evaluation]], batch: int
) -> tuple[int, np.ndarray, Evaluation] | None:
    """The lowest of the first points in a run that has one below: its place, itself, and what it tells."""
    for k in range(0, len(ends), batch):
        after = at_all(ends[k : k + batch])
        best = int(np.argmin([one.cost for one in after]))
        if after[best].cost < now.cost:
            return k + best, ends[k + best], after[best]
    return None


@np.errstate(over="ignore", invalid="ignore")
def _scored(now: Evaluation, moved: Sequence[Evaluation], widths: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
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
