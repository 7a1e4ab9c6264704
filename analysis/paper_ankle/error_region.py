"""The domain of the ratios k1, k2, k3 that keep E below a level: extremes, shape, profile likelihood intervals.

A domain is followed along a path: one direction is held step by step farther from the optimum while E is made least
over the others, with exact sensitivities, until E meets the level. Where the path ends is the extreme: E's gradient
there points along the direction. A path that never meets the level shows that the domain has no end.

Source: Dombre, Fournier and Coiffet, section II-3-2, table 2. Profile likelihood: Venzon and Moolgavkar, Applied
Statistics 37 (1988).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.stats

from fes_pin.data.errors import InputError
from fes_pin.data.numbers import all_known, between, positive_number
from fes_pin.data.read_only import ReadOnly
from fes_pin.data.show import Tabulated
from paper_ankle.ratios import RATIOS, REACH, UNITS, Optimum, RatioProblem

LIKELIHOOD_95 = float(scipy.stats.chi2.ppf(0.95, 1))
"""Rise of twice the log-likelihood at the end of a 95 % profile interval of one parameter."""
STEP = 0.08
"""Longest step along a path, in log-ratio: 8 %."""
CLOSE = 1e-6
"""A path ends when E meets the level to this part of it."""
INNER_ITERATIONS = 40


@dataclass(frozen=True, eq=False)
class Extreme(Tabulated):
    """The end of a path through a domain.

    Attributes
    ----------
    x
        Log-ratios there, shape (3,).
    distance
        From the optimum along the direction, in log-ratio; infinite if E stays below the level as far as it goes.
    error_percent
        E there.
    level_miss, gradient_miss
        What the optimality conditions lack: |E - level| / level, and E's gradient over what was free, relative to E's
        gradient along the direction.
    path
        Shape (m, 4): log-ratios and E on the way.
    """

    x: np.ndarray
    distance: float
    error_percent: float
    level_miss: float
    gradient_miss: float
    path: np.ndarray

    @property
    def has_end(self) -> bool:
        """False if the domain goes on as far as it was followed."""
        return math.isfinite(self.distance)

    def is_optimal(self, tolerance: float = 1e-3) -> bool:
        """True if the optimality conditions hold: on the level, and no free step leads back inside."""
        return self.has_end and self.level_miss <= tolerance and self.gradient_miss <= tolerance


def ratio_place(name: str) -> int:
    """The place of a ratio among k1, k2 and k3.

    Raises
    ------
    InputError
        For another name.
    """
    all_known([name], RATIOS, "ratio")
    return RATIOS.index(name)


def follow(
    problem: RatioProblem, optimum: Optimum, direction: np.ndarray, level: float, free: np.ndarray | None = None
) -> Extreme:
    """Walk from the optimum along `direction`, with E least over `free`, to where E meets the level.

    Parameters
    ----------
    direction
        In log-ratios, shape (3,).
    level
        Percent; above the least E.
    free
        Directions over which E is made least, shape (3, m); by default everything across `direction`. With none
        (m = 0) the path is a straight cut.

    Raises
    ------
    InputError
        If the level is not above the least E.
    """
    if not level > optimum.error_percent:
        raise InputError(f"expected a level above the least E of {optimum.error_percent:.4g} %, found {level:.4g} %")
    return _Path(problem, optimum, np.asarray(direction, dtype=float), level, free).walk()


class _Path:
    def __init__(
        self, problem: RatioProblem, optimum: Optimum, direction: np.ndarray, level: float, free: np.ndarray | None
    ) -> None:
        self.problem, self.optimum, self.level = problem, optimum, level
        self.direction = direction / np.linalg.norm(direction)
        self.free = np.linalg.svd(self.direction[None])[2][1:].T if free is None else free.reshape(3, -1)
        self.slope = np.zeros(self.free.shape[1])

    def walk(self) -> Extreme:
        limit = math.log(REACH)
        room = self.level - self.optimum.error_percent
        # the quadratic model's distance to the level sets the first step
        stiff = self._across(self.optimum.curvature)
        step = min(STEP, 0.25 * math.sqrt(2.0 * room / max(stiff, 1e-300)))
        inside, x, passed = 0.0, self.optimum.x, [np.r_[self.optimum.x, self.optimum.error_percent]]
        while inside < limit:
            new, error = self._least(inside + step, x)
            if not error <= self.level:
                return self._meet(inside, inside + step, x, passed)
            inside, x = inside + step, new
            passed.append(np.r_[x, error])
            step = min(1.5 * step, STEP)
        return Extreme(x, math.inf, passed[-1][3], math.inf, math.inf, np.array(passed))

    def _across(self, curvature: np.ndarray) -> float:
        """Curvature of E along the direction with all other parameters free."""
        d, f = self.direction, self.free
        own = float(d @ curvature @ d)
        if not f.shape[1]:
            return own
        cross = f.T @ curvature @ d
        return own - float(cross @ np.linalg.lstsq(f.T @ curvature @ f, cross, rcond=None)[0])

    def _meet(self, inside: float, outside: float, x: np.ndarray, passed: list[np.ndarray]) -> Extreme:
        """Bisect to the level."""
        error = passed[-1][3]
        for _ in range(60):
            if abs(error - self.level) <= CLOSE * self.level:
                break
            middle = 0.5 * (inside + outside)
            new, reached = self._least(middle, x)
            if reached <= self.level:
                inside, x, error = middle, new, reached
            else:
                outside = middle
        passed.append(np.r_[x, error])
        gradient = self.problem.error(x)[1]
        along = abs(float(self.direction @ gradient))
        across = float(np.linalg.norm(self.free.T @ gradient)) if self.free.shape[1] else 0.0
        miss = abs(error - self.level) / self.level
        return Extreme(x, inside, error, miss, across / max(along, 1e-300), np.array(passed))

    def _least(self, distance: float, near: np.ndarray) -> tuple[np.ndarray, float]:
        """The point of least E at a distance along the direction, by Levenberg-Marquardt over what is free."""
        ahead = distance - float(self.direction @ (near - self.optimum.x))
        x = near + ahead * self.direction
        r, s = self.problem.residual(x)
        damping, scale = 1e-6, 100.0 / self.problem.spread
        for _ in range(INNER_ITERATIONS if self.free.shape[1] else 0):
            j = s @ self.free
            hessian, gradient = j.T @ j, j.T @ r
            move = -np.linalg.solve(hessian + damping * np.diag(np.diag(hessian)), gradient)
            if scale * float(-gradient @ move) < 1e-9 * min(self.level, 100.0):
                break
            size = float(np.max(np.abs(move)))
            trial = x + self.free @ (move * min(1.0, 0.5 / size))
            new_r, new_s = self.problem.residual(trial)
            if np.isfinite(new_r).all() and new_r @ new_r <= r @ r:
                x, r, s, damping = trial, new_r, new_s, max(damping * 0.1, 1e-12)
            else:
                damping = max(damping * 10.0, 1e-6)
        error = scale * float(r @ r)
        return x, error if math.isfinite(error) else math.inf


@dataclass(frozen=True, eq=False)
class ErrorDomain(ReadOnly):
    """All ratios with E at most a level, seen through its extremes.

    Attributes
    ----------
    lowest, highest
        By ratio: where the domain ends downwards and upwards.
    """

    problem: RatioProblem
    level_percent: float
    optimum: Optimum
    lowest: Mapping[str, Extreme]
    highest: Mapping[str, Extreme]

    def minimum(self, name: str) -> float:
        """Least value of a ratio in the domain; 0 if it has no lower end."""
        return self.optimum.ratios[RATIOS[ratio_place(name)]] * math.exp(-self.lowest[name].distance)

    def maximum(self, name: str) -> float:
        """Greatest value of a ratio in the domain; infinite if it has no upper end."""
        return self.optimum.ratios[RATIOS[ratio_place(name)]] * math.exp(self.highest[name].distance)

    def is_optimal(self) -> bool:
        """True if every extreme that exists meets its optimality conditions."""
        return all(e.is_optimal() for e in (*self.lowest.values(), *self.highest.values()) if e.has_end)

    def correlation(self, one: str, other: str) -> float:
        """How two ratios go together near the optimum: correlation of their logarithms over the domain."""
        covariance = np.linalg.inv(self.optimum.curvature)
        i, j = ratio_place(one), ratio_place(other)
        return float(covariance[i, j] / np.sqrt(covariance[i, i] * covariance[j, j]))

    @cached_property
    def half_axes(self) -> tuple[np.ndarray, np.ndarray]:
        """Half axes of the domain's quadratic model, in log-ratio, shape (3,), longest first, and their directions."""
        values, vectors = np.linalg.eigh(self.optimum.curvature)
        return np.sqrt(2.0 * (self.level_percent - self.optimum.error_percent) / values), vectors

    def outline(self, one: str, other: str, angles: int = 48, cut: bool = False) -> np.ndarray:
        """The domain's shadow on the plane of two ratios (or its cut through the optimum), shape (angles, 2)."""
        i, j = ratio_place(one), ratio_place(other)
        if i == j:
            raise InputError(f"expected two ratios, found {one} twice")
        (k,) = {0, 1, 2} - {i, j}
        free = np.zeros((3, 0)) if cut else np.eye(3)[:, [k]]
        covariance = np.linalg.inv(self.optimum.curvature)[np.ix_([i, j], [i, j])]
        spread = np.linalg.cholesky(
            np.linalg.inv(self.optimum.curvature[np.ix_([i, j], [i, j])]) if cut else covariance
        )
        points = []
        for angle in np.linspace(0.0, 2.0 * np.pi, angles):
            direction = np.zeros(3)
            direction[[i, j]] = spread @ [math.cos(angle), math.sin(angle)]
            points.append(np.exp(follow(self.problem, self.optimum, direction, self.level_percent, free).x[[i, j]]))
        return np.array(points)

    def __str__(self) -> str:
        lines = [f"E <= {self.level_percent:.4g} %; least E {self.optimum.error_percent:.3g} %"]
        for name, value in self.optimum.ratios.items():
            low, high = (f"{v:8.3f}" if 0.0 < v < math.inf else "  no end" for v in self._ends(name))
            lines.append(f"  {name} {value:8.3f}   [{low}, {high}] {UNITS[name]}")
        lines.append(f"  k1 and k2 go together: correlation {self.correlation('k1', 'k2'):.4f}")
        return "\n".join(lines)

    def _ends(self, name: str) -> tuple[float, float]:
        return self.minimum(name), self.maximum(name)


