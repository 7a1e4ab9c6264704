"""What differs between groups of trials: which parameter or cause, by how much, and what certainly did not change."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fes_pin.contrast.conditions import Trials, contrast_with_conditions, misread_change
from fes_pin.contrast.decide import inflation
from fes_pin.contrast.fits import Fits
from fes_pin.contrast.grouped import Grouped, Item
from fes_pin.contrast.groups import BY_GROUP, grouped_study
from fes_pin.contrast.result import Change, Contrast
from fes_pin.contrast.search import ContrastFound, ContrastSearch
from fes_pin.contrast.words import of_cause, of_nominal
from fes_pin.data.schema import IMPOSED
from fes_pin.data.study import Study
from fes_pin.data.trial import Trial
from fes_pin.diagnose.cause import ParameterEstimate
from fes_pin.diagnose.diagnosis import measured_study, split
from fes_pin.diagnose.experiment import SEPARABLE
from fes_pin.diagnose.long_records import searched_part
from fes_pin.diagnose.plausibility import check_study
from fes_pin.diagnose.remainder.driven import driven_remainder
from fes_pin.diagnose.remainder.open_set import Remainder, unexplained_remainder
from fes_pin.identify.distributions import normal_quantile
from fes_pin.identify.feedback import is_fed_back
from fes_pin.identify.lasting import words_of_smoothing
from fes_pin.models.catalogue import Catalogue, Source, catalogue_of
from fes_pin.models.model import Model
from fes_pin.models.nominal import nominal_model
from fes_pin.models.predictor import Doubt
from fes_pin.workers import Progress, in_parallel, one_thread_each

SEEN = 0.95
"""Power at which a change that was not found is called excluded."""
LEVEL = 0.01
"""Family-wise level of a claim, which a change that is excluded would have reached."""


def contrast(
    study: Study,
    after: Study | None = None,
    *,
    by: str = BY_GROUP,
    groups: Sequence[str] | None = None,
    library: Source | Sequence[Source] | None = None,
    seed: int = 0,
    progress: Progress | None = None,
) -> Contrast:
    """Find out what differs between groups of trials of one rig.

    Parameters
    ----------
    study
        With a group in every trial; or what was measured before.
    after
        A study of the same rig: the second group.
    by
        "group", or a condition that every trial states.
    groups
        Those that are compared, in this order; by default all, in the order of the study.
    library
        Causes beside those written here and installed; see `diagnose`.
    seed
        Of simulated critical values.
    progress
        Called with a share done and a few words.

    Returns
    -------
    Contrast

    Raises
    ------
    InputError
        For fewer than two groups, groups that do not exist, trials that belong to none, studies of different rigs, and
        as `diagnose`.
    """
    began = time.perf_counter()
    tell = progress or (lambda _share, _words: None)
    catalogue = catalogue_of(library)
    measured = measured_study(grouped_study(study, after, by, groups))
    joined, nominal = measured.study, nominal_model(measured.study)
    warnings = [*measured.warnings, *check_study(joined, nominal)]
    names = tuple(dict.fromkeys(t.group for t in joined.trials if t.group is not None))
    trials, driven, said = _by_group(joined, names, nominal)
    warnings += said
    if any(len(many) < 2 for many in trials.values()):
        warnings.append("a group has one trial only: how much repeats differ is judged from its parts")
    with one_thread_each():
        effects = catalogue.effects_for(nominal.rig)

        def run(those: Trials) -> tuple[Fits, ContrastFound]:
            made = Fits(nominal, those, effects, driven)
            return made, ContrastSearch(made, seed, tell).run()

        searched = contrast_with_conditions(nominal, trials, run)
        fits, found = searched.fits, searched.found
        tell(0.95, "what is left")
        left, said = _left(fits, found.best, seed)
    changes = [_change(fits, found, i, names, catalogue) for i in found.best.changes] + misread_change(searched)
    changes.sort(key=lambda c: c.p_value)
    unchanged, excluded, untestable = _not_changed(found, driven)
    said = [*said, *_smoothed(found.best, trials)]
    if left.unexplained:  # sizes that would have been seen are those beside a model that is right
        unchanged, excluded = {}, {}
        said = [*said, "beside what is left unexplained it cannot be said what did not change"]
    tell(1.0, "done")
    return Contrast(
        study=joined,
        groups=names,
        verdict="changed" if changes else "unexplained" if left.unexplained else "nothing_changed",
        changes=tuple(changes),
        common=_common(found.best),
        unchanged=unchanged,
        excluded=excluded,
        untestable=untestable,
        remainder=left,
        fit=found.best.fit,
        driven=driven,
        repeats=found.best.repeats,
        warnings=tuple([*warnings, *said]),
        wall_s=time.perf_counter() - began,
    )


def _by_group(study: Study, names: Sequence[str], nominal: Model) -> tuple[dict[str, list[Trial]], bool, list[str]]:
    """The trials of each group that are searched; whether the likelihood judges them; what is to be said."""
    train, _ = split(study)
    fed_back = is_fed_back(nominal.rig, train)
    trials: dict[str, list[Trial]] = {}
    warnings: list[str] = []
    for group in names:
        own = [t for t in train if t.group == group]
        trials[group], _, said = searched_part(own, study.schema, fed_back, len(names))
        warnings += [f"group {group}: {one}" for one in said]
    return trials, fed_back or any(t.kind == IMPOSED for t in train), warnings


def _smoothed(best: Grouped, trials: Trials) -> tuple[str, ...]:
    """What is to be said of readings of a driven rig that were smoothed: their noise lasts as long in all groups."""
    group, doubt = next(iter(best.weights.items()))
    return words_of_smoothing(doubt if isinstance(doubt, Doubt) else None, best.model.rig, trials[group][0])


def _common(best: Grouped) -> tuple[str, ...]:
    """Causes of all groups, but for those that differ in one."""
    differ = {i.name for i in best.changes}
    return tuple(i.name for i in best.items if i.group is None and i.name not in differ)


def _left(fits: Fits, best: Grouped, seed: int) -> tuple[Remainder, list[str]]:
    """What is left in some groups alone; what is left in all is an error of the model, and is said."""
    parts = in_parallel(lambda g: fits.part(best, g), list(fits.trials))
    test = driven_remainder if fits.driven else unexplained_remainder
    each = dict(zip(fits.trials, in_parallel(lambda f: test(f, seed), parts), strict=True))
    each = {g: _in_single_trials(fits, best, g, r, seed) if r.unexplained else r for g, r in each.items()}
    least = min(each.values(), key=lambda r: r.p_value)
    open_ = [g for g, r in each.items() if r.unexplained]
    p = min(1.0, len(each) * least.p_value)
    if len(open_) == len(each):
        words = "the model leaves something unexplained in every group; `diagnose` says what"
        return Remainder(False, p, least.where), [words]
    if not open_ or not p < LEVEL:
        return Remainder(False, p, None), []
    return Remainder(True, p, least.where), [f"something is left unexplained in the group {g}" for g in open_]


def _in_single_trials(fits: Fits, best: Grouped, group: str, left: Remainder, seed: int) -> Remainder:
    """What is left in a group, if half of its trials leave something, each with nominal values of its own.

    Trials whose strength or friction differs, of whatever group, leave something beside values that they share.
    """
    test = driven_remainder if fits.driven else unexplained_remainder
    alone = in_parallel(lambda k: fits.part(best, group, k), range(len(fits.trials[group])))
    p = min(1.0, 2.0 * float(np.median([test(one, seed).p_value for one in alone])))
    return replace(left, unexplained=p < LEVEL, p_value=max(left.p_value, p))


def _change(fits: Fits, found: ContrastFound, item: Item, groups: tuple[str, ...], catalogue: Catalogue) -> Change:
    best, model = found.best, found.best.model
    assert item.group is not None
    rest = found.without[item]
    wider = math.sqrt(max(1.0, inflation(fits, best, rest).phi))
    nominal = item.name in found.nominal.model.free
    paths = [item.name] if nominal else [n for n in model.models[item.group].parameters() if _is_of(item.name, n)]
    parameters: dict[str, dict[str, ParameterEstimate]] = {}
    for path in paths:
        here = model.models[item.group].parameter_info()[path]
        if here.optional:
            continue
        short = path.removeprefix(f"{item.name}.")
        parameters[short] = {}
        for group in groups:
            if path in model.models[group].parameters():
                key = model.path(path, group)
                std = best.fit.std(key) * wider if key in best.fit.free else 0.0
                parameters[short][group] = ParameterEstimate(best.fit.values[key], std, here.unit)
            elif here.null is not None:
                parameters[short][group] = ParameterEstimate(here.null, 0.0, here.unit)
    first = next(iter(parameters.values()))
    reference = next(g for g in groups if g != item.group)
    forward = groups.index(reference) < groups.index(item.group)
    one, two = (reference, item.group) if forward else (item.group, reference)
    if nominal:
        words = of_nominal(model.rig, item.name, first[one].value, first[two].value, first[one].unit)
    else:
        there = item.name in (e.name for e in model.models[one].effects)
        words = of_cause(catalogue.effect(item.name), first[one].value, first[two].value, first[one].unit, there)
    near = [
        f.items[-1].name
        for f in found.rivals[item]
        if (f.price if not _driven(best) else min(f.price, f.fit.sse + best.price - best.fit.sse))
        < best.price + SEPARABLE
    ]
    return Change(
        name=item.name,
        kind="nominal" if nominal else "effect",
        group=item.group,
        words=f"{words} (from {one} to {two})",
        parameters=parameters,
        equivalents=tuple(sorted(set(near) - {item.name})),
        p_value=found.p_values[item],
    )


def _driven(one: Grouped) -> bool:
    return any(hasattr(w, "white") for w in one.weights.values())


def _is_of(cause: str, path: str) -> bool:
    return path.split(".", maxsplit=1)[0] == cause


def _not_changed(
    found: ContrastFound, driven: bool
) -> tuple[dict[str, float], dict[str, ParameterEstimate], tuple[str, ...]]:
    """How large a change would have been seen: of what the model has as a share, of other causes in their units."""
    changed = {i.name for i in found.best.items}
    single = 1.0 - (1.0 - LEVEL) ** (1.0 / found.family.tests)
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


ABSORBED_BELOW = 0.04
"""Share of its norm that a sensitivity must keep to be testable, as in a diagnosis."""

__all__ = ["contrast"]
