"""How safe is the ankle's position control: simulated faults, and hours of normal use without any.

.venv/bin/python scripts/control_safety.py                    # 1000 faults, 10 hours; 15 minutes on two cores
.venv/bin/python scripts/control_safety.py --faults 80 --hours 0.5
.venv/bin/python scripts/control_safety.py --faults 0 --hours 0 --steps 100000    # whatever callers do
.venv/bin/python scripts/control_safety.py --faults 0 --hours 0 --steps 0 --schedules 1000    # whenever they call

The ankles are twins (`analysis/paper_ankle/twin.py`), whose integrator shares no line with the controller's model. Each
is off by up to 30 % in gain, time constant and stiffness from what the controller believes, half of them tire, a third
stand on a frame that swings, of which the controller knows in half of the cases; readings have 2 mrad of noise and
steps of 1 mrad, 2 in 100 are lost and 1 in 1000 is a spike.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from multiprocessing import Pool
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import patch

import numpy as np
from scipy.stats import chi2
from threadpoolctl import threadpool_limits

from fes_pin.control.control import PositionController
from fes_pin.control.dynamics import PULSE_S, AnkleDynamics, JointObserver
from fes_pin.control.faults import Status
from fes_pin.control.pulse import StimulationLimits
from fes_pin.data.errors import InputError
from fes_pin.models.effects.fatigue import Fatigue
from fes_pin.models.effects.frame_vibration import FrameVibration

sys.path.insert(0, str(Path(__file__).parents[1] / "analysis"))
from paper_ankle.constants import paper_twin
from paper_ankle.ratios import ankle_of
from paper_ankle.twin import AnkleTwin, RunningTwin

BELIEVED = replace(paper_twin("3-23"), load_kg=0.5)
NOISE_RAD, STEP_RAD, LOST, SPIKED = 2e-3, 1e-3, 0.02, 0.001
CURRENT_MA = 40.0
"""For the charge that is printed."""
WATCHED_S = 30.0
"""A fault that is not off after this is not detected."""
SETTLED_S = 2.0
"""How long the pulses are seen to stay off; then the run ends."""
ASTRAY_DEG = 3.0
BOUT_S = 300.0
FATIGUE = {"rate_per_s": 0.03, "recovery_s": 60.0}
STEP_S = 4e-3
"""Of the twins' integrator: it errs by 1e-5 rad."""
Sensor = Callable[[int, float], float]


@dataclass(frozen=True)
class Subject:
    """A true ankle, and what its controller knows of it."""

    twin: AnkleTwin
    knows_frame: bool

    @classmethod
    def drawn(cls, rng: np.random.Generator) -> Subject:
        """One of the population."""
        gain, tau, stiff = rng.uniform(0.7, 1.3, 3)
        f1, rest = BELIEVED.f1_per_rad * stiff, BELIEVED.rest_angle() - BELIEVED.theta_r_rad
        twin = replace(
            BELIEVED,
            gain=BELIEVED.gain * gain,
            time_constant_s=BELIEVED.time_constant_s * tau,
            f0_n=BELIEVED.f0_n * math.expm1(BELIEVED.f1_per_rad * rest) / math.expm1(f1 * rest),
            f1_per_rad=f1,
            fatigue_per_s=FATIGUE["rate_per_s"] if rng.random() < 0.5 else 0.0,
        )
        if rng.random() < 1.0 / 3.0:
            coupling, hz, zeta = rng.uniform(0.2, 1.33), rng.uniform(4.0, 12.0), rng.uniform(0.03, 0.08)
            twin = replace(twin, frame_coupling=coupling, frame_hz=hz, frame_damping=zeta)
        return cls(twin, rng.random() < 0.5)

    def controller(self) -> PositionController:
        """As this subject's clinic would make it: the believed ankle, and its frame where that was identified."""
        t = self.twin
        frame = (t.frame_coupling, t.frame_hz, t.frame_damping) if self.knows_frame and t.frame_coupling else None
        made = _controller(frame)
        made.reset()
        return made


