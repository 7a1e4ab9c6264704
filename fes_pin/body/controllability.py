"""Which inputs control which modes, and with how much energy.

With A-orthonormal mode shapes, mode i obeys eta'' = mu_i eta + phi_i' (C + Q u). Its row b_i = phi_i' Q is what the
Popov-Belevitch-Hautus (PBH) test looks at, for +sqrt(mu_i) and -sqrt(mu_i) alike. Inputs that only pull control a body
only if, besides, every real left eigenvector of F sees pulls of both signs (R. F. Brammer, "Controllability in linear
autonomous systems with positive controllers", SIAM J. Control 10:339-353, 1972).
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy import linalg

from fes_pin.body.inputs import Inputs
from fes_pin.body.linear_body import LinearBody
from fes_pin.body.modes import ModeSet
from fes_pin.data.named import NamedArray
from fes_pin.data.numbers import between
from fes_pin.data.show import Tabulated

RELATIVE_TOLERANCE = 1e-9
"""Below this part of the largest gain, an input does not act on a mode: rounding, not muscle."""
SAME_POLE = 1e-6
"""Eigenvalues of A^-1 B closer than this part of their size (or of 1/s2) are taken as one."""


@dataclass(frozen=True, eq=False)
class ModalControllability(Tabulated):
    """Controllability of the modes of a body by a set of inputs.

    Parameters
    ----------
    modes, inputs, horizon
        The modes, the inputs, the time allowed (s).
    gains
        b = shapes' Q: (modes, inputs), modal force per unit of input.
    controllable
        PBH per mode: inputs of either sign could move it independently of the modes that share its pole.
    both_ways
        Inputs within their bounds push it both ways.
    energy
        Least integral of u'u that brings 1 degree in this mode alone back to rest within the horizon, the other modes
        let go: s for nerves (u = 0..1), (N m)2 s for torques; infinite if the mode is out of reach. Bounds are not
        looked at.
    mode_influence
        Acceleration of the mode's greatest joint per unit of input: (modes, inputs) rad/s2.
    joint_influence
        Acceleration of each joint per unit of input, A^-1 Q on one foot: (joints, inputs) rad/s2.
    """

    linear: LinearBody = field(repr=False)
    modes: ModeSet = field(repr=False)
    inputs: Inputs
    horizon: float
    gains: np.ndarray = field(repr=False)
    controllable: np.ndarray = field(repr=False)
    both_ways: np.ndarray = field(repr=False)
    energy: np.ndarray = field(repr=False)
    mode_influence: np.ndarray = field(repr=False)
    joint_influence: np.ndarray = field(repr=False)

    @property
    def falling(self) -> np.ndarray:
        """Which modes fall: (modes,) bool."""
        return self.modes.kinds == "fall"

    @property
    def _strongest(self) -> list[str]:
        return [self.inputs.names[int(i)] if self.inputs.n else "-" for i in np.abs(self.mode_influence).argmax(axis=1)]

    _index = "mode"

    def _table(self) -> dict[str, Any]:
        return {
            "mode": [mode.name for mode in self.modes],
            "controllable": self.controllable.tolist(),
            "both_ways": self.both_ways.tolist(),
            f"energy_{self.inputs.price_unit}": self.energy.tolist(),
            "strongest_input": self._strongest,
        }

    def influence(self, name: str) -> NamedArray:
        """Acceleration of each joint per unit of one input, (joints,) rad/s2 by joint name.

        Raises
        ------
        InputError
            A name that is not among the inputs.
        """
        column = self.inputs.select([name]).names[0]
        return NamedArray(self.joint_influence[:, self.inputs.names.index(column)], self.linear.joint_names)

    @property
    def controls_falls(self) -> bool:
        """Whether every falling mode can be moved, both ways, with these inputs."""
        return bool(np.all(self.controllable[self.falling] & self.both_ways[self.falling]))

    @property
    def fall_energy(self) -> tuple[np.ndarray, float]:
        """Price of all falls together, without a horizon (see `stabilizing_price`)."""
        rows = self.falling
        return stabilizing_price(self.modes.values[rows], self.gains[rows], self.modes.degree[rows])

    def __str__(self) -> str:
        out = [f"{self.inputs.n} inputs, horizon {self.horizon:g} s: " + ", ".join(self.inputs.names)]
        if not self.linear.conservative:
            out.append("(of the modes without damping and rates: see pbh)")
        price = f"1 deg, {self.inputs.price_unit}"
        out.append(f"     PBH both ways {price} {'strongest input':26s} mode")
        for i, mode in enumerate(self.modes):
            pbh, both = ("yes" if one[i] else "no" for one in (self.controllable, self.both_ways))
            by = f"{self.energy[i]:{len(price)}.3g} {self._strongest[i]:26s}"
            out.append(f"{i + 1:3d}  {pbh:3s} {both:9s} {by} {mode.name}")
        return "\n".join(out)


def modal_controllability(linear: LinearBody, inputs, horizon: float = 0.3) -> ModalControllability:
    """Controllability of every mode of a body.

    Parameters
    ----------
    linear
        From `linearize`, without damping and rates (for others see `pbh`).
    inputs
        `Inputs`, `Nerves`, or names of joints with a motor each.
    horizon
        Time allowed to bring a mode back, s.

    Raises
    ------
    InputError
        Inputs that are none, or a horizon outside 1 ms to 1000 s.
    """
    horizon = between(horizon, 1e-3, 1e3, "horizon")
    inputs = Inputs.of(inputs, linear)
    found = linear.modes()
    torque = inputs.on(linear)
    gains = found.shapes.T @ torque
    size = np.abs(gains).max(initial=0.0)
    gains = np.where(np.abs(gains) > RELATIVE_TOLERANCE * size, gains, 0.0)
    squared = (gains**2).sum(axis=1)
    price = mode_price(found.values, horizon) * found.degree**2
    controllable = independent(found.values, gains)
    with np.errstate(divide="ignore"):
        energy = np.where(controllable, price / squared, np.inf)
    both_ways = np.logical_and(*(push.any(axis=1) for push in inputs.pushes(gains)))
    influence = gains * (np.radians(1.0) / found.degree)[:, None], linear.mobility @ torque
    return ModalControllability(linear, found, inputs, horizon, gains, controllable, both_ways, energy, *influence)


def independent(values: np.ndarray, gains: np.ndarray) -> np.ndarray:
    """PBH per mode: within a group of equal poles as many independent rows as modes are needed."""
    found = np.zeros(len(values), dtype=bool)
    apart = np.abs(np.diff(values)) > SAME_POLE * np.maximum(1.0, np.abs(values[1:]))
    for group in np.split(np.arange(len(values)), np.flatnonzero(apart) + 1):
        rank = np.linalg.matrix_rank(gains[group], rtol=RELATIVE_TOLERANCE) if gains.size else 0
        found[group] = rank == len(group)
    return found


def mode_price(values: np.ndarray, horizon: float) -> np.ndarray:
    """Least integral of w2 that brings eta'' = mu eta + w from eta = 1 at rest to rest at 0 within the horizon: 1/s3.

    The finite-horizon Gramian of one mode in closed form; with a = sqrt(|mu|) T it is mu^(3/2) (2 a + sinh 2 a) /
    (sinh(a)^2 - a^2) for a fall, the same with sin for a swing, 12 / T^3 between. It tends to 2 mu^(3/2) for long
    horizons.
    """
    values = np.asarray(values, dtype=float)
    rate = np.sqrt(np.abs(values))
    a = rate * horizon
    series = 12.0 / horizon**3 * (1.0 + 0.4 * values * horizon**2)
    safe = np.clip(a, 0.05, None)
    big = np.minimum(safe, 300.0)
    with np.errstate(over="ignore"):
        decay = np.exp(-2.0 * big)
        fall = 2.0 * (1.0 - decay**2 + 4.0 * big * decay) / ((1.0 - decay) ** 2 - 4.0 * big**2 * decay)
    swing = (2.0 * safe + np.sin(2.0 * safe)) / (safe**2 - np.sin(safe) ** 2)
    return np.where(a < 0.05, series, rate**3 * np.where(values > 0.0, fall, swing))


def stabilizing_price(values: np.ndarray, gains: np.ndarray, scale: np.ndarray) -> tuple[np.ndarray, float]:
    """Least energy that catches all falling modes together, each from 1 degree, and the condition of the task.

    The growing part z = eta + eta'/rate of mode i obeys z' = rate z + b u / rate; with the Gramian of the reversed
    system, W_ij = b_i.b_j / (rate_i rate_j (rate_i + rate_j)), catching z costs z' W^-1 z, whatever the time.

    Parameters
    ----------
    values, gains
        Of the falling modes: (k,) 1/s2 and (k, inputs).
    scale
        Modal coordinate of 1 degree in each: (k,).

    Returns
    -------
    energy, condition
        (k,) as `Controllability.energy`, but with all other falls held too; and the condition number of W in degrees.
    """
    rates = np.sqrt(values)
    if not len(rates):
        return np.zeros(0), 1.0
    rows = gains / (rates * scale)[:, None]
    gramian = (rows @ rows.T) / (rates[:, None] + rates[None, :])
    eigenvalues, vectors = np.linalg.eigh(gramian)
    if eigenvalues[0] <= 1e-14 * eigenvalues[-1]:
        return np.full(len(rates), np.inf), np.inf
    return ((vectors**2) / eigenvalues).sum(axis=1), float(eigenvalues[-1] / eigenvalues[0])


def pbh(linear: LinearBody, inputs) -> tuple[np.ndarray, np.ndarray]:
    """Poles of F and, for each, how far inputs reach it: |w' R Q| of its unit left eigenvector w. (2n,), (2n,).

    Works with damping and rates. A zero means out of reach; of poles that coincide only the group's rank would tell.
    """
    values, left = linalg.eig(linear.F, left=True, right=False)
    reach = np.linalg.norm(left.conj().T @ linear.R @ Inputs.of(inputs, linear).on(linear), axis=1)
    order = np.lexsort((values.imag, -values.real))
    return values[order], reach[order]
