"""Dry friction."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fes_pin.models.maths import exp, fabs, lag, log, play, power, sqrt
from fes_pin.models.stage import Bounds, ByName, Effect, Grids, Measured, Scalar, Signals, Stage, parameter, refinement

STIFFEST = 2.5
"""Largest rate of decay times step that it may show; RK4 is stable to 2.78: Hairer, Wanner, Solving ODEs II, IV.2."""
CORNER = 0.01
"""Width of its corners, as a share of the friction torque: the joint breaks away within 1 % of it."""
CREEP = 0.004
"""Speed at which a joint creeps under half its friction until data show another, rad/s: 0.2 degrees a second."""
SPAN_S = 0.05
"""Time over which a speed is read off measured positions, s: an encoder's counts are small next to the way in it."""
WAYS = (0.05, 0.2)
"""Presliding that is tried, as shares of an imposed way."""
STRETCHES = (1e-4, 1e-3)
"""Stretches of a contact that are tried, as shares of the way of a free motion: some ten micrometres on a slide, a
milliradian on a joint that turns."""
MOST_STRETCH = 0.1
"""The largest, in the same: a hundred times the longer that is tried, where a contact would be a spring. Metal on metal
breaks away within micrometres (Armstrong-Helouvry, Dupont and Canudas de Wit, Automatica 30, 1994)."""
STANDING = 1e-6
"""Speed below which friction does not build up, rad/s or m/s: it keeps derivatives finite."""
UNLOADED = 1e-3
"""Load below which its sign no longer shows, in units of the weight at rest: it keeps derivatives finite."""
BEYOND, SUM = "at the joint beyond the friction that its URDF states.", "T = (friction + torque)"
"""The sentence and the equation of dry friction that adds to what is known of it; or takes from it, below 0."""
STATED = "friction"
"""Constant of a rig: the dry friction that is known of it, of a joint by its URDF, N m or N."""


def _by_load(exponent: float) -> str:
    return "in proportion to the load" + f" to the power {exponent:.3g}" * (exponent != 1.0)