@cache
def _controller(frame: tuple[float, float, float] | None) -> PositionController:
    model = ankle_of(BELIEVED) + Fatigue(**FATIGUE)
    if frame is not None:
        model = model + FrameVibration(coupling=frame[0], frequency_hz=frame[1], damping_ratio=frame[2])
    return PositionController(model, BELIEVED.load_kg)


def schedule(rng: np.random.Generator, seconds: float) -> np.ndarray:
    """What is done in a session: sines, steps, ramps and rests of 2 to 8 s, up to 15 degrees above rest, rad."""
    rest, count = BELIEVED.rest_angle(), round(seconds / PULSE_S)
    parts: list[np.ndarray] = [np.full(45, rest)]
    while sum(map(len, parts)) < count:
        t = np.arange(round(rng.uniform(2.0, 8.0) / PULSE_S)) * PULSE_S
        height = math.radians(rng.uniform(5.0, 15.0))
        kind = rng.integers(4)
        if kind == 0:
            parts.append(rest + 0.5 * height * (1.0 - np.cos(2.0 * math.pi * rng.uniform(0.2, 1.0) * t)))
        elif kind == 1:
            parts.append(rest + height * (np.floor(t / rng.uniform(0.7, 2.0)) % 2 == 0))
        elif kind == 2:
            parts.append(rest + height * np.minimum(t / rng.uniform(0.5, 2.0), 1.0))
        else:
            parts.append(np.full(len(t), rest))
    return np.concatenate(parts)[:count]


class Sensors:
    """A potentiometer that works as potentiometers do."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.rng = rng

    def __call__(self, k: int, angle: float) -> float:
        chance = self.rng.random()
        if chance < LOST:
            return math.nan
        if chance < LOST + SPIKED:
            return float(self.rng.uniform(0.3, 2.8))
        return STEP_RAD * round((angle + NOISE_RAD * self.rng.standard_normal()) / STEP_RAD)


def lost(rng: np.random.Generator) -> Sensor:
    """No readings any more."""
    return lambda k, reading: math.nan


def frozen(rng: np.random.Generator) -> Sensor:
    """The last reading again and again."""
    held: list[float] = []

    def sense(k: int, reading: float) -> float:
        if not held and not math.isnan(reading):
            held.append(reading)
        return held[0] if held else reading

    return sense


def loose(rng: np.random.Generator) -> Sensor:
    """Off the joint: rests where it was, with its noise."""
    held: list[float] = []

    def sense(k: int, reading: float) -> float:
        if not held and not math.isnan(reading):
            held.append(reading)
        return held[0] + NOISE_RAD * rng.standard_normal() if held else reading

    return sense


def mirrored(rng: np.random.Generator) -> Sensor:
    """Turned round, about an angle of up to 10 degrees from rest."""
    middle = BELIEVED.rest_angle() + math.radians(rng.uniform(-10.0, 10.0))
    return lambda k, reading: 2.0 * middle - reading


def slipped(rng: np.random.Generator) -> Sensor:
    """Shows 10 to 40 degrees more or less."""
    shift = math.radians(rng.uniform(10.0, 40.0)) * rng.choice([-1.0, 1.0])
    return lambda k, reading: reading + shift


def wild(rng: np.random.Generator) -> Sensor:
    """A bad contact: 50 to 100 in 100 readings are anything."""
    share = rng.uniform(0.5, 1.0)
    return lambda k, reading: float(rng.uniform(-1.0, 4.0)) if rng.random() < share else reading


def silent(rng: np.random.Generator) -> dict[str, float]:
    """An electrode off: the muscle does nothing."""
    return {"gain": 0.0}


def opposite(rng: np.random.Generator) -> dict[str, float]:
    """The other electrode: the antagonist pulls, with 30 to 100 % of the muscle's gain."""
    return {"gain": -BELIEVED.gain * rng.uniform(0.3, 1.0)}


