"""The groups of a contrast: trials of one study by their label, or two studies of one rig."""

from collections.abc import Sequence
from dataclasses import replace
from hashlib import sha256

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
    one, two = _rig_of(before), _rig_of(after)
    for name in dict.fromkeys([*one, *two]):
        if one.get(name) != two.get(name):
            message = f"expected the rig of {before.name}: {one.get(name, 'none')}, found {two.get(name, 'none')}"
            raise InputError(message, file=after.document or after.folder, column=name)
    names = labels_of(before, after)
    trials: list[Trial] = []
    for label, study in zip(names, (before, after), strict=True):
        trials += [derived_trial(t, name=f"{label}/{t.name}", group=label) for t in study.trials]
    return replace(before, name=f"{names[0]} and {names[1]}", trials=tuple(trials))


def _rig_of(study: Study) -> dict[str, object]:
    """Return what studies of one rig have alike, by its key in the study format."""
    start = dict.fromkeys((f"start.{n}" for n in study.start), "a value")
    urdf = {} if study.urdf is None else {"rig.urdf": f"SHA-256 {sha256(study.urdf.read_bytes()).hexdigest()}"}
    return {"study.rig": study.rig, **{f"rig.{n}": v for n, v in study.constants.items()}, **urdf, **start}


def labels_of(before: Study, after: Study) -> tuple[str, str]:
    """Return the names of two studies as groups."""
    return (before.name, after.name) if before.name != after.name else ("before", "after")
