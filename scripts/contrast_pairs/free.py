"""Ankles, muscles and free or driven joints with a change in one group, from the generator of the confusion matrix."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from confusion_matrix.drafts import Draft, draft, run_trials, study_of, with_noise
from confusion_matrix.form import Form
from confusion_matrix.generator import shape, size_of
from confusion_matrix.noise import FAMILIES
from confusion_matrix.plan import FORMS, Item

from fes_pin.data.study import Study

NOMINAL = {
    "ankle": ("gain", "time_constant_s", "inertia_kgm2", "damping_nms"),
    "muscle": ("gain", "time_constant_s"),
    "joint": ("inertia_scale", "damping"),
}
"""Nominal parameters that are changed, by rig."""
CAUSES = {
    "ankle": (
        *("threshold_shift", "recruitment_curvature", "fatigue", "electromechanical_delay", "coulomb_friction"),
        *("second_order_activation", "rise_fall_asymmetry", "force_velocity", "quadratic_damping", "joint_stop"),
        *("parallel_stiffness", "passive_relaxation", "load_inertia", "base_tilt", "load_error"),
        *("sensor_offset", "sensor_gain", "sensor_drift", "sensor_lag", "mains_hum"),
    ),
    "muscle": ("threshold_shift", "fatigue", "electromechanical_delay", "sensor_offset", "recruitment_curvature"),
    "joint": ("coulomb_friction", "quadratic_damping", "parallel_stiffness", "effort_offset", "sensor_gain"),
}
FACTORS = (1.1, 1.6)
"""A nominal parameter is multiplied or divided by a factor between these."""
SCATTER = 0.003
"""Every other study has trials in which the strength, or a joint's damping, scatters by this share."""


def free_pair(rig: str, changes: Sequence[str], distance: float, seed: int, folder: Path) -> Study:
    """A study of two groups; the second has the changes.

    Parameters
    ----------
    changes
        Nominal parameters and causes by name.
    distance
        d of a cause, if all trials had it: see `confusion_matrix`.
    """
    item = Item(rig, (), "decoy", round(distance), FAMILIES[seed % 3], seed)
    one = draft(item, folder)
    rng = np.random.default_rng([seed, 77])
    forms = [_form(name) for name in changes if name not in NOMINAL[rig]]
    if forms and rig == "joint":
        while one.trials[0].input is None:  # what an effort shows, a free swing may not
            item = replace(item, seed=item.seed + 1000)
            one = draft(item, folder)
    shape(one, forms, lambda _: rng)
    sizes = [size_of(one, k, form, distance)[0] for k, form in enumerate(forms)]
    other = _changed(one, [n for n in changes if n in NOMINAL[rig]], rng)
    steps = max([5, *(form.fine for form in forms)])
    scattered = seed % 2 == 1
    before = _read(one, [], (), steps, scattered, rng)
    after = _read(other, sizes, forms, steps, scattered, rng)
    late = [k // 2 % 2 == 1 for k in range(len(one.trials))]
    readings = [after[k] if late[k] else before[k] for k in range(len(late))]
    study = study_of(one, with_noise(one, readings))
    labels = ("after" if x else "before" for x in late)
    return replace(study, trials=tuple(replace(t, group=g) for t, g in zip(study.trials, labels, strict=True)))


def _form(cause: str) -> type[Form]:
    """The first form of a cause that the generator has."""
    return next(f for f in FORMS if f.cause == cause)


def _changed(one: Draft, names: Sequence[str], rng: np.random.Generator) -> Draft:
    true = dict(one.plant.true)
    for name in names:
        true[name] *= float(rng.uniform(*FACTORS)) ** float(rng.choice((-1.0, 1.0)))
    return replace(one, plant=replace(one.plant, true=true))


def _read(
    one: Draft,
    sizes: Sequence[float],
    forms: Sequence[type[Form]],
    steps: int,
    scattered: bool,
    rng: np.random.Generator,
) -> list[np.ndarray]:
    """Noiseless readings of all trials, with a random torque where the family has one, or with trials that scatter."""
    if not scattered:
        return run_trials([one], [sizes], forms, steps, pushed=True)[0]
    name = "damping" if one.plant.rig == "joint" else "gain"
    alone = []
    for k, trial in enumerate(one.trials):
        true = {**one.plant.true, name: one.plant.true[name] * float(1.0 + SCATTER * rng.standard_normal())}
        alone.append(replace(one, plant=replace(one.plant, true=true), trials=[trial]))
        alone[k].shapes = one.shapes
    return [y[0] for y in run_trials(alone, [sizes] * len(alone), forms, steps)]
