"""A controller and a joint in one loop, recorded."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from fes_pin.control.control import PositionController
from fes_pin.control.dynamics import PULSE_S
from fes_pin.data.show import Tabulated


class StimulatedJoint(Protocol):
    """A stimulated system that moves: a rig, or a twin."""

    @property
    def angle_rad(self) -> float:
        """Now."""

    def step(self, pulse_width_us: float, dt: float) -> float:
        """Hold a pulse width for a time in s."""


@dataclass(frozen=True, eq=False)
class Tracking(Tabulated):
    """A closed loop, recorded once per pulse.

    Attributes
    ----------
    time, reference_rad, angle_rad, measured_rad, pulse_width_us, share
        Shape (n,): reference and true angle, the reading, the stimulus, and the gain's share as estimated.
    step_s
        Time that the controller took for each step, shape (n,).
    """

    time: np.ndarray
    reference_rad: np.ndarray
    angle_rad: np.ndarray
    measured_rad: np.ndarray
    pulse_width_us: np.ndarray
    share: np.ndarray
    step_s: np.ndarray

    along = ("time", "reference_rad", "angle_rad", "measured_rad", "pulse_width_us", "share", "step_s")

    def rms_error_deg(self, start_s: float = 0.0, end_s: float = np.inf) -> float:
        """Root mean square of reference minus true angle, degrees."""
        among = (self.time >= start_s) & (self.time < end_s)
        return float(np.degrees(np.sqrt(np.mean((self.reference_rad - self.angle_rad)[among] ** 2))))


def track(
    controller: PositionController,
    joint: StimulatedJoint,
    reference_rad: np.ndarray,
    noise_std_rad: float = 2e-3,
    seed: int = 0,
    sensor: Callable[[int, float], float] = lambda k, angle: angle,
) -> Tracking:
    """Let a controller hold a joint to a reference, shape (n,), one value per pulse.

    Parameters
    ----------
    sensor
        What becomes of a reading: number of the pulse, and the noisy angle.
    """
    noise = noise_std_rad * np.random.default_rng(seed).standard_normal(len(reference_rad))
    controller.follow(reference_rad)
    rows = []
    for k in range(len(reference_rad)):
        angle = joint.angle_rad
        measured = sensor(k, angle + float(noise[k]))
        began = time.perf_counter()
        width = controller.step(measured, time_s=k * PULSE_S)
        took = time.perf_counter() - began
        joint.step(width, PULSE_S)
        rows.append((k * PULSE_S, reference_rad[k], angle, measured, width, controller.share, took))
    return Tracking(*np.array(rows, dtype=float).T)


def sine(rest_rad: float, height_deg: float, frequency_hz: float, seconds: float) -> np.ndarray:
    """A sine that starts at rest at its lowest point and rises by `height_deg` peak to peak, shape (n,), rad."""
    t = np.arange(round(seconds / PULSE_S)) * PULSE_S
    return rest_rad + np.radians(height_deg) * 0.5 * (1.0 - np.cos(2.0 * np.pi * frequency_hz * t))


def steps(rest_rad: float, levels_deg: tuple[float, ...], each_s: float) -> np.ndarray:
    """Levels above rest, each held for a time; shape (n,), rad."""
    return np.concatenate([np.full(round(each_s / PULSE_S), rest_rad + np.radians(level)) for level in levels_deg])
