"""A twin of the paper's ankle: a plain integrator of eq. (1) that shares no line with the engine.

No measured trial of the paper exists outside its figures. Trials are therefore made here, from its printed values, with
whatever the paper names but does not model (frame, fatigue, hysteresis) built in by hand. The integrator is the
classical Runge-Kutta method on plain numbers at about 1 kHz; it also runs one stimulus at a time, as a plant does.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from fes_pin.data.errors import InputError
from fes_pin.data.numbers import number, positive_number
from fes_pin.data.trial import Trial
from fes_pin.paper.equation_1 import antagonist_n, halved, static_torque_nm

MAX_STEP_S = 1.25e-3
"""Longest step of the integrator: 1/14 of the joint's fastest radian (57 rad/s at table 1); it errs by 1e-7 rad."""
FATIGUE_FLOOR = 0.35
"""Share of the force that never tires (Riener and Fuhr 1998: 0.3 to 0.4)."""
PULSE_RATE_HZ = 45.0
"""Of the stimulus; section II-3-1."""
SAMPLE_RATE_HZ = 225.0
"""Five samples to a pulse; not printed."""


@dataclass(frozen=True)
class AnkleTwin:
    """The true ankle: eq. (1) and what the paper leaves out, each switched off by 0.

    Parameters
    ----------
    inertia_kgm2, com_distance_m, moment_arm_m, damping_nms, foot_mass_kg
        J, l, a, xi and m of eq. (1).
    gain, force_scale_n, time_constant_s
        K, F_ref and tau: F_M settles to K F_ref r.
    f0_n, f1_per_rad, theta_r_rad
        Passive antagonist F_ANT = f0 (exp(f1 (theta - theta_r)) - 1) above theta_r.
    load_kg
        M.
    frame_coupling, frame_hz, frame_damping
        J over the frame's inertia, and the frame's own frequency and damping ratio.
    fatigue_per_s, recovery_s
        c' = (1 - c) / recovery - rate act (c - 0.35), force c F_M.
    hysteresis_us
        Half width of the play between pulse width and recruitment.

    Raises
    ------
    InputError
        For what is no finite number; inertia, lever and times that are not above 0; a saturation not above threshold.
    """

    inertia_kgm2: float = 1.0e-3
    com_distance_m: float = 0.08
    moment_arm_m: float = 0.034
    damping_nms: float = 0.0585
    foot_mass_kg: float = 0.12
    gain: float = 0.65
    force_scale_n: float = 60.0
    time_constant_s: float = 0.05
    threshold_us: float = 180.0
    saturation_us: float = 1000.0
    f0_n: float = 4.25
    f1_per_rad: float = 2.2
    theta_r_rad: float = 1.27
    load_kg: float = 1.0
    frame_coupling: float = 0.0
    frame_hz: float = 6.0
    frame_damping: float = 0.05
    fatigue_per_s: float = 0.0
    recovery_s: float = 60.0
    hysteresis_us: float = 0.0

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            number(value, name)
        for name in ("inertia_kgm2", "com_distance_m", "time_constant_s", "recovery_s"):
            positive_number(getattr(self, name), name)
        if not 0.0 <= self.threshold_us < self.saturation_us:
            raise InputError(f"expected more than the threshold of {self.threshold_us:g} us", column="saturation_us")

    def antagonist(self, q: float) -> float:
        """F_ANT in N at an angle in rad."""
        return antagonist_n(vars(self), q)

    def rest_angle(self, force_n: float = 0.0) -> float:
        """Angle in rad at which the joint rests under a constant muscle force; by bisection.

        Raises
        ------
        InputError
            If it rests nowhere between 0.2 and 2.9 rad.
        """
        low, high = 0.2, 2.9
        if self._torque(low, 0.0, force_n) < 0.0 or self._torque(high, 0.0, force_n) > 0.0:
            raise InputError(f"a load of {self.load_kg:g} kg rests nowhere between {low} and {high} rad")
        return halved(lambda q: self._torque(q, 0.0, force_n), low, high, 60)

    def _torque(self, q: float, v: float, force_n: float) -> float:
        return static_torque_nm(vars(self), q, force_n, self.load_kg) - self.damping_nms * v

    def constants(self) -> dict[str, float]:
        """The `[rig]` and `[rig.passive]` numbers of a study of this ankle."""
        names = ("foot_mass_kg", "com_distance_m", "moment_arm_m", "force_scale_n", "threshold_us", "saturation_us")
        return {n: getattr(self, n) for n in (*names, "f0_n", "f1_per_rad", "theta_r_rad")}


