"""Plans of bounded inputs over a horizon, as linear programs: what they do to falls, swings and the ground's pressure.

Mode i obeys eta'' = mu eta + F with F = phi' (C + Q u). Of a falling mode the growing part z = eta + eta'/r, r =
sqrt(mu), obeys z' = r z + F/r. It stays bounded if and only if z(0) = -integral of e^(-rt) F(t)/r dt, so growing parts
are computed backwards from the end of the plan, decaying ones, y = eta - eta'/r, forwards: nothing grows with time.
Torques follow the stimulation at once.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from fes_pin.body.balance import GroundRows, balance
from fes_pin.body.inputs import Inputs
from fes_pin.body.linear_body import LinearBody
from fes_pin.body.modes import ModeSet
from fes_pin.body.programs import LinearProgram

SETTLE_DEG = 10.0
"""How far a mode may be from the posture and still count as the posture: ours; linear models reach no further. The
answers depend on it: it is an option of the command."""
PULSE_S = 0.04
"""Time between pulses, s: 25 a second, within the 20 to 50 of functional stimulation (Peckham, Knutson, Annu. Rev.
Biomed. Eng. 7:327-360, 2005)."""
PIECES = (1, 1, 1, 1, 2, 2, 3, 5, 8)
"""Pulses for which each input of a plan is held: fine at first, coarse later, 1 s in all; then the last one stays.
Any plan is one that the body could be given; a finer one may catch a little more."""
LOOK_S = 0.08
"""Longest time between instants at which a plan's limits are looked at, s; between them it may pass them a little."""

_SPARED, _OUTSIDE_M = 1e-3, 1e-3
"""Of the gentlest plan: full stimulation of all inputs counts as much as a thousandth of the limit on modes, and a
millimetre outside the soles as much as the whole of it."""


