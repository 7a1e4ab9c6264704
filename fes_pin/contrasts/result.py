"""The answer of a contrast, and it in words."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from fes_pin.data.study import Study
from fes_pin.diagnosis.cause import ParameterEstimate
from fes_pin.diagnosis.remainder.open_set import Remainder
from fes_pin.diagnosis.text import probability, quantity
from fes_pin.identify.fit import Fit

STOPPED = "stopped"
"""The verdict where a limit of time ended the search: the changes are the best set so far."""


@dataclass(frozen=True)
class Change:
    """One thing that differs.

    Attributes
    ----------
    name
        A nominal parameter, a cause, or "condition_misread".
    kind
        "nominal", "effect" or "condition".
    group
        The group that has a value of its own.
    words
        What happened, in plain words.
    parameters
        By name and group: of a group that does not have the cause its null, without deviation.
    equivalents
        What could have changed instead: read them as one set.
    p_value
        Family-wise over the whole library.
    trial
        The only trial that it concerns, of a condition that was misread.
    """

    name: str
    kind: str
    group: str
    words: str
    parameters: Mapping[str, Mapping[str, ParameterEstimate]]
    equivalents: tuple[str, ...]
    p_value: float
    trial: str | None = None


@dataclass(frozen=True)
class Contrast:
    """What differs between the groups of a study.

    Attributes
    ----------
    verdict
        "nothing_changed", "changed", "unexplained", or "stopped": a limit of time ended the search.
    changes
        Surest first.
    common
        Causes that act in all groups alike: errors of the model, and no changes.
    unchanged
        For each parameter of the model that is not among the changes the size, as a share of its value, beyond which a
        change would have been seen in 95 of 100.
    excluded
        For each cause that no group has, its first parameter: the size beyond which its coming would have been seen.
    untestable
        What could have changed unseen.
    remainder
        What is left in a group that no other group has.
    repeats
        Standard deviation of a nominal parameter between trials that are meant to be alike, as a share of its value: of
        those that scatter by more than their noise.
    """

    study: Study
    groups: tuple[str, ...]
    verdict: str
    changes: tuple[Change, ...]
    common: tuple[str, ...]
    unchanged: Mapping[str, float]
    excluded: Mapping[str, ParameterEstimate]
    untestable: tuple[str, ...]
    remainder: Remainder
    fit: Fit
    driven: bool
    repeats: Mapping[str, float] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    wall_s: float = field(default=0.0, compare=False)

    def __str__(self) -> str:
        return contrast_text(self)


def contrast_headline(found: Contrast) -> str:
    """The answer in one sentence."""
    between = " and ".join(found.groups)
    so_far = "stopped: best set so far: " if found.verdict == STOPPED else ""
    if found.verdict == "unexplained":
        return f"something differs between {between}, and nothing in the library explains it."
    if not found.changes:
        if so_far:
            return f"{so_far}no change between {between}."
        return f"nothing changed between {between} that these data show."
    many = "one thing" if len(found.changes) == 1 else f"{len(found.changes)} things"
    return f"{so_far}{many} changed between {between}."


def change_row(change: Change) -> tuple[str, str, str, str, str]:
    """Name, what happened, values by group, p, what it cannot be told from."""
    lines = []
    for name, by_group in change.parameters.items():
        values = ", ".join(f"{g} {quantity(p.value, p.std, p.unit) if p.std else 'none'}" for g, p in by_group.items())
        lines.append(f"{name}: {values}")
    shown = probability(change.p_value)
    return change.name, change.words, "\n".join(lines), shown, ", ".join(change.equivalents) or "-"


def contrast_notes(found: Contrast) -> list[str]:
    """What stands beneath the changes."""
    lines = []
    if found.common:
        lines.append(f"in all groups alike, so no change: {', '.join(found.common)}")
    if found.repeats:
        sizes = ", ".join(f"{n} by {100.0 * v:.2g} %" for n, v in found.repeats.items())
        lines.append(f"repeats scatter by themselves: {sizes} (standard deviation)")
    if found.unchanged:
        sizes = ", ".join(f"{n} by {100.0 * v:.2g} %" for n, v in found.unchanged.items())
        lines.append(f"did not change; would have been seen in 95 of 100: {sizes}")
    if found.excluded:
        sizes = ", ".join(f"{n} {p.value:.2g} {p.unit}".strip() for n, p in found.excluded.items())
        lines.append(f"did not come; would have been seen in 95 of 100: {sizes}")
    if found.untestable:
        lines.append(f"could have changed unseen: {', '.join(found.untestable)}")
    left = found.remainder
    if left.unexplained:
        lines.append(f"something is left unexplained in one group alone ({probability(left.p_value)})")
    else:  # what every group leaves is the model's error, and is a warning
        lines.append("nothing is left unexplained in one group alone")
    return [*lines, *(f"warning: {words}" for words in found.warnings)]


def contrast_text(found: Contrast) -> str:
    """The whole answer as plain text."""
    lines = [f"{found.study.name}: {contrast_headline(found)}"]
    for change in found.changes:
        name, words, values, shown, others = change_row(change)
        lines.append(f" {name}: {words}; {shown}; cannot be told from {others}")
        lines += [f"   {value}" for value in values.split("\n")]
    return "\n".join(lines + [f" {note}" for note in contrast_notes(found)])
