"""What goes wrong in laboratories and leaves files that can be read: each makes a study of a study."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial

import numpy as np

from fes_pin.data.errors import InputError
from fes_pin.data.study import Study
from fes_pin.data.trial import Trial

INPUTS = ("pulse_width_us", "stim", "effort")
Odd = Callable[[Study, np.random.Generator], Study]


def _each(study: Study, change: Callable[[Trial], Trial]) -> Study:
    return replace(study, trials=tuple(change(t) for t in study.trials))


def _outputs(study: Study, change: Callable[[np.ndarray], np.ndarray], only: int | None = None) -> Study:
    def changed(trial: Trial) -> Trial:
        return trial.with_columns(**{n: change(v) for n, v in trial.columns.items() if n not in INPUTS})

    return _each(study, lambda t: changed(t) if only is None or t is study.trials[only] else t)


def _inputs(study: Study, change: Callable[[np.ndarray], np.ndarray]) -> Study:
    def changed(trial: Trial) -> Trial:
        return trial.with_columns(**{n: change(v) for n, v in trial.columns.items() if n in INPUTS})

    return _each(study, changed)


def _late(study: Study, seconds: float) -> Study:
    def later(trial: Trial) -> Trial:
        count = min(round(seconds / trial.dt), len(trial))
        moved = {n: np.r_[np.zeros(count), v[: len(v) - count]] for n, v in trial.columns.items() if n in INPUTS}
        return trial.with_columns(**moved)

    return _each(study, later)


def _timed(study: Study, change: Callable[[np.ndarray], np.ndarray]) -> Study:
    return _each(study, lambda t: replace(t, time=change(t.time)))


def _held(values: np.ndarray, count: int) -> np.ndarray:
    return np.repeat(values[::count], count)[: len(values)]


def _dropout(values: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    out, begin = values.copy(), int(rng.integers(len(values)))
    out[begin : begin + int(rng.integers(2, len(values)))] = values[begin]
    return out


def _swapped(study: Study, rng: np.random.Generator) -> Study:
    order = rng.permutation(len(study.trials))
    trials = []
    for k, trial in zip(order, study.trials, strict=True):
        other = study.trials[k]
        names = [n for n in trial.columns if n not in INPUTS]
        able = len(other) == len(trial) and all(n in other for n in names)
        trials.append(trial.with_columns(**{n: other[n] for n in names}) if able else trial)
    return replace(study, trials=tuple(trials))


def _cut(study: Study, rows: int) -> Study:
    return _each(study, lambda t: t.first(rows))


def _unequal(study: Study, rng: np.random.Generator) -> Study:
    return _each(study, lambda t: t.first(int(rng.integers(3, len(t) + 1))))


def _rates(study: Study, rng: np.random.Generator) -> Study:
    def coarser(trial: Trial) -> Trial:
        k = int(rng.integers(1, 5))
        if len(trial) < 4 * k:
            return trial
        return replace(trial, columns={n: v[::k] for n, v in trial.columns.items()}, time=trial.time[::k])

    return _each(study, coarser)


def _start(study: Study, rng: np.random.Generator, size: float) -> Study:
    start = {n: v * 10.0 ** float(rng.uniform(-size, size)) for n, v in study.start.items()}
    return replace(study, start=start)


def _constants(study: Study, rng: np.random.Generator) -> Study:
    if not study.constants:
        return study
    name = str(rng.choice([n for n in study.constants if not n.endswith("_us")] or ["none"]))
    if name == "none":
        return study
    return replace(study, constants={**study.constants, name: study.constants[name] * 10.0 ** rng.uniform(-3, 3)})


def _conditions(study: Study, rng: np.random.Generator) -> Study:
    factor = 10.0 ** float(rng.uniform(-3, 3))
    return _each(study, lambda t: replace(t, conditions={n: v * factor for n, v in t.conditions.items()}))


def _clipped(study: Study, rng: np.random.Generator) -> Study:
    def clip(values: np.ndarray) -> np.ndarray:
        low, high = np.quantile(values, sorted(rng.uniform(0.0, 1.0, 2)))
        return np.clip(values, low, high)

    return _outputs(study, clip)


def _velocity(study: Study, rng: np.random.Generator) -> Study:
    if study.rig != "joint":
        return study
    return _each(study, lambda t: t.with_columns(velocity=rng.standard_normal(len(t))))


def _spiked(values: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    out = values.copy()
    out[rng.integers(len(out), size=int(rng.integers(1, 6)))] *= 10.0 ** rng.uniform(0.5, 8)
    return out


def _free(study: Study) -> Study:
    if study.rig != "joint":
        return study
    return _each(study, lambda t: replace(t, columns={n: v for n, v in t.columns.items() if n != "effort"}))


ODDITIES: Mapping[str, Odd] = {
    "late_50_ms": lambda s, r: _late(s, 0.05),
    "late_2_s": lambda s, r: _late(s, 2.0),
    "early": lambda s, r: _inputs(s, lambda u: np.roll(u, -int(r.integers(1, len(u))))),
    "reversed_input": lambda s, r: _inputs(s, lambda u: u[::-1]),
    "no_input": lambda s, r: _inputs(s, np.zeros_like),
    "faint_input": lambda s, r: _inputs(s, lambda u: (u > 1e9) * 1.0 if set(np.unique(u)) <= {0.0, 1.0} else 0.1 * u),
    "constant_input": lambda s, r: _inputs(s, lambda u: np.full_like(u, u.max())),
    "huge_input": lambda s, r: _inputs(s, lambda u: u if u.max() <= 1.0 and u.min() >= 0 else 1e6 * u),
    "free": lambda s, r: _free(s),
    "dropout": lambda s, r: _outputs(s, lambda y: _dropout(y, r)),
    "held": lambda s, r: _outputs(s, lambda y: _held(y, int(r.integers(2, 30)))),
    "constant": lambda s, r: _outputs(s, lambda y: np.full_like(y, y[0])),
    "constant_one": lambda s, r: _outputs(s, lambda y: np.full_like(y, y[0]), int(r.integers(len(s.trials)))),
    "zero": lambda s, r: _outputs(s, np.zeros_like),
    "degrees": lambda s, r: _outputs(s, np.degrees),
    "millimetres": lambda s, r: _outputs(s, lambda y: 1e3 * y),
    "scaled": lambda s, r: _outputs(s, partial(np.multiply, 10.0 ** r.uniform(-12, 12))),
    "inverted": lambda s, r: _outputs(s, np.negative),
    "shifted": lambda s, r: _outputs(s, partial(np.add, 10.0 ** r.uniform(-2, 9))),
    "ramp": lambda s, r: _outputs(s, lambda y: y + np.linspace(0.0, 10.0 ** r.uniform(-2, 4), len(y))),
    "noise_alone": lambda s, r: _outputs(s, lambda y: r.standard_normal(len(y))),
    "walk": lambda s, r: _outputs(s, lambda y: y + 0.1 * np.cumsum(r.standard_normal(len(y)))),
    "rounded": lambda s, r: _outputs(s, partial(np.round, decimals=int(r.integers(0, 3)))),
    "clipped": _clipped,
    "spiked": lambda s, r: _outputs(s, lambda y: _spiked(y, r)),
    "hum": lambda s, r: _outputs(s, lambda y: y + np.sin(0.9 * np.pi * np.arange(len(y)))),
    "swapped": _swapped,
    "other_velocity": _velocity,
    "milliseconds": lambda s, r: _timed(s, lambda t: 1e3 * t),
    "minutes": lambda s, r: _timed(s, lambda t: t / 60.0),
    "epoch": lambda s, r: _timed(s, lambda t: t + 1.6e9),
    "before_zero": lambda s, r: _timed(s, lambda t: t - 100.0),
    "three_rows": lambda s, r: _cut(s, 3),
    "few_rows": lambda s, r: _cut(s, int(r.integers(3, 40))),
    "unequal": _unequal,
    "rates": _rates,
    "one_trial": lambda s, r: replace(s, trials=s.trials[:1]),
    "start_off": lambda s, r: _start(s, r, 1.0),
    "start_far_off": lambda s, r: _start(s, r, 6.0),
    "constants_off": _constants,
    "conditions_off": _conditions,
    "one_held_out": lambda s, r: replace(s, trials=(replace(s.trials[0], role="held_out"), *s.trials[1:])),
    "all_held_out": lambda s, r: _each(s, lambda t: replace(t, role="held_out")),
    "same_trial_twice": lambda s, r: replace(s, trials=(*s.trials, replace(s.trials[0], name="again"))),
}


def odd_study(study: Study, rng: np.random.Generator) -> tuple[str, Study]:
    """A study with one to three oddities, and their names; what cannot be built is left as it was."""
    chosen = [str(n) for n in rng.choice(list(ODDITIES), size=int(rng.integers(1, 4)), replace=False)]
    for name in chosen:
        with contextlib.suppress(InputError):
            study = ODDITIES[name](study, rng)
    return "+".join(chosen), study