@dataclass(frozen=True)
class CoulombFriction(Effect):
    """Dry friction at the joint.

        effort - T sat(x, softness)                                              without presliding
        effort - T z,   presliding z' = |v| (sat(x, softness) - z)               with presliding
        T = torque |load|^load_exponent (1 + stiction exp(-(v / stribeck_speed)^2)) (1 + asymmetry sign(x))
        x = y / max(1, |y|)^2 + k v / S,   y = effort / S,   S = T + creep_speed k                     without stretch
        x = (q - a) / stretch + k v / S,   S = T + k sqrt(creep_speed^2 + T stretch / (4 J))           with stretch
        a+ = clip(a, q - stretch, q + stretch)      once per sample                                    with stretch
        k = STIFFEST J / h

    with sat(x, w) from -1 to 1, its corners rounded over w of the friction as ln cosh is, and h the integration
    step, 0 where the motion is imposed. It is T sign(v) in motion, and what holds the joint at rest: there x is
    effort / S, and k v brings the joint there within a step. A torque beyond T only turns the motion: y falls out of x
    then, and friction changes its sign where the velocity does. Under a torque below T the joint still creeps, at most
    by `creep_speed`: 0.2 degrees a second, until data show another. In the limit of small steps x = v / creep_speed.
    Far from its corners friction is T but for what falls exponentially: a slower approach would pass for damping. Wide
    corners make it T tanh(v / speed), the commonest smooth form. `load` is the bearing's: see the rig.
    The sign of the asymmetry is that of x without it.
    Where the motion is an estimate, friction is near its mean over what x may be by it: corners are rounded over
    sqrt(pi / 2) of that deviation as well. T sign(v) becomes T tanh(v / (sqrt(pi / 2) v_std)), which has the slope of
    the mean for a Gaussian. The slope at one velocity says nothing of friction at those next to it.
    A contact stretches before it slips. On a joint that is free, with `stretch` of it, what holds the joint at rest is
    a spring to an anchor a that it drags along, and not the torque itself, so that it comes to rest within the stretch
    of where it stopped. T over the stretch is the spring's stiffness, no more than integration steps resolve, and its
    damping is critical, as bristles' is chosen to be, or less where data show a larger `creep_speed`. Where the motion
    is imposed, friction may build up over a way `presliding` as exponentials do: a share z acts. The velocity is known
    there; noise in one that is estimated would wear z away while the joint stands.
    Sliding contacts lose in proportion to the load; rolling ones by elastic hysteresis, the load times the width of the
    contact: to the power 4/3 for balls, 3/2 for rollers. Friction that differs by the direction is, moving and at rest,
    symmetric friction together with a constant torque: a joint has `effort_offset` for that, and no asymmetry.

    Tell-tale: the joint comes to rest at other angles from above than from below; free swings shrink by equal steps.
    Source: Olsson, Astrom, Canudas de Wit, Gafvert and Lischinsky, Friction models and friction compensation,
    European Journal of Control 4 (1998). Load: Tabor, The mechanism of rolling friction II: the elastic range, Proc. R.
    Soc. A 229 (1955); Greenwood, Minshall and Tabor, Hysteresis losses in rolling and sliding friction, 259 (1961).
    Smooth forms: Andersson, Soderberg and Bjorklund, Friction models for sliding dry, boundary and mixed lubricated
    contacts, Tribology International 40 (2007).
    Critical damping of what bends before it slips: Canudas de Wit, Olsson, Astrom and Lischinsky, A new model for
    control of systems with friction, IEEE Trans. Automatic Control 40 (1995).
    Presliding: Dahl, A solid friction model, Aerospace Corporation TOR-0158(3107-18)-1, 1968. Spring to an anchor:
    Hayward and Armstrong, A new computational model of friction applied to haptic rendering, in Experimental Robotics
    VI, Springer 2000; Prandtl, ZAMM 8 (1928).
    Mean over an estimate: Gelb, Applied Optimal Estimation, 1974, section 6.2, statistical linearization.
    Asymmetry: Khalil and Dombre, Modeling, Identification and Control of Robots, 2002, whose offset holds it.
    """

    torque_nm: float = parameter(0.01, unit="{effort}", null=0.0, lower=0.0, upper=1e6, scale=0.01)
    stiction: float = refinement(
        0.0, lower=0.0, upper=10.0, scale=0.1, grid=(0.05, 0.3), words="with more of it at rest (Stribeck)"
    )
    stribeck_speed: float = parameter(
        1.0, unit="{q}/s", lower=1e-4, upper=1e4, scale=0.5, optional=True, grid=(1.0, 0.2, 4.0)
    )
    creep_speed: float = refinement(
        CREEP, unit="{q}/s", lower=1e-5, upper=0.5, scale=0.002, grid=(0.02,), words="under which the joint creeps"
    )
    softness: float = refinement(
        CORNER, lower=1e-3, upper=50.0, scale=0.1, grid=(0.5,), words="which changes its sign smoothly with the speed"
    )
    load_exponent: float = refinement(
        0.0, lower=0.0, upper=2.0, scale=1.0, fitted=False, grid=(1.0, 4.0 / 3.0, 1.5), words=_by_load
    )
    asymmetry: float = refinement(
        0.0, lower=-1.0, upper=1.0, scale=0.1, grid=(0.3, -0.3), rigs=("ankle",), words="with more of it one way"
    )
    presliding: float = refinement(
        0.0, unit="{q}", lower=0.0, scale=0.01, words="which builds up over a way (presliding)"
    )
    stretch: float = refinement(
        0.0, unit="{q}", lower=0.0, scale=0.001, rigs=("joint",), words="at a contact that stretches before it slips"
    )

    name, stage, signal, rigs = "coulomb_friction", Stage.JOINT, "friction", ("ankle", "joint")
    states, memories, of_form = ("share",), ("anchor",), {"share": "presliding", "anchor": "stretch"}
    dissipative = True
    predictor_step_s = 4e-3 / 3.0

    @classmethod
    def grids(cls, measured: Measured) -> Grids:
        """Return grids of speeds in proportion to those of the joint; a sine is slower a fifth of the time."""
        grids, speed, info = super().grids(measured), _usual_speed(measured), cls.parameters()
        tried: dict[str, tuple[Sequence[float], float]] = {
            "presliding": (WAYS, _imposed_way(measured)),
            "stretch": (STRETCHES, _free_way(measured)),
        }
        if speed > 0.0:
            tried |= {"stribeck_speed": ((0.3, 0.1, 1.0), speed), "creep_speed": ((0.1, 0.5, 0.02), speed)}
        own = {n: tuple(info[n].nearest(k * unit) for k in shares) for n, (shares, unit) in tried.items()}
        return {**grids, **own}

    @classmethod
    def forms(cls, measured: Measured) -> tuple[Mapping[str, float], ...]:
        """With presliding as well where the motion is imposed: at rates of many samples a band's stretch is no jump.

        With a stretch where an effort answers the readings: in a model that also contains a play, a joint that sticks
        and creeps is otherwise mistaken for one without friction.
        """
        grids, tried = cls.grids(measured), "stretch" if "answer" in measured else "presliding"
        return ({}, *({tried: way} for way in grids[tried] if way > 0.0))

    def limits(self, measured: Measured) -> Bounds:
        """A fall of friction with speed ends among the speeds that a joint moves at; else it is less damping.

        What a joint moves by without slipping is little of its motion; else the contact is a spring.
        """
        speed, free, way = _usual_speed(measured), _free_way(measured), _imposed_way(measured)
        limits = {"stribeck_speed": (0.0, 2.0 * speed)} if speed > 0.0 else {}
        limits |= {"stretch": (0.0, MOST_STRETCH * free)} if free > 0.0 else {}
        return {**limits, "presliding": (0.0, 0.5 * way)} if way > 0.0 else limits

    @classmethod
    def on(cls, constants: Mapping[str, float]) -> type[Effect]:
        """Return what is beyond the friction that a joint's URDF states, where it states one."""
        return FrictionBeyond if STATED in constants else cls

    def _torque(self, s: Signals) -> Scalar:
        """Return all dry friction: what the rig states, and what is beyond it."""
        return self.torque_nm + getattr(s.c, STATED) if hasattr(s.c, STATED) else self.torque_nm

    def apply(self, value: Scalar, s: Signals) -> Scalar:
        ratio = s.v / self.stribeck_speed
        loaded = power(s.bearing_load, self.load_exponent, UNLOADED)
        most = self._torque(s) * loaded * (1.0 + self.stiction * exp(-ratio * ratio))
        both_ways = self._acting(most, value, s)[0]
        most = most * (1.0 + self.asymmetry * both_ways / _length(both_ways))
        return value - most * self._acting(most, value, s)[0]

    def _held(self, y: Scalar, s: Signals) -> Scalar:
        """Return the friction that holds the joint at rest, in units of the largest friction."""
        if hasattr(s.own, "anchor"):
            return (s.q - s.own.anchor) / self._way(s)
        beyond = 0.5 * (_length(y + 1.0) + _length(y - 1.0))
        return y / (beyond * beyond)

    def update(self, s: Signals) -> ByName:
        return {"anchor": play(s.own.anchor, s.q, self._way(s))} if hasattr(s.own, "anchor") else {}

    def rest(self, s: Signals) -> ByName:
        return {"anchor": s.q} if hasattr(s.own, "anchor") else {}

    def start_variances(self, reach: Scalar, speed: Scalar) -> ByName:
        """Return the variance of the unknown initial stretch of the contact."""
        return {"anchor": self.stretch**2 / 3.0}

    def _way(self, s: Signals) -> Scalar:
        """Way over which the contact stretches, at least the shortest that integration steps resolve."""
        shortest = self._torque(s) * s.step / _stopping(s)
        return sqrt(self.stretch * self.stretch + shortest * shortest)

    def _creeping(self, most: Scalar, s: Signals) -> Scalar:
        """Speed at which it creeps: on a contact that stretches at least as fast as critical damping has it."""
        if not hasattr(s.own, "anchor"):
            return self.creep_speed
        return sqrt(self.creep_speed * self.creep_speed + 0.25 * most * self._way(s) / s.inertia)

    def rate(self, s: Signals) -> ByName:
        return {"share": self._acting(self._torque(s), 0.0, s)[1]} if hasattr(s.own, "share") else {}

    def _acting(self, most: Scalar, value: Scalar, s: Signals) -> tuple[Scalar, Scalar]:
        """Share that acts, and the rate of its state."""
        steady = self._share(most, value, s)
        if not hasattr(s.own, "share"):
            return steady, 0.0
        return lag(steady, s.own.share, self.presliding / sqrt(s.v * s.v + STANDING * STANDING), s.step)

    def _share(self, most: Scalar, value: Scalar, s: Signals) -> Scalar:
        """Share of the largest friction that acts, with its sign: clip(x)."""
        stopping = _stopping(s)
        scale = most + stopping * self._creeping(most, s)
        x = self._held(value / scale, s) + stopping * s.v / scale
        unsure = self._unsure(stopping / scale, s)
        return _clip(x, sqrt(self.softness * self.softness + 0.5 * math.pi * unsure * unsure))

    def _unsure(self, slope: Scalar, s: Signals) -> Scalar:
        """Standard deviation of x by the motion, with `slope` of the velocity."""
        if not hasattr(s.own, "anchor"):
            return slope * s.std(s.v)
        way = self._way(s)
        return s.std(s.q - s.own.anchor + way * slope * s.v) / way


