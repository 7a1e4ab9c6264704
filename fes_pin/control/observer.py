"""State of a stimulated ankle from its angle, one sample to a pulse: an extended Kalman filter.

State: activation, angle, rate, a torque that the model does not know, and the share of the believed gain that the
muscle has. The torque wanders (it takes up what is wrong in passive curve, load and damping), the gain's share wanders
more slowly (it takes up fatigue). What is fed in is the recruitment that the nerve really got, after every limit: a
limit that holds the stimulus back leaves nothing to wind up.

Five states in plain numbers: arrays this small cost more to call than to compute.
"""

from __future__ import annotations

import math

import numpy as np
import scipy.linalg

from fes_pin.control.dynamics import PULSE_S, AnkleDynamics, PulseToPulse
from fes_pin.data.errors import InputError
from fes_pin.data.numbers import between, positive_number, shortened

GATE = 5.0
"""Standard deviations beyond which a reading says no more than this many: the model may be wrong, or the reading. Which
readings come here at all: `fes_pin.control.faults`."""
LEAST_SHARE, MOST_SHARE = 0.1, 2.0
"""Bounds of the gain's share."""
RECRUITMENT_STD = 0.025
"""What a pulse recruits is known to this share of the muscle: a third of what a play of 60 us hides. With a tenth of
it the filter believes its activation so firmly that it answers a swinging frame with a torque, and takes the readings
of a nerve with play for spikes."""
RATE_WANDER = 0.5
"""Standard deviation of the unknown change of the rate in a second, rad/s."""


class JointObserver:
    """See the module.

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
    upper
        Upper triangle of the covariance, by rows: fifteen numbers.
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
        self.pulse = PulseToPulse(dynamics)
        self.fade = math.exp(-PULSE_S / dynamics.time_constant)
        activation = (1.0 - self.fade) * RECRUITMENT_STD / math.sqrt(PULSE_S)
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
        variances = [std * std for std in self.start_std]
        self.upper = [variances[i] if i == k else 0.0 for i in range(5) for k in range(i, 5)]

    @property
    def covariance(self) -> np.ndarray:
        """Of the state, shape (5, 5)."""
        p = np.zeros((5, 5))
        p[np.triu_indices(5)] = self.upper
        return p + np.triu(p, 1).T

    def expects(self, angle_rad: float) -> tuple[float, float]:
        """The innovation of a reading, and the standard deviation that it should have, rad."""
        return angle_rad - self.x[1], math.sqrt(self.upper[5] + self.variance)

    def correct(self, angle_rad: float) -> None:
        """Take in a reading: an angle that was judged before."""
        size = self.upper[5] + self.variance
        far = GATE * math.sqrt(size)
        innovation = min(max(angle_rad - self.x[1], -far), far)
        p00, c0, p02, p03, p04, c1, c2, c3, c4, p22, p23, p24, p33, p34, p44 = self.upper
        g0, g1, g2, g3, g4 = c0 / size, c1 / size, c2 / size, c3 / size, c4 / size
        x0, x1, x2, x3, x4 = self.x
        x0, x4 = x0 + g0 * innovation, x4 + g4 * innovation
        self.x = [
            min(max(x0, 0.0), 1.0),
            x1 + g1 * innovation,
            x2 + g2 * innovation,
            x3 + g3 * innovation,
            min(max(x4, LEAST_SHARE), MOST_SHARE),
        ]
        p44 -= g4 * c4
        # what is never used is never seen: its doubt stays at 30 %
        s = 0.3 / math.sqrt(p44) if p44 > 0.09 else 1.0
        self.upper = [
            *(p00 - g0 * c0, c0 - g0 * c1, p02 - g0 * c2, p03 - g0 * c3, s * (p04 - g0 * c4)),
            *(c1 - g1 * c1, c2 - g1 * c2, c3 - g1 * c3, s * (c4 - g1 * c4)),
            *(p22 - g2 * c2, p23 - g2 * c3, s * (p24 - g2 * c4)),
            *(p33 - g3 * c3, s * (p34 - g3 * c4), s * s * p44),
        ]

    @property
    def torque_wander(self) -> float:
        """Standard deviation of the unknown torque's change in a second, N m."""
        return math.sqrt(self.noise[3] / PULSE_S)

    @torque_wander.setter
    def torque_wander(self, wander: float) -> None:
        self.noise[3] = wander * wander * PULSE_S

    def predict(self, recruitment: float) -> None:
        """Go on by one pulse with this recruitment in the nerve."""
        act, q, v, torque, share = self.x
        change = self.pulse.transition(q, act, share)
        act, q, v = self.pulse.moved(act, q, v, torque, share, recruitment)
        self.x = [act, q, v, torque, share]
        self.upper = self._spread(*change)
        if not (math.isfinite(act + v + sum(self.upper)) and 0.0 < q < math.pi):
            self.reset()

    def _spread(self, a: list[float], b: list[float]) -> list[float]:
        """A P A' + noise, its upper triangle; rows a and b of A lead to angle and rate, the others are diagonal."""
        p00, p01, p02, p03, p04, p11, p12, p13, p14, p22, p23, p24, p33, p34, p44 = self.upper
        (a0, a1, a2, a3, a4), (b0, b1, b2, b3, b4) = a, b
        f, (n0, n1, n2, n3, n4) = self.fade, self.noise
        s0 = a0 * p00 + a1 * p01 + a2 * p02 + a3 * p03 + a4 * p04
        s1 = a0 * p01 + a1 * p11 + a2 * p12 + a3 * p13 + a4 * p14
        s2 = a0 * p02 + a1 * p12 + a2 * p22 + a3 * p23 + a4 * p24
        s3 = a0 * p03 + a1 * p13 + a2 * p23 + a3 * p33 + a4 * p34
        s4 = a0 * p04 + a1 * p14 + a2 * p24 + a3 * p34 + a4 * p44
        t0 = b0 * p00 + b1 * p01 + b2 * p02 + b3 * p03 + b4 * p04
        t1 = b0 * p01 + b1 * p11 + b2 * p12 + b3 * p13 + b4 * p14
        t2 = b0 * p02 + b1 * p12 + b2 * p22 + b3 * p23 + b4 * p24
        t3 = b0 * p03 + b1 * p13 + b2 * p23 + b3 * p33 + b4 * p34
        t4 = b0 * p04 + b1 * p14 + b2 * p24 + b3 * p34 + b4 * p44
        aa = a0 * s0 + a1 * s1 + a2 * s2 + a3 * s3 + a4 * s4
        ab = b0 * s0 + b1 * s1 + b2 * s2 + b3 * s3 + b4 * s4
        bb = b0 * t0 + b1 * t1 + b2 * t2 + b3 * t3 + b4 * t4
        return [
            *(f * f * p00 + n0, f * s0, f * t0, f * p03, f * p04),
            *(aa + n1, ab, s3, s4, bb + n2, t3, t4, p33 + n3, p34, p44 + n4),
        ]

    def steady_gain(self, transition: np.ndarray) -> np.ndarray:
        """What of an innovation goes to activation, angle, rate and torque in the long run, shape (4,).

        Parameters
        ----------
        transition
            From pulse to pulse, of these four, shape (4, 4).
        """
        noise = np.diag(self.noise[:4]) + 1e-12 * np.eye(4)
        p = scipy.linalg.solve_discrete_are(transition.T, np.eye(4)[:, [1]], noise, np.array([[self.variance]]))
        return p[:, 1] / (p[1, 1] + self.variance)