SENSOR_FAULTS = (lost, frozen, loose, mirrored, slipped, wild)
MUSCLE_FAULTS = (silent, opposite)
KINDS = {fault.__name__: fault for fault in (*SENSOR_FAULTS, *MUSCLE_FAULTS)}


@dataclass(frozen=True)
class Outcome:
    """What came of a fault.

    Attributes
    ----------
    off_s
        From the fault to the last pulse; infinite if pulses go on.
    found_s
        From the fault to its detection.
    astray_s
        From the moment that the joint was `ASTRAY_DEG` from where it was to be, to the last pulse; 0 if it never was.
    pulses, charge_uc, widest_us
        That were given after it.
    status
        Of the controller at the end.
    early
        True if the controller had stopped before the fault.
    """

    kind: str
    found_s: float
    off_s: float
    astray_s: float
    pulses: int
    charge_uc: float
    widest_us: float
    status: str
    early: bool


def fault(kind: str, seed: int) -> Outcome:
    """One simulated fault: from the first pulse on in one of five, else while the joint is being moved."""
    rng = np.random.default_rng([seed, list(KINDS).index(kind)])
    subject, working = Subject.drawn(rng), Sensors(rng)
    start = 0 if rng.random() < 0.2 else round(rng.uniform(5.0, 20.0) / PULSE_S)
    count = start + round(WATCHED_S / PULSE_S)
    controller, joint = subject.controller(), RunningTwin(subject.twin, max_step_s=STEP_S)
    controller.follow(schedule(rng, count * PULSE_S))
    change, broken, early, found, astray, widths = KINDS[kind](rng), None, False, math.inf, math.inf, []
    for k in range(count):
        if k == start:
            early = controller.status.is_fault
            if isinstance(change, dict):
                joint.twin = replace(joint.twin, **change)
            else:
                broken = change
        reading = working(k, joint.angle_rad)
        width = controller.step(broken(k, reading) if broken else reading, time_s=k * PULSE_S)
        joint.step(width, PULSE_S)
        if k < start:
            continue
        widths.append(width)
        since = (k - start) * PULSE_S
        if controller.status.is_fault:
            found = min(found, since)
        elif abs(joint.angle_rad - controller.wanted_rad) > math.radians(ASTRAY_DEG):
            astray = min(astray, since)
        if since - found > controller.limits.ramp_s + SETTLED_S:
            break
    given = np.flatnonzero(widths)
    last = 0.0 if not len(given) else (given[-1] + 1) * PULSE_S
    safe = controller.status is not Status.RUNNING and (not len(given) or last <= found + controller.limits.ramp_s)
    return Outcome(
        kind=kind,
        found_s=found,
        off_s=last if safe else math.inf,
        astray_s=max(last - astray, 0.0),
        pulses=len(given),
        charge_uc=1e-3 * CURRENT_MA * sum(widths),
        widest_us=max(widths),
        status=controller.status.name,
        early=early,
    )


@dataclass(frozen=True)
class Bout:
    """Five minutes of normal use: false stop or none, the largest surprise, and whether the loop was calmed."""

    status: str
    surprise: float
    calm: float
    subject: Subject
    stopped_s: float


def normal(seed: int, seconds: float = BOUT_S) -> Bout:
    """A bout of normal use."""
    rng = np.random.default_rng([seed, 77])
    subject, working = Subject.drawn(rng), Sensors(rng)
    controller, joint = subject.controller(), RunningTwin(subject.twin, max_step_s=STEP_S)
    controller.follow(schedule(rng, seconds))
    surprise, stopped = 0.0, math.inf
    for k in range(round(seconds / PULSE_S)):
        joint.step(controller.step(working(k, joint.angle_rad), time_s=k * PULSE_S), PULSE_S)
        surprise = max(surprise, controller.monitor.surprise)
        if controller.status.is_fault:
            stopped = k * PULSE_S
            break
    return Bout(controller.status.name, surprise, controller.calm, subject, stopped)


