"""Fisher scoring for the parameters of a model and of its noise.

Parameters of the noise are in logarithms. With e_k = r_k / sqrt(V_k) the standardised innovations, whitened by the
autoregression of noise, e_i and V_i the derivatives of these and of the variances by finite differences, which include
the change of the filter's gains, and N_k the noise of a reading that is repeated n_k times in a row
(`identify.likelihood`), gradient and expected information of half the cost are

    g_i = sum e e_i + V_i / (2 V) - (1 - 1 / n) N_i / (2 N)
    I_ij = sum s_i s_j + V_i V_j / (2 n V^2),    s_i = e_i + e V_i / (2 V),    which is r_i / sqrt(V) for white noise

Source: Kristensen, Madsen and Jorgensen, Parameter estimation in stochastic grey-box models, Automatica 40 (2004).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np

from fes_pin.infer.optimize import WORTH
from fes_pin.infer.problem import Problem, Unknowns

LITTLE = 0.1
"""Fall of the cost at which alternation ends: a third of a standard deviation of one parameter."""
STEPS = (1e-3, 0.03)
"""Steps of the finite differences in logarithms. The second is used where the first predicts a gain that no step
reaches, as where a cost is rough: a filter linearizes a model with kinks."""
DEVIATIONS = 10.0
"""Standard deviations of a parameter, at constant gains, that are scaled to one unit of a logarithm: a difference is
then 0.01 of them, or 0.3."""
LONGEST_MOVE = 1.5
"""Longest step of a logarithm: noise changes by a factor of at most 4.5 between steps of the parameters."""


Point = tuple[Mapping[str, float], Unknowns, Mapping[str, float]]
"""Values of parameters, unknowns of each trial, and parameters of the noise by name."""


@dataclass(frozen=True)
class Evaluation:
    """One-step predictions at a point, all trials end to end, each array of shape (m,); and their cost.

    The arrays are standardised innovations, variances and 1 - 1 / n; and for repeated readings, the noise in their
    variance.
    """

    cost: float
    innovations: np.ndarray
    variances: np.ndarray
    noise: np.ndarray
    again: np.ndarray

    @classmethod
    def joined(cls, parts: Sequence[Evaluation]) -> Evaluation:
        """Return the evaluations of several sets of trials, end to end."""
        arrays = ([getattr(p, n) for p in parts] for n in ("innovations", "variances", "noise", "again"))
        return cls(float(sum(p.cost for p in parts)), *(np.concatenate(each) for each in arrays))


@runtime_checkable
class NoisyProblem(Problem, Protocol):
    """A problem whose noise has parameters of its own."""

    @property
    def noise_parameters(self) -> Mapping[str, float]:
        """Parameters of the noise that may change, by name."""

    @property
    def noise_limits(self) -> Mapping[str, tuple[float, float]]:
        """Bounds of each, by name."""

    def evaluate(self, points: Sequence[Point]) -> list[Evaluation]:
        """Return one-step predictions of all trials at each of several points."""

    def costs(self, points: Sequence[tuple[Mapping[str, float], Unknowns]]) -> list[float]:
        """Return the cost at several points without sensitivities: less work than linearizing at one of them."""
        return [one.cost for one in self.evaluate([(values, unknowns, {}) for values, unknowns in points])]

    def set_noise(self, parameters: Mapping[str, float]) -> None:
        """Change parameters of the noise, in place."""


@dataclass(frozen=True)
class Reached:
    """The end of some steps.

    Attributes
    ----------
    values, noise
        Parameters of the model and of the noise that moved.
    gained
        By how much the cost has fallen.
    held
        Parameters that are held by a bound.
    left
        Predicted gain of a further step.
    converged
        False where the steps ran out.
    """

    values: dict[str, float]
    noise: dict[str, float]
    gained: float
    held: tuple[str, ...]
    left: float
    converged: bool


@dataclass(frozen=True)
class _Slopes:
    """Gradient and expected information of half the cost at a point, and the parameters that a bound holds there."""

    gradient: np.ndarray
    information: np.ndarray
    held: np.ndarray

    def step(self, damping: float) -> np.ndarray:
        """Return the step to subtract."""
        return _damped_step(self.information, self.gradient, ~self.held, damping)

    def predicted(self, step: np.ndarray) -> float:
        """Return by how much a step lowers the cost in the quadratic approximation."""
        return float(2.0 * self.gradient @ step - step @ self.information @ step)


class _Scale:
    """Coordinates of the parameters, in units of `DEVIATIONS`, and of those of the noise, in logarithms."""

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
        """Return the parameters at a point; one that has reached a bound is exactly there."""
        out = {}
        for (name, unit), v, low, high in zip(self.units.items(), z, self.low, self.high, strict=False):
            ends = self.limits[name]
            out[name] = ends[0] if v <= low else ends[1] if v >= high else float(v * unit)
        return out

    def noise(self, z: np.ndarray) -> dict[str, float]:
        """Return parameters of the noise at a point."""
        return {n: float(np.exp(v)) for n, v in zip(self.of_noise, z[len(self.units) :], strict=True)}

    def held(self, z: np.ndarray, gradient: np.ndarray) -> np.ndarray:
        """Return which parameters a bound holds, given the gradient of the cost."""
        return np.asarray(((z <= self.low) & (gradient > 0)) | ((z >= self.high) & (gradient < 0)))

    def end(self, z: np.ndarray, step: np.ndarray) -> np.ndarray:
        """Return the end of a step, limited to `LONGEST_MOVE` in the noise."""
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
    """Lower the cost until actual and predicted gain of a step differ by no more than `LITTLE`.

    Parameters
    ----------
    problem, values, unknowns
        The problem and its start values.
    sizes
        For each parameter that moves, the inverse of its standard deviation at constant gains.
    steps
        Most steps.
    with_noise
        Whether the noise moves.
    """
    scale = _Scale(problem, values, sizes, with_noise)

    def at_all(many: np.ndarray) -> list[Evaluation]:
        return problem.evaluate([({**values, **scale.values(z)}, unknowns, scale.noise(z)) for z in many])

    return _Scoring(scale, at_all, problem.batch).run(steps)


class _Scoring:
    """A descent of the cost, from the origin of a scale."""

    def __init__(self, scale: _Scale, at_all: Callable[[np.ndarray], list[Evaluation]], batch: int) -> None:
        self.scale, self.at_all, self.batch = scale, at_all, batch
        self.z, self.lengths, self.damping = scale.here, list(STEPS), 1e-3
        self.now, *self.moved = at_all(np.vstack([self.z, self._neighbours()]))
        self.held, self.left = np.zeros(len(self.z), dtype=bool), 0.0

    def _widths(self) -> np.ndarray:
        """Return the widths of differences along each axis, away from a bound."""
        return np.where(self.z + self.lengths[0] > self.scale.high, -self.lengths[0], self.lengths[0])

    def _neighbours(self) -> np.ndarray:
        """Return the points of the differences, one a row."""
        return np.asarray(self.z + np.diag(self._widths()))

    def run(self, steps: int) -> Reached:
        """Take at most `steps` steps, and return their end: the beginning where nothing moves."""
        begin, scale = self.now.cost, self.scale
        done = not (math.isfinite(begin) and len(self.z))
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
        """Take one step, or change to longer differences; return True at the end of the descent."""
        gradient, information = _scored(self.now, self.moved, self._widths())
        lost = ~(np.isfinite(gradient) & np.isfinite(np.diag(information)))  # a prediction diverges there
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
            return done
        k, end, after = found
        step, gained = self.z - end, self.now.cost - after.cost
        self.left = abs(gained - slopes.predicted(step))
        self.held = self.scale.held(end, gradient - information @ step)
        self.z, self.now, self.damping = end, after, max(0.3 * float(dampings[k]), 1e-6)
        return min(gained, self.left) < LITTLE


def _first_below(
    now: Evaluation, ends: np.ndarray, at_all: Callable[[np.ndarray], list[Evaluation]], batch: int
) -> tuple[int, np.ndarray, Evaluation] | None:
    """Return the lowest point of the first batch that has one below the present cost: place, point and evaluation."""
    for k in range(0, len(ends), batch):
        after = at_all(ends[k : k + batch])
        best = int(np.argmin([one.cost for one in after]))
        if after[best].cost < now.cost:
            return k + best, ends[k + best], after[best]
    return None


@np.errstate(over="ignore", invalid="ignore")
def _scored(now: Evaluation, moved: Sequence[Evaluation], widths: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return gradient and expected information of half the cost, from differences of `widths`; see the module."""
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
    """Return a step of the free parameters."""
    step = np.zeros(len(gradient))
    if free.any():
        inner = information[np.ix_(free, free)]
        inner = inner + np.diag(damping * np.diag(inner) + 1e-9)
        step[free] = np.linalg.lstsq(inner, gradient[free], rcond=1e-12)[0]
    return step
