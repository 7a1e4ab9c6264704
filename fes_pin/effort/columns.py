"""Columns of a regression of efforts: links by Pinocchio, and one small function a cause of the catalogue.

    effort = (links + damping v + sum of torques of causes) / (1 + effort_gain)

The torque of a cause has the sign in which it resists: minus that of its equation in the catalogue. What a sensor does
to the reading is a view: the reading is corrected, and all columns are made again from it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from fes_pin.effort.motion import Motion, noise_of_speed
from fes_pin.models.effects.coulomb_friction import STATED
from fes_pin.models.effects.parallel_stiffness import ParallelStiffness
from fes_pin.models.rigs.joint import Joint

Values = Mapping[str, float]
"""Values by name; those of a cause as `cause.parameter`, within its own functions as `parameter`."""
Torques = Callable[[Motion, Values, "Sizes"], Sequence[np.ndarray]]

SLOWLY = 0.05
"""Speed at which friction has most of its size, until data show another, and below which the reading of a play stands;
as a share of the usual speed."""
UNSURE = 5.0
"""Speed below which a reading behind a play stands, in deviations of the noise of the speed, if that is the larger."""
STRIBECK = 0.1
"""Speed over which stiction falls, as a share of the usual speed, where a fit starts."""
PRESLIDING = 1e-3
"""Way over which friction builds up, as a share of the range, where a fit starts, as the catalogue has it."""
STOPS = ((0.98, 0.93, 0.85, 0.7), (0.02, 0.07, 0.15, 0.3))
"""Quantiles of the position at which an upper and a lower stop are tried."""
RELAXING_S = (0.08, 0.3, 1.2)
"""Relaxation times that are tried, s, as the catalogue has them."""
SWAYS_HZ = tuple(k / 20 for k in range(2, 16))
"""Frequencies of a periodic torque that are tried, Hz, as the catalogue has them."""
WAVES = tuple(1.5 + 0.75 * k for k in range(20))
"""Waves of a cogging torque within the range that are tried."""
RINGS_HZ = (3.0, 4.5, 6.5, 9.0, 11.0, 13.5, 17.0, 22.0)
"""Frequencies of a frame that are tried, Hz, as the catalogue has them."""
FRAME = 0.01
"""Coupling of a frame that is tried: its torque is in proportion within 1 %."""
PLAYS = (0.003, 0.03)
"""Half widths of a play that are tried, as shares of the range, as the catalogue has them."""


@dataclass(frozen=True)
class Sizes:
    """What trials of a study have in common.

    Attributes
    ----------
    low, high
        Range of the positions.
    usual, fast
        Root mean square and 98 % quantile of the speed.
    seconds
        Longest trial.
    quantiles
        Positions by the quantiles of `STOPS`.
    links
        The rig's links.
    """

    low: float
    high: float
    usual: float
    fast: float
    seconds: float
    quantiles: Mapping[float, float]
    links: Links

    @property
    def reach(self) -> float:
        """Range of the positions."""
        return self.high - self.low


@dataclass(frozen=True)
class Links:
    """Inertia and gravity of one joint: inertia a + cosine cos(q) + sine sin(q); see `models.rigs.joint`.

    `friction` is the dry friction that its URDF states, `undetermined` names the causes that nothing else determines.
    """

    inertia: float
    cosine: float
    sine: float
    turns: bool
    friction: float = 0.0
    undetermined: tuple[str, ...] = ()

    @classmethod
    def of_rig(cls, rig: Joint) -> Links:
        """Return the links of a joint as its URDF has them."""
        inertia, cosine, sine, turns = (float(rig.constants[n]) for n in rig.needed)
        return cls(inertia, cosine, sine, bool(turns), float(rig.constants.get(STATED, 0.0)), rig.undetermined())

    def gravity(self, q: np.ndarray, tilt: float = 0.0) -> np.ndarray:
        """Return the torque of gravity at positions, shape (n,), the base tilted."""
        at = self.turns * q + tilt
        return self.cosine * np.cos(at) + self.sine * np.sin(at)

    @property
    def idle(self) -> float:
        """Position at which the joint rests without effort: hanging."""
        return math.atan2(-self.cosine, self.sine) if self.turns and (self.cosine or self.sine) else 0.0


NOMINAL = ("inertia_scale", "damping", "gravity_scale")
"""Parameters of the nominal model, as `models.rigs.joint` has them."""


def nominal_columns(track: Motion, links: Links, tilt: float = 0.0) -> Sequence[np.ndarray]:
    """Return the columns of the nominal model at the rows of a trial, in the order of `NOMINAL`."""
    gravity = track.low(links.gravity(track.q, tilt)) if links.cosine or links.sine else np.zeros(len(track.rows))
    return links.inertia * track.moved(2), track.moved(1), gravity


def stated_friction(track: Motion, sizes: Sizes) -> Sequence[np.ndarray]:
    """Return dry friction in the form that a fit starts from."""
    return coulomb_friction(track, _friction(sizes), sizes)


def _friction(s: Sizes) -> Values:
    """Return the shapes of dry friction where a fit starts."""
    creep = SLOWLY * s.usual
    return {"creep_speed": creep, "stiction": 0.0, "stribeck_speed": STRIBECK * s.usual, "presliding": 0.0}


def coulomb_friction(track: Motion, x: Values, sizes: Sizes) -> Sequence[np.ndarray]:
    """Return dry friction, with stiction that falls over the Stribeck speed, or that builds up over a way."""
    share = presliding(track.q, x["presliding"]) if x["presliding"] else np.tanh(track.v / x["creep_speed"])
    if x["stiction"]:
        share = share * (1.0 + x["stiction"] * np.exp(-((track.v / x["stribeck_speed"]) ** 2)))
    return (track.low(share),)


def presliding(q: np.ndarray, way: float) -> np.ndarray:
    """Return the share of friction that acts along a motion, shape (n,): way z' = |v| (sign(v) - z), from z = 0."""
    moved = np.diff(q, prepend=q[0])
    sign, ways = np.sign(moved), np.cumsum(np.abs(moved)) / way
    starts = np.flatnonzero(np.diff(sign, prepend=np.nan) != 0.0)
    lengths = np.diff(starts, append=len(q))
    ends = ways[starts + lengths - 1]
    begun, share = np.concatenate([[0.0], ends[:-1]]), 0.0
    shares = np.empty(len(starts))
    for k, (one, keeps) in enumerate(zip(sign[starts].tolist(), np.exp(begun - ends).tolist(), strict=True)):
        shares[k] = share
        share = one + (share - one) * keeps
    return np.asarray(sign + (np.repeat(shares, lengths) - sign) * np.exp(np.repeat(begun, lengths) - ways))


