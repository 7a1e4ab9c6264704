"""The groups of a contrast: trials of one study by their label, or two studies of one rig."""

from collections.abc import Sequence
from dataclasses import replace

from fes_pin.data.errors import InputError
from fes_pin.data.numbers import instance
from fes_pin.data.study import Study
from fes_pin.data.trial import Trial, derived_trial

BY_GROUP = "group"


def grouped_study(study: Study, other: Study | None, by: str, chosen: Sequence[str] | None) -> Study:
    """Return one study whose trials all have a group, without trials of groups that were not chosen.

    Raises
    ------
    InputError
        For fewer than two groups, groups that do not exist, trials that belong to none, studies of different rigs.
    """
    if study.rig == "body":
        raise InputError("expected a rig whose trials are simulated; walking has no contrast", file=study.folder)
    labelled = _labelled(study, by) if other is None else _joined(study, instance(other, Study, "after"))
    order = _order(labelled, chosen)
    trials = [t for g in order for t in labelled.trials if t.group == g]
    fitted = {t.group for t in trials if t.role != "held_out"}
    for group in order:
        if group not in fitted:
            raise InputError(f"group {group!r} has no trial to fit: all have role = held_out", file=study.folder)
    return replace(labelled, trials=tuple(trials))


def _order(study: Study, chosen: Sequence[str] | None) -> list[str]:
    """Return the groups that are compared, in their order: those that were chosen, or all."""
    groups = list(in_groups(study.trials))
    if chosen is not None:
        instance(chosen, Sequence, "groups")
    chosen = (chosen,) if isinstance(chosen, str) else chosen
    for name in chosen or ():
        if name not in groups:
            raise InputError(f"no group {name!r}; expected some of {', '.join(groups)}", file=study.folder)
    order = list(dict.fromkeys(chosen)) if chosen else groups
    if len(order) < 2:
        found = f"only {order[0]!r}" if order else "none"
        raise InputError(f"expected at least two groups to contrast, found {found}", file=study.folder)
    return order


def in_groups(trials: Sequence[Trial]) -> dict[str, list[Trial]]:
    """Return trials by their group, groups in the order of their first trials."""
    out: dict[str, list[Trial]] = {}
    for trial in trials:
        out.setdefault(str(trial.group), []).append(trial)
    return out


def _labelled(study: Study, by: str) -> Study:
    if by == BY_GROUP:
        labels: list[str | None] = [t.group for t in study.trials]
        expected = 'group = "..." in every [[trial]]' if study.document else "every trial in one"
    else:
        labels = [f"{t.conditions[by]:g}" if by in t.conditions else None for t in study.trials]
        expected = f"{BY_GROUP}, or a condition that every trial states"
    for trial, label in zip(study.trials, labels, strict=True):
        if label is None:
            message = f"trial {trial.name} has no {by}; expected {expected}"
            raise InputError(message, file=study.document, column=by)
    trials = [derived_trial(t, group=label) for t, label in zip(study.trials, labels, strict=True)]
    return replace(study, trials=tuple(trials))


def _joined(before: Study, after: Study) -> Study:
    """Return two studies of one rig as one, each a group by its name."""
    if before.rig != after.rig:
        raise InputError(f"expected a study of the rig {before.rig}, found {after.rig}", file=after.folder)
    for name in sorted(set(before.constants) | set(after.constants)):
        one, two = before.constants.get(name), after.constants.get(name)
        if one != two:
            message = f"expected the rig of {before.name} with {name} = {one}, found {two}"
            raise InputError(message, file=after.document, column=f"rig.{name}")
    if (before.urdf is None) != (after.urdf is None):
        raise InputError(f"expected the rig of {before.name}: one has a URDF, the other none", file=after.folder)
    if before.urdf is not None and after.urdf is not None and before.urdf.read_bytes() != after.urdf.read_bytes():
        raise InputError(f"expected the URDF of {before.name}, found another", file=after.urdf)
    if set(before.start) != set(after.start):
        odd = sorted(set(before.start) ^ set(after.start))[0]
        raise InputError(f"expected start.{odd} in both studies, or in none", file=after.document)
    names = labels_of(before, after)
    trials: list[Trial] = []
    for label, study in zip(names, (before, after), strict=True):
        trials += [derived_trial(t, name=f"{label}/{t.name}", group=label) for t in study.trials]
    return replace(before, name=f"{names[0]} and {names[1]}", trials=tuple(trials))


def labels_of(before: Study, after: Study) -> tuple[str, str]:
    """Return the names of two studies as groups."""
    return (before.name, after.name) if before.name != after.name else ("before", "after")
