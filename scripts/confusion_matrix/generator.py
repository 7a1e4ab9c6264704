"""Studies with hidden causes of a wanted size: integrated without the engine, sized by the engine's nominal refit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from confusion_matrix.dynamics import Lanes, simulate
from confusion_matrix.form import Form
from confusion_matrix.noise import LEVEL, random_torque, sensor_noise
from confusion_matrix.plan import Item
from confusion_matrix.rigs import Plant, Protocol, draw_plant, draw_trials, urdf_text
from confusion_matrix.stimuli import times
from fes_pin.data.study import Study
from fes_pin.data.trial import Trial
from fes_pin.identify.fit import Fit, fit_problem
from fes_pin.identify.noise import Noise
from fes_pin.identify.problem import Problem
from fes_pin.models.model import Model
from fes_pin.models.nominal import nominal_model
from fes_pin.models.rigs.base import Rig

WHITE = {name: Noise(level, (), level, 0.0) for name, level in LEVEL.items()}
FRESH = 2
"""Motion trials (for a muscle: isometric) of each study that the diagnosis never sees."""
COARSE = 5
"""Integration steps per sample that the bare rigs need: 1 kHz."""
CLOSE = 0.12
"""Share by which d may miss its target."""
ROUNDS = 5
COLUMN = {"ankle": "angle_rad", "joint": "position", "muscle": "force_n"}


@dataclass
class Draft:
    """A study before anything is hidden in it."""

    item: Item
    plant: Plant
    trials: list[Protocol]
    fresh: list[Protocol]
    shapes: list[dict[str, float]]
    sizes: list[float]
    distances: list[float]
    urdf: Path


@dataclass(frozen=True)
class Made:
    """A study and what is true of it.

    Attributes
    ----------
    fresh
        Noiseless trials that the study does not hold.
    sizes, distances
        Of each cause alone.
    truth
        Parameters of the extended model by name, where the form is the engine's.
    orthogonal
        d that remains beside the nearest single cause of the library, for a cause outside it.
    """

    item: Item
    study: Study
    fresh: tuple[Trial, ...]
    sizes: tuple[float, ...]
    distances: tuple[float, ...]
    truth: Mapping[str, float]
    orthogonal: float | None


def make(items: Sequence[Item], folder: Path) -> list[Made]:
    """Make studies that hide the same forms on the same rig.

    Parameters
    ----------
    folder
        For the URDFs of joints.
    """
    forms = items[0].forms()
    drafts = [draft(item, folder) for item in items]
    bare = _run(drafts, [()] * len(drafts), (), COARSE) if forms else []
    for one, quiet in zip(drafts, bare, strict=False):
        angles = np.concatenate([y for y, p in zip(quiet, one.trials, strict=True) if p.kind == "motion"] or [[0.0]])
        one.shapes = [form.draw(one.item.rng(10 + k), angles) for k, form in enumerate(forms)]
    quiet = [_size(drafts, k, form) for k, form in enumerate(forms)]
    finest = max([COARSE, *(form.fine for form in forms)])
    run = _run(drafts, [one.sizes for one in drafts], forms, finest, fresh=True)
    return [
        _made(one, forms, readings, quiet[0][i] if quiet else None)
        for i, (one, readings) in enumerate(zip(drafts, run, strict=True))
    ]


def draft(item: Item, folder: Path) -> Draft:
    """The rig and the trials of a study."""
    rng = item.rng(0)
    plant = draw_plant(rng, item.rig, 0.03 if item.form == "null" else 0.4)
    motion = 0 if item.rig == "muscle" else 8
    isometric = {"ankle": 3 if rng.random() < 2 / 3 else 0, "joint": 0, "muscle": 6}[item.rig]
    trials = draw_trials(rng, plant, motion, isometric)
    fresh = draw_trials(item.rng(1), plant, FRESH if motion else 0, 0 if motion else FRESH)
    if item.rig != "muscle":
        driven = trials[0].input is not None
        fresh = [p if driven or item.rig == "ankle" else Protocol(p.kind, None, p.conditions) for p in fresh]
        fresh = [p if p.input is not None or not driven else _driven(item, plant, p) for p in fresh]
    urdf = folder / f"{item.name}.urdf"
    if item.rig == "joint":
        urdf.write_text(urdf_text(plant.known), encoding="utf-8")
    return Draft(item, plant, trials, fresh, [], [], [], urdf)


def _driven(item: Item, plant: Plant, p: Protocol) -> Protocol:
    rng = item.rng(2)
    while (other := draw_trials(rng, plant, 1, 0)[0]).input is None:
        pass
    return Protocol(p.kind, other.input, p.conditions)


def _size(drafts: list[Draft], k: int, form: type[Form]) -> list[list[np.ndarray]]:
    """Find each study's size of one cause, alone; its noiseless readings at that size."""
    tried: list[list[tuple[float, float]]] = [[] for _ in drafts]
    best: list[tuple[float, float, float, list[np.ndarray]]] = [(np.inf, 0.0, 0.0, []) for _ in drafts]
    for turn in range(ROUNDS):
        open_ = [i for i in range(len(drafts)) if best[i][0] > CLOSE]
        sizes = [_propose(tried[i], form, drafts[i].item.distance, turn) for i in open_]
        open_ = [i for i, s in zip(open_, sizes, strict=True) if s is not None]
        sizes = [s for s in sizes if s is not None]
        if not open_:
            break
        part = [drafts[i] for i in open_]
        run = _run(part, [[s] for s in sizes], (form,), min(form.fine, 10), only=k)
        for i, size, readings in zip(open_, sizes, run, strict=True):
            d = noncentrality(drafts[i], readings)
            tried[i].append((size, d))
            miss = abs(np.log(max(d, 1e-9) / drafts[i].item.distance))
            if miss < best[i][0]:
                best[i] = (miss, size, d, readings)
    for one, (_, size, d, _readings) in zip(drafts, best, strict=True):
        one.sizes.append(size)
        one.distances.append(d)
    return [b[3] for b in best]