def quadratic_damping(track: Motion, x: Values, sizes: Sizes) -> Sequence[np.ndarray]:
    """Return drag in proportion to the square of the speed."""
    return (track.low(track.v * np.abs(track.v)),)


def effort_offset(track: Motion, x: Values, sizes: Sizes) -> Sequence[np.ndarray]:
    """Return a constant effort in addition to the recorded one."""
    return (-np.ones(len(track.rows)),)


def parallel_stiffness(track: Motion, x: Values, sizes: Sizes) -> Sequence[np.ndarray]:
    """Return a spring."""
    away = track.moved(0) - x["rest_angle_rad"]
    if x["hardening_per_rad2"]:
        away = away + x["hardening_per_rad2"] * track.low((track.q - x["rest_angle_rad"]) ** 3)
    return (away,)


def joint_stop(track: Motion, x: Values, sizes: Sizes) -> Sequence[np.ndarray]:
    """Return a stiff limit at an angle."""
    return (track.low(x["side"] * np.maximum(x["side"] * (track.q - x["angle_rad"]), 0.0)),)


def passive_relaxation(track: Motion, x: Values, sizes: Sizes) -> Sequence[np.ndarray]:
    """Return a spring in series with a damper."""
    from scipy.signal import lfilter  # noqa: PLC0415 - half a second, which other rigs do not need

    keeps = math.exp(-track.dt / x["relaxation_s"])
    rest = lfilter([1.0 - keeps], [1.0, -keeps], track.q - track.q[0]) + track.q[0]
    return (track.low(track.q - rest),)


def periodic_torque(track: Motion, x: Values, sizes: Sizes) -> Sequence[np.ndarray]:
    """Return a torque that is periodic in time."""
    phase = 2.0 * math.pi * x["frequency_hz"] * track.time
    return track.low(-np.sin(phase)), track.low(-np.cos(phase))


def cogging(track: Motion, x: Values, sizes: Sizes) -> Sequence[np.ndarray]:
    """Return a torque that is periodic in the angle."""
    return track.low(-np.sin(x["waves"] * track.q)), track.low(-np.cos(x["waves"] * track.q))


