"""What is said of each change, and of what did not change."""

from __future__ import annotations

import math

import numpy as np

from fes_pin.contrasts.decide import inflation
from fes_pin.contrasts.fits import Fits
from fes_pin.contrasts.grouped import Grouped, Item
from fes_pin.contrasts.search import ContrastFound
from fes_pin.contrasts.words import of_cause, of_nominal
from fes_pin.infer.distributions import normal_quantile
from fes_pin.infer.levels import ABSORBED_BELOW, CLAIM_LEVEL, SEPARABLE
from fes_pin.infer.result import Change, ParameterEstimate
from fes_pin.models.catalogue import Catalogue

SEEN = 0.95
"""Power at which a change that was not found is called excluded."""


def change_of(fits: Fits, found: ContrastFound, item: Item, groups: tuple[str, ...], catalogue: Catalogue) -> Change:
    """What is said of one change: its size in each group, in words, and what it cannot be told from."""
    best, model = found.best, found.best.model
    assert item.group is not None
    wider = math.sqrt(max(1.0, inflation(fits, best, found.without[item]).phi))
    nominal = item.name in found.nominal.model.free
    parameters = _by_group(best, item, groups, nominal, wider)
    first = next(iter(parameters.values()))
    reference = next(g for g in groups if g != item.group)
    forward = groups.index(reference) < groups.index(item.group)
    one, two = (reference, item.group) if forward else (item.group, reference)
    if nominal:
        words = of_nominal(model.rig, item.name, first[one].value, first[two].value, first[one].unit)
    else:
        there = item.name in (e.name for e in model.models[one].effects)
        words = of_cause(catalogue.effect(item.name), first[one].value, first[two].value, first[one].unit, there)
    return Change(
        name=item.name,
        kind="nominal" if nominal else "effect",
        group=item.group,
        words=f"{words} (from {one} to {two})",
        parameters=parameters,
        equivalents=_equivalents(found, item),
        p_value=found.p_values[item],
    )


def _by_group(
    best: Grouped, item: Item, groups: tuple[str, ...], nominal: bool, wider: float
) -> dict[str, dict[str, ParameterEstimate]]:
    """Each parameter of what changed in each group, with deviations so much wider; its null where a group has none."""
    model = best.model
    assert item.group is not None
    own = model.models[item.group]
    parameters: dict[str, dict[str, ParameterEstimate]] = {}
    for path in [item.name] if nominal else [n for n in own.parameters() if n.split(".", maxsplit=1)[0] == item.name]:
        here = own.parameter_info()[path]
        if here.optional:
            continue
        parameters[path.removeprefix(f"{item.name}.")] = values = {}
        for group in groups:
            if path in model.models[group].parameters():
                values[group] = ParameterEstimate.of(best.fit, model.path(path, group), here.unit, wider)
            elif here.null is not None:
                values[group] = ParameterEstimate(here.null, 0.0, here.unit)
    return parameters


def _equivalents(found: ContrastFound, item: Item) -> tuple[str, ...]:
    """What could stand in a change's place."""
    best = found.best
    near = [
        f.items[-1].name
        for f in found.rivals[item]
        if (f.price if not best.is_driven else min(f.price, f.fit.sse + best.price - best.fit.sse))
        < best.price + SEPARABLE
    ]
    return tuple(sorted(set(near) - {item.name}))


def not_changed(found: ContrastFound) -> tuple[dict[str, float], dict[str, ParameterEstimate], tuple[str, ...]]:
    """How large a change would have been seen: of what the model has as a share, of other causes in their units."""
    changed = {i.name for i in found.best.items}
    single = 1.0 - (1.0 - CLAIM_LEVEL) ** (1.0 / found.family.tests)
    reach = normal_quantile(1.0 - 0.5 * single) + normal_quantile(SEEN)
    unchanged: dict[str, float] = {}
    sizes: dict[str, list[tuple[float, str, float]]] = {}
    model, info = found.best.model, found.best.model.parameter_info()
    for one in found.promises:
        if one.item.group is None:
            continue
        size = reach * one.deviation * math.sqrt(max(one.spread, 1.0))
        if one.effect is None:
            path = one.item.name
            if path in info and path not in changed and model.parameters()[path]:
                unchanged[path] = max(unchanged.get(path, 0.0), size / abs(model.parameters()[path]))
        elif one.item.name not in changed:
            name = one.effect.amplitudes()[0]
            unit = one.effect.parameters()[name].in_units(model.rig.units()).unit
            sizes.setdefault(one.item.name, []).append((size, unit, one.kept))
    excluded = {
        n: ParameterEstimate(max(s for s, _, _ in many), 0.0, many[0][1])
        for n, many in sizes.items()
        if max(k for _, _, k in many) >= ABSORBED_BELOW and np.isfinite(max(s for s, _, _ in many))
    }
    unseen = [n for n in sizes if n not in excluded]
    unseen += [n for n, v in unchanged.items() if not v < 1.0]
    return {n: v for n, v in unchanged.items() if v < 1.0}, excluded, tuple(sorted(unseen))
