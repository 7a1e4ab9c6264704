"""The program behind an allocation: a quadratic program with limits, ready for any torque."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from fes_pin.allocate.allocation import Allocation, AllocationSequence
from fes_pin.allocate.box import BoxProgram, by_daqp, solve_sequence
from fes_pin.allocate.branch import NODES, branch_and_bound, rounded
from fes_pin.allocate.certificate import Certifier, residuals, slopes
from fes_pin.allocate.efforts import error_then_effort, least_cubes
from fes_pin.body.joints import JOINT_NAMES
from fes_pin.data.errors import InputError
from fes_pin.muscles.named import by_name
from fes_pin.muscles.recruitment import ChannelRecruitment, LinearRecruitment

LEAST_EFFORT = 1e-10
"""Below this price double precision cannot tell choices apart."""
LEAST_LEFT = 0.05
"""A channel with less strength left than this costs as if it had this much."""
EFFORT = 1e-4
"""Default price of effort: recruiting the strongest channel fully costs as much as missing 1 % of its torque."""


class Allocator:
    """The program at one posture, ready for any torque; it starts where its last answer was.

        min over r of sum w (R r - torque)^2 / 2 + effort + change / 2 |r - previous|^2,  lower <= r <= upper

    Parameters
    ----------
    nerves
        `Nerves`, or an array (joints, n) of torque at full recruitment, N m.
    q, v
        Posture and, if it moves, its rates, if nerves are given: muscles that shorten pull less (`Nerves`).
    recruitment
        Curve for all channels or one per channel; the paper's threshold and saturation by default.
    weights
        Per joint, how much its torque matters, 0 or more, by name or (joints,).
    effort
        Price of recruitment squared, of `scale`, the squared torque of the strongest channel; a number or one each.
    effort_kind
        `squares`; `cubes` (of recruitment, which spreads it over more channels); `fatigue` (squares, dearer the less
        strength a channel has left: by one over the square of what is left).
    lexicographic
        First the least torque error, whatever it costs; among all choices that reach it, the least effort.
    change
        Price of changing a recruitment, likewise.
    lower, upper
        Limits of recruitment within 0 and 1, by name or (n,); upper 0 is a channel that is not to be used.
    least
        Least recruitment at which a channel is reliable: r is 0 or at least this; None: any.
    rounding, nodes
        With `least`: only round the answer without it, cheaply; else stop the search after so many subproblems. The
        allocation's `gap` says how much better another choice could be.
    rate
        Greatest change of a recruitment from one call to the next.
    dead
        Names of channels that do not answer.

    Raises
    ------
    InputError
        Anything above that is not so.
    """

    def __init__(
        self,
        nerves,
        q=None,
        *,
        v=None,
        recruitment=None,
        weights=1.0,
        effort=EFFORT,
        effort_kind: str = "squares",
        lexicographic: bool = False,
        change: float = 0.0,
        lower=0.0,
        upper=1.0,
        least=None,
        rounding: bool = False,
        nodes: int = NODES,
        rate: float = np.inf,
        dead: Sequence[str] = (),
    ) -> None:
        if hasattr(nerves, "torque_matrix"):
            self.names, self.nominal = tuple(nerves.names), np.asarray(nerves.torque_matrix(q, v), dtype=float)
            self.held, self.band = nerves.held(q), nerves.strength_band
        else:
            if v is not None:
                raise InputError("a velocity goes with nerves: a torque matrix holds what muscles make at theirs")
            self.held, self.band = (), (1.0, 1.0)
            self.nominal = np.atleast_2d(np.array(nerves, dtype=float))
            self.names = tuple(f"channel_{i + 1}" for i in range(self.nominal.shape[-1]))
        if self.nominal.ndim != 2 or 0 in self.nominal.shape:
            raise InputError(f"the torque matrix must be joints x channels, got shape {self.nominal.shape}")
        if not np.isfinite(self.nominal).all():
            raise InputError("the torque matrix holds a number that is not finite")
        count = len(self.nominal)
        self.joints = JOINT_NAMES if count == len(JOINT_NAMES) else tuple(f"joint_{j + 1}" for j in range(count))
        self.n = len(self.names)
        self.curves = ChannelRecruitment(recruitment if recruitment is not None else LinearRecruitment(), self.n)
        self.weights = by_name(weights, self.joints, "weights", 1.0)
        self.effort = by_name(effort, self.names, "effort", EFFORT)
        self._limits(lower, upper, least, dead)
        self._efforts(effort_kind, lexicographic, getattr(nerves, "left_over", np.ones(self.n)))
        if (self.weights < 0.0).any():
            raise InputError(f"weight of {self.joints[int(np.argmin(self.weights))]} is negative")
        if (self.effort < LEAST_EFFORT).any():
            raise InputError(
                f"effort must cost {LEAST_EFFORT:g} or more; for torque before any effort ask lexicographic"
            )
        if not (np.isfinite(change) and change >= 0.0):
            raise InputError(f"change must cost 0 or more, got {change}")
        if not rate > 0.0:
            raise InputError(f"rate must be more than 0, got {rate}")
        self.change, self.rate = float(change), float(rate)
        self.rounding, self.nodes = bool(rounding), int(nodes)
        self._assemble()

    def _efforts(self, kind: str, lexicographic: bool, left_over: np.ndarray) -> None:
        if kind not in ("squares", "cubes", "fatigue"):
            raise InputError(f"effort_kind must be squares, cubes or fatigue, got {kind!r}")
        self.cubes, self.lexicographic, self.choosy = kind == "cubes", bool(lexicographic), self.least is not None
        if self.choosy and (self.cubes or self.lexicographic):
            raise InputError("least recruitments go with effort squares or fatigue, not with cubes or lexicographic")
        if kind == "fatigue":
            self.effort = self.effort / np.maximum(left_over, LEAST_LEFT) ** 2

    def _limits(self, lower, upper, least, dead) -> None:
        self.lower = by_name(lower, self.names, "lower limits", 0.0)
        self.upper = by_name(upper, self.names, "upper limits", 1.0)
        for name in (dead,) if isinstance(dead, str) else dead:
            if name not in self.names:
                raise InputError(f"dead channel {name!r} is not one of {', '.join(self.names)}")
            self.lower[self.names.index(name)] = self.upper[self.names.index(name)] = 0.0
        if (self.lower < 0.0).any() or (self.upper > 1.0).any() or (self.lower > self.upper).any():
            wrong = (self.lower < 0.0) | (self.upper > 1.0) | (self.lower > self.upper)
            i = int(np.argmax(wrong))
            raise InputError(
                f"limits of {self.names[i]} must be 0 <= lower <= upper <= 1, got {self.lower[i]} and {self.upper[i]}"
            )
        self.least = None if least is None else by_name(least, self.names, "least recruitment", 0.0)
        if self.least is not None and ((self.least < 0.0) | (self.least > 1.0)).any():
            raise InputError("least recruitment must lie between 0 and 1")

    def _assemble(self) -> None:
        dead = self.upper == 0.0
        self.matrix = np.where(dead, 0.0, self.nominal)
        weighed = self.matrix.T * self.weights
        squares = weighed @ self.matrix
        self.scale = float(squares.diagonal().max()) or 1.0
        self.prices, self._from_torque = self.effort, -weighed.T / self.scale
        self.squares = squares / self.scale
        self.H = self.squares.copy()
        self.H.flat[:: self.n + 1] += self.effort + self.change
        self.program = BoxProgram(self.H)
        self.program.lower[:], self.program.upper[:] = self.lower, self.upper
        certified_prices = np.zeros(self.n) if self.lexicographic else self.prices
        self.certify = Certifier(self.matrix, self.weights, certified_prices, self.scale, self.change, self.cubes)
        self.previous = self.at_rest = np.zeros(self.n)

    def torque_of(self, torque) -> np.ndarray:
        """A wanted torque, by name (absent joints: 0) or (joints,), as an array, N m."""
        good = isinstance(torque, np.ndarray) and torque.dtype == float and torque.shape == (len(self.joints),)
        if good and np.isfinite(torque.sum()):
            return torque.copy()
        return by_name(torque, self.joints, "wanted torque", 0.0)

    def __call__(self, torque, previous=None, *, solver: str = "pivot") -> Allocation:
        """Allocate one torque.

        Parameters
        ----------
        torque
            Wanted joint torque, N m, by joint name (absent: 0) or (joints,).
        previous
            Recruitments in force until now, (n,), for `rate` and `change`; those of the last call by default.
        solver
            `pivot`, or any solver that qpsolvers knows (`daqp`, `osqp` ...).

        Raises
        ------
        InputError
            A torque that is not a number, unknown joint, unknown solver.
        """
        wanted = self.torque_of(torque)
        before = self.previous if previous is None else previous
        if before is not self.previous and before is not self.at_rest:
            before = by_name(before, self.names, "previous recruitment", 0.0)
        lower, upper = self.limits(before)
        f = wanted @ self._from_torque
        if self.change:
            f -= self.change * before
        if solver != "pivot" and (self.choosy or self.cubes or self.lexicographic):
            raise InputError(f"solver {solver!r} does not go with least recruitments, cubes or lexicographic")
        if self.choosy:
            return self.choose(f, wanted, lower, upper, before)
        if self.cubes:
            r, note = least_cubes(self.squares, f, self.prices, self.change, lower, upper)
            return self.result(r, wanted, lower, upper, before, note=note)
        if self.lexicographic:
            r, note = error_then_effort(self.squares, f, self.prices, lower, upper)
            return self.result(r, wanted, lower, upper, before, note=note)
        if solver != "pivot":
            return self.result(self.ask(solver, f, lower, upper), wanted, lower, upper, before)
        note = ""
        if not self.program.solve(f):
            note = "pivoting gave up, DAQP answered"
            self.program.r[:] = by_daqp(self.H, f, lower, upper)
        return self.result(self.program.r.copy(), wanted, lower, upper, before, note=note)

    def limits(self, before: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Limits of recruitment under the rate limit."""
        if self.rate == np.inf:
            return self.lower, self.upper
        lower = np.clip(before - self.rate, self.lower, self.upper)
        upper = np.clip(before + self.rate, self.lower, self.upper)
        if self.least is not None:  # between off and its least recruitment a channel may jump
            lower = np.where(lower < self.least, self.lower, lower)
            upper = np.maximum(upper, np.minimum(self.least, self.upper))
        self.program.lower[:], self.program.upper[:] = lower, upper
        return lower, upper

    def result(
        self, r, wanted, lower, upper, before, gap: float | None = None, note: str = "", held: tuple | None = None
    ) -> Allocation:
        """The allocation with its certificate, recomputed from the moment arms; `held`: limits of the choice made."""
        certificate, achieved, gradient = self.certify(before, wanted, r, *(held or (lower, upper)))
        self.previous = r
        width = self.curves.pulse_width_us(r)
        gap = certificate.gap if gap is None else gap
        return Allocation(r, width, wanted, achieved, gradient, lower, upper, before, certificate, gap, self, note)

    def ask(self, solver: str, f, lower, upper) -> np.ndarray:
        """Solve through qpsolvers."""
        import qpsolvers

        if solver not in qpsolvers.available_solvers:
            known = ", ".join(["pivot", *qpsolvers.available_solvers])
            raise InputError(f"solver {solver!r} is not installed; there are {known}")
        H: Any = self.H
        quiet: dict[str, Any] = (
            {"raise_error": False} if solver == "osqp" else {}
        )  # it warns of a default that will change
        if solver in qpsolvers.sparse_solvers:
            from scipy.sparse import csc_matrix

            H = csc_matrix(H)
        r = qpsolvers.solve_qp(H, f, lb=lower, ub=upper, solver=solver, **quiet)
        if r is None:
            raise InputError(f"solver {solver!r} found no answer")
        return np.clip(r, lower, upper)

    def choose(self, f, wanted, lower, upper, before) -> Allocation:
        """Solve with channels that are off or at least at their least; the certificate is of the choice made."""
        assert self.least is not None
        if self.rounding:
            choice = rounded(self.H, f, lower, upper, self.least)
        else:
            choice = branch_and_bound(self.H, f, lower, upper, self.least, nodes=self.nodes)
        on = choice.r > 0.0
        held = np.where(on, np.maximum(lower, self.least), 0.0), np.where(on, upper, 0.0)
        note = f"{choice.nodes} choices compared"
        return self.result(choice.r, wanted, lower, upper, before, gap=choice.gap, note=note, held=held)

    def sequence(self, torques, previous=None) -> AllocationSequence:
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
            Wrong shape, a torque that is not a number, or channels with a least recruitment (allocate those singly).
        """
        wanted = np.asarray(torques, dtype=float)
        if wanted.ndim != 2 or wanted.shape[1] != len(self.joints):
            raise InputError(f"torques must be samples x {len(self.joints)}, got shape {wanted.shape}")
        if not np.isfinite(wanted.sum()) and not np.isfinite(wanted).all():
            k, j = np.argwhere(~np.isfinite(wanted))[0]
            raise InputError(f"wanted torque of {self.joints[j]} at sample {k} is not a finite number")
        if self.choosy or self.cubes or self.lexicographic:
            raise InputError("least recruitments, cubes and lexicographic are allocated one torque at a time")
        start = np.zeros(self.n) if previous is None else by_name(previous, self.names, "previous recruitment", 0.0)
        F = wanted @ self._from_torque
        r = solve_sequence(
            self.H,
            F,
            self.lower,
            self.upper,
            keep=self.change,
            rate=self.rate,
            previous=start,
        )
        return self.certified(r, wanted, start)

    def certified(self, r, wanted, start) -> AllocationSequence:
        """Arrays of results with residuals recomputed from the moment arms."""
        achieved = r @ self.matrix.T
        before: Any = np.vstack([start, r[:-1]]) if self.change or self.rate < np.inf else start
        gradient = slopes(self.matrix, self.weights, self.scale, achieved - wanted, self.prices, r, self.change, before)
        lower, upper = self.lower, self.upper
        if self.rate < np.inf:
            lower, upper = (np.clip(before + s * self.rate, self.lower, self.upper) for s in (-1.0, 1.0))
        residual = np.maximum.reduce(residuals(gradient, r, lower, upper)[:3])
        return AllocationSequence(r, self.curves.pulse_width_us(r), wanted, achieved, residual, self)
