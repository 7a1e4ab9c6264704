"""The plain linear filter on (alpha, beta) with the measured force as regressor.

It is what a linear Kalman filter for these two usually is, and it takes the noise of the regressor for motion: its tau
is estimated as too short.
"""

from __future__ import annotations

import math

import numpy as np

from fes_pin.paper.kalman import GainFilter, StraightRecruitment


class RegressionFilter(GainFilter):
    """Plain linear Kalman filter of (alpha, beta): the measured force explains the next one.

    Same parameters as `GainFilter`; its innovation is y+ - alpha y - beta r, whose noise it takes for white.
    """

    def __init__(
        self, dt: float, recruitment: StraightRecruitment, noise_std: float, greatest_gain: float = 2.0
    ) -> None:
        super().__init__(dt, recruitment, noise_std, greatest_gain)
        self.x, self.p = self.x[1:], self.p[1:, 1:]
        self.before: np.ndarray | None = None

    def step(self, force_n: float, pulse_width_us: float) -> None:
        """Take in one measured force (NaN: none, nor anything to explain the next one by), and the next pulse width."""
        known = np.array([force_n, self.recruitment(pulse_width_us)])
        if not math.isfinite(force_n):
            self.before, self.skipped = None, self.skipped + 1
            return
        if self.before is not None:
            size = float(self.before @ self.p @ self.before) + 2.0 * self.noise_std**2
            innovation = force_n - float(self.before @ self.x)
            gain = self.p @ self.before / size
            self.nis = innovation**2 / size
            self.x, self.p = self.x + gain * innovation, self.p - np.outer(gain, gain) * size
        self.before = known