@dataclass(frozen=True)
class Abuse:
    """What two controllers did whose callers do anything: steps, pauses, limits that were rejected, what went wrong."""

    steps: int
    pauses: int
    rejected: int
    wrong: tuple[str, ...]


LIMIT_UNITS = {"pulse_width_us": 1e3, "rate_us_per_s": 1e3, "charge_uc_per_s": 1e3, "current_ma": 1e3}
"""Factors by which a unit slips: ms for us, mC for uC, A for mA."""


def limits_of(rng: np.random.Generator) -> StimulationLimits:
    """Limits of a clinic, in one of three draws with a slip of units; such are rejected, and drawn again."""
    given = {
        "pulse_width_us": rng.uniform(200.0, 1000.0),
        "rate_us_per_s": rng.uniform(1000.0, 20_000.0),
        "charge_uc_per_s": rng.uniform(500.0, 3000.0),
        "current_ma": rng.uniform(15.0, 40.0),
    }
    if rng.random() < 1.0 / 3.0:
        name = str(rng.choice(list(given)))
        given[name] *= LIMIT_UNITS[name] ** rng.choice([-1.0, 1.0])
    return StimulationLimits(**given)


def must_not_be(controller: PositionController, widths: list[float], stopped: int, gap: float) -> list[str]:
    """What is wrong with the last of some widths, `gap` seconds after the one before it."""
    limits, width = controller.limits, widths[-1]
    wrong = {
        "outside of the limits": width != 0.0
        and not BELIEVED.threshold_us <= width <= min(limits.pulse_width_us, BELIEVED.saturation_us),
        "while waiting": width > 0.0 and controller.status is Status.WAITING,
        "while stopped": width > 0.0 and stopped > limits.ramp_s / PULSE_S + 1,
        "at once after a pause": width > 0.0 and gap >= 0.2,
        "charge above its limit": 1e-3 * (limits.current_ma or 0.0) * sum(widths[-45:])
        > limits.charge_uc_per_s * (1.0 + 1e-9),
    }
    return [what for what, found in wrong.items() if found]


def abused(seed: int, steps: int = 2000) -> Abuse:
    """Two legs of one clinic, given one observer: one is moved, one is to rest; readings, references, times, pauses and
    resets are anything."""
    rng, rejected, wrong, legs = np.random.default_rng([seed, 78]), 0, [], []
    model = ankle_of(BELIEVED)
    shared = JointObserver(AnkleDynamics.of(model, BELIEVED.load_kg))
    while len(legs) < 2:
        try:
            legs.append(PositionController(model, BELIEVED.load_kg, shared, limits_of(rng)))
        except InputError:
            rejected += 1
    joints, rest, pauses = [RunningTwin(BELIEVED, max_step_s=STEP_S) for _ in legs], BELIEVED.rest_angle(), 0
    now, given, stopped = 0.0, [[0.0], [0.0]], [0, 0]
    for k in range(steps):
        gap = rng.uniform(0.8, 1.2) * PULSE_S
        if rng.random() < 0.003:
            gap, pauses = float(rng.choice([0.2, 1.0, 60.0])), pauses + 1
        now += gap
        for leg, (controller, joint) in enumerate(zip(legs, joints, strict=True)):
            joint.step(given[leg][-1], min(gap, PULSE_S))
            for _ in range(min(round(gap / PULSE_S) - 1, 200)):
                joint.step(0.0, PULSE_S)
            reading: object = joint.angle_rad + NOISE_RAD * rng.standard_normal()
            if rng.random() < 0.01:
                reading = rng.choice([math.nan, math.inf, -math.inf, 0.0, 1e300, 3.0, 105.0])
            wanted: object = (
                rest if leg else rest + math.radians(rng.uniform(-5.0, 40.0) if rng.random() < 0.1 else 9.0)
            )
            if rng.random() < 5e-4:
                wanted = rng.choice([math.nan, 95.0, -1.0])
            try:
                width = controller.step(reading, wanted, now if rng.random() > 2e-4 else -1.0)
            except InputError:
                width = 0.0
            stopped[leg] = stopped[leg] + 1 if controller.status is not Status.RUNNING else 0
            given[leg].append(width)
            place = f"seed {seed}, leg {leg}, step {k}, {controller.status.name}: {width:.0f} us, "
            wrong += [place + what for what in must_not_be(controller, given[leg], stopped[leg], gap)]
            if leg and width > 400.0 and not pauses and abs(joint.angle_rad - rest) < math.radians(1.0):
                wrong.append(f"{place}for a leg that is to rest")
            if controller.status.is_fault and stopped[leg] > 60:
                controller.reset()
    return Abuse(2 * steps, pauses, rejected, tuple(wrong))