def _propose(tried: list[tuple[float, float]], form: type[Form], target: float, turn: int) -> float | None:
    """The next size to try; None if the largest has been tried and is too small."""
    if not tried:
        return form.unit
    known = [(np.log(s), np.log(d)) for s, d in tried if np.isfinite(d) and d > 1e-3]
    if not known:
        return form.unit * 0.1 ** (turn + 1)
    known.sort(key=lambda p: abs(p[1] - np.log(target)))
    slope = 1.0
    if len(known) > 1 and abs(known[0][0] - known[1][0]) > 1e-6:
        slope = float(np.clip((known[1][1] - known[0][1]) / (known[1][0] - known[0][0]), 0.3, 3.0))
    size = float(np.exp(known[0][0] + np.clip((np.log(target) - known[0][1]) / slope, -4.0, 4.0)))
    size = min(size, form.cap)
    return None if any(abs(size / s - 1.0) < 1e-3 for s, _ in tried) else size


def noncentrality(one: Draft, readings: list[np.ndarray]) -> float:
    """Root of what noiseless readings leave after the nominal refit, in units of white noise at the true level."""
    if not all(np.isfinite(y).all() for y in readings):
        return float("inf")
    fitted = nominal_fit(study_of(one, readings), one.plant.true)
    return float(np.sqrt(fitted.sse))


def nominal_fit(study: Study, true: Mapping[str, float], model: Model | None = None) -> Fit:
    """Fit a study's nominal model, or one that extends it, from the true values, with white noise at the true level."""
    extended = model or nominal_model(study)
    with np.errstate(all="ignore"):
        return fit_problem(Problem(extended, study.trials, WHITE), {**extended.parameters(), **true})


def study_of(one: Draft, readings: Sequence[np.ndarray]) -> Study:
    """The study with these readings."""
    trials = [
        _trial(one.plant.rig, f"{k:02d}", p, y) for k, (p, y) in enumerate(zip(one.trials, readings, strict=True))
    ]
    if one.plant.rig == "joint":
        files = {"urdf": one.urdf}
        return Study(one.item.name, "joint", {}, dict(one.plant.start), tuple(trials), files=files)
    return Study(one.item.name, one.plant.rig, dict(one.plant.known), dict(one.plant.start), tuple(trials))


def _trial(rig: str, name: str, p: Protocol, y: np.ndarray) -> Trial:
    column = "force_n" if p.kind == "isometric" else COLUMN[rig]
    drive = "effort" if rig == "joint" else "pulse_width_us"
    columns = {drive: p.input} if p.input is not None else {}
    conditions = {n: v for n, v in p.conditions.items() if n not in ("position0", "velocity0")}
    return Trial(name, p.kind, {**columns, column: y}, times(), conditions)