@dataclass(frozen=True)
class Plans:
    """Effect of a plan of inputs on the modes: rows over the inputs of all pieces, one after the other.

    Parameters
    ----------
    linear, inputs, settle_deg, balance
        The body, its inputs, and the limits: every mode stays within `settle_deg` of the posture, at all times and
        in the equilibrium that the last input keeps; each foot's centre of pressure stays on its sole.
    rest_deg
        How far from the posture falling modes may come to rest, degrees; `settle_deg` by default. 0: in the posture
        itself, as the null-controllable region has it.
    gravity
        Whether the posture's weight (C) must be carried; otherwise only deviations count, and no pressure is known.
    pieces
        How long each input is held, in pulses.
    steady
        Whether one input is held for good: it must balance each fall where it is, whose lean is not limited, and
        swings are looked at where they have come to rest.
    """

    linear: LinearBody
    inputs: Inputs
    settle_deg: float = SETTLE_DEG
    balance: bool = True
    rest_deg: float | None = None
    gravity: bool = True
    pieces: Sequence[int] = PIECES
    steady: bool = False

    @classmethod
    def held(cls, linear: LinearBody, inputs: Inputs, settle_deg: float, balance: bool, gravity: bool) -> "Plans":
        """Plans of one input that is held for good; with an infinite `settle_deg` swings are ignored."""
        return cls(linear, inputs, settle_deg, balance, gravity=gravity, pieces=(1,), steady=True)

    @cached_property
    def modes(self) -> ModeSet:
        """The body's modes."""
        return self.linear.modes()

    @cached_property
    def gains(self) -> np.ndarray:
        """Modal force per input: (r, m)."""
        return self.modes.shapes.T @ self.inputs.on(self.linear)

    @cached_property
    def constant(self) -> np.ndarray:
        """Modal force of gravity: (r,)."""
        return self.modes.shapes.T @ self.linear.C * self.gravity

    @cached_property
    def _edges(self) -> tuple[np.ndarray, np.ndarray]:
        """Beginnings and ends of the pieces, s; the last has no end."""
        ends = PULSE_S * np.cumsum(self.pieces)
        return np.concatenate([[0.0], ends[:-1]]), np.append(ends[:-1], np.inf)

    @cached_property
    def _looks(self) -> tuple[np.ndarray, np.ndarray]:
        """Instants at which limits are looked at, s, and the piece whose input acts there: both ends of each piece.

        The centre of pressure jumps with the input and is looked at at both; modes do not, and are at the later ones.
        """
        times, which, start = [], [], 0.0
        for j, pulses in enumerate(self.pieces):
            length = PULSE_S * pulses
            count = max(1, int(np.ceil(length / LOOK_S - 1e-9)))
            times += [start + length * k / count for k in range(count + 1)]
            which += [j] * (count + 1)
            start += length
        return np.array(times), np.array(which)

    @cached_property
    def _later(self) -> np.ndarray:
        """The first look, and those that are not the beginning of a piece: (looks,) bool."""
        _, which = self._looks
        return np.append(True, which[1:] == which[:-1])

    @cached_property
    def _starts(self) -> np.ndarray:
        """Response of the growing part's start to a force in each piece, for the falling modes: (k, pieces)."""
        begin, end = self._edges
        rate, values = self._rates
        return -(np.exp(-rate[:, None] * begin) - np.exp(-rate[:, None] * end)) / values[:, None]

    @property
    def _rates(self) -> tuple[np.ndarray, np.ndarray]:
        values = self.modes.values[self.modes.kinds == "fall"]
        return np.sqrt(values), values

    @cached_property
    def _responses(self) -> np.ndarray:
        """The response of each mode at each look to a unit force in each piece: (r, looks, pieces)."""
        times, _ = self._looks
        begin, end = self._edges
        since, until = times[:, None] - begin, times[:, None] - end
        out = np.zeros((len(self.modes), len(times), len(begin)))
        for i, value in enumerate(self.modes.values):
            rate = np.sqrt(abs(value))
            if self.modes.kinds[i] == "fall":
                decaying = np.exp(-rate * np.maximum(until, 0.0)) - np.exp(-rate * np.maximum(since, 0.0))
                growing = np.exp(-rate * np.maximum(-since, 0.0)) - np.exp(-rate * np.maximum(-until, 0.0))
                out[i] = -0.5 * (growing + decaying) / value
            elif self.modes.kinds[i] == "swing":
                out[i] = (np.cos(rate * np.maximum(until, 0.0)) - np.cos(rate * np.maximum(since, 0.0))) / -value
        return out

    @cached_property
    def _courses(self) -> np.ndarray:
        """Each mode's coordinate at each look without inputs, per unit of its start and rate: (r, looks, 2).

        Of a falling mode only the decaying part: the growing one is what the plan must meet. Of a drift nothing.
        """
        times, _ = self._looks
        out = np.zeros((len(self.modes), len(times), 2))
        for course, kind, value in zip(out, self.modes.kinds, self.modes.values, strict=True):
            w = np.sqrt(abs(value))
            if kind == "fall":
                course[:] = np.multiply.outer(0.5 * np.exp(-w * times), [1.0, -1.0 / w])
            elif kind == "swing":
                course[:] = np.column_stack([np.cos(w * times), np.sin(w * times) / w])
        return out

    def _spread(self, i, response: np.ndarray) -> np.ndarray:
        """Rows over all inputs of responses (rows, pieces) of mode i."""
        return np.kron(response, self.gains[i])

    @cached_property
    def _limits(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Rows <= limits over all inputs, for a body that starts in the posture at rest: (rows, m pieces), (rows,).

        Then what each row is about, (rows,): twice the mode's place on the way, one more in the end; -1 the ground. And
        what the modes' starts and rates add to the limits, (rows, 2 r).
        """
        modes = len(self.modes)
        nothing = np.zeros((0, self.inputs.n * len(self.pieces))), np.zeros(0), np.zeros(0), np.zeros((0, 2 * modes))
        blocks = [nothing]
        for i in np.flatnonzero(self.modes.kinds == "swing" if self.steady else self.modes.kinds != "neutral"):
            blocks += self._near_the_posture(int(i))
        if self.balance and self.gravity:
            blocks += self._on_the_soles()
        rows, limits, about, starts = (np.concatenate(part) for part in zip(*blocks, strict=True))
        return rows, limits, about, starts

    def _near_the_posture(self, i: int) -> list[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]]:
        """The block of `_limits` that keeps mode i within them, one way and the other."""
        value, kind, weight = self.modes.values[i], self.modes.kinds[i], self.modes.degree[i] * self.settle_deg
        last = np.eye(len(self.pieces))[[-1]]
        along, alone = [last / -value], [np.zeros((1, 2))]
        if not self.steady:
            along.insert(0, self._responses[i][self._later])
            alone.insert(0, self._courses[i][self._later])
        later = sum(map(len, along)) - 1
        # what still swings then goes on: |rest| + |offset| + |rate| within the limit
        if kind == "swing" and not self.steady:
            (begin, end), w, time = self._edges, np.sqrt(-value), self._looks[0][-1]
            rate = (np.sin(w * (time - begin)) - np.sin(w * np.maximum(time - end, 0.0))) / -value
            offset, ends = self._responses[i][[-1]] - last / -value, self._courses[i][[-1]]
            turns = np.array([[-np.sin(w * time), np.cos(w * time) / w]])
            for a, b in itertools.product((1.0, -1.0), repeat=2):
                along.append(last / -value + a * offset + b * rate)
                alone.append(a * ends + b * turns)
        response, starts = np.vstack(along), np.zeros((sum(map(len, along)), 2 * len(self.modes)))
        starts[:, 2 * i : 2 * i + 2] = np.vstack(alone) / weight
        spread, still = self._spread(i, response) / weight, self.constant[i] * response.sum(axis=1) / weight
        room, about = np.ones(len(response)), 2.0 * i + (np.arange(len(response)) >= later)
        if kind == "fall" and self.rest_deg is not None:
            room[later] = self.rest_deg / self.settle_deg
        return [(spread, room - still, about, -starts), (-spread, room + still, about, starts)]

    @cached_property
    def _musts(self) -> np.ndarray:
        """The start of each falling mode's growing part, over all inputs, in degrees: (k, m pieces)."""
        fall = np.flatnonzero(self.modes.kinds == "fall")
        spread = [self._spread(i, row[None]) / self.modes.degree[i] for i, row in zip(fall, self._starts, strict=True)]
        return np.vstack([np.zeros((0, self.inputs.n * len(self.pieces))), *spread])

    @cached_property
    def ground(self) -> GroundRows:
        """The inequalities of the centre of pressure."""
        return balance(self.linear, self.modes)

    def _on_the_soles(self) -> list[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]]:
        """Blocks of `_limits`: each foot's centre of pressure on its sole, at every look and at rest in the end."""
        times, which = self._looks
        now = np.zeros((len(times), len(self.pieces)))
        now[np.arange(len(times)), which] = 1.0
        values = self.modes.values
        resting = np.where(self.modes.kinds == "neutral", 0.0, -1.0 / np.where(values, values, 1.0))
        shares, constant = self.ground.per_torque @ self.inputs.on(self.linear), self.ground.constant
        constant = constant + self.ground.per_torque @ self.linear.C
        blocks = []
        for e in range(len(constant)):
            row, limit = np.kron(now, shares[e]), np.full(len(times), -constant[e])
            end, rest = shares[e].copy(), -constant[e]
            for i in range(len(self.modes)):
                response = self.ground.per_mode[e, i] * self._responses[i] + self.ground.per_force[e, i] * now
                row = row + self._spread(i, response)
                limit = limit - self.constant[i] * response.sum(axis=1)
                end += self.ground.at_rest[e, i] * resting[i] * self.gains[i]
                rest -= self.ground.at_rest[e, i] * resting[i] * self.constant[i]
            final = np.zeros((1, self.inputs.n * len(self.pieces)))
            final[0, -self.inputs.n :] = end
            starts = np.einsum("i,ilk->lik", -self.ground.per_mode[e], self._courses).reshape(len(times), -1)
            if not self.steady:
                blocks.append((row, limit, np.full(len(times), -1.0), starts))
            blocks.append((final, np.array([rest]), np.array([-1.0]), np.zeros((1, starts.shape[1]))))
        return blocks

    @property
    def leans(self) -> np.ndarray:
        """Modal coordinates of one degree of lean in each falling mode: (k, r)."""
        return np.diag(self.modes.degree)[self.modes.kinds == "fall"]

    @property
    def owner(self) -> np.ndarray:
        """The input that each column of a plan belongs to: (m pieces,) int."""
        return np.tile(np.arange(self.inputs.n), len(self.pieces))

    def program(self, eta: np.ndarray, rate: np.ndarray) -> LinearProgram:
        """The plan that brings a start to rest; its cost is nothing.

        Parameters
        ----------
        eta, rate
            Modal coordinates of the start and their rates: (r,) each.
        """
        fall = self.modes.kinds == "fall"
        rows, limits, _, starts = self._limits
        growing = eta[fall] + rate[fall] / self._rates[0] - self.constant[fall] * self._starts.sum(axis=1)
        lower, upper = (np.tile(bound, len(self.pieces)) for bound in (self.inputs.lower, self.inputs.upper))
        limits = limits + starts @ np.column_stack([eta, rate]).ravel()
        start = growing / self.modes.degree[fall]
        return LinearProgram(np.zeros(len(upper)), rows, limits, self._musts, start, lower, upper)

    def gentlest(self, eta: np.ndarray, rate: np.ndarray) -> LinearProgram:
        """The plan whose modes stray least, on the way and in the equilibrium at its end.

        Further variables are how far each mode strays, on the way and in the end, as a part of `settle_deg`, and, the
        last, how far the centre of pressure lies outside the soles, m, where no plan keeps it inside. The sum is least;
        a little effort is spared.
        """
        plan, reach = self.program(eta, rate), self._reach
        modal = reach.any(axis=1)
        count, spared = reach.shape[1], np.full(len(plan.cost), _SPARED / max(len(plan.cost), 1))
        price, straying = np.append(np.ones(count), 1.0 / _OUTSIDE_M), np.column_stack([-reach, -1.0 * ~modal])
        wide = plan.widened(price, straying, np.zeros((len(plan.b_eq), count + 1)))
        return replace(wide, b_ub=plan.b_ub - modal, cost=np.append(spared, price))

    @cached_property
    def _reach(self) -> np.ndarray:
        """Which rows of the limits are about which mode, on the way and in the end: (rows, 2 modes) 0 or 1."""
        places = np.flatnonzero(np.repeat(self.modes.kinds != "neutral", 2))
        return 1.0 * (self._limits[2][:, None] == places)
