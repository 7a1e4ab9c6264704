"""Gains of the position control by a stated rule, and the margins that they leave.

The feedback's gains are those of a linear quadratic regulator at each angle. Its one weight follows a rule: one degree
of error is worth `boldness` of the muscle (Bryson's rule), and `boldness` is that of a ladder with which the linear
loop, its observer included, decays fastest at the worst corner of +-30 % in gain, time constant and stiffness over the
whole range of angles; of several that are as good, the boldest. A frame that was identified (`frame_vibration`) swings
in that loop, though the observer does not know it: an observer that takes the frame's swing for an unknown torque,
answers it a little late and so feeds it, is made slower as far as that helps. Where no loop is stable, there is no
tuning.
"""

import itertools
import math
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg

from fes_pin.control.dynamics import PULSE_S, AnkleDynamics, JointObserver
from fes_pin.control.given import GivenAnkle, Sampled, held
from fes_pin.data.errors import InputError
from fes_pin.data.show import DataFrame, Tabulated, frame

DEGREE = math.pi / 180.0
LADDER = (0.5, 0.35, 0.25, 0.18, 0.12, 0.08, 0.05, 0.03)
"""Shares of the muscle that one degree of error may be worth, boldest first."""
SLOWER = (1.0, 0.35, 0.12, 0.04)
"""Shares of the observer's torque wander, quickest first: without a frame the first that is stable serves."""
AS_GOOD = 0.002
"""Difference of two moduli, per pulse, that does not count."""
UNCERTAINTY = 0.3
"""Relative uncertainty of gain, time constant and stiffness."""
ANGLES = 9
"""Angles that gains are computed for."""


@dataclass(frozen=True, eq=False)
class Gains(Tabulated):
    """Feedback of (share times activation, angle, rate) to recruitment, by angle.

    Attributes
    ----------
    angles
        Shape (n,), rad.
    table
        Shape (n, 3).
    boldness
        As the rule chose it.
    radius
        Largest modulus of the loop's eigenvalues over corners and angles; below 1.
    torque_wander
        Of the observer that they belong to, N m.
    """

    angles: np.ndarray
    table: np.ndarray
    boldness: float
    radius: float
    torque_wander: float

    along = ("angles", "table")

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.table.shape[1:] != (3,) or len(self.angles) < 2 or not (np.diff(self.angles) > 0.0).all():
            raise InputError("expected two or more rising angles, and three gains for each", column="table")

    def to_frame(self) -> DataFrame:
        """The gains by angle as a frame of pandas, a row an angle."""
        names = ("of_activation", "of_angle_per_rad", "of_rate_s_per_rad")
        columns = {n: self.table[:, k] for k, n in enumerate(names)}
        return frame({"angle_rad": self.angles, **columns}, index="angle_rad")

    def at(self, angle: float) -> list[float]:
        """The three gains at an angle, between the table's by straight lines."""
        return [float(np.interp(angle, self.angles, gains)) for gains in self.table.T]


def plant(dynamics: AnkleDynamics, q: float) -> tuple[np.ndarray, np.ndarray, float]:
    """The joint held at an angle, from pulse to pulse, its frame at rest: transition (4, 4) of (activation, angle,
    rate, torque), input (4,), and torque that full activation makes.
    """
    f = dynamics.linear(q, dynamics.activation_for(q), 1.0)[:4, :4]
    a, b = held(f, np.eye(4)[0] / dynamics.time_constant, PULSE_S)
    return a, b, dynamics.pull_nm * math.sin(q)


def moved(dynamics: AnkleDynamics, q: float) -> Sampled:
    """Return the sampled plant of the true states: (activation, angle, rate), and the frame where there is one."""
    a, b = swinging(dynamics, q) if dynamics.frame_coupling else plant(dynamics, q)[:2]
    n = 5 if dynamics.frame_coupling else 3
    return a[:n, :n], b[:n], np.eye(n)[1]


def swinging(dynamics: AnkleDynamics, q: float) -> tuple[np.ndarray, np.ndarray]:
    """The joint on its frame: transition (5, 5) of (activation, angle, rate, frame's angle, frame's rate), input (5,).

    phi'' = -omega^2 phi - 2 zeta omega phi' - coupling torque / J, and the sensor sees the joint against the frame.
    """
    f, c = np.zeros((5, 5)), dynamics.frame_coupling
    omega = 2.0 * math.pi * dynamics.frame_hz
    spring = np.array([0.0, 0.0, 0.0, -omega * omega, -2.0 * dynamics.frame_damping * omega])
    joint = dynamics.linear(q, dynamics.activation_for(q), 1.0)[:3, :3]
    f[:3, :3], f[3, 4] = joint, 1.0
    f[4] = spring - c * np.r_[joint[2], 0.0, 0.0]
    f[2] -= f[4]
    return held(f, np.eye(5)[0] / dynamics.time_constant, PULSE_S)


def regulator(dynamics: AnkleDynamics, q: float, boldness: float) -> np.ndarray:
    """Linear quadratic gains at an angle, shape (3,)."""
    a, b, _ = plant(dynamics, q)
    a, b = a[:3, :3], b[:3, None]
    cost = np.diag([1e-6, (boldness / DEGREE) ** 2, 1e-6])
    p = scipy.linalg.solve_discrete_are(a, b, cost, np.eye(1))
    return np.linalg.solve(np.eye(1) + b.T @ p @ b, b.T @ p @ a)[0]


_ENDS = (1.0 - UNCERTAINTY, 1.0 + UNCERTAINTY)
CORNERS = tuple(itertools.product(_ENDS, _ENDS, _ENDS))
"""Factors on gain, time constant and stiffness."""


