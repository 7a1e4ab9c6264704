"""Nonlinear least squares by Levenberg and Marquardt's method, with bounds and with unknowns of each trial."""

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from fes_pin.infer.covariance import UNIDENTIFIED
from fes_pin.infer.problem import (
    Linearized,
    NormalEquations,
    Problem,
    Unknowns,
    completed,
    normal_equations,
    whitened_sse,
)

TOLERANCE = 0.01
"""A fit ends when the predicted gain of the next step is less than this, in twice the log-likelihood: no test depends
on it."""
WORTH = 1.0
"""Change of twice the log-likelihood that is worth further steps, as where it is predicted and no step reaches it: one
standard deviation of one parameter."""
TRIES = 12
"""Steps that are tried, each ten times as damped as the last, before a point counts as the minimum."""
SHORTER = 0.5
"""Largest share of the predicted gain of a failed step that a shorter step may predict, where the end is not final: in
well identified directions ten times the damping changes little at first."""
LARGEST_DAMPING = 1e12
"""Largest damping: with more a step is zero."""


@dataclass(frozen=True)
class _Proposal:
    """The step at a damping, and its predicted gain in twice the log-likelihood."""

    damping: float
    x: np.ndarray
    unknowns: Unknowns
    predicted: float


class Descent:
    """The state of one search for the least sum of squares.

    Parameters
    ----------
    problem
        The problem that is fitted.
    start
        Value of every parameter.
    unknowns
        Unknowns of each trial; by default the start values of the problem.
    """

    def __init__(self, problem: Problem, start: Mapping[str, float], unknowns: Unknowns | None) -> None:
        self.problem, self.names = problem, problem.free
        self.lower = np.array([problem.limits[n][0] for n in self.names])
        self.upper = np.array([problem.limits[n][1] for n in self.names])
        self.fixed = dict(start)
        self.x = np.clip([start[n] for n in self.names], self.lower, self.upper)
        self.unknowns = completed(problem.start_unknowns(), unknowns)
        self.damping, self._gained = 1e-4, 0.0
        self._system: NormalEquations | None = None
        self.parts = self._linearize(self.x, self.unknowns)
        self.sse = whitened_sse(self.parts)

    def _linearize(self, x: np.ndarray, unknowns: Unknowns) -> list[Linearized]:
        with np.errstate(all="ignore"):
            return self.problem.linearize(self.values(x), unknowns)

    def values(self, x: np.ndarray) -> dict[str, float]:
        return {**self.fixed, **dict(zip(self.names, (float(v) for v in x), strict=True))}

    def free_now(self, gradient: np.ndarray) -> np.ndarray:
        """Return which parameters are not held by a bound."""
        held = ((self.x <= self.lower) & (gradient < 0)) | ((self.x >= self.upper) & (gradient > 0))
        return ~held

    def run(self, max_iterations: int) -> bool:
        """Take at most `max_iterations` steps; return whether the descent ended at a minimum."""
        return any(self.step() for _ in range(max_iterations)) and bool(np.isfinite(self.sse))

    def step(self) -> bool:
        """Take one step; return True at a minimum.

        A step that gains nothing is tried again shorter; for shorter steps the cost alone is evaluated first.
        """
        if not np.isfinite(self.sse):
            return True
        first = self._proposed(self.damping)
        if 0.0 <= first.predicted < TOLERANCE:
            return True
        if self._takes(first):
            return self._gained < TOLERANCE
        shorter = self._shorter(first)
        while some := list(itertools.islice(shorter, self.problem.batch)):
            bounds = self.problem.costs([(self.values(one.x), one.unknowns) for one in some])
            for one, bound in zip(some, bounds, strict=True):
                self.damping = one.damping
                if bound <= self.sse and self._takes(one):
                    return self._gained < TOLERANCE
        return True

    def _proposed(self, damping: float) -> _Proposal:
        if self._system is None or self.problem.unknown_names:
            self._system = normal_equations(self.parts, damping)
        system = self._system
        move = self._bounded_move(system, damping)
        predicted = system.local_gain + 2.0 * system.gradient @ move - move @ system.hessian @ move
        return _Proposal(damping, self._end(move), self._moved(system.local_steps(move)), float(predicted))

    def _shorter(self, last: _Proposal) -> Iterator[_Proposal]:
        """Yield proposals of growing damping after one that failed, up to the first that is not worth a try."""
        least, share = (TOLERANCE, np.inf) if self.problem.is_final else (WORTH, SHORTER)
        for _ in range(TRIES - 1):
            most = share * last.predicted
            last = self._proposed(max(last.damping * 10.0, 1e-4))
            while last.predicted > most > 0.0 and last.damping < LARGEST_DAMPING:
                last = self._proposed(last.damping * 10.0)
            if 0.0 <= last.predicted < least:
                return
            yield last

    def _takes(self, one: _Proposal) -> bool:
        """Take the step of a proposal if it lowers the cost; return whether it does."""
        parts = self._linearize(one.x, one.unknowns)
        sse = whitened_sse(parts)
        if not (one.predicted > 0.0 and np.isfinite(sse) and sse <= self.sse):
            return False
        self._gained = self.sse - sse
        self.x, self.unknowns, self.parts, self.sse, self._system = one.x, one.unknowns, parts, sse, None
        self.damping = max(one.damping * _relief(self._gained / one.predicted), 1e-9)
        return True

    def _bounded_move(self, system: NormalEquations, damping: float) -> np.ndarray:
        """Return Marquardt's step within the bounds: a parameter that would leave them stops there."""
        free, move = self.free_now(system.gradient), np.zeros(len(self.x))
        while free.any():
            gradient = system.gradient - system.hessian[:, ~free] @ move[~free]
            move[free] = _damped(system.hessian[np.ix_(free, free)], gradient[free], damping)
            room = np.where(move > 0, self.upper, self.lower) - self.x
            with np.errstate(divide="ignore", invalid="ignore"):
                share = np.where(free & (move != 0.0), room / move, np.inf)
            first = int(np.argmin(share))
            if share[first] >= 1.0:
                break
            move[first], free[first] = room[first], False
        return np.asarray(np.clip(self.x + move, self.lower, self.upper) - self.x)

    def _end(self, move: np.ndarray) -> np.ndarray:
        """Return the end of a step that is straight in an amplitude k and in its product k r with a shape."""
        out = self.x + move
        for shape, k in self.problem.products:
            if out[k] != 0.0:
                bent = self.x[shape] + move[shape] * self.x[k] / out[k]
                out[shape] = np.clip(bent, self.lower[shape], self.upper[shape])
        return np.asarray(np.clip(out, self.lower, self.upper))

    def _moved(self, steps: list[np.ndarray]) -> Unknowns:
        if not steps:
            return self.unknowns
        names = self.problem.unknown_names
        each = zip(self.unknowns, steps, strict=True)
        return [{n: u[n] + float(d) for n, d in zip(names, step, strict=True)} for u, step in each]


def _relief(kept: float) -> float:
    """Return the factor on the damping after a step that kept a share of its gain (Nielsen, IMM-REP-1999-05)."""
    return float(np.clip(1.0 - (2.0 * kept - 1.0) ** 3, 0.2, 2.0))


def _damped(hessian: np.ndarray, gradient: np.ndarray, damping: float) -> np.ndarray:
    """Return Marquardt's step in parameters scaled by their information."""
    if not len(gradient):
        return gradient
    scale = np.sqrt(np.maximum(np.diag(hessian), 1e-300))
    scaled = hessian / np.outer(scale, scale) + damping * np.eye(len(scale))
    values, vectors = np.linalg.eigh(scaled)
    inverse = np.where(values > UNIDENTIFIED, 1.0 / np.maximum(values, UNIDENTIFIED), 0.0)
    return (vectors @ (inverse * (vectors.T @ (gradient / scale)))) / scale