@dataclass(frozen=True)
class Calls:
    """When a controller is called: in truth, and as stated; None where the computer's clock is asked."""

    true_s: np.ndarray
    stated_s: np.ndarray | None


def calls(rng: np.random.Generator, seconds: float) -> Calls:
    """Calls on a beat of 45 Hz, each up to 0 to 10 ms late; a program that is held up for 20 to 400 ms calls in a burst
    what it has missed. In half of the schedules times are stated, by a clock that is set by 1 ms to an hour every two
    seconds."""
    true = np.arange(round(seconds / PULSE_S)) * PULSE_S
    true += rng.uniform(0.0, rng.uniform(0.0, 0.01), len(true))
    for begin in np.flatnonzero(rng.random(len(true)) < rng.choice([0.0, 0.005, 0.02])):
        end = true[begin] + math.exp(rng.uniform(math.log(0.02), math.log(0.4)))
        true[begin:] = np.maximum(true[begin:], end)
    order = np.arange(len(true)) * rng.uniform(1e-5, 1e-3)  # of calls in a burst
    true = np.maximum.accumulate(true - order) + order
    if rng.random() < 0.5:
        return Calls(true, None)
    stated = true.copy()
    for set_s in np.arange(rng.uniform(0.5, 2.0), seconds, 2.0):
        stated[true >= set_s] += rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(-3.0, 3.5)
    return Calls(true, stated)


def passed(true_s: np.ndarray, widths_us: Sequence[float], limits: StimulationLimits) -> list[str]:
    """Limits that pulses at these times are beyond; the charge in any second."""
    widths = np.asarray(widths_us)
    total = np.r_[0.0, np.cumsum(widths)]
    inside = total[np.searchsorted(true_s, true_s + 1.0)] - total[:-1]
    on = (widths[1:] > 0.0) & (widths[:-1] > 0.0)
    found = {
        "charge": 1e-3 * (limits.current_ma or 0.0) * inside.max() > limits.charge_uc_per_s * (1.0 + 1e-9),
        "width": widths.max() > limits.pulse_width_us,
        "rise": np.max(np.diff(widths)[on], initial=0.0) > limits.rate_us_per_s * PULSE_S * (1.0 + 1e-9),
    }
    return [what for what, is_so in found.items() if is_so]


@dataclass(frozen=True)
class Called:
    """Result of a schedule of calls: refusals, faults, limits passed, and calls with the controller running."""

    refused: int
    faults: tuple[str, ...]
    passed: tuple[str, ...]
    running: int
    calls: int


def pulsed(joint: RunningTwin, lasts: tuple[float, float], gap: float) -> tuple[float, float]:
    """Apply a pulse to a joint until the next call; return the width, us, and the time, s, of it that are left."""
    width, left = lasts
    joint.step(width, min(gap, left))
    joint.step(0.0, max(gap - left, 0.0))
    return width, max(left - gap, 0.0)


