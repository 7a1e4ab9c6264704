"""Eq. (1) of one ankle (`fes_pin.paper.equation_1`) from pulse to pulse, and the Kalman filter of its state.

The extended filter has the angle alone, one sample to a pulse.
State: activation, angle, rate, a torque that the model does not know, and the share of the believed gain that the
muscle has. The torque wanders (it takes up what is wrong in passive curve, load and damping), the gain's share wanders
more slowly (it takes up fatigue). What is fed in is the recruitment that the nerve really got, after every limit: a
limit that holds the stimulus back leaves nothing to wind up.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg

from fes_pin.data.channels import WIDTH
from fes_pin.data.errors import InputError
from fes_pin.data.numbers import between, number, positive_number, shortened
from fes_pin.data.show import Tabulated
from fes_pin.models.effects.frame_vibration import FrameVibration
from fes_pin.models.model import Model
from fes_pin.models.rigs.ankle import Ankle
from fes_pin.paper.equation_1 import halved, static_stiffness_nm, static_torque_nm

PULSE_S = 1.0 / 45.0
"""Time between pulses, s; Dombre, Fournier and Coiffet, section II-3-1."""
RESOLVED = 0.7
"""Longest integration step, in units of the joint's fastest radian: Runge-Kutta's fourth order then errs by 1e-3."""
ANGLES_RAD = (0.3, 2.8)
"""Angles that eq. (1) is used between, rad: at 0 and at pi its cables pull along the leg and turn nothing; an ankle's
own lie well within."""
LONGEST_STRETCH = 3.0
"""Angle in rad beyond theta_r from which eq. (1) is as there, so that no state overflows: far beyond any ankle."""


@dataclass(frozen=True, eq=False)
class AnkleDynamics(Tabulated):
    """Eq. (1) as plain numbers: the ankle that a controller believes in, with one load.

    Attributes
    ----------
    pull_nm
        a K F_ref: torque of full activation at sin(theta) = 1, N m.
    known
        Constants of eq. (1) by the rig's names.
    load_kg
        M.
    frame_coupling, frame_hz, frame_damping
        Of the effect `frame_vibration`; a coupling of 0 is a rigid frame. Gains are chosen with it; nothing else here
        moves with it.
    """

    inertia: float
    damping: float
    time_constant: float
    pull_nm: float
    known: Mapping[str, float]
    load_kg: float
    frame_coupling: float = 0.0
    frame_hz: float = 0.0
    frame_damping: float = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("inertia", "time_constant", "pull_nm"):
            positive_number(getattr(self, name), name)
        for name in ("damping", "load_kg", "frame_coupling", "frame_hz", "frame_damping"):
            between(getattr(self, name), 0.0, math.inf, name)

    @classmethod
    def of(cls, model: Model, load_kg: float) -> "AnkleDynamics":
        """From an ankle's model; of its effects the frame is used.

        Raises
        ------
        InputError
            For another rig, or a load that is none or that the passive joint does not hold.
        """
        if not isinstance(model, Model):
            message = f"expected a model, as fp.nominal_model gives it, found {shortened(model)}"
            raise InputError(message, column="model")
        if not isinstance(model.rig, Ankle):
            raise InputError(f"position control needs the rig ankle, found {model.rig.name}")
        if model.rig.channel is not WIDTH:
            words = f"missing; position control commands pulse widths, and needs {' and '.join(WIDTH.ends)}"
            raise InputError(words, column=f"constants.{WIDTH.ends[0]}")
        if number(load_kg, "load_kg") < 0.0:
            raise InputError(f"expected a load of at least 0 kg, found {load_kg:g}")
        rig, c = model.rig, {n: float(v) for n, v in model.rig.constants.items()}
        low, high = ANGLES_RAD
        if not static_torque_nm(c, low, 0.0, load_kg) > 0.0 > static_torque_nm(c, high, 0.0, load_kg):
            message = f"expected a load that rests between {low} and {high} rad, found {load_kg:g}"
            raise InputError(message, column="load_kg")
        frame = next((e for e in model.effects if isinstance(e, FrameVibration)), None)
        swings = () if frame is None else map(float, (frame.coupling, frame.frequency_hz, frame.damping_ratio))
        pull_nm = c["moment_arm_m"] * rig.gain * c["force_scale_n"]
        return cls(rig.inertia_kgm2, rig.damping_nms, rig.time_constant_s, pull_nm, c, float(load_kg), *swings)

    @cached_property
    def pieces(self) -> int:
        """Integration steps per pulse that resolve damping and stiffness up to where full activation holds."""
        stiff = max(-self.passive(self.rest_angle(share))[1] / self.inertia for share in (0.0, 1.0))
        fastest = max(self.damping / self.inertia, math.sqrt(max(stiff, 0.0)))
        return max(2, math.ceil(PULSE_S * fastest / RESOLVED))

    def passive(self, q: float) -> tuple[float, float]:
        """Torque of antagonist, load and weight at an angle, N m, and its slope, N m/rad."""
        q = self._within(q)
        return static_torque_nm(self.known, q, 0.0, self.load_kg), static_stiffness_nm(self.known, q, 0.0, self.load_kg)

    def acceleration(self, q: float, v: float, pull_nm: float, torque: float) -> float:
        """Eq. (1): rad/s2 under a muscle that would pull `pull_nm` at sin(theta) = 1, and an unknown torque, N m."""
        held = static_torque_nm(self.known, self._within(q), pull_nm / self.known["moment_arm_m"], self.load_kg)
        return (held + torque - self.damping * v) / self.inertia

    def _within(self, q: float) -> float:
        return min(q, self.known["theta_r_rad"] + LONGEST_STRETCH)

    def rest_angle(self, activation: float = 0.0) -> float:
        """Angle in rad that a steady activation of the believed muscle holds; by bisection."""
        return halved(lambda q: self.passive(q)[0] + self.pull_nm * activation * math.sin(q), *ANGLES_RAD, 50)

    def activation_for(self, q: float, v: float = 0.0, acceleration: float = 0.0, torque: float = 0.0) -> float:
        """Activation (times gain share) that moves the joint so against an unknown `torque`; unbounded."""
        needed = self.inertia * acceleration + self.damping * v - self.passive(q)[0] - torque
        return needed / (self.pull_nm * max(math.sin(q), 0.05))

    def linear(self, q: float, activation: float, share: float) -> np.ndarray:
        """Derivative of the rates of (activation, angle, rate, torque, share), shape (5, 5)."""
        s, j = math.sin(q), self.inertia
        stiff = (self.pull_nm * share * activation * math.cos(q) + self.passive(q)[1]) / j
        pull = self.pull_nm * s / j
        f = np.zeros((5, 5))
        f[0, 0], f[1, 2] = -1.0 / self.time_constant, 1.0
        f[2] = pull * share, stiff, -self.damping / j, 1.0 / j, pull * activation
        return f

    def moved(
        self, act: float, q: float, v: float, torque: float, share: float, recruitment: float, time_s: float = PULSE_S
    ) -> tuple[float, float, float]:
        """Activation, angle and rate a time of up to a pulse later: classical Runge-Kutta method, activation exact."""
        rise, pull, h = self.acceleration, self.pull_nm * share, time_s / self.pieces
        half, half_fade = 0.5 * h, math.exp(-0.5 * h / self.time_constant)
        for _ in range(self.pieces):
            rest = (act - recruitment) * half_fade
            middle, end = recruitment + rest, recruitment + rest * half_fade
            k1 = rise(q, v, pull * act, torque)
            v2 = v + half * k1
            k2 = rise(q + half * v, v2, pull * middle, torque)
            v3 = v + half * k2
            k3 = rise(q + half * v2, v3, pull * middle, torque)
            v4 = v + h * k3
            k4 = rise(q + h * v3, v4, pull * end, torque)
            q += h / 6.0 * (v + 2.0 * (v2 + v3) + v4)
            v += h / 6.0 * (k1 + 2.0 * (k2 + k3) + k4)
            act = end
        return act, q, v

    def transition(self, q: float, activation: float, share: float, time_s: float = PULSE_S) -> np.ndarray:
        """The transition of `linear` over a time about a state, shape (5, 5)."""
        return scipy.linalg.expm(time_s * self.linear(q, activation, share))


GATE = 5.0
"""Standard deviations beyond which a reading says no more than this many: the model may be wrong, or the reading. Which
readings come here at all: `fes_pin.control.faults`."""
LEAST_SHARE, MOST_SHARE = 0.1, 2.0
"""Bounds of the gain's share."""
MOST_SHARE_STD = 0.3
"""Limit of the standard deviation of a share: a muscle that is not used is not observed."""
RECRUITMENT_STD = 0.025
"""What a pulse recruits is known to this share of the muscle: a third of what a play of 60 us hides. With a tenth of
it the filter believes its activation so firmly that it answers a swinging frame with a torque, and takes the readings
of a nerve with play for spikes."""
RATE_WANDER = 0.5
"""Standard deviation of the unknown change of the rate in a second, rad/s."""

