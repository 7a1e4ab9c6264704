"""Studies with hidden causes of a wanted size: integrated without the engine, sized by the engine's nominal refit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from confusion_matrix.drafts import Draft, as_trial, draft, run_trials, sensor_family, study_of, with_noise
from confusion_matrix.form import Form
from confusion_matrix.noise import LEVEL, innovations
from confusion_matrix.plan import Item
from fes_pin.data.study import Study
from fes_pin.data.trial import Trial
from fes_pin.identify.fit import Fit, fit_problem
from fes_pin.identify.noise import Noise
from fes_pin.identify.problem import Problem
from fes_pin.models.model import Model
from fes_pin.models.nominal import nominal_model
from fes_pin.models.rigs.base import Rig

WHITE = {name: Noise(level, (), level, 0.0) for name, level in LEVEL.items()}
COARSE = 5
"""Integration steps per sample that the bare rigs need: 1 kHz."""
CLOSE = 0.12
"""Share by which d may miss its target."""
ROUNDS = 5


@dataclass(frozen=True)
class Made:
    """A study and what is true of it.

    Attributes
    ----------
    fresh
        Noiseless trials that the study does not hold.
    sizes, distances
        Of each cause alone.
    felt
        d of a single cause against the noise as it is; None with a random torque.
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
    felt: float | None
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
    drafts, quiet = sized(items, folder)
    finest = max([COARSE, *(form.fine for form in forms)])
    run = run_trials(drafts, [one.sizes for one in drafts], forms, finest, fresh=True)
    return [
        _made(one, forms, readings, quiet[0][i] if quiet else None)
        for i, (one, readings) in enumerate(zip(drafts, run, strict=True))
    ]


def sized(items: Sequence[Item], folder: Path) -> tuple[list[Draft], list[list[list[np.ndarray]]]]:
    """Drafts that know how large each of their causes is, and noiseless readings with each cause alone."""
    forms = items[0].forms()
    drafts = [draft(item, folder) for item in items]
    bare = run_trials(drafts, [()] * len(drafts), (), COARSE) if forms else []
    for one, quiet in zip(drafts, bare, strict=False):
        angles = np.concatenate([y for y, p in zip(quiet, one.trials, strict=True) if p.kind == "motion"] or [[0.0]])
        one.shapes = [form.draw(one.item.rng(10 + k), angles) for k, form in enumerate(forms)]
    return drafts, [_size(drafts, k, form) for k, form in enumerate(forms)]


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
        run = run_trials(part, [[s] for s in sizes], (form,), min(form.fine, 10), only=k)
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


def noise_as_it_is(item: Item) -> dict[str, Noise] | None:
    """The noise of a study's readings, by column; None where a random torque makes more of it."""
    family, colour = sensor_family(item)
    if item.noise == "process" and family == "white":
        return None
    return {n: Noise(*innovations(family, n, colour), level, 0.0) for n, level in LEVEL.items()}


def felt_noncentrality(one: Draft, readings: list[np.ndarray]) -> float | None:
    """The same, for the noise that the study has; None where it is a random torque."""
    noise = noise_as_it_is(one.item)
    return noise and float(np.sqrt(nominal_fit(study_of(one, readings), one.plant.true, noise=noise).sse))


def nominal_fit(
    study: Study, true: Mapping[str, float], model: Model | None = None, noise: Mapping[str, Noise] = WHITE
) -> Fit:
    """Fit a study's nominal model, or one that extends it, from the true values."""
    extended = model or nominal_model(study)
    with np.errstate(all="ignore"):
        return fit_problem(Problem(extended, study.trials, noise), {**extended.parameters(), **true})


def _made(one: Draft, forms: Sequence[type[Form]], readings: list[np.ndarray], quiet: list[np.ndarray] | None) -> Made:
    count = len(one.trials)
    noisy = with_noise(one, readings[:count])
    fresh = [
        as_trial(one.plant.rig, f"fresh{k}", p, y)
        for k, (p, y) in enumerate(zip(one.fresh, readings[count:], strict=True))
    ]
    orthogonal = _orthogonal(one, quiet) if one.item.kind == "outside" and quiet else None
    truth = true_values(one, forms)
    felt = felt_noncentrality(one, quiet) if quiet and one.item.kind == "single" else None
    return Made(
        one.item, study_of(one, noisy), tuple(fresh), tuple(one.sizes), tuple(one.distances), felt, truth, orthogonal
    )


def true_values(one: Draft, forms: Sequence[type[Form]]) -> dict[str, float]:
    """Parameters by name as the engine would have them; none where its form is another."""
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
