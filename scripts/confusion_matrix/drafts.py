"""Studies before anything is hidden in them, and their trials as they are run and read."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from confusion_matrix.dynamics import Lanes, simulate
from confusion_matrix.form import Form
from confusion_matrix.noise import random_torque, sensor_noise
from confusion_matrix.plan import Item
from confusion_matrix.rigs import Plant, Protocol, draw_plant, draw_trials, urdf_text
from confusion_matrix.stimuli import times
from fes_pin.data.study import Study
from fes_pin.data.trial import Trial

COLUMN = {"ankle": "angle_rad", "joint": "position", "muscle": "force_n"}


@dataclass
class Draft:
    """A study before anything is hidden in it."""

    item: Item
    plant: Plant
    trials: list[Protocol]
    shapes: list[dict[str, float]]
    sizes: list[float]
    distances: list[float]
    urdf: Path


def draft(item: Item, folder: Path) -> Draft:
    """The rig and the trials of a study."""
    rng = item.rng(0)
    plant = draw_plant(rng, item.rig, 0.03 if item.form == "null" else 0.4)
    motion = 0 if item.rig == "muscle" else 8
    isometric = {"ankle": 3 if rng.random() < 2 / 3 else 0, "joint": 0, "muscle": 6}[item.rig]
    trials = draw_trials(rng, plant, motion, isometric)
    urdf = folder / f"{item.name}.urdf"
    if item.rig == "joint":
        urdf.write_text(urdf_text(plant.known), encoding="utf-8")
    return Draft(item, plant, trials, [], [], [], urdf)


def study_of(one: Draft, readings: Sequence[np.ndarray]) -> Study:
    """The study with these readings."""
    trials = [
        as_trial(one.plant.rig, f"{k:02d}", p, y) for k, (p, y) in enumerate(zip(one.trials, readings, strict=True))
    ]
    if one.plant.rig == "joint":
        files = {"urdf": one.urdf}
        return Study(one.item.name, "joint", {}, dict(one.plant.start), tuple(trials), files=files)
    return Study(one.item.name, one.plant.rig, dict(one.plant.known), dict(one.plant.start), tuple(trials))


def as_trial(rig: str, name: str, p: Protocol, y: np.ndarray) -> Trial:
    column = "force_n" if p.kind == "isometric" else COLUMN[rig]
    drive = "effort" if rig == "joint" else "pulse_width_us"
    columns = {drive: p.input} if p.input is not None else {}
    conditions = {n: v for n, v in p.conditions.items() if n not in ("position0", "velocity0")}
    return Trial(name, p.kind, {**columns, column: y}, times(), conditions)


def run_trials(
    drafts: Sequence[Draft],
    sizes: Sequence[Sequence[float]],
    forms: Sequence[type[Form]],
    steps: int,
    *,
    pushed: bool = False,
    only: int = 0,
) -> list[list[np.ndarray]]:
    """Readings of every trial of every draft, all side by side; `pushed` by random torques where the noise has them."""
    owner = [i for i, one in enumerate(drafts) for _ in one.trials]
    flat = [p for one in drafts for p in one.trials]
    numbers = [drafts[i].plant.numbers() for i in owner]
    k = {n: np.array([x[n] for x in numbers]) for n in numbers[0]}
    for name, default in (("load_kg", 0.0), ("angle_rad", 1.8), ("position0", 0.0), ("velocity0", 0.0)):
        k[name] = np.array([p.conditions.get(name, default) for p in flat])
    k["number"] = np.concatenate([np.arange(len(one.trials)) for one in drafts])
    count = len(times())
    drive = np.stack([p.input if p.input is not None else np.zeros(count) for p in flat], axis=1)
    moving = np.array([p.kind == "motion" for p in flat])
    torque = _torques(drafts, count) if pushed else None
    built = []
    for n, form in enumerate(forms):
        at = only + n
        shape = {key: np.array([drafts[i].shapes[at][key] for i in owner]) for key in drafts[0].shapes[at]}
        built.append(form(np.array([sizes[i][n] for i in owner]), shape))
    with np.errstate(all="ignore"):
        y = simulate(Lanes(drafts[0].plant.rig, k, drive, moving, torque), built, steps)
    out: list[list[np.ndarray]] = [[] for _ in drafts]
    for lane, i in enumerate(owner):
        out[i].append(y[:, lane])
    return out


def _torques(drafts: Sequence[Draft], count: int) -> np.ndarray | None:
    """Random torques of the studies whose noise has them, shape (n, L)."""
    if not any(one.item.noise == "process" for one in drafts) or drafts[0].plant.rig == "muscle":
        return None
    columns = []
    for one in drafts:
        rng = one.item.rng(3)
        colour, kind = rng.random(), rng.random()
        weight = one.plant.numbers()["damping"] / 0.075
        pushed = one.item.noise == "process" and kind < TORQUE_SHARE
        columns += [random_torque(rng, count, weight, colour) if pushed else np.zeros(count) for _ in one.trials]
    return np.stack(columns, axis=1)


TORQUE_SHARE = 0.6
"""Share of the third noise family that is a random torque; the others are ARMA noise of the sensor."""


def sensor_family(item: Item) -> tuple[str, float]:
    """Family of the sensor's noise, and its colour."""
    rng = item.rng(3)
    colour, kind = float(rng.random()), float(rng.random())
    if item.noise != "process":
        return item.noise, colour
    return ("arma" if kind >= TORQUE_SHARE or item.rig == "muscle" else "white"), colour


def with_noise(one: Draft, readings: Sequence[np.ndarray]) -> list[np.ndarray]:
    family, colour = sensor_family(one.item)
    out, own = [], one.item.rng(4)
    for p, y in zip(one.trials, readings, strict=True):
        column = "force_n" if p.kind == "isometric" else COLUMN[one.plant.rig]
        noise = sensor_noise(own, family, column, len(y), colour)
        out.append(np.round(y + noise, 4 if column == "force_n" else 5))
    return out
