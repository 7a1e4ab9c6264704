"""Endurance of a muscle: a fatigue budget for schedules, and a warning while it is spent.

With c the share of the fresh force that is left (the effect `fatigue`),

    c' = (1 - c) / recovery - rate act (c - FLOOR),    act = needed / c

where `needed` is the activation that a fresh muscle would need. What is needed grows dearer as c falls: a schedule fits
the budget as long as needed <= (1 - RESERVE) c at every moment.
"""

from dataclasses import dataclass

import numpy as np

from fes_pin.control.dynamics import ANGLES_RAD, PULSE_S, AnkleDynamics
from fes_pin.data.errors import InputError
from fes_pin.data.numbers import between, numbers, whole
from fes_pin.data.show import Tabulated
from fes_pin.models.effects.fatigue import FLOOR, Fatigue
from fes_pin.models.model import Model

RESERVE = 0.1
"""Share of the force left that a schedule keeps for the feedback."""
LONGEST_REST_S = 600.0
WINDOW_PULSES = 450
"""Past that the watch takes for the future: 10 s."""
HORIZON_S = 120.0
LEAD_S = 20.0
"""The watch warns when less time than this is left."""
FORECAST_STEP_S = 0.5


@dataclass(frozen=True, eq=False)
class Budget(Tabulated):
    """The fatigue that a schedule costs.

    Attributes
    ----------
    time, needed, capacity
        Shape (n,): activation that a fresh muscle would need, and the share of the fresh force that is left.
    """

    time: np.ndarray
    needed: np.ndarray
    capacity: np.ndarray

    along = ("time", "needed", "capacity")

    def __post_init__(self) -> None:
        super().__post_init__()
        if not len(self.time) or not all(np.isfinite(getattr(self, name)).all() for name in self.along):
            raise InputError("expected one or more finite numbers each", column=", ".join(self.along))

    @property
    def short_at_s(self) -> float:
        """When the schedule first asks for more than the budget has; infinite if it never does."""
        short = self.needed > (1.0 - RESERVE) * self.capacity
        return float(self.time[int(np.argmax(short))]) if short.any() else float("inf")

    @property
    def respected(self) -> bool:
        """Whether the muscle can do all of it."""
        return self.short_at_s == float("inf")


def fatigue_of(model: Model) -> Fatigue | None:
    """The model's fatigue, if it has one."""
    return next((e for e in model.effects if isinstance(e, Fatigue)), None)


def muscle_budget(model: Model, load_kg: float, reference_rad: np.ndarray, capacity: float = 1.0) -> Budget:
    """Return the cost of a schedule for a muscle, from the identified fatigue.

    Parameters
    ----------
    reference_rad
        The schedule, one angle per pulse, shape (n,).
    capacity
        Share of the fresh force at its start.

    Raises
    ------
    InputError
        If the model knows no fatigue, the schedule is no row of angles in rad, or the capacity is not within 0 to 1.
    """
    capacity = between(capacity, 0.0, 1.0, "capacity")
    fatigue = fatigue_of(model)
    if fatigue is None:
        raise InputError("a fatigue budget needs a model with the effect fatigue")
    angles = numbers(reference_rad, "reference_rad")
    low, high = ANGLES_RAD
    if angles.ndim != 1 or not len(angles) or not ((angles >= low) & (angles <= high)).all():
        raise InputError(f"expected a schedule of one or more finite angles from {low} to {high} rad")
    dynamics = AnkleDynamics.of(model, load_kg)
    speed = np.gradient(angles, PULSE_S) if len(angles) > 1 else np.zeros(1)
    needed = np.array([max(dynamics.activation_for(q, v), 0.0) for q, v in zip(angles.tolist(), speed, strict=True)])
    left = np.empty(len(needed))
    for k, want in enumerate(needed.tolist()):
        left[k] = capacity
        capacity = spent(fatigue, capacity, want, PULSE_S)
    return Budget(PULSE_S * np.arange(len(needed)), needed, left)


def spent(fatigue: Fatigue, capacity: float, needed: float, time: float) -> float:
    """Capacity after a time in s of an activation that a fresh muscle would need."""
    act = min(needed / max(capacity, FLOOR), 1.0)
    tires = fatigue.rate_per_s * act * max(capacity - FLOOR, 0.0)
    return capacity + time * ((1.0 - capacity) / fatigue.recovery_s - tires)


def least_rest(model: Model, load_kg: float, bout_rad: np.ndarray, bouts: int) -> float:
    """The shortest rest in s between equal bouts that keeps their schedule within the budget, to 0.1 s.

    Parameters
    ----------
    bout_rad
        One bout, one angle per pulse, shape (n,).

    Raises
    ------
    InputError
        If no rest of up to 10 minutes is enough, or `bouts` is below 1.
    """
    rest_angle = AnkleDynamics.of(model, load_kg).rest_angle()

    def fits(rest_s: float) -> bool:
        return muscle_budget(model, load_kg, scheduled(bout_rad, bouts, rest_s, rest_angle)).respected

    low, high = 0.0, LONGEST_REST_S
    if fits(low):
        return low
    if not fits(high):
        raise InputError(f"no rest of up to {LONGEST_REST_S:g} s lets the muscle do {bouts} such bouts")
    while high - low > 0.1:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if fits(middle) else (middle, high)
    return high


def scheduled(bout_rad: np.ndarray, bouts: int, rest_s: float, rest_rad: float) -> np.ndarray:
    """Bouts with rests of up to 10 minutes between them, one angle per pulse, shape (n,).

    Raises
    ------
    InputError
        For fewer than one bout, another rest, or a bout that is not (n,).
    """
    bouts = whole(bouts, "bouts", least=1)
    bout = numbers(bout_rad, "bout_rad")
    if bout.ndim != 1:
        raise InputError(f"expected one angle per pulse, (n,), got shape {bout.shape}", column="bout_rad")
    pause = np.full(round(between(rest_s, 0.0, LONGEST_REST_S, "rest_s") / PULSE_S), rest_rad)
    return np.concatenate([bout, *[part for _ in range(bouts - 1) for part in (pause, bout)]])


class EnduranceWatch:
    """Looks ahead once a second: will the muscle last if it goes on as in the last 10 s?

    Attributes
    ----------
    lasts_s
        Time until the greatest activation of the last 10 s is more than the muscle will have; infinite if it never is.
    """

    def __init__(self, fatigue: Fatigue) -> None:
        self.fatigue = fatigue
        self.past = np.zeros(WINDOW_PULSES)
        self.count = 0
        self.lasts_s = float("inf")

    def take(self, needed: float, share: float) -> None:
        """Note one pulse: activation that a fresh muscle would have needed, and the share that is left."""
        self.past[self.count % WINDOW_PULSES] = needed
        self.count += 1
        if self.count % 45 == 0:
            self.lasts_s = self._look_ahead(share)

    def _look_ahead(self, share: float) -> float:
        past = self.past[: min(self.count, WINDOW_PULSES)]
        most, mean, time = float(past.max()), float(past.mean()), 0.0
        while time < HORIZON_S:
            if most > share:
                return time
            share = spent(self.fatigue, share, mean, FORECAST_STEP_S)
            time += FORECAST_STEP_S
        return float("inf")

    @property
    def warning(self) -> str:
        """One line when less than `LEAD_S` are left, else empty."""
        return f"the muscle can do this for {self.lasts_s:.0f} s more" if self.lasts_s < LEAD_S else ""
