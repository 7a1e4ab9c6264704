"""Notices readings that must not be acted on: missing, impossible, frozen, or far from the model's prediction.

1. A reading is bad if there is none, if no joint can have it, or if the joint would have to jump. Bad ones count 1,
   good ones take 1 / 2 off; at `BAD_READINGS` it is a fault: so many in a row, or a third of all for long.
2. Readings of an analogue sensor differ in their last digits. The same number again and again while the muscle is
   stimulated is frozen, as soon as its noise would do that less often than the stated rate.
3. Innovations: reading less expectation over its standard deviation, which the filter's own variance and what 30 % of
   ignorance about gain, time constant and stiffness can do to a joint that the muscle is moving make together. The sum
   of the last `WINDOW` squares, each clipped so that three of five must be large, against the quantile of chi square
   that noise exceeds at the stated rate.
   Source of the test: Mehra and Peschon, An innovations approach to fault detection and diagnosis in dynamic systems,
   Automatica 7 (1971) 637-640; the share for ignorance and the clipping are of this project.
4. A filter can explain a wrong joint by absurd estimates: a muscle that has hardly any of its gain, or an unknown
   torque as large as a third of what the muscle can do.
"""

import math
from collections import Counter, deque
from enum import Enum

from scipy.special import chdtri, erf

from fes_pin.control.dynamics import GATE, PULSE_S, AnkleDynamics, JointObserver

FALSE_STOPS_PER_HOUR = 1e-3
"""Rate at which noise alone trips the test of frozen readings, and at most that of innovations: clipping leaves 1.3e-4
an hour of it. What a model lacks comes on top, and has no rate that could be stated; it is measured
(scripts/control_safety.py)."""
BAD_READINGS = 6
"""0.13 s. Of independent losses 3 in 100 make a false stop 4e-4 times an hour, 5 in 100 once in 70 h."""
SPIKE_RAD = 0.14
"""A reading this far from the one expected, 8 degrees, is a jump, if it is also beyond `GATE` of its standard
deviations and what ignorance explains is taken off: the joint would have to be 6 rad/s off."""
WINDOW = 5
"""Innovations that are summed: a fault of them is found within as many pulses of its being large."""
CLIP = 4.1
"""Standard deviations beyond which an innovation counts no more: three in five must be as large, so that one reading
that is off, with what it does to the estimates, is no stop."""
IGNORANCE = 0.3
"""Relative uncertainty of gain, time constant and stiffness, as in the tuning."""
MEMORY = 8
"""Pulses whose activations count as motion of the muscle: 0.18 s, more than three of its time constants."""
LEAST_SHARE = 0.15
"""Share of the believed gain below which a muscle counts as not answering: a muscle 30 % weaker than believed has 0.25
when it is fatigued as far as muscles are (Riener and Fuhr 1998: 0.35)."""
MOST_TORQUE = 0.3
"""Share of the muscle's greatest torque that an unknown torque may have: a load of 0.2 kg that the model lacks makes
0.12, 30 % in stiffness 0.07 to 0.17."""
PERSISTENT = 9
"""Pulses in a row that an estimate must be absurd for: 0.2 s."""


class Status(Enum):
    """Status of a controller; its text gives the reason. All but the first two are faults: off until `reset()`."""

    WAITING = "waiting for valid readings of a joint at rest: nothing is stimulated"
    RUNNING = "running"
    MISSING = "readings are missing: sensor or cable"
    IMPOSSIBLE = "readings that this joint cannot have: sensor, cable, or units"
    JUMPING = "readings jump farther than a joint can move: sensor slipped, mirrored or loose"
    FROZEN = "readings are frozen: the same number again and again while the muscle is stimulated"
    INCONSISTENT = "readings are far from the model's prediction: sensor, muscle, electrode, or a joint that is held"
    SILENT = "the joint does not answer to stimulation: electrode, cable, muscle, or a sensor that is loose"
    SWINGING = "the loop swings by itself and calming it did not help: a late sensor, or a model that lacks something"
    REFUSED = "what was handed in was no reading or no reference: see the error that was raised"

    @property
    def is_fault(self) -> bool:
        """Whether pulses ramp down, or are off until `reset()`."""
        return self not in {Status.WAITING, Status.RUNNING}

    def __str__(self) -> str:
        return self.value


