"""The program behind an allocation: a quadratic program with limits, ready for any torque."""

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from fes_pin.allocation.allocation import Allocation, AllocationSequence
from fes_pin.allocation.bounded import PRECISE, BoundedProgram, known_solver, solve_by, solve_once
from fes_pin.allocation.certificate import Certifier, Solve
from fes_pin.allocation.efforts import error_then_effort, least_cubes
from fes_pin.allocation.inputs import fractions, wanted_torque, wanted_torques
from fes_pin.allocation.off_or_enough import best_choice, rounded_to_least
from fes_pin.allocation.problem import AllocationProblem, Limits, OfProblem, Options, problem_of
from fes_pin.data.errors import InputError

PREVIOUS = "previous recruitment"
SAME = 1e-8
"""Recruitments are exact to this, times the number of channels; see `Certificate.flattest`."""


class Allocator(OfProblem):
    """The program at one posture, ready for any torque.

        min over r of sum w (R r - torque)^2 / 2 + effort + change / 2 |r - previous|^2,  lower <= r <= upper

    An answer depends on earlier calls by `previous` alone, and only with `rate` or `change`. It may be called from
    several threads; where `rate` or `change` count, give `previous` then.

    Parameters
    ----------
    nerves
        `Nerves`, or torque at full recruitment, N m: a DataFrame (joints x channels), or an array whose joints are then
        `joint_1` ... and channels `channel_1` ...
    q, v
        Posture, rad, and, if it moves, its rates, rad/s, if nerves are given, by joint name: muscles that shorten pull
        less (`Nerves`). Arrays without names are in the order of `joints`.
    options
        By name, see `fes_pin.allocation.problem.Options`.

    Raises
    ------
    InputError
        Anything that is not as it is said there.
    """

    def __init__(self, nerves: Any, q: Any = None, *, v: Any = None, **options: Any) -> None:
        self._set_up(problem_of(nerves, q, v, Options.of(options)))

    @classmethod
    def of_problem(cls, problem: AllocationProblem) -> "Allocator":
        """The program of a problem that was checked before."""
        program = cls.__new__(cls)
        program._set_up(problem)
        return program

    def _set_up(self, p: AllocationProblem) -> None:
        self.problem = p
        self.certify = Certifier(p)
        self.precise = max(PRECISE, SAME * self.certify.flattest)
        self.squares, self.pull = p.squares, p.pull
        self.H = self.squares + np.diag(p.prices + p.change)
        for array in (self.squares, self.pull, self.H):
            array.setflags(write=False)
        self.program = BoundedProgram(self.H)
        self._previous = self.at_rest = np.zeros(p.n)
        self.at_rest.setflags(write=False)

    def __getstate__(self) -> dict[str, Any]:
        return {"problem": self.problem, "previous": self._previous}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self._set_up(state["problem"])
        self.previous = state["previous"]

    @property
    def previous(self) -> np.ndarray:
        """Recruitments (n,) that the last call gave, 0 before the first: what `rate` and `change` count from."""
        return self._previous

    @previous.setter
    def previous(self, values: Any) -> None:
        self._previous = fractions(values, self.problem.names, PREVIOUS)

    @property
    def n(self) -> int:
        """Number of channels."""
        return len(self.problem.names)

    def __call__(self, torque: Any, previous: Any = None, *, solver: str = "daqp") -> Allocation:
        """Allocate one torque.

        Parameters
        ----------
        torque
            Wanted joint torque, N m, by joint name (absent: 0), or (joints,) in the order of `joints`, which is no
            body's.
        previous
            Recruitments in force until now, 0 to 1, by channel (absent: 0) or (n,), for `rate` and `change`; those of
            the last call by default (`Allocator.previous`). Without `rate` and `change` nothing depends on them.
        solver
            `daqp`, or any solver that qpsolvers knows (`osqp`, `proxqp` ...).

        Raises
        ------
        InputError
            A torque that is not a number, unknown joint, previous recruitments that are none, unknown solver, or one
            for what only DAQP solves.
        """
        p = self.problem
        wanted = wanted_torque(torque, p.joints, p.other)
        if solver != "daqp":
            known_solver(solver, "an allocation")
            if not p.plain:
                raise InputError(f"least recruitments, cubes and lexicographic are solved by daqp, not by {solver!r}")
        before = self._previous if previous is None else previous
        if before is not self._previous and before is not self.at_rest:
            before = fractions(before, p.names, PREVIOUS)
        found = self._solve(wanted, before, solver)
        self._previous = found.recruitment
        return found

    def _solve(self, wanted: np.ndarray, before: np.ndarray, solver: str) -> Allocation:
        p = self.problem
        lower, upper = limits = p.limits(before)
        f = wanted @ self.pull
        if p.lexicographic:
            total, root = p.prices + p.change, np.sqrt(p.weights / p.scale)
            target = p.change * before / total
            r, note = error_then_effort(root[:, None] * p.matrix, root * wanted, total, target, limits)
            return replace(self.result(r, wanted, limits, before), note=note)
        if p.change:
            f -= p.change * before
        if p.least is not None:
            return self._choose(f, wanted, limits, before)
        if p.cubes:
            r, note = least_cubes(self.squares, f, p.prices, p.change, limits, self.certify.unseen(wanted))
            return replace(self.result(r, wanted, limits, before), note=note)
        if solver == "daqp":
            r = self.program.solve(f[None], lower, upper)[0][0]
        else:
            r = np.clip(solve_by(solver, self.H, f, lower, upper)[0], lower, upper)
        solve = partial(solve_once, self.H, f)
        found = self.result(r, wanted, limits, before, solve)
        if found.certificate.residual <= self.precise:
            return found
        return self.result(solve(lower, upper), wanted, limits, before, solve)

    def result(
        self, r: np.ndarray, wanted: np.ndarray, limits: Limits, before: np.ndarray, solve: Solve | None = None
    ) -> Allocation:
        """The allocation with its certificate, recomputed from the moment arms."""
        r = self.certify.at_limits(before, wanted, r, limits, solve)
        proof, achieved, gradient = self.certify(before, wanted, r, limits)
        width, p = self.problem.curves.pulse_width_us(r), self.problem
        return Allocation(r, width, wanted, achieved, gradient, *limits, before, proof, proof.gap, p)

    def _choose(self, f: np.ndarray, wanted: np.ndarray, limits: Limits, before: np.ndarray) -> Allocation:
        """Solve with channels that are off or at least at their least; the certificate is of the choice made."""
        p = self.problem
        assert p.least is not None
        lower, upper = limits
        if p.rounding:
            choice = rounded_to_least(self.H, f, lower, upper, p.least)
        else:
            choice = best_choice(self.H, f, lower, upper, p.least, seconds=p.seconds)
        on = choice.r > 0.0
        low, high = np.where(on, np.maximum(lower, p.least), 0.0), np.where(on, upper, 0.0)
        proof, achieved, gradient = self.certify(before, wanted, choice.r, (low, high))
        width, note = p.curves.pulse_width_us(choice.r), f"{choice.nodes} choices compared"
        return Allocation(choice.r, width, wanted, achieved, gradient, *limits, before, proof, choice.gap, p, note)

    def sequence(self, torques: Any, previous: Any = None) -> AllocationSequence:
        """Allocate a torque over time, samples in order, each starting from the last.

        Parameters
        ----------
        torques
            (samples, joints), N m: by name (DataFrame, `NamedArray`, mapping), or in the order of `joints`.
        previous
            Recruitments before the first sample, 0 to 1, by channel or (n,); 0 by default.

        Raises
        ------
        InputError
            Wrong shape, a torque that is not a number, previous recruitments that are none, or what is allocated one
            torque at a time.
        """
        p = self.problem
        wanted = wanted_torques(torques, p.joints, other=p.other)
        if not p.plain:
            raise InputError("least recruitments, cubes and lexicographic are allocated one torque at a time")
        start = np.zeros(p.n) if previous is None else fractions(previous, p.names, PREVIOUS)
        r, follows = np.empty((len(wanted), p.n)), bool(p.change) or p.rate < np.inf
        each = np.arange(len(wanted))
        if not follows:  # all at once, and one by one those that are not exact
            r = self.program.solve(wanted @ self.pull, p.lower, p.upper)[0]
            near = self.certify.close(np.minimum(r - p.lower, p.upper - r), wanted).any(axis=1)
            near |= ~(self.certify.residual(start, wanted, r, (p.lower, p.upper)) <= self.precise)
            each = np.flatnonzero(near)
        for k in each.tolist():
            r[k] = self._solve(wanted[k], r[k - 1] if follows and k else start, "daqp").recruitment
        before: Any = np.vstack([start, r[:-1]]) if follows else start
        residual = self.certify.residual(before, wanted, r, p.limits(before))
        return AllocationSequence(r, p.curves.pulse_width_us(r), wanted, r @ p.matrix.T, residual, p)