def frame_vibration(track: Motion, x: Values, inertia: float) -> np.ndarray:
    """Return the change of the column of an inertia where the frame swings, at the rows, shape (m,).

    With H(s) = s^2 / (s^2 + 2 zeta omega s + omega^2) an inertia J has the effort

        J q'' / (1 + c H) = J q'' - J c / (1 + c) H' q''

    where H' has omega and zeta divided by sqrt(1 + c).
    """
    from scipy.signal import lfilter  # noqa: PLC0415 - as above

    softer = math.sqrt(1.0 + x["coupling"])
    w = math.tan(math.pi * x["frequency_hz"] / softer * track.dt)  # s = (z - 1) / (z + 1) keeps this frequency
    swing = 2.0 * x["damping_ratio"] / softer * w
    below = np.array([1.0 + swing + w**2, 2.0 * w**2 - 2.0, 1.0 - swing + w**2])
    share = x["coupling"] / (1.0 + x["coupling"])
    return -inertia * share * track.low(lfilter([1.0, -2.0, 1.0], below, track.a))


def sensor_offset(track: Motion, x: Values, sizes: Sizes) -> np.ndarray:
    """Return the reading without a constant."""
    return np.asarray(track.reading - x["offset"])


def sensor_drift(track: Motion, x: Values, sizes: Sizes) -> np.ndarray:
    """Return the reading without a ramp in time."""
    return np.asarray(track.reading - x["rate_per_s"] * track.time)


def _origin(track: Motion, x: Values, sizes: Sizes) -> float:
    return float((np.median(track.reading[:5]), sizes.links.idle, 0.0)[round(x["place"])])


def sensor_gain(track: Motion, x: Values, sizes: Sizes) -> np.ndarray:
    """Return the reading with its deviations from a place divided by the gain."""
    origin = _origin(track, x, sizes)
    return np.asarray(origin + (track.reading - origin) / (1.0 + x["error"]))


def sensor_nonlinearity(track: Motion, x: Values, sizes: Sizes) -> np.ndarray:
    """Return the y of which y + curvature y^2 is the deviation of the reading from a place."""
    origin = _origin(track, x, sizes)
    away = track.reading - origin
    return np.asarray(origin + 2.0 * away / (1.0 + np.sqrt(np.maximum(1.0 + 4.0 * x["curvature"] * away, 0.25))))


def backlash(track: Motion, x: Values, sizes: Sizes) -> np.ndarray:
    """Return the position of the driven side of a play.

    The driven side turns where the reading stops, and crosses the slack from rest until the reading moves again: by
    the square of the time.
    """
    moving = np.flatnonzero(np.abs(track.v) > max(SLOWLY * sizes.usual, UNSURE * math.sqrt(noise_of_speed(track.band))))
    if len(moving) < 2:
        return track.reading
    side, at = np.sign(track.v[moving]), np.interp(np.arange(len(track.v)), moving, np.arange(len(moving)))
    last = np.minimum(at.astype(int), len(moving) - 2)
    return np.asarray(track.reading + x["half_width"] * (side[last] + np.diff(side)[last] * (at - last) ** 2))


@dataclass(frozen=True)
class CauseOfEffort:
    """A cause as a search fits it.

    Attributes
    ----------
    torques
        Columns at the rows, one for each amplitude, at values of the shapes; None of a view, and
        of a change of the links or of the effort.
    view
        The corrected reading, shape (n,); None of a torque.
    amplitudes
        By name: bounds, and a size at which the cause is tried, where it is no torque.
    shapes
        Starts of the shapes by name, for each place at which it is tried.
    free
        Shapes that are fitted from the first: bounds.
    forms
        Further shapes that are fitted if that is significant, one form after the other: start and bounds.
    """

    name: str
    torques: Torques | None = None
    view: Callable[[Motion, Values, Sizes], np.ndarray] | None = None
    amplitudes: Mapping[str, tuple[float, float, float]] = field(default_factory=dict)
    shapes: Sequence[Values] = ({},)
    free: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    forms: Sequence[Mapping[str, tuple[float, float, float]]] = ()


ANY, POSITIVE = (-math.inf, math.inf, 0.0), (0.0, math.inf, 0.0)
"""Bounds of amplitudes of a torque, which need no size at which they are tried."""


def library(sizes: Sizes, fastest: float) -> dict[str, CauseOfEffort]:
    """Return the causes of one joint by name, with the starts and bounds that the recorded motion gives."""
    causes = [*_torques(sizes), *_of_sensors(sizes)]
    causes += [
        CauseOfEffort(
            "frame_vibration",
            None,
            None,
            {"coupling": (0.0, 5.0, FRAME)},
            [{"frequency_hz": f, "damping_ratio": 0.05} for f in RINGS_HZ if f < fastest],
            {"frequency_hz": (2.0, fastest), "damping_ratio": (0.0, 0.2)},
        ),
        CauseOfEffort("effort_gain", None, None, {"error": (-0.9, 9.0, 0.05)}),
        CauseOfEffort("sensor_lag", None, None, {"lag_s": (0.0, 0.5, 0.005)}),
    ]
    if sizes.links.turns and (sizes.links.cosine or sizes.links.sine):
        causes.append(CauseOfEffort("base_tilt", None, None, {"tilt_rad": (-1.0, 1.0, 0.02)}))
    return {one.name: one for one in causes if one.name not in sizes.links.undetermined}


