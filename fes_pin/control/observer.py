"""State of a stimulated ankle from its angle, one sample to a pulse: an extended Kalman filter.

State: activation, angle, rate, a torque that the model does not know, and the share of the believed gain that the
muscle has. The torque wanders (it takes up what is wrong in passive curve, load and damping), the gain's share wanders
more slowly (it takes up fatigue). What is fed in is the recruitment that the nerve really got, after every limit: a
limit that holds the stimulus back leaves nothing to wind up.
"""

import math

import numpy as np
import scipy.linalg

from fes_pin.control.dynamics import PULSE_S, AnkleDynamics
from fes_pin.data.errors import InputError
from fes_pin.data.numbers import between, positive_number, shortened

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