def corners(dynamics: AnkleDynamics) -> list[AnkleDynamics]:
    """Ankles that differ by +-30 % in gain, time constant and stiffness."""
    found = []
    for gain, tau, stiff in CORNERS:
        other = replace(dynamics, pull_nm=dynamics.pull_nm * gain, time_constant=dynamics.time_constant * tau)
        stiffer = {**dynamics.known, "f1_per_rad": dynamics.known["f1_per_rad"] * stiff}
        found.append(replace(other, known=stiffer))
    return found


@dataclass(frozen=True, eq=False)
class Loop(Tabulated):
    """The linear loop at one angle: x+ = a x + b r of the truth, of which the sensor sees angle = see x; z+ = own z +
    seen angle and r = law z + direct angle of observer and feedback.
    """

    a: np.ndarray
    b: np.ndarray
    see: np.ndarray
    own: np.ndarray
    seen: np.ndarray
    law: np.ndarray
    direct: float

    @classmethod
    def of(
        cls, truth: Sampled, believed: tuple[np.ndarray, np.ndarray, float], k: np.ndarray, observer: np.ndarray
    ) -> "Loop":
        """From what moves (`moved`), what is believed (`plant`), feedback k (3,) and steady observer gain (4,)."""
        model_a, model_b, pull = believed
        # r = -k (x - x*) + x*_act, with x*_act = -torque / pull
        law = np.r_[-k, -(1.0 + k[0]) / pull]
        keep = np.eye(4) - np.outer(observer, [0.0, 1.0, 0.0, 0.0])
        moves = model_a + np.outer(model_b, law)
        return cls(*truth, moves @ keep, moves @ observer, law @ keep, float(law @ observer))

    def radius(self) -> float:
        """Largest modulus of its eigenvalues, per pulse."""
        top = np.hstack([self.a + np.outer(self.b, self.direct * self.see), np.outer(self.b, self.law)])
        bottom = np.hstack([np.outer(self.seen, self.see), self.own])
        loop = np.vstack([top, bottom])
        return float(np.abs(np.linalg.eigvals(loop)).max()) if np.isfinite(loop).all() else math.inf

    def opened(self, frequencies_hz: np.ndarray) -> np.ndarray:
        """Return the loop gain at the nerve, shape (n,), complex; at -1 the loop is unstable.

        Where the observer has an integrator (its unknown torque), frequencies must be above 0.
        """
        z = np.exp(2j * math.pi * frequencies_hz * PULSE_S)[:, None, None]
        angle = np.linalg.solve(z * np.eye(len(self.a)) - self.a, self.b[:, None])[..., 0] @ self.see
        return -(np.linalg.solve(z * np.eye(4) - self.own, self.seen[:, None])[..., 0] @ self.law + self.direct) * angle


def loop_at(truth: AnkleDynamics, observer: JointObserver, gains: Gains, q: float) -> Loop:
    """The loop of a controller with these gains and this observer at an angle, on another ankle or its own."""
    believed = observer.dynamics
    steady = observer.steady_gain(plant(believed, q)[0])
    return Loop.of(moved(truth, q), plant(believed, q), np.array(gains.at(q)), steady)


def tune(dynamics: AnkleDynamics, observer: JointObserver, given: GivenAnkle | None = None) -> Gains:
    """The gains of the rule; see the module. The observer is made slower where that is needed.

    Parameters
    ----------
    given
        The model with effects that `dynamics` leaves out: the loop must be stable with them as well.

    Raises
    ------
    InputError
        If the loop is unstable somewhere with every boldness and every observer.
    """
    angles = np.linspace(dynamics.rest_angle(), dynamics.rest_angle(1.0), ANGLES)
    tables = [np.array([regulator(dynamics, q, boldness) for q in angles]) for boldness in LADDER]
    places = [(_truths(dynamics, q, given), plant(dynamics, q)) for q in angles[::2].tolist()]
    quickest = observer.torque_wander
    tried: list[Gains] = []
    for share in SLOWER:
        observer.torque_wander = share * quickest
        steady = [observer.steady_gain(believed[0]) for _, believed in places]
        for boldness, table in zip(LADDER, tables, strict=True):
            each = zip(places, table[::2], steady, strict=True)
            loops = (Loop.of(one, at, k, see) for (truths, at), k, see in each for one in truths)
            worst = max(loop.radius() for loop in loops)
            tried.append(Gains(angles, table, boldness, worst, observer.torque_wander))
        if min(g.radius for g in tried) < 1.0 and not dynamics.frame_coupling:
            break
    least = min(g.radius for g in tried)
    if least < 1.0:
        best = next(g for g in tried if g.radius <= least + AS_GOOD and g.radius < 1.0)
        observer.torque_wander = best.torque_wander
        return best
    frame = f" with its frame at {dynamics.frame_hz:.3g} Hz" if dynamics.frame_coupling else ""
    frame += f" with {', '.join(given.names)}" if given is not None else ""
    wide = f"over +-{100 * UNCERTAINTY:.0f} % in gain, time constant and stiffness"
    grows = f"at best its swing grows by {100 * (least - 1.0):.2g} % a pulse"
    raise InputError(f"no gains hold this ankle{frame} {wide}: {grows}")


def _truths(dynamics: AnkleDynamics, q: float, given: GivenAnkle | None) -> list[Sampled]:
    """Return the plants at an angle: the ankle and its corners."""
    if given is None:
        return [moved(other, q) for other in (dynamics, *corners(dynamics))]
    return [m for factors in ((1.0, 1.0, 1.0), *CORNERS) for m in given.moved(q, factors)]
