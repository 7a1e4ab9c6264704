"""Ankles whose stimulator answers their angle: a position controller that keeps a foot on a wave by pulse widths.

Rigs, forms of causes, noise and random torques are those of `scripts/accuracy free`, a cause as large as there: d = 40
under a scripted stimulus, 100 each of two, 60 outside the library. A controller keeps a foot from where a cause would
show, so that less of it is left. It is proportional and integral, gives a pulse width every 25 ms in whole us or in
steps of 10, and reads the angle with its noise.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from confusion_matrix.drafts import Draft, as_trial, sensor_family
from confusion_matrix.dynamics import Lanes, Run, recruitment
from confusion_matrix.form import Form
from confusion_matrix.generator import sized, true_values
from confusion_matrix.noise import FAMILIES, random_torque, sensor_noise
from confusion_matrix.plan import OUTSIDE_DISTANCE, PAIR_DISTANCE, Item
from confusion_matrix.stimuli import DT, PULSE_SAMPLES, times

from driven_rigs.draw import Drawn
from fes_pin.data.study import Study, write_study

CAUSES = (
    "coulomb_friction",
    "fatigue",
    "quadratic_damping",
    "parallel_stiffness",
    "second_order_activation",
    "load_error",
    "rise_fall_asymmetry",
    "electromechanical_delay",
    "force_length",
    "recruitment_hysteresis",
    "passive_relaxation",
    "sensor_drift",
    "threshold_drift",
)
PAIRS = (("coulomb_friction", "fatigue"), ("parallel_stiffness", "fatigue"), ("coulomb_friction", "threshold_drift"))
OUTSIDE = ("spasms", "detents", "sensor_slip")
"""Not in the library."""
DISTANCE = 40
STEPS_US = (1.0, 10.0)
"""Pulse widths that a stimulator can give."""
FINE = 20
"""Integration steps per sample, as of a rig with friction."""
FIRST_S = 0.4
"""Until then nothing is stimulated."""
LEAST_RAD = 0.05
"""Least of how far half of what can be recruited is taken to move the foot."""
LAST = 0.95
"""Widest pulse, as a share of the saturation."""


class Controlled(Run):
    """Trials of which those that move are stimulated by a controller, sample by sample."""

    def __init__(self, lanes: Lanes, forms: list[Form], noise: np.ndarray, seed: int, step_us: float) -> None:
        super().__init__(lanes, forms, FINE)
        self.noise, self.step_us = noise, step_us
        rng, count = np.random.default_rng([seed, 6]), len(lanes.moving)
        k = lanes.k
        self.width_range = k["saturation_us"] - k["threshold_us"]
        self.rest = self.equilibrium(count)
        self.reach = np.maximum(self.equilibrium(count, 0.5) - self.rest, LEAST_RAD)
        per_rad = 0.5 * self.width_range / self.reach
        self.kp = per_rad * rng.uniform(0.3, 1.0)
        self.ki = per_rad * rng.uniform(0.8, 2.0)
        self.gathered = np.zeros(count)
        self.wanted = self._wanted(rng, count)
        self.y = np.zeros_like(lanes.input)
        self.v = np.zeros_like(lanes.input)

    def _wanted(self, rng: np.random.Generator, count: int) -> np.ndarray:
        """A wave of two sines, or steps of 1.5 s, about half of the reach; shape (n, L)."""
        t = times()[:, None]
        slow, fast = rng.uniform(0.2, 0.5, count), rng.uniform(0.6, 1.3, count)
        phases = rng.uniform(0.0, 6.28, (2, count))
        waves = 0.5 + 0.3 * np.sin(6.28 * slow * t + phases[0]) + 0.15 * np.sin(6.28 * fast * t + phases[1])
        steps = rng.uniform(0.1, 0.95, (8, count))[np.minimum((t[:, 0] / 1.5).astype(int), 7)]
        return self.rest + self.reach * np.where(np.arange(count) % 3 == 2, steps, waves)

    def _mark(self, x: np.ndarray, i: int) -> None:
        super()._mark(x, i)
        self.y[i] = self._sensed(np.where(self.lanes.moving, self.s.q, self.s.force))
        self.v[i] = self.s.v
        if i % PULSE_SAMPLES == 0:
            self._stimulate(i)

    def _stimulate(self, i: int) -> None:
        """Give the pulse width of the samples until the next pulse."""
        read = self._read(self.y[: i + 1], self.v[: i + 1])[-1] + self.noise[i]
        error = self.wanted[i] - read
        now = i * DT >= FIRST_S
        if now:
            self.gathered += self.ki * error * PULSE_SAMPLES * DT
        low, high = self.lanes.k["threshold_us"], LAST * self.lanes.k["saturation_us"]
        wanted = low + 0.1 * self.width_range + self.kp * error + self.gathered
        self.gathered -= np.where(wanted > high, wanted - high, 0.0) + np.where(wanted < low, wanted - low, 0.0)
        width = np.clip(np.round(wanted / self.step_us) * self.step_us, 0.0, high) if now else np.zeros_like(error)
        rows = slice(i, i + PULSE_SAMPLES)
        self.lanes.input[rows] = np.where(self.lanes.moving, width, self.lanes.input[rows])
        self.drive[rows] = recruitment(self._until(rows.stop), self.forms)[rows]  # type: ignore[arg-type]

    def _until(self, stop: int) -> Lanes:
        return replace(self.lanes, input=self.lanes.input[:stop])


def draw_stimulated(causes: tuple[str, ...], seed: int, folder: Path) -> Drawn:
    """Draw an ankle, hide causes in it, put its foot under a controller, and write the study."""
    folder.mkdir(parents=True, exist_ok=True)
    family = FAMILIES[seed % len(FAMILIES)]
    form, distance = ("pair", PAIR_DISTANCE) if len(causes) > 1 else ("same" if causes else "null", DISTANCE)
    if causes and causes[0] in OUTSIDE:
        form, distance = "outside", OUTSIDE_DISTANCE
    item = Item("ankle", tuple(sorted(causes)), form, distance, family, seed)
    one = sized(item, folder)
    study = _controlled(one, item, float(item.rng(20).choice(STEPS_US)))
    write_study(study, folder / "study")
    truth = true_values(one, item.forms())
    return Drawn(folder / "study", "ankle", causes, truth)


def _controlled(one: Draft, item: Item, step_us: float) -> Study:
    """The study, those of its trials that move under a controller."""
    trials = one.trials
    numbers = one.plant.numbers()
    k = {n: np.full(len(trials), v) for n, v in numbers.items()}
    for name, default in (("load_kg", 0.0), ("angle_rad", 1.8)):
        k[name] = np.array([p.conditions.get(name, default) for p in trials])
    k["number"] = np.arange(len(trials))
    drive = np.stack([p.input for p in trials], axis=1).astype(float)
    moving = np.array([p.kind == "motion" for p in trials])
    drive[:, moving] = 0.0
    torques, noise = _random(one, moving)
    forms = [
        form(np.full(len(trials), size), {n: np.full(len(trials), v) for n, v in shape.items()})
        for form, size, shape in zip(item.forms(), one.sizes, one.shapes, strict=True)
    ]
    run = Controlled(Lanes("ankle", k, drive, moving, torques), forms, noise, item.seed, step_us)
    with np.errstate(all="ignore"):
        read = run.readings() + noise
    told = []
    for n, p in enumerate(trials):
        trial = as_trial("ankle", f"{n:02d}", p, np.round(read[:, n], 5 if moving[n] else 4))
        told.append(trial.with_columns(pulse_width_us=np.round(run.lanes.input[:, n], 3)))
    return Study(item.name, "ankle", dict(one.plant.known), dict(one.plant.start), tuple(told))


def _random(one: Draft, moving: np.ndarray) -> tuple[np.ndarray | None, np.ndarray]:
    """Random torques, None without any, and the noise of readings, shape (n, trials)."""
    item, count = one.item, len(times())
    family, colour = sensor_family(item)
    own = item.rng(4)
    columns = ["angle_rad" if m else "force_n" for m in moving]
    noise = np.stack([sensor_noise(own, family, c, count, colour) for c in columns], axis=1)
    if item.noise != "process" or family != "white":
        return None, noise
    rng, weight = item.rng(5), one.plant.numbers()["damping"] / 0.075
    return np.stack([random_torque(rng, count, weight, colour) for _ in moving], axis=1), noise