def error_domain(
    problem: RatioProblem, optimum: Optimum, level_percent: float = 10.0, cut: bool = False
) -> ErrorDomain:
    """The domain of E <= level and its extremes in each ratio.

    Parameters
    ----------
    cut
        Hold the other two ratios at the optimum: one ratio at a time, not the domain's extremes.

    Raises
    ------
    InputError
        If the level is not above the least E.
    """
    ends: list[dict[str, Extreme]] = [{}, {}]
    for sign, found in zip((-1.0, 1.0), ends, strict=True):
        for k, name in enumerate(RATIOS):
            axis = np.eye(3)[k]
            free = np.zeros((3, 0)) if cut else np.delete(np.eye(3), k, axis=1)
            found[name] = follow(problem, optimum, sign * axis, level_percent, free)
    return ErrorDomain(problem, level_percent, optimum, *ends)


def error_holding(problem: RatioProblem, optimum: Optimum, name: str, value: float) -> float:
    """E in percent with one ratio held at a value and the other two made best for it."""
    k, value = ratio_place(name), positive_number(value, "value")
    ahead = math.log(value) - optimum.x[k]
    path = _Path(problem, optimum, math.copysign(1.0, ahead) * np.eye(3)[k], math.inf, np.delete(np.eye(3), k, axis=1))
    x, error = optimum.x, optimum.error_percent
    for distance in np.linspace(0.0, abs(ahead), math.ceil(abs(ahead) / STEP) + 1)[1:]:
        x, error = path._least(float(distance), x)
    return error


def ellipsoid_floor(low: float, best: float, high: float, error_percent: float, level_percent: float = 10.0) -> float:
    """The least E, percent, of a parabola in log-ratio that meets the level at both ends and E at the best point.

    An ellipsoidal domain has such a parabola for each ratio's profile, and the profile is at most E at the best point:
    where this is below 0, ends and best point are not those of one ellipsoid.
    """
    low, high = positive_number(low, "low"), positive_number(high, "high")
    best = between(best, low, high, "best")
    ends = np.log([low, high])
    place = (math.log(best) - ends.mean()) / (0.5 * np.ptp(ends))
    return float((error_percent - level_percent * place**2) / (1.0 - place**2))


def profile_intervals(problem: RatioProblem, optimum: Optimum, noise_std: float) -> ErrorDomain:
    """95 % profile likelihood intervals of the ratios under white noise of known size, as a (much smaller) domain.

    An E of 10 % says how wrong a curve may look; a likelihood interval says what the noise leaves undecided.

    Parameters
    ----------
    noise_std
        rad.
    """
    noise_std = positive_number(noise_std, "noise_std")
    rise = 100.0 * LIKELIHOOD_95 * noise_std**2 / problem.spread
    return error_domain(problem, optimum, optimum.error_percent + rise)
