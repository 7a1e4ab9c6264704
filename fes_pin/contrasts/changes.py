"""Reports of each change, and of parameters and causes that did not change."""

import math
from collections.abc import Sequence

import numpy as np

from fes_pin.contrasts.grouped import Grouped
from fes_pin.contrasts.models import ContrastModels, Found
from fes_pin.contrasts.words import of_cause, of_nominal
from fes_pin.data.trial import Trial
from fes_pin.data.units import own_unit
from fes_pin.faults.misread import NAME, Misread
from fes_pin.infer.family import least_seen
from fes_pin.infer.keys import Key
from fes_pin.infer.levels import CLAIM_LEVEL, IDENTIFIABLE_SHARE
from fes_pin.infer.result import Change, Evidence, ParameterEstimate
from fes_pin.models.describe import fitted_equation


def change_of(models: ContrastModels, found: Found, item: Key, evidence: Evidence | None) -> Change:
    """Return one change of the result: its size in each group, in words, and its equivalents."""
    best, model, groups = found.best, found.best.grouped, tuple(found.best.grouped.models)
    wider = math.sqrt(max(1.0, models.spread(best, *models.under_noise_of(best, [found.without[str(item)]])).phi))
    parameters = _by_group(best, item, wider)
    first = next(iter(parameters.values()))
    one, two = sorted((item.group, next(g for g in groups if g != item.group)), key=groups.index)
    effect = next((e for e in model.models[item.group].effects if e.name == item.name), None)
    if effect is None:
        words = of_nominal(model.rig, item.name, first[one].value, first[two].value, first[one].unit)
    else:
        there = item.name in (e.name for e in model.models[one].effects)
        words = of_cause(model.rig, effect, first[one].value, first[two].value, first[one].unit, there)
    return Change(
        name=item.name,
        kind="effect" if effect else "nominal",
        group=item.group,
        words=f"{words} (from {one} to {two})",
        equation=fitted_equation(effect, model.rig) if effect else "",
        parameters=parameters,
        equivalents=_equivalents(models, found, item),
        p_value=found.p_values[str(item)],
        evidence=evidence,
    )


def _by_group(best: Grouped, item: Key, wider: float) -> dict[str, dict[str, ParameterEstimate]]:
    """Return each parameter of a change in each group, with widened deviations; its null where a group has none."""
    model = best.grouped
    own = model.models[item.group]
    unused = own.unused_parameters()
    parameters: dict[str, dict[str, ParameterEstimate]] = {}
    for path in [n for n in own.parameters() if n.partition(".")[0] == item.name]:
        here = own.parameter_info()[path]
        if path in unused:
            continue
        parameters[path.removeprefix(f"{item.name}.")] = values = {}
        for group in model.models:
            if path in model.models[group].parameters():
                values[group] = ParameterEstimate.of(best, model.path(path, group), here.unit, wider)
            elif here.null is not None:
                values[group] = ParameterEstimate(here.null, 0.0, here.unit)
    return parameters


def _equivalents(models: ContrastModels, found: Found, item: Key) -> tuple[str, ...]:
    """Return the names of the equivalents of a change."""
    near = models.equivalents(found.best, found.without[str(item)], found.rivals[str(item)])
    return tuple(sorted({i.name for rival in near for i in rival.items - found.best.items} - {item.name}))


def not_changed(
    models: ContrastModels, best: Grouped
) -> tuple[dict[str, float], dict[str, ParameterEstimate], tuple[str, ...]]:
    """Return the sizes above which changes are excluded at 95 % power.

    Returns
    -------
    tuple
        For parameters of the model, shares of their values by name; for other causes, sizes in their units by name; and
        the names of parameters and causes whose change is not testable.
    """
    reach, named = least_seen(CLAIM_LEVEL, models.family.tests), {i.name for i in best.items}
    values, units, largest, seen = best.values, best.grouped.rig.units(), dict[str, float](), dict[str, str]()
    for one in models.screen.scores(best).scored:
        name, size = one.item.name, reach * one.deviation * math.sqrt(max(one.spread.phi, 1.0))
        if not one.item.group or name in named or not values.get(name, 1.0):
            continue
        largest[name] = max(largest.get(name, 0.0), size / abs(values.get(name, 1.0)))
        if one.effect is not None and one.kept >= IDENTIFIABLE_SHARE:
            seen[name] = one.effect.parameters()[one.effect.amplitudes()[0]].in_units(units).unit
    unchanged, most = (
        {n: v for n, v in largest.items() if n in values and v < 1.0},
        ranges(best.trials, units["q"] == "rad"),
    )
    known = {n: unit for n, unit in seen.items() if math.isfinite(v := largest[n]) and v <= most.get(unit, v)}
    excluded = {n: ParameterEstimate(largest[n], 0.0, unit) for n, unit in known.items()}
    return unchanged, excluded, tuple(sorted({*largest} - {*excluded, *unchanged}))


def ranges(trials: Sequence[Trial], revolute: bool) -> dict[str, float]:
    """Return the largest range of the columns of trials by their unit: a larger size is none that these data show."""
    out: dict[str, float] = {}
    for trial in trials:
        for name, values in trial.columns.items():
            unit = own_unit(name, revolute)
            out[unit] = max(out.get(unit, 0.0), float(np.ptp(values[np.isfinite(values)])))
    return out


def misread_change(models: ContrastModels, misread: Misread) -> Change:
    """Return a restated trial as a change of its group."""
    group = next(g for g, many in models.trials.items() if misread.trial in (t.name for t in many))
    return Change(
        name=NAME,
        kind="condition",
        group=group,
        words=misread.words,
        parameters={misread.condition: {group: misread.estimate}},
        equivalents=(),
        p_value=misread.p_value,
        trial=misread.trial,
    )
