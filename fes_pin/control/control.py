"""Position control of the ankle by pulse width, 45 times a second.

    reference -> feedforward: eq. (1) turned round, the activation's lag turned round
              -> + feedback on the estimated state
              -> inverse recruitment -> limits -> pulse width

Nothing is stimulated before the sensor has shown a joint, and readings are judged before they are acted on
(`fes_pin.control.faults`): after a fault the pulses ramp down and stay off until `reset()`. How the gains are chosen:
`fes_pin.control.tuning`. If the loop swings by itself all the same, because of something that the model does not have,
the controller says so and becomes calmer; if that does not help, it is a fault.
"""

import copy
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from fes_pin.control.dynamics import PULSE_S, AnkleDynamics, JointObserver
from fes_pin.control.endurance import EnduranceWatch, fatigue_of
from fes_pin.control.faults import FaultMonitor, Status
from fes_pin.control.given import GivenAnkle, RunningAnkle
from fes_pin.control.oscillation import OscillationWatch
from fes_pin.control.pulse import PulseWidth, StimulationLimits
from fes_pin.control.reference import LARGEST_RAD, LOOKAHEAD, ReferenceWindow, coming, hint, read, trajectory
from fes_pin.control.timing import PulseClock
from fes_pin.control.tuning import tune
from fes_pin.data.errors import InputError
from fes_pin.data.numbers import between, shortened
from fes_pin.models.effects.recruitment_hysteresis import RecruitmentHysteresis
from fes_pin.models.model import Model
from fes_pin.muscles.recruitment import LinearRecruitment

START_READINGS = 5
"""Valid readings in a row, before the first pulse: 0.11 s, in which the observer estimates the torque at rest."""
LET_GO = 9
"""Readings more after a pause, 0.2 s, in which a muscle lets go: a clock that was set tells a pause that there was not,
and the joint still falls."""
START_RAD = math.radians(10.0)
"""The first pulse waits for a joint this near to where the model has it at rest: load, sensor's zero, its sign."""
MARGIN_RAD = math.radians(2.0)
"""A reference is held this far inside of what the muscle can reach, as a share is kept for the feedback."""
CALMER = 1.0 / 3.0
"""What remains, each time that the loop swings by itself, of the torque that the observer may find in a second and of
the feedback."""
CALMEST = 0.1
"""A loop that still swings with less of the feedback than this is at fault: two calmings did not help."""
RESOLUTION_RAD = 1e-3
"""Step of the sensor's readings: 12 bits of a potentiometer of 270 degrees make 1.15 mrad."""
FARTHEST_BEYOND_RAD = math.radians(0.5)
"""A reference that lies farther beyond reach than this is warned of: nearer ones are held, and nobody sees it."""
RISE_PULSES = 23
"""0.5 s after the first pulse after a pause, in which the reference is let in: a joint that came to rest is not thrown
to where the reference has gone."""
REHEARSED_RAD = math.radians(15.0)
REHEARSED = (0.0, 0.8, 0.0, 1.0, 0.3)
"""Height of what is followed on a model with other effects before it may be used, and its levels as shares of that,
each for a second; then come two seconds of a sine."""
REACH_ANGLES = 200
"""Angles that the muscle's reach is tabulated at: to half a degree."""