def called(seed: int, seconds: float = 10.0) -> Called:
    """A controller with limits that are reached, called by a schedule; after a fault it is reset."""
    rng, controller, now = np.random.default_rng([seed, 79]), None, [0.0]
    while controller is None:
        try:
            controller = PositionController(ankle_of(BELIEVED), BELIEVED.load_kg, limits=limits_of(rng))
        except InputError:
            continue
    when, joint = calls(rng, seconds), RunningTwin(BELIEVED, max_step_s=STEP_S)
    controller.follow(schedule(rng, seconds))
    gaps = np.diff(when.true_s, append=when.true_s[-1] + PULSE_S).tolist()
    widths, refused, faults, running, lasts = [], 0, [], 0, (0.0, 0.0)
    with patch("fes_pin.control.timing.time", SimpleNamespace(monotonic=lambda: now[0])):
        for k, gap in enumerate(gaps):
            now[0] = float(when.true_s[k])
            stated = None if when.stated_s is None else float(when.stated_s[k])
            reading = joint.angle_rad + NOISE_RAD * rng.standard_normal()
            try:
                widths.append(controller.step(reading, time_s=stated))
            except InputError:
                refused += 1
                widths.append(0.0)
            if controller.status.is_fault:
                faults.append(controller.status.name)
                controller.reset()
            running += controller.status is Status.RUNNING
            lasts = pulsed(joint, lasts if not widths[-1] else (widths[-1], PULSE_S), gap)
    return Called(refused, tuple(faults), tuple(passed(when.true_s, widths, controller.limits)), running, len(gaps))


def show_called(outcomes: Iterable[Called]) -> None:
    """What came of it."""
    every = list(outcomes)
    faults = Counter(name for o in every for name in o.faults)
    limits = Counter(name for o in every for name in o.passed)
    count, running = (sum(getattr(o, n) for o in every) for n in ("calls", "running"))
    print(
        f"{len(every)} schedules, {count} calls with jitter, bursts and clocks that are set: "
        f"{sum(o.refused > 0 for o in every)} schedules refused; limits passed: {dict(limits) or 'none'}; "
        f"faults: {dict(faults) or 'none'}; running in {100 * running / count:.0f} % of the calls"
    )


def show_abuse(outcomes: Iterable[Abuse]) -> None:
    """What came of it."""
    every = list(outcomes)
    steps, pauses, rejected = (sum(getattr(o, n) for o in every) for n in ("steps", "pauses", "rejected"))
    wrong = [line for o in every for line in o.wrong]
    print(
        f"{steps} steps of controllers that were given one observer, {pauses} pauses, {rejected} limits with a slip of "
        f"units or without room rejected: {len(wrong)} widths that must not be"
    )
    for line in wrong[:20]:
        print(f"  {line}")


def show_faults(outcomes: Iterable[Outcome]) -> None:
    """The table of faults."""
    every = list(outcomes)
    print(
        f"{'':10s} {'':6s} {'':6s} {'off, s':>15s} {'astray, s':>15s} {'pulses':>13s} {'charge, uC':>15s}\n"
        f"{'kind':10s} {'faults':>6s} {'found':>6s}"
        + f" {'median':>8s} {'worst':>6s}"
        * 2
        + f" {'median':>6s} {'worst':>6s}"
        f" {'median':>8s} {'worst':>6s}  named"
    )
    for kind in KINDS:
        rows = [o for o in every if o.kind == kind]
        if not rows:
            continue
        names = {s: sum(o.status == s for o in rows) for s in sorted({o.status for o in rows})}
        off, astray, pulses, charge = (
            np.array([getattr(o, n) for o in rows]) for n in ("off_s", "astray_s", "pulses", "charge_uc")
        )
        print(
            f"{kind:10s} {len(rows):6d} {np.isfinite(off).sum():6d} {np.median(off):8.2f} {off.max():6.2f} "
            f"{np.median(astray):8.2f} {astray.max():6.2f} {np.median(pulses):6.0f} {pulses.max():6d} "
            f"{np.median(charge):8.0f} {charge.max():6.0f}  " + ", ".join(f"{s.lower()} {n}" for s, n in names.items())
        )
    print(
        f"{sum(math.isfinite(o.off_s) for o in every)} of {len(every)} detected and off; "
        f"{sum(o.early for o in every)} had stopped before their fault. Off: from the fault to the last pulse; "
        f"astray: from {ASTRAY_DEG:g} degrees off the reference to the last pulse; charge at {CURRENT_MA:g} mA"
    )
    for o in every:
        if not math.isfinite(o.off_s):
            print(f"  {o}")


