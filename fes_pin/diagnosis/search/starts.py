"""Where the fit of a cause starts: next to its null, at a linear estimate, far from it, and in another form."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from fes_pin.models.model import Model
from fes_pin.models.parameters import ParameterInfo
from fes_pin.models.stage import Effect

STARTS = 2
"""Shapes that a fit of a set starts from, largest score first, if it is half the largest at least."""
TINY = 0.02
"""Share of an amplitude's scale at which a one-sided effect is linearized: next to its null, on its own side."""


def near_null(effect: type[Effect], name: str) -> float:
    """The null of an amplitude, or next to it where that is a bound."""
    info, null = effect.parameters()[name], effect.nulls()[name]
    return null + (TINY * info.scale if null in {info.lower, info.upper} else 0.0)


def from_afar(effect: Effect, measured: Mapping[str, np.ndarray]) -> list[Effect]:
    """The effect at the sizes that it has of itself, on what was measured."""
    chosen: list[dict[str, Any]] = [{n: value} for n, many in effect.far_sizes(measured).items() for value in many]
    return [replace(effect, **one) for one in chosen]


def started(effect: Effect, amplitudes: Mapping[str, float]) -> Effect:
    """The effect at a linear estimate of its amplitudes, within bounds; next to its null where that says nothing."""
    info = effect.parameters()
    values: dict[str, Any] = {}
    for name, value in amplitudes.items():
        nothing = abs(value - effect.nulls()[name]) < 1e-6 * info[name].scale
        values[name] = near_null(type(effect), name) if nothing else info[name].nearest(float(value))
    return replace(effect, **values)


def refinements(
    model: Model, effect: Effect, measured: Mapping[str, np.ndarray], barred: str | None = None
) -> list[Model]:
    """Starts with one more refinement of an effect switched on, but for one that is barred.

    A value that is the refinement's null, as the way of an imposed motion where none is, switches nothing on.
    """
    out, info, refined, grids = [], effect.parameters(), effect.refined(), effect.grids(measured)
    for names in effect.refinements():
        if names[0] in refined or names[0] == barred or not fits_rig(model, info[names[0]]):
            continue
        paths = [f"{effect.name}.{n}" for n in names]
        for values in itertools.product(*(grids[n] for n in names)):
            if values[0] != info[names[0]].null:
                out.append(model.with_parameters(dict(zip(paths, values, strict=True))))
    return out


def number_of_forms(model: Model, effects: Sequence[Effect]) -> int:
    """How many other forms of a model's effects are tried: the refinements that they have not adopted; at least 1."""
    each = ((e, n) for e in effects for n, *_ in e.refinements() if n not in e.refined())
    return max(1, sum(fits_rig(model, e.parameters()[n]) for e, n in each))


def fits_rig(model: Model, refinement: ParameterInfo) -> bool:
    """True if a refinement is for the model's rig."""
    return not refinement.rigs or model.rig.is_one_of(refinement.rigs)


def restarted_forms(model: Model, effect: Effect, measured: Mapping[str, np.ndarray]) -> list[Model]:
    """The start of an effect with several refinements from their most likely values; none of others."""
    adopted = [names for names in effect.refinements() if names[0] in effect.refined()]
    if len(adopted) < 2:
        return []
    grids = effect.grids(measured)
    starts = {f"{effect.name}.{n}": grids[n][0] for names in adopted for n in names if len(grids[n])}
    return [model.with_parameters(starts)]