def most_repeats(noise_std_rad: float, resolution_rad: float) -> float:
    """How often a working sensor's reading may be the same in a row, at the stated rate of false stops; infinite for a
    sensor whose steps hide its noise.

    The reading is most likely to come again where the true angle is in the middle of a step.
    """
    again = float(erf(resolution_rad / (2.0 * math.sqrt(2.0) * noise_std_rad)))
    if again > 0.9:
        return math.inf
    return max(BAD_READINGS, 1 + math.ceil(math.log(_per_pulse()) / math.log(max(again, 1e-12))))


def _per_pulse() -> float:
    return FALSE_STOPS_PER_HOUR * PULSE_S / 3600.0


class FaultMonitor:
    """Judges each reading against what the observer expects.

    Parameters
    ----------
    dynamics
        The ankle as believed.
    range_rad
        Angles that the joint may have.
    noise_std_rad, resolution_rad
        Of the sensor.

    Attributes
    ----------
    fault
        The fault that was found; None as long as there is none.
    bad
        Level of bad readings: 0 if the last ones were good.
    surprise
        Sum of the last squared innovations over what it may be: 1 is the limit.
    """

    def __init__(
        self, dynamics: AnkleDynamics, range_rad: tuple[float, float], noise_std_rad: float, resolution_rad: float
    ) -> None:
        self.range_rad = range_rad
        self.repeats_allowed = most_repeats(noise_std_rad, resolution_rad)
        self.limit = float(chdtri(WINDOW, _per_pulse()))
        # what 30 % of ignorance does to the joint when all of the muscle is switched
        self.ignorance_rad = IGNORANCE * (dynamics.rest_angle(1.0) - dynamics.rest_angle())
        self.torque_nm = MOST_TORQUE * dynamics.pull_nm
        self.reset()

    def reset(self) -> None:
        """Forget everything."""
        self.fault: Status | None = None
        self.bad, self.why = 0.0, Counter[Status]()
        self.last, self.repeats = math.nan, 0
        self.squares: deque[float] = deque([0.0] * WINDOW, WINDOW)
        self.active: deque[float] = deque([0.0] * (MEMORY + 1), MEMORY + 1)
        self.silent = self.pushed = 0

    @property
    def surprise(self) -> float:
        """See the class."""
        return sum(self.squares) / self.limit

    def possible(self, reading: float) -> bool:
        """True for an angle that this joint may have."""
        return self.range_rad[0] <= reading <= self.range_rad[1]

    def judge(self, reading: float, observer: JointObserver, stimulated: bool) -> bool:
        """Look at a reading before the observer takes it in; True if it may.

        Parameters
        ----------
        stimulated
            Whether the muscle got a pulse since the last reading.
        """
        self.active.append(observer.x[0] * observer.x[4])
        innovation, std = observer.expects(reading)
        moving = self.ignorance_rad * (max(self.active) - min(self.active))
        found = None
        if math.isnan(reading):
            found = Status.MISSING
        elif not self.possible(reading):
            found = Status.IMPOSSIBLE
        elif abs(innovation) - moving > max(GATE * std, SPIKE_RAD):
            found = Status.JUMPING
        self._count(found)
        if found is None:
            self._repeated(reading, stimulated)
            self.squares.append(min(abs(innovation) / math.hypot(std, moving), CLIP) ** 2)
            if sum(self.squares) > self.limit:
                self._found(Status.INCONSISTENT)
        return found is None

    def look(self, observer: JointObserver, stimulated: bool) -> None:
        """Look at the estimates after a reading was taken in."""
        if stimulated:
            self.silent = self.silent + 1 if observer.x[4] < LEAST_SHARE else 0
        self.pushed = self.pushed + 1 if abs(observer.x[3]) > self.torque_nm else 0
        if self.silent >= PERSISTENT:
            self._found(Status.SILENT)
        if self.pushed >= PERSISTENT:
            self._found(Status.INCONSISTENT)

    def _found(self, fault: Status) -> None:
        self.fault = self.fault or fault

    def _count(self, found: Status | None) -> None:
        if found is None:
            self.bad = max(self.bad - 0.5, 0.0)
            if not self.bad:
                self.why.clear()
            return
        self.bad += 1.0
        self.why[found] += 1
        if self.bad >= BAD_READINGS:
            self._found(self.why.most_common(1)[0][0])

    def _repeated(self, reading: float, stimulated: bool) -> None:
        if reading != self.last:
            self.last, self.repeats = reading, 0
        elif stimulated:
            self.repeats += 1
            if self.repeats >= self.repeats_allowed:
                self._found(Status.FROZEN)