@dataclass(frozen=True)
class FrictionBeyond(CoulombFriction):  # noqa: D101 - the docstring of dry friction, with another first line
    __doc__ = (CoulombFriction.__doc__ or "").replace("at the joint.", BEYOND, 1).replace("T = torque", SUM)

    torque_nm: float = parameter(0.01, unit="{effort}", null=0.0, lower=-1e6, upper=1e6, scale=0.01)

    may_end = ("torque_nm",)

    def limits(self, measured: Measured) -> Bounds:
        """Return the same bounds, with no more taken away than is stated."""
        return {**super().limits(measured), "torque_nm": (-float(measured[STATED][0]), np.inf)}


def _stopping(s: Signals) -> Scalar:
    """Torque over velocity that stops the joint within a step: k."""
    return STIFFEST * getattr(s, "stopping", s.inertia / s.step)


def _free_way(measured: Measured) -> float:
    """Return the range of a motion that is read as a position, rad or m; 0 for others."""
    position = measured.get("position", np.empty(0))
    return float(np.ptp(position)) if len(position) and np.array_equal(position, measured.get("reading", ())) else 0.0


def _imposed_way(measured: Measured) -> float:
    """Return the range of an imposed motion, rad or m; 0 where the motion is the reading."""
    position = measured.get("position", measured.get("angle_rad", np.zeros(1)))
    return 0.0 if np.array_equal(position, measured.get("reading", ())) else float(np.ptp(position))


def _usual_speed(measured: Measured) -> float:
    """Root mean square of a joint's speed over SPAN_S, rad/s or m/s; 0 where no position was measured.

    That of a sine is its median as well; but a joint that rests most of the time has the median of its noise.
    """
    if "position" not in measured:
        return 0.0
    dt = float(np.median(np.diff(measured["time"])))
    lag = max(1, round(SPAN_S / dt))
    moved = measured["position"][lag:] - measured["position"][:-lag]
    return float(np.sqrt(np.nanmean(moved**2))) / (lag * dt) if len(moved) else 0.0


def _length(x: Scalar) -> Scalar:
    """|x| with a rounded corner."""
    return sqrt(x * x + CORNER * CORNER)


def _clip(x: Scalar, corner: Scalar) -> Scalar:
    """x from -1 to 1 with rounded corners: corner / 2 ln(cosh((x + 1) / corner) / cosh((x - 1) / corner))."""
    above, below = fabs(x + 1.0), fabs(x - 1.0)
    tails = (1.0 + exp(-2.0 * above / corner)) / (1.0 + exp(-2.0 * below / corner))
    return 0.5 * (above - below + corner * log(tails))
