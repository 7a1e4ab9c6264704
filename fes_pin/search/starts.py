"""Start values of the fit of a cause: next to its null, at a linear estimate, far from it, and in another form."""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from fes_pin.models.model import Model
from fes_pin.models.stage import Effect

STARTS = 2
"""Shapes from which a fit of a set starts, largest score first, if their score is `STARTED` of the largest."""
STARTED = 0.5
"""Share of the largest score from which a shape is fitted, and of the gain that a form needs, from which it is."""
TINY = 1e-6
"""Share of an amplitude's scale at which a one-sided effect is linearized: next to its null, on its own side."""
LATE = 0.02
"""The same of a lag, s, which must not vanish within a sample."""


def near_null(effect: type[Effect], name: str) -> float:
    """Return the null of an amplitude, or a value next to it where the null is a bound."""
    info, null = effect.parameters()[name], effect.nulls()[name]
    share = LATE if info.unit == "s" else TINY
    return null + (share * info.scale if null in {info.lower, info.upper} else 0.0)


def from_afar(effect: Effect, measured: Mapping[str, np.ndarray]) -> list[Effect]:
    """Return the effect at its far sizes on the measured trials; see `Effect.far_sizes`."""
    sizes: Mapping[str, Any] = effect.bounded(effect.far_sizes(measured))
    return [replace(effect, **{n: v}) for n, many in sizes.items() for v in many]


def started(effect: Effect, amplitudes: Mapping[str, float]) -> Effect:
    """Return the effect at a linear estimate of its amplitudes within bounds; next to its null where that is 0."""
    info = effect.parameters()
    values: dict[str, Any] = {}
    for name, value in amplitudes.items():
        nothing = abs(value - effect.nulls()[name]) < 1e-6 * info[name].scale
        values[name] = near_null(type(effect), name) if nothing else info[name].nearest(float(value))
    return replace(effect, **values)


def at_null(effect: Effect) -> Effect:
    """Return the effect next to its null."""
    return started(effect, {n: effect.nulls()[n] for n in effect.amplitudes()})


def refinements(model: Model, effect: Effect, measured: Mapping[str, np.ndarray]) -> list[Model]:
    """Return starts with one more refinement of an effect switched on.

    A value equal to the refinement's null switches nothing on and gives no start.
    """
    out, info, grids = [], effect.parameters(), effect.bounded(effect.grids(measured))
    for names in _lacking(model, effect):
        paths = [f"{effect.name}.{n}" for n in names]
        for values in itertools.product(*(grids[n] for n in names)):
            if values[0] != info[names[0]].null:
                out.append(model.with_parameters(dict(zip(paths, values, strict=True))))
    return out


def number_of_forms(model: Model, effects: Sequence[Effect]) -> int:
    """Return the number of refinements that a model's effects do not have, each a form that is tried; at least 1."""
    return max(1, sum(len(_lacking(model, e)) for e in effects))


def _lacking(model: Model, effect: Effect) -> list[tuple[str, ...]]:
    """Return the refinements for the model's rig that an effect does not have."""
    rigs, refined = {n: info.rigs for n, info in effect.parameters().items()}, effect.refined()
    others = (names for names in effect.refinements() if names[0] not in refined)
    return [names for names in others if not rigs[names[0]] or model.rig.is_one_of(rigs[names[0]])]
