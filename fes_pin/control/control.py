"""Position control of the ankle by pulse width, 45 times a second.

    reference -> feedforward: eq. (1) turned round, the activation's lag turned round
              -> + feedback on the estimated state
              -> inverse recruitment -> pulse width

How its gains are chosen: `fes_pin.control.tuning`. If the loop swings by itself all the same, because of something
that the model does not have, the controller says so and becomes calmer.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from fes_pin.control.dynamics import PULSE_S, AnkleDynamics
from fes_pin.control.endurance import EnduranceWatch, fatigue_of
from fes_pin.control.observer import JointObserver
from fes_pin.control.oscillation import OscillationWatch
from fes_pin.control.pulse import PulseWidth
from fes_pin.control.reference import LOOKAHEAD, ReferenceWindow
from fes_pin.control.tuning import Gains, tune
from fes_pin.models.effects.recruitment_hysteresis import RecruitmentHysteresis
from fes_pin.models.model import Model
from fes_pin.muscles.recruitment import LinearRecruitment

BLIND_S = 1.0
"""A joint that has not been seen for this long is no longer stimulated."""
MARGIN_RAD = math.radians(2.0)
"""A reference is held this far inside of what the muscle can reach, as a share is kept for the feedback."""
CALMER = 1.0 / 3.0
"""What remains, each time that the loop swings by itself, of the torque that the observer may find in a second and of
the feedback."""
REACH_ANGLES = 200
"""Angles that the muscle's reach is tabulated at: to half a degree."""


class PositionController:
    """Holds an ankle to a reference by pulse width; call `step` once per pulse.

    Parameters
    ----------
    model
        The ankle as identified; of its effects, `recruitment_hysteresis` is compensated, and `fatigue` tells how long
        the muscle will last.
    load_kg
        M.
    observer
        State estimate; by default one with the noise levels of `JointObserver`.

    Attributes
    ----------
    recruitment
        That the nerve got in the last pulse.
    wanted_rad
        The reference as the joint is to follow it now: smoothed and held within reach.
    short_of
        Recruitment that was wanted beyond what the muscle has, in the last pulse.
    calm
        Share of the tuned feedback that is in use: below 1 the loop has swung by itself.
    """

    def __init__(self, model: Model, load_kg: float = 0.0, observer: JointObserver | None = None) -> None:
        dynamics = AnkleDynamics.of(model, load_kg)
        constants = model.rig.constants
        play = [e.half_width_us for e in model.effects if isinstance(e, RecruitmentHysteresis)]
        curve = LinearRecruitment(constants["threshold_us"], constants["saturation_us"])
        self.pulse = PulseWidth(curve, play[0] if play else 0.0)
        self.dynamics = dynamics
        self.observer = observer if observer is not None else JointObserver(dynamics)
        self.gains = tune(dynamics, self.observer)
        self.lowest, self.fade = dynamics.rest_angle(), math.exp(-PULSE_S / dynamics.time_constant)
        self.window = ReferenceWindow(self.lowest)
        self.recruitment = self.short_of = 0.0
        self.wanted_rad = self.lowest
        angles = np.linspace(self.lowest, 2.8, REACH_ANGLES)
        # from the first angle on that needs more than those before
        self.reachable = angles, np.maximum.accumulate([dynamics.activation_for(q) for q in angles.tolist()])
        self.highest = dynamics.rest_angle(1.0)
        self.swings, self.calm = OscillationWatch(), 1.0
        self.count = 0
        fatigue = fatigue_of(model)
        self.watch = EnduranceWatch(fatigue) if fatigue else None

    @property
    def share(self) -> float:
        """Share of the believed gain that the muscle has: below 1 it is tired."""
        return self.observer.x[4]

    def step(self, angle_rad: float, reference_rad: float | Sequence[float]) -> float:
        """One pulse: the pulse width in us from a reading and the reference.

        Parameters
        ----------
        angle_rad
            As measured now; NaN or None if there is none.
        reference_rad
            The angle wanted now and at the next `LOOKAHEAD` pulses; a single number is taken for the last of these, so
            the joint follows it `LOOKAHEAD` pulses late. What is not finite is replaced by the value before it.

        Returns
        -------
        float
            0, or threshold to saturation, whatever comes in.
        """
        if self.count % 15 == 0:
            self._reach()
        self.count += 1
        self.window.take(reference_rad, self.lowest, self.highest)
        self.observer.correct(angle_rad)
        if self.observer.blind * PULSE_S > BLIND_S:
            width, self.recruitment = self.pulse(0.0)
        else:
            wanted = self._law()
            width, self.recruitment = self.pulse(wanted)
            self.short_of = max(wanted - 1.0, 0.0)
            if self.swings.take(self.wanted_rad, self.observer.x[1]):
                self.calm *= CALMER
                self.observer.torque_wander *= CALMER
        if self.watch is not None:
            self.watch.take(self.observer.x[0] * self.share, self.share)
        self.observer.predict(self.recruitment)
        return width

    @property
    def warning(self) -> str:
        """A line when the loop has swung by itself, and one some time before the muscle can no longer do what it has
        been doing; else empty.
        """
        lines = [self.watch.warning] if self.watch is not None and self.watch.warning else []
        if self.calm < 1.0:
            lines.append(
                f"the loop swung by itself at {self.swings.frequency_hz:.1f} Hz and was calmed to "
                f"{100 * self.calm:.0f} %: the model lacks something, such as the frame; diagnose trials of this rig"
            )
        return "; ".join(lines)

    def _reach(self) -> None:
        """How far the muscle can move the joint now."""
        angles, needed = self.reachable
        full = float(np.interp(self.share + self.observer.x[3] / self.dynamics.pull_nm, needed, angles))
        self.highest = max(full - MARGIN_RAD, self.lowest)

    def _law(self) -> float:
        q, v, acceleration, next_q, next_v, next_acceleration = self.window.now()
        self.wanted_rad = q
        act, angle, rate, torque, share = self.observer.x
        now = self.dynamics.activation_for(q, v, acceleration, torque)
        then = self.dynamics.activation_for(next_q, next_v, next_acceleration, torque)
        # the lag turned round: what recruitment takes the activation from now to then in one pulse
        feedforward = (then - self.fade * now) / (1.0 - self.fade)
        k = self.gains.at(angle)
        feedback = self.calm * (k[0] * (now - share * act) + k[1] * (q - angle) + k[2] * (v - rate))
        return (feedforward + feedback) / share


__all__ = ["LOOKAHEAD", "Gains", "PositionController", "tune"]