def _torques(s: Sizes) -> list[CauseOfEffort]:
    """Return the causes that are torques."""
    creep, reach = SLOWLY * s.usual, s.reach
    stops = [
        {"side": side, "angle_rad": s.quantiles[q]} for side, qs in zip((1.0, -1.0), STOPS, strict=True) for q in qs
    ]
    softer = {"creep_speed": (creep, 0.1 * creep, 20.0 * creep)}
    sticks = {"stiction": (0.2, 0.0, 3.0), "stribeck_speed": (STRIBECK * s.usual, 0.5 * creep, s.usual)}
    builds_up = {"presliding": (PRESLIDING * reach, 0.0, 0.1 * reach)}
    rests = [{"rest_angle_rad": x, "hardening_per_rad2": 0.0} for x in (s.quantiles[0.5], s.low, s.high)]
    slowest = 1.0 / s.seconds
    waves = 2.0 * math.pi / reach
    hardens = {"hardening_per_rad2": (1.0 / reach**2, 0.0, 1e3 / reach**2)}
    return [
        CauseOfEffort(
            "coulomb_friction",
            coulomb_friction,
            None,
            {"torque_nm": (-s.links.friction, math.inf, 0.0) if s.links.friction else POSITIVE},
            [_friction(s)],
            {},
            [softer, sticks, builds_up],
        ),
        CauseOfEffort("quadratic_damping", quadratic_damping, None, {"coefficient": POSITIVE}),
        CauseOfEffort("effort_offset", effort_offset, None, {"offset": ANY}),
        CauseOfEffort(
            "parallel_stiffness",
            parallel_stiffness,
            None,
            {"stiffness_nm_per_rad": POSITIVE},
            rests,
            dict(ParallelStiffness().limits({"position": np.array([s.low, s.high])})),
            [hardens],
        ),
        CauseOfEffort("joint_stop", joint_stop, None, {"stiffness": POSITIVE}, stops, {"angle_rad": (s.low, s.high)}),
        CauseOfEffort(
            "passive_relaxation",
            passive_relaxation,
            None,
            {"stiffness_nm_per_rad": POSITIVE},
            [{"relaxation_s": x} for x in RELAXING_S],
            {"relaxation_s": (0.02, s.seconds)},
        ),
        CauseOfEffort(
            "periodic_torque",
            periodic_torque,
            None,
            {"in_phase": ANY, "quadrature": ANY},
            [{"frequency_hz": f} for f in SWAYS_HZ if f >= slowest] or [{"frequency_hz": SWAYS_HZ[-1]}],
            {"frequency_hz": (min(slowest, SWAYS_HZ[-1]), 0.8)},
        ),
        CauseOfEffort(
            "cogging",
            cogging,
            None,
            {"in_phase": ANY, "quadrature": ANY},
            [{"waves": waves * n} for n in WAVES],
            {"waves": (WAVES[0] * waves, 2.0 * WAVES[-1] * waves)},
        ),
    ]


def _of_sensors(s: Sizes) -> list[CauseOfEffort]:
    """Return the causes that are views of the reading."""
    reach = s.reach
    most = math.pi / 2.0 if s.links.turns else reach
    places = [{"place": k} for k in (1.0, 0.0, 2.0)] if s.links.turns else [{"place": 0.0}]
    return [
        CauseOfEffort("sensor_offset", None, sensor_offset, {"offset": (-most, most, 0.02 * reach)}),
        CauseOfEffort("sensor_drift", None, sensor_drift, {"rate_per_s": (-most, most, 0.02 * reach / s.seconds)}),
        CauseOfEffort("sensor_gain", None, sensor_gain, {"error": (-0.5, 1.0, 0.02)}, places),
        CauseOfEffort(
            "sensor_nonlinearity",
            None,
            sensor_nonlinearity,
            {"curvature": (-2 / reach, 2 / reach, 0.02 / reach)},
            places,
        ),
        CauseOfEffort("backlash", None, backlash, {"half_width": (0.0, 0.5 * reach, PLAYS[0] * reach)}),
    ]
