"""The program behind an allocation: a quadratic program with limits, ready for any torque."""

from __future__ import annotations

from typing import Any

import numpy as np

from fes_pin.allocation.allocation import Allocation, AllocationSequence
from fes_pin.allocation.bounded import BoundedProgram, known_solver, refined, solve_by, solve_sequence
from fes_pin.allocation.certificate import Certifier
from fes_pin.allocation.efforts import CUBE_TOLERANCE, error_then_effort, least_cubes
from fes_pin.allocation.inputs import wanted_torque, wanted_torques
from fes_pin.allocation.off_or_enough import best_choice, rounded_to_least
from fes_pin.allocation.problem import AllocationProblem, Options, problem_of
from fes_pin.data.errors import InputError
from fes_pin.data.numbers import by_name

__all__ = ["Allocator"]

PRECISE = 1e-11
"""Residual up to which an answer of DAQP is taken as it is."""


class Allocator:
    """The program at one posture, ready for any torque; it starts where its last answer was.

        min over r of sum w (R r - torque)^2 / 2 + effort + change / 2 |r - previous|^2,  lower <= r <= upper

    It may be called from several threads; where `rate` or `change` count, give `previous` then.

    Parameters
    ----------
    nerves
        `Nerves`, or an array (joints, n) of torque at full recruitment, N m.
    q, v
        Posture and, if it moves, its rates, if nerves are given: muscles that shorten pull less (`Nerves`).
    options
        By name, see `fes_pin.allocation.problem.Options`.

    Raises
    ------
    InputError
        Anything that is not as it is said there.
    """

    def __init__(self, nerves: Any, q: Any = None, *, v: Any = None, **options: Any) -> None:
        self.problem: AllocationProblem = problem_of(nerves, q, v, Options.of(options))
        p = self.problem
        self.certify = Certifier(p)
        self.squares, self.pull = p.squares, p.pull
        self.H = self.squares + np.diag(p.prices + p.change)
        self.program = BoundedProgram(self.H)
        self.previous = self.at_rest = np.zeros(p.n)
        self.at_rest.setflags(write=False)

    @property
    def names(self) -> tuple[str, ...]:
        """Channels."""
        return self.problem.names

    @property
    def joints(self) -> tuple[str, ...]:
        """Joints."""
        return self.problem.joints

    @property
    def n(self) -> int:
        """Number of channels."""
        return len(self.problem.names)

    def __call__(self, torque: Any, previous: Any = None, *, solver: str = "daqp") -> Allocation:
        """Allocate one torque.

        Parameters
        ----------
        torque
            Wanted joint torque, N m, by joint name (absent: 0) or (joints,).
        previous
            Recruitments in force until now, (n,), for `rate` and `change`; those of the last call by default.
        solver
            `daqp`, or any solver that qpsolvers knows (`osqp`, `proxqp` ...).

        Raises
        ------
        InputError
            A torque that is not a number, unknown joint, unknown solver, or one for what only DAQP solves.
        """
        p = self.problem
        wanted = wanted_torque(torque, p.joints)
        if solver != "daqp":
            known_solver(solver, "daqp", "an allocation")
            if not p.plain:
                raise InputError(f"least recruitments, cubes and lexicographic are solved by daqp, not by {solver!r}")
        before = self.previous if previous is None else previous
        if before is not self.previous and before is not self.at_rest:
            before = by_name(before, p.names, "previous recruitment", 0.0)
        found = self._solve(wanted, before, solver)
        self.previous = found.recruitment
        return found

    def _solve(self, wanted: np.ndarray, before: np.ndarray, solver: str) -> Allocation:
        p = self.problem
        lower, upper = p.limits(before)
        f = wanted @ self.pull
        if p.lexicographic:
            r, note = error_then_effort(self.squares, f, p.prices, p.change, before, lower, upper)
            return self.result(r, wanted, lower, upper, before, note)
        if p.change:
            f -= p.change * before
        if p.least is not None:
            return self._choose(f, wanted, lower, upper, before)
        if p.cubes:
            r, note = least_cubes(self.squares, f, p.prices, p.change, lower, upper)
            return self.result(r, wanted, lower, upper, before, note, CUBE_TOLERANCE)
        if solver != "daqp":
            return self.result(self._ask(solver, f, lower, upper), wanted, lower, upper, before)
        found = self.result(self.program.solve(f, lower, upper), wanted, lower, upper, before)
        if found.certificate.residual <= PRECISE:
            return found
        again = refined(self.H, f, found.recruitment, lower, upper)  # numbers of very different sizes
        return min(found, self.result(again, wanted, lower, upper, before), key=lambda a: a.certificate.residual)

    def result(
        self,
        r: np.ndarray,
        wanted: np.ndarray,
        lower: np.ndarray,
        upper: np.ndarray,
        before: np.ndarray,
        note: str = "",
        accuracy: float = 0.0,
    ) -> Allocation:
        """The allocation with its certificate, recomputed from the moment arms."""
        r = self.certify.at_limits(before, wanted, r, lower, upper, accuracy)
        certificate, achieved, gradient = self.certify(before, wanted, r, lower, upper)
        width = self.problem.curves.pulse_width_us(r)
        return Allocation(
            r,
            width,
            wanted,
            achieved,
            gradient,
            lower,
            upper,
            before,
            certificate,
            certificate.gap,
            self.problem,
            note,
        )

    def _ask(self, solver: str, f: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
        """Solve through qpsolvers; a limit that a step down the slope would reach holds."""
        r = np.clip(solve_by(solver, self.H, f, lower=lower, upper=upper)[0], lower, upper)
        step = r - (self.H @ r + f)
        return np.where(step <= lower, lower, np.where(step >= upper, upper, r))

    def _choose(
        self, f: np.ndarray, wanted: np.ndarray, lower: np.ndarray, upper: np.ndarray, before: np.ndarray
    ) -> Allocation:
        """Solve with channels that are off or at least at their least; the certificate is of the choice made."""
        p = self.problem
        assert p.least is not None
        if p.rounding:
            choice = rounded_to_least(self.H, f, lower, upper, p.least)
        else:
            choice = best_choice(self.H, f, lower, upper, p.least, seconds=p.seconds)
        on = choice.r > 0.0
        low, high = np.where(on, np.maximum(lower, p.least), 0.0), np.where(on, upper, 0.0)
        certificate, achieved, gradient = self.certify(before, wanted, choice.r, low, high)
        width, note = p.curves.pulse_width_us(choice.r), f"{choice.nodes} choices compared"
        return Allocation(
            choice.r, width, wanted, achieved, gradient, lower, upper, before, certificate, choice.gap, p, note
        )

    def sequence(self, torques: Any, previous: Any = None) -> AllocationSequence:
        """Allocate a torque over time, samples in order, each starting from the last.

        Parameters
        ----------
        torques
            (samples, joints), N m.
        previous
            (n,) recruitments before the first sample, 0 by default.

        Raises
        ------
        InputError
            Wrong shape, a torque that is not a number, or what is allocated one torque at a time.
        """
        p = self.problem
        wanted = wanted_torques(torques, p.joints)
        if not p.plain:
            raise InputError("least recruitments, cubes and lexicographic are allocated one torque at a time")
        start = np.zeros(p.n) if previous is None else by_name(previous, p.names, "previous recruitment", 0.0)
        F = wanted @ self.pull

        def settle(k: int, r: np.ndarray, before: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
            return self.certify.at_limits(before, wanted[k], r, low, high)

        r = solve_sequence(self.H, F, p.lower, p.upper, keep=p.change, rate=p.rate, previous=start, settle=settle)
        return self._certified(r, wanted, start)

    def _certified(self, r: np.ndarray, wanted: np.ndarray, start: np.ndarray) -> AllocationSequence:
        """Arrays of results with residuals recomputed from the moment arms."""
        p = self.problem
        before: Any = np.vstack([start, r[:-1]]) if p.change or p.rate < np.inf else start
        lower, upper = p.limits(before)
        if not p.change and p.rate == np.inf:  # else each was settled before the next followed from it
            slack = np.minimum(r - lower, upper - r)
            for k in np.flatnonzero(
                ((slack > 0.0) & (slack <= self.certify.room(self.certify.rounding(wanted)))).any(1)
            ):
                r[k] = self.certify.at_limits(start, wanted[k], r[k], lower, upper)
        achieved = r @ p.matrix.T
        residual = self.certify.residual(before, wanted, r, lower, upper)
        return AllocationSequence(r, p.curves.pulse_width_us(r), wanted, achieved, residual, p)