RESOLVED_S = 1e-6
"""A shorter time is none: seconds since 1970 are resolved to 2.4e-7 s."""


class JointObserver:
    """Extended Kalman filter of an ankle's state, from the angle alone, one sample to a pulse.

    Parameters
    ----------
    dynamics
        The ankle as believed.
    angle_std_rad
        Noise of the potentiometer.
    torque_wander
        Standard deviation of the unknown torque's change in a second, N m: quicker ones answer a swinging frame and
        feed it, slower ones are late on what is wrong in the passive curve.
    share_wander
        The same of the gain's share; 0.02 follows a muscle that loses 40 % in 30 s.
    share_std
        How wrong the gain may be at the start.

    Attributes
    ----------
    x
        Mean: five numbers.
    covariance
        Of the state, shape (5, 5).
    """

    def __init__(
        self,
        dynamics: AnkleDynamics,
        angle_std_rad: float = 2e-3,
        torque_wander: float = 0.01,
        share_wander: float = 0.02,
        share_std: float = 0.3,
    ) -> None:
        if not isinstance(dynamics, AnkleDynamics):
            raise InputError(f"expected AnkleDynamics, found {shortened(dynamics)}", column="dynamics")
        stds = {"angle_std_rad": angle_std_rad, "torque_wander": torque_wander, "share_std": share_std}
        for name, value in stds.items():
            positive_number(value, name)
        between(share_wander, 0.0, math.inf, "share_wander")
        self.dynamics, self.variance = dynamics, angle_std_rad**2
        self.angle_std_rad = angle_std_rad
        activation = -math.expm1(-PULSE_S / dynamics.time_constant) * RECRUITMENT_STD / math.sqrt(PULSE_S)
        wander = [activation, 0.0, RATE_WANDER, torque_wander, share_wander]
        self.noise = [float(w * w * PULSE_S) for w in wander]
        self.start = [0.0, dynamics.rest_angle(), 0.0, 0.0, 1.0]
        self.start_std = [0.01, 0.1, 0.1, 0.3, share_std]
        self.reset()

    def reset(self, angle_rad: float | None = None) -> None:
        """Forget everything: fresh, and resting at an angle; without one, at that of the believed load."""
        self.x = list(self.start)
        if angle_rad is not None:
            self.x[1] = angle_rad
        self.covariance = np.diag(np.square(self.start_std))

    def expects(self, angle_rad: float) -> tuple[float, float]:
        """The innovation of a reading, and the standard deviation that it should have, rad."""
        return angle_rad - self.x[1], math.sqrt(self.covariance[1, 1] + self.variance)

    def correct(self, angle_rad: float) -> None:
        """Take in a reading: an angle that was judged before."""
        seen, (innovation, std) = self.covariance[1], self.expects(angle_rad)
        gain = seen / std**2
        x = self.x + gain * min(max(innovation, -GATE * std), GATE * std)
        x[0], x[4] = min(max(x[0], 0.0), 1.0), min(max(x[4], LEAST_SHARE), MOST_SHARE)
        self.x = x.tolist()
        self.covariance = self.covariance - np.outer(gain, seen)
        if self.covariance[4, 4] > MOST_SHARE_STD**2:
            shrink = MOST_SHARE_STD / math.sqrt(self.covariance[4, 4])
            self.covariance[4] *= shrink
            self.covariance[:, 4] *= shrink

    @property
    def torque_wander(self) -> float:
        """Standard deviation of the unknown torque's change in a second, N m."""
        return math.sqrt(self.noise[3] / PULSE_S)

    @torque_wander.setter
    def torque_wander(self, wander: float) -> None:
        self.noise[3] = wander * wander * PULSE_S

    def predict(self, recruitment: float, time_s: float = PULSE_S) -> None:
        """Go on by a time with this recruitment in the nerve, and after `PULSE_S` with none."""
        while time_s > RESOLVED_S:
            part = min(time_s, PULSE_S)
            act, q, v, torque, share = self.x
            a = self.dynamics.transition(q, act, share, part)
            self.x = [*self.dynamics.moved(act, q, v, torque, share, recruitment, part), torque, share]
            spread = a @ self.covariance @ a.T
            self.covariance = 0.5 * (spread + spread.T)
            self.covariance.flat[::6] += np.multiply(part / PULSE_S, self.noise)  # its diagonal
            if not (math.isfinite(self.covariance.sum() + sum(self.x)) and 0.0 < self.x[1] < math.pi):
                self.reset()
            recruitment, time_s = 0.0, time_s - part

    def steady_gain(self, transition: np.ndarray) -> np.ndarray:
        """Return the stationary gains of an innovation to activation, angle, rate and torque, shape (4,).

        Parameters
        ----------
        transition
            From pulse to pulse, of these four, shape (4, 4).
        """
        noise = np.diag(self.noise[:4]) + 1e-12 * np.eye(4)
        p = scipy.linalg.solve_discrete_are(transition.T, np.eye(4)[:, [1]], noise, np.array([[self.variance]]))
        return p[:, 1] / (p[1, 1] + self.variance)
