"""Studies with hidden causes of a wanted size: integrated without the engine, sized by the engine's nominal refit."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from confusion_matrix.drafts import Draft, draft, run_trials, study_of, with_noise
from confusion_matrix.form import Form
from confusion_matrix.plan import Item
from fes_pin.data.study import Study

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
    distances
        d of each cause alone, as it came out.
    truth
        Parameters of the extended model by name, where the form is the engine's.
    """

    study: Study
    distances: tuple[float, ...]
    truth: Mapping[str, float]


def make(item: Item, folder: Path) -> Made:
    """Make a study.

    Parameters
    ----------
    folder
        For the URDF of a joint.
    """
    one, forms = sized(item, folder), item.forms()
    finest = max([COARSE, *(form.fine for form in forms)])
    (readings,) = run_trials([one], [one.sizes], forms, finest, pushed=True)
    return Made(study_of(one, with_noise(one, readings)), tuple(one.distances), true_values(one, forms))


def sized(item: Item, folder: Path) -> Draft:
    """A draft that knows how large each of its causes is."""
    one = draft(item, folder)
    shape(one, item.forms(), lambda k: item.rng(10 + k))
    for k, form in enumerate(item.forms()):
        size, d = size_of(one, k, form, item.distance)
        one.sizes.append(size)
        one.distances.append(d)
    return one


def shape(one: Draft, forms: Sequence[type[Form]], rng: Callable[[int], np.random.Generator]) -> None:
    """Draw the shape of each cause, about the angles of the motion without any."""
    if not forms:
        return
    (quiet,) = run_trials([one], [()], (), COARSE)
    angles = np.concatenate([y for y, p in zip(quiet, one.trials, strict=True) if p.kind == "motion"] or [[0.0]])
    one.shapes = [form.draw(rng(k), angles) for k, form in enumerate(forms)]


def size_of(one: Draft, k: int, form: type[Form], target: float) -> tuple[float, float]:
    """Size of the k-th cause, alone, at which the nominal model misses by d = `target`, and the d that it has."""
    from confusion_matrix.refit import noncentrality  # noqa: PLC0415

    tried: list[tuple[float, float]] = []
    best = (np.inf, form.unit, 0.0)
    for turn in range(ROUNDS):
        size = _propose(tried, form, target, turn)
        if size is None or best[0] <= CLOSE:
            break
        d = noncentrality(one, run_trials([one], [[size]], (form,), min(form.fine, 10), only=k)[0])
        tried.append((size, d))
        best = min(best, (abs(float(np.log(max(d, 1e-9) / target))), size, d))
    return best[1:]


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


def true_values(one: Draft, forms: Sequence[type[Form]]) -> dict[str, float]:
    """Parameters by name as the engine would have them; none where its form is another."""
    out: dict[str, float] = {}
    for form, size, shape in zip(forms, one.sizes, one.shapes, strict=True):
        own = form.truth(size, shape) if form.name == "same" else {}
        if not own:
            return {}
        out |= {f"{form.cause}.{n}": v for n, v in own.items()}
    nominal = dict(one.plant.true)
    if "force_length" in one.item.causes:  # the engine's factor is 1 at pi/2, so its gain is another one
        del nominal["gain"]
    return {**nominal, **out}
