"""Allocation through time: muscles that lag, pulses that may not jump, strength that tires."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from fes_pin.allocation.allocation import ByName
from fes_pin.allocation.allocator import Allocator
from fes_pin.allocation.bounded import BoundedProgram, held, known_solver, solve_by
from fes_pin.allocation.certificate import NOTHING
from fes_pin.allocation.inputs import fractions, wanted_torques
from fes_pin.allocation.problem import AllocationProblem, within_rate
from fes_pin.data.errors import InputError
from fes_pin.data.numbers import between, numbers, positive_number, shortened, whole
from fes_pin.data.read_only import ReadOnly

ROUNDED = 1e-13
"""A plan may exceed the rate by so much: its steps are sums, and solvers round; a pulse width by 1e-10 us."""
STEP_S, LAG_S, FATIGUE_S = (0.002, 1.0), (0.002, 1.0), (0.2, 1000.0)
"""Ranges of time between pulses (1 to 500 a second), of a muscle's lag (activation rises within 0.01 s and ends within
some tenths; the paper has 0.05 s), of fatigue and recovery (Riener and others 1996: some ten seconds to minutes). Times
in ms lie outside."""
LONGEST = 1000
"""Steps ahead or under way, beyond which a horizon is no horizon: half a minute of pulses."""


@dataclass(frozen=True)
class StrengthFatigue:
    """Strength falls with use, comes back with rest (Riener, Quintern and Schmidt 1996, J. Biomech. 29:1157-1167).

        d left / dt = (least - left) act / fatigue_s + (1 - left) (1 - act) / recovery_s

    Time constants differ between muscles and people by more than a factor of two; the defaults are a middle of that.
    """

    fatigue_s: float = 20.0
    recovery_s: float = 40.0
    least: float = 0.2

    def __post_init__(self) -> None:
        for name in ("fatigue_s", "recovery_s"):
            if positive_number(getattr(self, name), name, infinite=True) < np.inf:
                between(getattr(self, name), *FATIGUE_S, name)
        between(self.least, 0.0, 1.0, "least")

    def after(self, left: np.ndarray, act: np.ndarray, step_s: float) -> np.ndarray:
        """Strength left (n,) after a step with activation act (n,), exact for constant activation."""
        down, up = act / self.fatigue_s, (1.0 - act) / self.recovery_s
        rate = down + up
        settled = np.where(rate > 0.0, (self.least * down + up) / np.where(rate > 0.0, rate, 1.0), left)
        return settled + (left - settled) * np.exp(-rate * step_s)


def invert_lag(
    recruitment: np.ndarray, step_s: float, time_constant_s: float, start: np.ndarray | None = None
) -> np.ndarray:
    """Commands that make a first-order lag follow recruitments as far as commands within 0 and 1 can.

    Parameters
    ----------
    recruitment
        (samples, n) wanted activation at the end of each step.
    step_s, time_constant_s
        Time between pulses, and of the lag, s.
    start
        (n,) activation at the beginning; by default that of the first sample.

    Raises
    ------
    InputError
        Times out of `STEP_S` and `LAG_S`, recruitments that are not numbers (samples, n), a start that is not (n,).
    """
    between(step_s, *STEP_S, "step_s")
    between(time_constant_s, *LAG_S, "time_constant_s")
    recruitment = numbers(recruitment, "recruitment")
    if recruitment.ndim != 2 or not len(recruitment) or not np.isfinite(recruitment).all():
        raise InputError(f"recruitment must be finite numbers, samples x channels, got shape {recruitment.shape}")
    keep = np.exp(-step_s / time_constant_s)
    act = numbers(recruitment[0] if start is None else start, "start")
    if act.shape != recruitment.shape[1:] or not np.isfinite(act).all():
        raise InputError(f"expected {recruitment.shape[1]} finite numbers, got shape {act.shape}", column="start")
    commands = np.empty_like(recruitment)
    for k, wanted in enumerate(recruitment):
        commands[k] = np.clip((wanted - keep * act) / (1.0 - keep), 0.0, 1.0)
        act = keep * act + (1.0 - keep) * commands[k]
    return commands


@dataclass(frozen=True, eq=False)
class Plan(ByName, ReadOnly):
    """Stimulation over the horizon; only its first step is meant to be applied. `plan["left_femoral"]` are the steps of
    a channel, us, `plan.torque("left_knee_flexion")` those of a joint, N m.

    Attributes
    ----------
    recruitment, pulse_width_us
        (steps, n); within the limits and the rate.
    achieved
        (steps, joints) torque that the muscles will make, N m.
    primal, dual
        Residuals, recomputed: distance of the solver's answer from the limits, slope that no limit explains.
    gap
        No plan costs less than this one by more (of the cost divided by `scale`).
    problem
        Names, moment arms, weights, prices.
    """

    recruitment: np.ndarray
    pulse_width_us: np.ndarray
    achieved: np.ndarray
    primal: float
    dual: float
    gap: float
    problem: AllocationProblem


@dataclass
class Horizon:
    """Receding horizon at the pulse rate for one posture.

        act' = keep act + (1 - keep) recruitment `delay_steps` ago

    Parameters
    ----------
    program
        An `Allocator`: moment arms, weights, limits, curves, prices of effort and of change, rate (per pulse).
    step_s
        Time between pulses.
    time_constant_s
        Of the muscles' lag; the paper's 0.05 s.
    delay_steps
        Pulses between a pulse and the beginning of its effect.
    steps
        Length of the horizon.
    fatigue
        How strength falls with use; None: it does not.

    Raises
    ------
    InputError
        Times out of `STEP_S` and `LAG_S`, counts that are no whole numbers, a fatigue that is none, no Allocator, or
        one with least recruitments, cubes or lexicographic.
    """

    program: Allocator
    step_s: float = 1.0 / 30.0
    time_constant_s: float = 0.05
    delay_steps: int = 0
    steps: int = 10
    fatigue: StrengthFatigue | None = None
    act: np.ndarray = field(init=False)
    left: np.ndarray = field(init=False)

    def __post_init__(self) -> None:
        between(self.step_s, *STEP_S, "step_s")
        between(self.time_constant_s, *LAG_S, "time_constant_s")
        self.delay_steps = whole(self.delay_steps, "delay_steps", 0, LONGEST - 1)
        self.steps = whole(self.steps, "steps", 1, LONGEST - 1)
        if not isinstance(self.fatigue, StrengthFatigue | None):
            raise InputError(f"must be a StrengthFatigue or None, got {shortened(self.fatigue)}", column="fatigue")
        _check(self.program)
        n = self.program.n
        self.keep = float(np.exp(-self.step_s / self.time_constant_s))
        self.act, self.left, self.before = np.zeros(n), np.ones(n), np.zeros(n)
        self.queue = np.zeros((self.delay_steps, n))
        self._assemble()

    def _assemble(self, like: BoundedProgram | None = None) -> None:
        p, steps, n = self.program.problem, self.steps, self.program.n
        self.matrix = p.matrix * self.left
        later = np.subtract.outer(np.arange(steps), np.arange(steps))
        self.response = np.where(later >= 0, (1.0 - self.keep) * self.keep ** np.maximum(later, 0), 0.0)
        step = np.eye(steps) - np.eye(steps, k=-1)
        squares = (self.matrix.T * p.weights) @ self.matrix / p.scale
        self.H = np.kron(self.response.T @ self.response, squares) + np.kron(p.change * step.T @ step, np.eye(n))
        self.H[np.diag_indices(steps * n)] += np.tile(p.prices, steps)
        self.rows = np.kron(step[1:], np.eye(n))
        self.exact = BoundedProgram(self.H, self.rows, like)

    def plan(self, torques: Any, *, solver: str = "daqp") -> Plan:
        """Stimulation for the torques ahead, from the present state.

        Parameters
        ----------
        torques
            (steps, joints) N m, by name or in the order of the program's joints: wanted at the pulses `delay_steps` + 1
            ... `delay_steps` + steps ahead.
        solver
            `daqp`, whose plan is exact, or any solver that qpsolvers knows (`osqp`, `piqp` ...).

        Raises
        ------
        InputError
            Wrong shape, a torque that is not a number, unknown solver, a state that is none.
        """
        p = self.program.problem
        for name in ("act", "left", "before"):
            fractions(getattr(self, name), p.names, name)
        known_solver(solver, "a horizon")
        wanted = wanted_torques(torques, p.joints, f"{self.steps} steps", p.other)
        if len(wanted) != self.steps:
            raise InputError(f"torques must be {self.steps} steps x {len(p.joints)}, got shape {wanted.shape}")
        free = self.keep ** np.arange(1, self.steps + 1)[:, None] * self.act_when_pulses_act()
        error = (free @ self.matrix.T - wanted) * p.weights / p.scale
        f = self.response.T @ (error @ self.matrix)
        f[0] -= p.change * self.before
        low, high = self.limits()
        found, y = self._solve(f, low, high) if solver == "daqp" else self._solve_by(solver, f, low, high)
        u = self.feasible(found, low, high)
        primal = float(np.abs(u - found).max())
        u, dual, gap = self._at_limits(u, y, f, low, high, wanted)
        achieved = (free + self.response @ u) @ self.matrix.T
        return Plan(u, p.curves.pulse_width_us(u), achieved, primal, dual, gap, p)

    def _solve(self, f: np.ndarray, low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The exact plan (steps, n) for a linear term (steps, n), and its multipliers, shaped as limits."""
        ends = low.ravel(), high.ravel()
        _, (y,) = self.exact.solve(f.reshape(1, -1), *ends)
        u, y = self.exact.exact(f.ravel(), y, *ends)
        return u.reshape(f.shape), y.reshape(low.shape)

    def _solve_by(self, solver: str, f: np.ndarray, low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The same by another solver, at the limits whose multipliers are greater than their slack."""
        x, flat = solve_by(solver, self.H, f.ravel(), low.ravel(), high.ravel(), self.rows)
        u, y = x.reshape(f.shape), flat.reshape(low.shape)
        box, least, most = y[: self.steps], low[: self.steps], high[: self.steps]
        slack = np.where(box > 0.0, most - u, u - least)
        return held(u, np.where(np.abs(box) > slack, box, 0.0), least, most), y

    def _at_limits(
        self, u: np.ndarray, y: np.ndarray, f: np.ndarray, low: np.ndarray, high: np.ndarray, wanted: np.ndarray
    ) -> tuple[np.ndarray, float, float]:
        """The plan, off where the proof cannot tell it from off, dual residual, gap; see `Certifier.at_limits`."""
        dual, gap = self.proof(u, y, f, low, high)
        certify = self.program.certify
        rounding = self.steps * certify.rounding(wanted)
        least, most = low[: self.steps], high[: self.steps]
        limit = np.where(u - least <= most - u, least, most)
        slack = np.abs(u - limit)
        near = (slack > 0.0) & (slack <= np.maximum(rounding / certify.paid, NOTHING))
        if near.any():
            moved = self.feasible(np.where(near, limit, u), low, high)
            dual_then, gap_then = self.proof(moved, y, f, low, high)
            hidden = max(float(rounding.max()), NOTHING)
            if dual_then <= max(dual, hidden) and gap_then <= max(gap, u.size * hidden):
                return moved, dual_then, gap_then
        return u, dual, gap

    def limits(self) -> tuple[np.ndarray, np.ndarray]:
        """Limits (2 steps - 1, n) of the steps, the first also by the rate, then of the changes."""
        p, steps, n = self.program.problem, self.steps, self.program.n
        low, high = np.empty((2 * steps - 1, n)), np.empty((2 * steps - 1, n))
        low[:steps], high[:steps] = p.lower, p.upper
        low[0], high[0] = within_rate(self.before, p.rate, p.lower, p.upper)
        low[steps:], high[steps:] = -min(p.rate, 1.0), min(p.rate, 1.0)
        return low, high

    def feasible(self, near: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
        """A solver's answer, moved into limits and rate step by step."""
        u, rate = near.copy(), min(self.program.problem.rate, 1.0) + ROUNDED
        np.clip(u[0], low[0], high[0], out=u[0])
        for k in range(1, self.steps):
            np.clip(u[k], np.maximum(low[k], u[k - 1] - rate), np.minimum(high[k], u[k - 1] + rate), out=u[k])
        return u

    def proof(
        self, u: np.ndarray, y: np.ndarray, f: np.ndarray, low: np.ndarray, high: np.ndarray
    ) -> tuple[float, float]:
        """Dual residual and a bound on the gap, from the plan and a solver's multipliers."""
        slope = (self.H @ u.ravel()).reshape(f.shape) + f
        rows = np.vstack([u, np.diff(u, axis=0)])
        pull = y[: self.steps].copy()
        pull[1:] += y[self.steps :]
        pull[:-1] -= y[self.steps :]
        unexplained = slope + pull
        stuck = high[: self.steps] == low[: self.steps]  # its multiplier is whatever its slope asks for
        y = y.copy()
        y[: self.steps][stuck] -= unexplained[stuck]
        unexplained[stuck] = 0.0
        gap = np.maximum(y * (high - rows), y * (low - rows)).sum() + np.abs(unexplained).sum()
        return float(np.abs(unexplained).max()), float(gap)

    def act_when_pulses_act(self) -> np.ndarray:
        """Activation when the next pulse begins to act: after what is still under way."""
        act = self.act
        for command in self.queue:
            act = self.keep * act + (1.0 - self.keep) * command
        return act

    def advance(self, torques: Any) -> Plan:
        """Plan, apply the first step, and carry activation, fatigue and the pulses under way on to the next pulse."""
        plan = self.plan(torques)
        command = plan.recruitment[0]
        acting = self.queue[0] if self.delay_steps else command
        act = self.keep * self.act + (1.0 - self.keep) * acting
        left = self.left if self.fatigue is None else self.fatigue.after(self.left, act, self.step_s)
        if self.delay_steps:
            self.queue = np.vstack([self.queue[1:], command])
        self.act, self.before, self.left = act, command, left
        if self.fatigue is not None:
            self._assemble(self.exact)
        return plan

    def carry_on(self, program: Allocator) -> None:
        """Go on with another program (a dead channel, other limits): activation, strength, pulses under way stay.

        Raises
        ------
        InputError
            Other channels, or what a horizon cannot take.
        """
        if program.names != self.program.names:
            raise InputError("a horizon can only be carried on with the same channels")
        _check(program)
        self.program = program
        self._assemble()

    @property
    def torque(self) -> np.ndarray:
        """Torque that the muscles make now, (joints,) N m."""
        return self.matrix @ self.act


def _check(program: Allocator) -> None:
    if not isinstance(program, Allocator):
        raise InputError(f"a horizon needs an Allocator, got {type(program).__name__}")
    if not program.problem.plain:
        raise InputError("a horizon takes effort squares or fatigue, and no least recruitment")