def _run(
    drafts: Sequence[Draft],
    sizes: Sequence[Sequence[float]],
    forms: Sequence[type[Form]],
    steps: int,
    *,
    fresh: bool = False,
    only: int = 0,
) -> list[list[np.ndarray]]:
    """Readings of every trial of every draft, all side by side."""
    each = [one.trials + (one.fresh if fresh else []) for one in drafts]
    owner = [i for i, trials in enumerate(each) for _ in trials]
    flat = [p for trials in each for p in trials]
    numbers = [drafts[i].plant.numbers() for i in owner]
    k = {n: np.array([x[n] for x in numbers]) for n in numbers[0]}
    for name, default in (("load_kg", 0.0), ("angle_rad", 1.8), ("position0", 0.0), ("velocity0", 0.0)):
        k[name] = np.array([p.conditions.get(name, default) for p in flat])
    k["number"] = np.concatenate([np.arange(len(trials)) for trials in each])
    count = len(times())
    drive = np.stack([p.input if p.input is not None else np.zeros(count) for p in flat], axis=1)
    moving = np.array([p.kind == "motion" for p in flat])
    torque = _torques(drafts, each, count) if fresh else None
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


def _torques(drafts: Sequence[Draft], each: Sequence[Sequence[Protocol]], count: int) -> np.ndarray | None:
    """Random torques of the studies whose noise has them, shape (n, L); fresh trials have none."""
    if not any(one.item.noise == "process" for one in drafts) or drafts[0].plant.rig == "muscle":
        return None
    columns = []
    for one, trials in zip(drafts, each, strict=True):
        rng = one.item.rng(3)
        colour, kind = rng.random(), rng.random()
        weight = one.plant.numbers()["damping"] / 0.075
        for n, _ in enumerate(trials):
            pushed = one.item.noise == "process" and kind < TORQUE_SHARE and n < len(one.trials)
            columns.append(random_torque(rng, count, weight, colour) if pushed else np.zeros(count))
    return np.stack(columns, axis=1)


TORQUE_SHARE = 0.6
"""Share of the third noise family that is a random torque; the rest is ARMA noise of the sensor."""


def _made(one: Draft, forms: Sequence[type[Form]], readings: list[np.ndarray], quiet: list[np.ndarray] | None) -> Made:
    count = len(one.trials)
    noisy = _with_noise(one, readings[:count])
    fresh = [
        _trial(one.plant.rig, f"fresh{k}", p, y)
        for k, (p, y) in enumerate(zip(one.fresh, readings[count:], strict=True))
    ]
    orthogonal = _orthogonal(one, quiet) if one.item.kind == "outside" and quiet else None
    truth = _truth(one, forms)
    return Made(one.item, study_of(one, noisy), tuple(fresh), tuple(one.sizes), tuple(one.distances), truth, orthogonal)


def _with_noise(one: Draft, readings: Sequence[np.ndarray]) -> list[np.ndarray]:
    rng = one.item.rng(3)
    colour, kind = rng.random(), rng.random()
    family = one.item.noise
    if family == "process":
        family = "arma" if kind >= TORQUE_SHARE or one.plant.rig == "muscle" else "white"
    out, own = [], one.item.rng(4)
    for p, y in zip(one.trials, readings, strict=True):
        column = "force_n" if p.kind == "isometric" else COLUMN[one.plant.rig]
        noise = sensor_noise(own, family, column, len(y), colour)
        out.append(np.round(y + noise, 4 if column == "force_n" else 5))
    return out


def _truth(one: Draft, forms: Sequence[type[Form]]) -> dict[str, float]:
    out: dict[str, float] = {}
    for form, size, shape in zip(forms, one.sizes, one.shapes, strict=True):
        own = form.truth(size, shape)
        if not own:
            return {}
        out |= {f"{form.cause}.{n}": v for n, v in own.items()}
    nominal = dict(one.plant.true)
    if "force_length" in one.item.causes:  # the engine's factor is 1 at pi/2, so its gain is another one
        del nominal["gain"]
    return {**nominal, **out}


def _orthogonal(one: Draft, quiet: list[np.ndarray]) -> float:
    """d that the nearest single cause of the library leaves, refitted jointly."""
    from fes_pin.models.effects import effects_for  # noqa: PLC0415

    study = study_of(one, quiet)
    rig: Rig = nominal_model(study).rig
    left = []
    for effect in effects_for(one.plant.rig):
        sse = nominal_fit(study, one.plant.true, Model(rig) + effect()).sse
        if np.isfinite(sse):
            left.append(sse)
    return float(np.sqrt(min(left)))