class RunningTwin:
    """A twin at work: stimulated sample by sample from its rest, or from the angle that it is held at.

    Parameters
    ----------
    max_step_s
        Longest step of the integrator; with 4 ms it errs by 1e-5 rad.

    Attributes
    ----------
    angle_rad, rate
        Of the joint against the frame, as the potentiometer sees it, rad and rad/s.
    capacity
        Share of the fresh force that is left.
    force_n, torque_nm, antagonist_nm
        Muscle force, total torque, and the torque of the passive antagonist.
    """

    def __init__(self, twin: AnkleTwin, held_at_rad: float | None = None, max_step_s: float = MAX_STEP_S) -> None:
        self.twin, self.held, self.max_step_s = twin, held_at_rad, max_step_s
        start = twin.rest_angle() if held_at_rad is None else held_at_rad
        self.state = [0.0, start, 0.0, 0.0, 0.0, 0.0]
        self.followed_us = 0.0

    angle_rad = property(lambda self: self.state[1])
    rate = property(lambda self: self.state[2])
    capacity = property(lambda self: 1.0 - self.state[5])

    @property
    def force_n(self) -> float:
        """Muscle force, N."""
        return self.twin.gain * self.twin.force_scale_n * self.state[0] * self.capacity

    @property
    def torque_nm(self) -> float:
        """Torque on the joint, all terms of eq. (1), N m."""
        return self.twin._torque(self.state[1], self.state[2], self.force_n)

    @property
    def antagonist_nm(self) -> float:
        """Torque of the passive antagonist, N m."""
        return -self.twin.com_distance_m * self.twin.antagonist(self.state[1]) * math.sin(self.state[1])

    def step(self, pulse_width_us: float, dt: float) -> float:
        """Hold a pulse width for `dt` seconds; the angle in rad at the end."""
        t = self.twin
        self.followed_us = min(
            max(self.followed_us, pulse_width_us - t.hysteresis_us), pulse_width_us + t.hysteresis_us
        )
        r = min(max((self.followed_us - t.threshold_us) / (t.saturation_us - t.threshold_us), 0.0), 1.0)
        count = max(1, math.ceil(dt / self.max_step_s - 1e-9))
        h = dt / count
        for _ in range(count):
            x = self.state
            k1 = self._rates(x, r)
            k2 = self._rates([a + 0.5 * h * b for a, b in zip(x, k1, strict=True)], r)
            k3 = self._rates([a + 0.5 * h * b for a, b in zip(x, k2, strict=True)], r)
            k4 = self._rates([a + h * b for a, b in zip(x, k3, strict=True)], r)
            self.state = [
                a + h / 6.0 * (b + 2.0 * c + 2.0 * d + e) for a, b, c, d, e in zip(x, k1, k2, k3, k4, strict=True)
            ]
        return self.state[1]

    def _rates(self, x: list[float], r: float) -> list[float]:
        t = self.twin
        act, q, v, phi, phi_rate, lost = x
        tired = t.fatigue_per_s * act * (1.0 - FATIGUE_FLOOR - lost) - lost / t.recovery_s
        rise = (r - act) / t.time_constant_s
        if self.held is not None:
            return [rise, 0.0, 0.0, 0.0, 0.0, tired]
        torque = t._torque(q, v, t.gain * t.force_scale_n * act * (1.0 - lost))
        swing = 0.0
        if t.frame_coupling:
            # the frame's own equation, J_frame phi'' = -k phi - c phi' - torque; the sensor sees the joint against it
            omega = 2.0 * math.pi * t.frame_hz
            swing = -omega * (omega * phi + 2.0 * t.frame_damping * phi_rate)
            swing -= t.frame_coupling * torque / t.inertia_kgm2
        return [rise, v, torque / t.inertia_kgm2 - swing, phi_rate, swing, tired]


def record(
    twin: AnkleTwin,
    pulse_widths_us: np.ndarray,
    name: str,
    *,
    held_at_rad: float | None = None,
    noise_std: float = 0.0,
    seed: int = 0,
    sample_rate_hz: float = SAMPLE_RATE_HZ,
    role: str | None = None,
) -> Trial:
    """Record a trial of a twin.

    Parameters
    ----------
    pulse_widths_us
        Shape (n,): the width held from each sample to the next.
    held_at_rad
        For an isometric trial, which measures force.
    noise_std
        Of white noise on the measured column, rad or N.

    Returns
    -------
    Trial
        Of kind "motion" with `angle_rad`, or "isometric" with `force_n`.
    """
    running, dt = RunningTwin(twin, held_at_rad), 1.0 / sample_rate_hz
    true = np.empty(len(pulse_widths_us))
    for k, width in enumerate(pulse_widths_us):
        true[k] = running.angle_rad if held_at_rad is None else running.force_n
        running.step(float(width), dt)
    noisy = true + noise_std * np.random.default_rng(seed).standard_normal(len(true))
    kind, column = ("motion", "angle_rad") if held_at_rad is None else ("isometric", "force_n")
    conditions = {"load_kg": twin.load_kg} if held_at_rad is None else {"angle_rad": held_at_rad}
    time = dt * np.arange(len(true))
    return Trial(name, kind, {"pulse_width_us": np.asarray(pulse_widths_us), column: noisy}, time, conditions, role)


def staircase(levels: list[tuple[float, float]], sample_rate_hz: float = SAMPLE_RATE_HZ) -> np.ndarray:
    """Pulse widths, shape (n,), of a stepwise stimulus: (duration s, width us) one after the other."""
    return np.concatenate([np.full(round(s * sample_rate_hz), float(w)) for s, w in levels])
