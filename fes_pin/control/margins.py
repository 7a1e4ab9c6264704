"""Stability margins of a position control: those of one loop, and the worst over uncertain parameters.

A margin at one angle of the believed ankle is not what a person gets: near rest, where the joint is softest, and with a
stronger and quicker muscle the loop bears far less dead time.
"""

import math
from dataclasses import dataclass

import numpy as np

from fes_pin.control.dynamics import PULSE_S, AnkleDynamics, JointObserver
from fes_pin.control.tuning import Gains, Loop, corners, loop_at
from fes_pin.data.numbers import instance
from fes_pin.data.show import Tabulated

FREQUENCIES = 4000
"""Up to half the pulse rate."""


@dataclass(frozen=True, eq=False)
class StabilityMargins(Tabulated):
    """Stability margins of a loop.

    Attributes
    ----------
    gain
        Factor on the muscle's gain that it bears: the least one above 1.
    phase_deg
        Phase lag that it bears at any frequency where it answers with gain 1, degrees.
    delay_s
        The dead time that it bears.
    distance
        Least distance of the open loop from -1: one over the greatest sensitivity.
    distance_hz
        Where that is.
    """

    gain: float
    phase_deg: float
    delay_s: float
    distance: float
    distance_hz: float


def margins(loop: Loop) -> StabilityMargins:
    """Margins of a loop, from its frequency response up to half the pulse rate."""
    hz = np.linspace(0.0, 0.5 / PULSE_S, FREQUENCIES + 1)[1:]
    answer = loop.opened(hz)
    size, turn = np.abs(answer), np.unwrap(np.angle(answer))
    real, flips = answer.real, np.diff(np.sign(answer.imag)) != 0
    crossing = [1.0 / -r for r in 0.5 * (real[1:] + real[:-1])[flips] if -1.0 < r < 0.0]
    ones = np.diff(np.sign(size - 1.0)) != 0
    lag = np.mod(turn[1:][ones] + math.pi, 2.0 * math.pi)
    gain, phase = min(crossing, default=math.inf), math.degrees(min(lag, default=math.inf))
    delay = float(min(lag / (2.0 * math.pi * hz[1:][ones]), default=math.inf))
    distance = np.abs(1.0 + answer)
    least = int(np.argmin(distance))
    return StabilityMargins(gain, phase, delay, float(distance[least]), float(hz[least]))


def delay_margin(dynamics: AnkleDynamics, observer: JointObserver, gains: Gains) -> tuple[float, float]:
    """Dead time between joint and pulse that the loop bears at every angle, s.

    Returns
    -------
    tuple of float
        Of the believed ankle; and of the worst one within 30 % in gain, time constant and stiffness.

    Raises
    ------
    InputError
        Dynamics, an observer or gains that are none.
    """
    instance(dynamics, AnkleDynamics, "dynamics")
    instance(observer, JointObserver, "observer")
    angles = [float(q) for q in instance(gains, Gains, "gains").angles]
    believed, worst = (
        min(margins(loop_at(truth, observer, gains, q)).delay_s for truth in truths for q in angles)
        for truths in ([dynamics], corners(dynamics))
    )
    return believed, min(believed, worst)