class PositionController:
    """Holds an ankle to a reference by pulse width; call `step` once per pulse.

    Parameters
    ----------
    model
        The ankle as identified, or the fit or diagnosis that holds it. Of its effects, `recruitment_hysteresis` is
        compensated, `frame_vibration` is tuned for, and `fatigue` says how long the muscle will last. All others the
        controller does not know, a delay or a lag for example: its gains are chosen so that the loop is stable with
        them, and it must follow steps and a sine on the model as given without a fault.
    load_kg
        M.
    observer
        State estimate of this ankle with this load; by default one with the noise levels of `JointObserver`. The
        controller takes a copy, so that two controllers never share one.
    limits
        What the stimulation may do, as `StimulationLimits` or a mapping of their names; by default what the muscle can.
    resolution_rad
        Step of the sensor's readings. The coarser it is in units of the noise, the later a frozen reading is
        distinguished from equal readings of a joint at rest.

    Attributes
    ----------
    status
        What the controller is doing, in words; a fault says why the pulses are off.
    recruitment
        That the nerve got in the last pulse.
    wanted_rad
        The reference as the joint is to follow it now: smoothed and held within reach.
    short_of
        Recruitment that the last pulse lacked: what the feedback wanted above 1, or what the reference takes beyond
        what the muscle can hold.
    beyond_rad
        How far the reference has lain outside of rest to `highest` since `follow` or `reset`, at most, rad.
    highest
        Farthest angle that the muscle is asked for now, rad: 2 degrees less than it can hold.
    paused_s
        Longest pause between two calls since `reset`, s; 0 if there was none.
    calm
        Share of the tuned feedback that is in use: below 1 the loop has swung by itself.

    Raises
    ------
    InputError
        For another rig, a load that is none or that rests nowhere, an observer of another ankle, limits that allow no
        pulses or do not hold the angle at rest, an ankle that no gains hold, or a model with effects that the loop
        fails with.

    Examples
    --------
    >>> controller = PositionController(model, load_kg=1.0)  # doctest: +SKIP
    >>> controller.follow(angles_rad)  # the whole trajectory, one angle per pulse  # doctest: +SKIP
    >>> pulse_width_us = controller.step(angle_rad)  # 45 times a second  # doctest: +SKIP
    """

    def __init__(
        self,
        model: Model,
        load_kg: float = 0.0,
        observer: JointObserver | None = None,
        limits: StimulationLimits | Mapping[str, Any] | None = None,
        resolution_rad: float = RESOLUTION_RAD,
    ) -> None:
        resolution_rad = between(resolution_rad, 0.0, MARGIN_RAD, "resolution_rad")
        model = getattr(model, "model", model)
        dynamics = AnkleDynamics.of(model, load_kg)
        if observer is not None and getattr(observer, "dynamics", None) != dynamics:
            message = f"expected a JointObserver of this ankle with {load_kg:g} kg, found {shortened(observer)}"
            raise InputError(message, column="observer")
        constants = model.rig.constants
        play = [e.half_width_us for e in model.effects if isinstance(e, RecruitmentHysteresis)]
        curve = LinearRecruitment(constants["threshold_us"], constants["saturation_us"])
        self.limits = StimulationLimits.given(limits)
        self.pulse = PulseWidth(curve, play[0] if play else 0.0, self.limits)
        self.dynamics = dynamics
        self.lowest, self.fade = dynamics.rest_angle(), math.exp(-PULSE_S / dynamics.time_constant)
        low, high = ends = self.limits.range_of_motion_rad
        if not low < self.lowest < high:
            want = f"expected a range that holds the {self.lowest:.3g} rad at which the joint rests"
            raise InputError(f"{want}, found {low:g} to {high:g} rad", column="range_of_motion_rad")
        self.observer = copy.deepcopy(observer) if observer is not None else JointObserver(dynamics)
        given = GivenAnkle(model, dynamics)
        with np.errstate(all="ignore"):  # a model that is not finite has no gains, and is an input error
            self.gains = tune(dynamics, self.observer, given if given.names else None)
        self.monitor = FaultMonitor(dynamics, ends, self.observer.angle_std_rad, resolution_rad)
        angles = np.linspace(self.lowest, 2.8, REACH_ANGLES)
        # from the first angle on that needs more than those before
        self.reachable = angles, np.maximum.accumulate([dynamics.activation_for(q) for q in angles.tolist()])
        self.fatigue = fatigue_of(model)
        self.reset()
        if given.names:
            self._rehearse(given)

    def reset(self) -> None:
        """Start again, after a fault or for another bout: waiting for readings, not fatigued, without a trajectory.

        After a fault call this when its cause was found and mended, not by a program. What charge was given in the last
        second still counts.
        """
        self.trajectory: list[float] = []
        self.place = 0
        self.swings, self.calm = OscillationWatch(), 1.0
        self.observer.torque_wander = self.gains.torque_wander
        self.watch = EnduranceWatch(self.fatigue) if self.fatigue else None
        self.clock = PulseClock(min(self.limits.charge_uc_per_s, self.limits.rate_us_per_s) < math.inf)
        self.beyond_rad = self.paused_s = 0.0
        self._begin()

    def _rehearse(self, given: GivenAnkle) -> None:
        """Follow steps and a sine on the model as it was given, with effects that observer and faults' tests leave out.

        Raises
        ------
        InputError
            If the loop does not begin, is at fault, or swings.
        """
        joint, other = RunningAnkle(given), copy.deepcopy(self)
        height = min(REHEARSED_RAD, 0.8 * (self.highest - MARGIN_RAD - self.lowest))
        wave = 0.5 * (1.0 - np.cos(math.pi * PULSE_S * np.arange(90)))
        other.follow(self.lowest + height * np.r_[np.repeat(REHEARSED, 45), wave])
        noise = np.random.default_rng(0).normal(0.0, self.observer.angle_std_rad, len(other.trajectory))
        with np.errstate(all="ignore"):  # a model that runs away reads what is no angle
            for k, error in enumerate(noise.tolist()):
                joint.step(other.step(joint.angle_rad + error, time_s=k * PULSE_S), PULSE_S)
        if other.status is not Status.RUNNING or other.calm < 1.0:
            why = "the loop swings by itself" if other.status is Status.RUNNING else str(other.status)
            left_out = f"with {', '.join(given.names)}, which the controller's equations leave out"
            raise InputError(f"{left_out}, the loop fails on this model itself: {why}")

    def _begin(self) -> None:
        """Wait for readings of a joint at rest, at the start and after a pause."""
        self.status = Status.WAITING
        self.observer.reset()
        self.monitor.reset()
        self.pulse.reset()
        self.window = ReferenceWindow(self.lowest)
        self.count, self.good, self.risen = 0, 0, RISE_PULSES
        self.falling: list[float] | None = None
        self.recruitment = self.short_of = 0.0
        self.wanted_rad = self.lowest
        self.highest = self.dynamics.rest_angle(self.pulse.most)

    @property
    def share(self) -> float:
        """Share of the believed gain that the muscle has: below 1 it is tired."""
        return self.observer.x[4]

    def follow(self, reference_rad: Sequence[float] | np.ndarray) -> None:
        """Take a trajectory that `step` follows from its next call on, one angle per pulse; its last angle is held.

        A trajectory is seen `LOOKAHEAD` pulses (133 ms) ahead, which is what the muscle's lag takes.

        Parameters
        ----------
        reference_rad
            Shape (n,), within `limits.range_of_motion_rad`. What the muscle cannot reach is cut off.

        Raises
        ------
        InputError
            For what is no row of such angles; the trajectory before it stays.
        """
        self.trajectory = trajectory(reference_rad, self.limits.range_of_motion_rad)
        self.place, self.beyond_rad = 0, 0.0

    def step(
        self, angle_rad: float | None, reference_rad: float | Sequence[float] | None = None, time_s: float | None = None
    ) -> float:
        """One pulse: the pulse width in us from a reading.

        After a pause between two calls nothing is stimulated until the joint has been seen at rest again, as at the
        start; from there the reference is let in within `RISE_PULSES`.

        Parameters
        ----------
        angle_rad
            As measured now; NaN or None if there is none.
        reference_rad
            Without it the trajectory given to `follow` goes on, or the joint is left at rest. Or the angles wanted now
            and at the next `LOOKAHEAD` pulses, as far as they are known; the last is held. Or a single number, for a
            target that nobody knows before: it is taken for `LOOKAHEAD` pulses ahead, and the joint follows that late.
        time_s
            When the reading was taken, s, from any start: a gap of `timing.PAUSE_S` is a pause, and so is a step back.
            Without it the computer's clock is asked, and a gap of `timing.CLOCK_PAUSE_S` is one. State it in
            simulations: with limits of charge or of its rate a call that the clock finds too early gives no pulse.

        Returns
        -------
        float
            0, or threshold to saturation, within the limits; 0 of a call that comes too early to be a pulse
            (`fes_pin.control.timing`), of which nothing else is taken.

        Raises
        ------
        InputError
            For what is no reading or no reference: text, lists, booleans, degrees, angles outside the range of motion.
            It is a fault, too. A number that no joint can have is an input error only before the first pulse; later it
            is a fault of the sensor. For what is no time, and for calls that come faster than pulses for long: it gives
            no pulse, and the next call is taken again.
        """
        try:
            if not self._notice(time_s):
                return 0.0
            if self.status.is_fault:
                return self._ramp()
            reading = read(angle_rad)
            if self.status is Status.WAITING and abs(reading) > LARGEST_RAD:
                raise InputError(f"angle_rad: expected an angle in rad, found {reading:g}{hint(reading)}")
            wanted, preview = self._coming(reference_rad)
        except InputError as error:
            if self.status.is_fault:
                return self._ramp()
            self.status = self.status if error.column == "time_s" else Status.REFUSED
            raise
        self._next(wanted, preview)
        if self.status is Status.WAITING:
            self._await(reading)
        elif self.monitor.judge(reading, self.observer, self.recruitment > 0.0):
            self.observer.correct(reading)
            self.monitor.look(self.observer, self.recruitment > 0.0)
        if self.status is Status.WAITING:
            width, self.recruitment = self.pulse.give(0.0)
        else:
            self.status = self.monitor.fault or self._calmed(reading)
            if self.status.is_fault:
                return self._ramp()
            needed = self._law()
            width, self.recruitment = self.pulse(needed)
            self.short_of = max(needed - 1.0, self._lacking(wanted[0]), 0.0)
        if self.watch is not None:
            self.watch.take(self.observer.x[0] * self.share, self.share)
        return width

    def _notice(self, time_s: float | None) -> bool:
        """Return whether a call is a pulse; begin again after a pause; a fault stays one, and its ramp is over."""
        if (call := self.clock.take(time_s)) is None:
            return False
        since_s, pause_s = call
        self.pulse.limiter.wait(since_s)
        self.observer.predict(self.recruitment, since_s)
        if pause_s and self.status.is_fault:
            self.falling = []
        elif pause_s:
            self.paused_s = max(self.paused_s, pause_s)
            self._begin()
            self.risen, self.good = 0, -LET_GO
        return True

    def _coming(self, reference_rad: object) -> tuple[list[float], bool]:
        """Return the reference of this pulse and the next ones, and whether those are known."""
        if reference_rad is not None:
            return coming(reference_rad, self.limits.range_of_motion_rad)
        if not self.trajectory:
            return [self.lowest], True
        wanted = self.trajectory[self.place : self.place + LOOKAHEAD + 1]
        self.place = min(self.place + 1, len(self.trajectory) - 1)
        return wanted, True

    def _next(self, wanted: list[float], preview: bool) -> None:
        """Let the window go on by one pulse."""
        if self.count % 15 == 0:
            self._reach()
        self.count += 1
        if self.status is Status.RUNNING:
            self.risen = min(self.risen + 1, RISE_PULSES)
        held_back = (1.0 - self.risen / RISE_PULSES) * (self.highest - self.lowest)
        self.window.take(wanted, preview, self.lowest, self.highest - held_back)

    def _lacking(self, wanted: float) -> float:
        """Recruitment that a reference takes beyond what the muscle can hold; notes how far it lies beyond reach."""
        beyond = max(wanted - self.highest, self.lowest - wanted)
        if beyond <= 0.0:
            return 0.0
        self.beyond_rad = max(self.beyond_rad, beyond)
        return self.dynamics.activation_for(wanted, torque=self.observer.x[3]) / self.share - self.pulse.most

    def _await(self, reading: float) -> None:
        """Wait for a row of readings of one joint near its rest."""
        if not (self.monitor.possible(reading) and abs(reading - self.lowest) < START_RAD):
            self.good = min(self.good, 0)
            return
        if not (self.good and self.monitor.judge(reading, self.observer, False)) or self.monitor.fault:
            self.monitor.reset()
            self.observer.reset(reading)
            self.good = min(self.good, 0)
        self.observer.correct(reading)
        self.good += 1
        if self.good >= START_READINGS:
            self.status = Status.RUNNING

    def _calmed(self, reading: float) -> Status:
        """Note how the joint follows; calm a loop that swings by itself."""
        if self.monitor.possible(reading) and self.swings.take(self.wanted_rad, reading):
            self.calm *= CALMER
            self.observer.torque_wander *= CALMER
        return Status.SWINGING if self.calm < CALMEST else Status.RUNNING

    def _ramp(self) -> float:
        """Pulses on their way to off: what they have above the threshold goes in equal steps within `limits.ramp_s`."""
        if self.falling is None:
            pulses, over = round(self.limits.ramp_s / PULSE_S), self.pulse.limiter.last_us - self.pulse.threshold
            self.falling = [self.pulse.threshold + over * k / pulses for k in range(1, pulses)] if over >= 0.0 else []
        width, self.recruitment = self.pulse.give(self.falling.pop() if self.falling else 0.0, at_once=True)
        return width

    @property
    def warning(self) -> str:
        """Lines when the loop has swung by itself, when a reference lay beyond reach, when the calls paused, and some
        time before the muscle can no longer do what it has been doing; else empty.
        """
        lines = [self.watch.warning] if self.watch is not None and self.watch.warning else []
        if self.beyond_rad > FARTHEST_BEYOND_RAD:
            beyond = f"the reference lies up to {math.degrees(self.beyond_rad):.1f} degrees beyond"
            asked = f"what the muscle is asked for with this load, {self.lowest:.2f} to {self.highest:.2f} rad"
            lines.append(f"{beyond} {asked}: the joint is held within that")
        if self.paused_s:
            lines.append(f"the calls paused for {self.paused_s:.3g} s: stimulation begins again with the joint at rest")
        if self.calm < 1.0:
            swung = f"the loop swung by itself at {self.swings.frequency_hz:.1f} Hz and was calmed"
            why = "the model lacks something, such as the frame; diagnose trials of this rig"
            lines.append(f"{swung} to {100 * self.calm:.0f} %: {why}")
        return "; ".join(lines)

    def _reach(self) -> None:
        """Set the range of angles to which the muscle can move the joint now."""
        angles, needed = self.reachable
        force = self.share * self.pulse.most + self.observer.x[3] / self.dynamics.pull_nm
        full = float(np.interp(force, needed, angles))
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