def per_hour(stops: int, hours: float) -> tuple[float, float]:
    """The rate that a count allows: 97.5 % at both ends, of none 95 % at one (F. Garwood, Biometrika 28:437, 1936)."""
    if not stops:
        return 0.0, float(chi2.ppf(0.95, 2)) / 2.0 / hours
    low, high = chi2.ppf(0.025, 2 * stops), chi2.ppf(0.975, 2 * stops + 2)
    return float(low) / 2.0 / hours, float(high) / 2.0 / hours


def show_normal(bouts: Iterable[Bout], hours: float) -> None:
    """False stops, and what the tail of the innovations' test says of rarer ones."""
    every = list(bouts)
    stops = [b for b in every if b.status != "RUNNING"]
    largest = np.sort([b.surprise for b in every])
    # Gumbel's law of the largest of many, by its moments
    scale = max(math.sqrt(6.0) / math.pi * float(np.std(largest)), 1e-9)
    place = float(np.mean(largest)) - 0.5772156649 * scale
    rate = -math.expm1(-math.exp(-(1.0 - place) / scale)) * 3600.0 / BOUT_S
    by = {status: sum(b.status == status for b in stops) for status in sorted({b.status for b in stops})}
    low, high = per_hour(len(stops), hours)
    print(
        f"{hours:g} hours of normal use: {len(stops)} stops ({low:.2g} to {high:.2g} an hour at 95 %)"
        + "".join(f"; {status.lower()} {n}" for status, n in by.items())
        + f"; surprise in 5 minutes: median {np.median(largest):.2f}, largest {largest[-1]:.2f} of 1; "
        f"by Gumbel's law of the largest it passes 1 {rate:.1g} times an hour; "
        f"{sum(b.calm < 1.0 for b in every)} loops were calmed"
    )
    for b in stops:
        print(f"  {b.status} after {b.stopped_s:.0f} s, calm {b.calm:.2f}, surprise {b.surprise:.2f}: {b.subject}")


def _fault(job: tuple[str, int]) -> Outcome:
    return fault(*job)


def main() -> None:
    """The tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--faults", type=int, default=1000, help="of all kinds together")
    parser.add_argument("--hours", type=float, default=10.0, help="of normal use")
    parser.add_argument("--steps", type=int, default=100_000, help="of controllers whose callers do anything")
    parser.add_argument("--schedules", type=int, default=1000, help="of calls with jitter, bursts and clock steps")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    given = parser.parse_args()
    jobs = [(kind, given.seed + k) for k in range(-(-given.faults // len(KINDS))) for kind in KINDS][: given.faults]
    with Pool(given.jobs, threadpool_limits, (1,)) as pool:
        if jobs:
            show_faults(pool.imap_unordered(_fault, jobs, chunksize=4))
        bouts = range(given.seed, given.seed + round(given.hours * 3600.0 / BOUT_S))
        if bouts:
            show_normal(pool.imap_unordered(normal, bouts), given.hours)
        if given.steps:
            show_abuse(pool.imap_unordered(abused, range(given.seed, given.seed + -(-given.steps // 4000))))
        if given.schedules:
            show_called(pool.imap_unordered(called, range(given.seed, given.seed + given.schedules)))


if __name__ == "__main__":
    main()
