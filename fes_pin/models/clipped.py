"""Commands that an actuator does not follow: beyond a limit, which falls with the speed, it gives the limit.

    acting = sign(u) min(|u|, stall - slope max(0, v sign(u))),   not below 0

A motor that turns as it is driven has less voltage left for its current, and one that brakes has all of it. The limit
is estimated by a regression of the acting effort on what position, velocity and acceleration can explain, in the band
of the motion. It is taken where it leaves far less of the effort unexplained than the complete command does.

Source: Hughes and Drury, Electric Motors and Drives, 4th ed., 2013, chapter 3: torque and speed at a given voltage.
"""

from collections.abc import Mapping, Sequence
from functools import cached_property

import numpy as np

from fes_pin.data.direction import ALIKE, FEWEST, band_hz, columns_of_motion, moved, smoothed_rows
from fes_pin.data.plausibility import trials_named
from fes_pin.data.schema import IMPOSED
from fes_pin.data.trial import Trial
from fes_pin.models.goals import fitted_of
from fes_pin.models.rigs.base import Rig
from fes_pin.models.rigs.joint import Joint

UNEXPLAINED = 0.02
"""Least share of the variance of a command that the motion leaves unexplained, where a limit is looked for."""
LEFT = 0.25
"""Largest share of that which a limit may leave. Of 31 driven rigs without a limit 0.60 is the least, and of rigs with
one 0.02 the largest (`tests/effort/test_clipped.py`)."""
FEW, MOST = 0.01, 0.8
"""Share of samples beyond a limit: fewer do not show one, and of more a command says little but its sign."""
STALLS = tuple(0.2 + 0.06 * k for k in range(14))
"""Quantiles of the size of the command at which a limit is tried."""
FALLS = (0.0, 0.3, 0.6, 0.9)
"""Share of the limit that the fastest motion takes, where it is tried."""


def with_limited_efforts(trials: Sequence[Trial], rig: Rig) -> tuple[tuple[Trial, ...], list[str]]:
    """Return trials with the efforts that acted in the place of commands beyond a limit, and a warning about them.

    Trials that are held out have no part in the limit.
    """
    driven = [t for t in trials if t.kind != IMPOSED and {"effort", "position"} <= {*t.columns} and len(t) >= FEWEST]
    driven = [t for t in driven if np.ptp(t["effort"]) > 0.0 and np.ptp(t["position"]) > 0.0]
    fitted = fitted_of(driven)
    if not isinstance(rig, Joint) or not np.isfinite(band := band_hz(fitted)):
        return tuple(trials), []
    commands = _Commands(fitted, band)
    if len(commands.rows) < FEWEST or (whole := commands.left(np.inf, 0.0)) < UNEXPLAINED:
        return tuple(trials), []
    stall, slope = commands.likeliest()
    share = commands.share(stall, slope)
    if not (commands.left(stall, slope) < LEFT * whole and FEW < share < MOST):
        return tuple(trials), []
    acting = {id(t): limited(t["effort"], moved(t, band)[1], stall, slope) for t in driven}
    out = (t.with_columns(effort=acting[id(t)]) if id(t) in acting else t for t in trials)
    return tuple(out), [_words(driven, rig.units(), share, stall, slope)]


def _words(driven: Sequence[Trial], units: Mapping[str, str], share: float, stall: float, slope: float) -> str:
    names, unit = trials_named([t.name for t in driven]), units["effort"]
    limit = f"{stall:.3g} {unit}, less {slope:.2g} {unit} s/{units['q']} times the speed of a joint that it drives on"
    beyond = (
        f"effort is a command beyond what the actuator gave in {names}: {100.0 * share:.2g} % of it is above {limit}"
    )
    return f"{beyond}; the effort within this limit is taken"


def limited(command: np.ndarray, velocity: np.ndarray, stall: float, slope: float) -> np.ndarray:
    """Return the effort of an actuator with a limit, shape (n,); see the module."""
    limit = np.maximum(stall - slope * np.maximum(velocity * np.sign(command), 0.0), 0.0)
    return np.asarray(np.clip(command, -limit, limit))


class _Commands:
    """Commands of one actuator, and how much of them within a limit the motion leaves unexplained."""

    def __init__(self, trials: Sequence[Trial], band: float) -> None:
        self.trials, self.band = trials, band
        motions = [moved(t, band) for t in trials]
        self.velocities = [m[1] for m in motions]
        self.every, self.speeds = (np.concatenate(x) for x in ([t["effort"] for t in trials], self.velocities))
        q = np.concatenate([m[0] for m in motions])
        middle, half, usual = 0.5 * (q.max() + q.min()), 0.5 * float(np.ptp(q)), float(np.sqrt(np.mean(self.speeds**2)))
        columns = [np.vstack([m[2], columns_of_motion(m[0], m[1], middle, half, usual)]) for m in motions]
        self.rows = np.concatenate([smoothed_rows(t, x, band) for t, x in zip(trials, columns, strict=True)])

    @cached_property
    def basis(self) -> np.ndarray:
        """Orthonormal columns of the motion at the rows, shape (m, columns); columns that are alike count once."""
        sizes = np.sqrt(np.mean(np.square(self.rows), axis=0))
        basis, values, _ = np.linalg.svd(self.rows / np.where(sizes > 0.0, sizes, 1.0), full_matrices=False)
        return np.asarray(basis[:, values > ALIKE * values[0]])

    def left(self, stall: float, slope: float) -> float:
        """Return the share of the variance of the acting effort that the motion does not explain."""
        acting = [limited(t["effort"], v, stall, slope) for t, v in zip(self.trials, self.velocities, strict=True)]
        held = [0.5 * (x + np.concatenate([x[:1], x[:-1]])) for x in acting]
        each = zip(self.trials, held, strict=True)
        effort = np.concatenate([smoothed_rows(t, x[None], self.band) for t, x in each])[:, 0]
        missed = effort - self.basis @ (self.basis.T @ effort)
        return float(missed @ missed) / max(float(np.sum((effort - effort.mean()) ** 2)), 1e-300)

    def share(self, stall: float, slope: float) -> float:
        """Return the share of samples beyond a limit."""
        return float(np.mean(limited(self.every, self.speeds, stall, slope) != self.every))

    def likeliest(self) -> tuple[float, float]:
        """Return the limit at stall, and its fall with the speed, that leave least."""
        from scipy.optimize import minimize  # noqa: PLC0415 - half a second of SciPy, for efforts alone

        fast, stalls = float(np.quantile(np.abs(self.speeds), 0.98)), np.quantile(np.abs(self.every), STALLS)

        def left(stall: float, fall: float) -> float:
            return self.left(abs(stall), abs(stall * fall) / fast)

        tried = [(float(s), f) for s in stalls if s > 0.0 for f in FALLS]
        first, fall = min(tried, key=lambda one: left(*one))
        found = minimize(lambda x: left(first * x[0], x[1]), (1.0, fall), method="Nelder-Mead")
        stall = first * abs(float(found.x[0]))
        return stall, stall * abs(float(found.x[1])) / fast
