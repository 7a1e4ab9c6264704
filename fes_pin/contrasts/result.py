"""The answer of a contrast, and it in words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from fes_pin.data.results import Recorded, Saveable, shown
from fes_pin.data.show import by_columns
from fes_pin.data.study import Study
from fes_pin.diagnosis.cause import CELLS, ParameterEstimate
from fes_pin.diagnosis.remainder.open_set import Remainder
from fes_pin.diagnosis.text import estimate_text, probability
from fes_pin.identify.fit import Fit

STOPPED = "stopped"
"""The verdict where a limit of time ended the search: the changes are the best set so far."""


@dataclass(frozen=True, eq=False)
class Change(Recorded):
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

    def record(self) -> dict[str, Any]:
        """The change as `contrast.json` has it."""
        return {
            "name": self.name,
            "kind": self.kind,
            "group": self.group,
            **({"trial": self.trial} if self.trial is not None else {}),
            "words": self.words,
            "parameters": {n: {g: p.record() for g, p in by_group.items()} for n, by_group in self.parameters.items()},
            "equivalents": list(self.equivalents),
            "p_value": shown(self.p_value),
        }


@dataclass(frozen=True, eq=False, repr=False)
class Contrast(Saveable):
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
    wall_s: float = 0.0

    def record(self) -> dict[str, Any]:
        """`contrast.json` as a dictionary, without the text and the table that a saved result has as well."""
        left = self.remainder
        return {
            "study": self.study.name,
            "groups": list(self.groups),
            "verdict": self.verdict,
            "changes": [c.record() for c in self.changes],
            "common": list(self.common),
            "unchanged": {n: {"at_most": shown(v)} for n, v in self.unchanged.items()},
            "excluded": {n: {"at_most": shown(p.value), "unit": p.unit} for n, p in self.excluded.items()},
            "untestable": list(self.untestable),
            "repeats": {n: shown(v) for n, v in self.repeats.items()},
            "remainder": {"unexplained": left.unexplained, "p_value": shown(left.p_value), "where": left.where},
            "judged_by": "predictions" if self.driven else "simulations",
            "warnings": list(self.warnings),
            "wall_s": round(self.wall_s, 2),
        }

    def columns(self) -> dict[str, list[Any]]:
        """The table of `to_frame`, by columns: a row a parameter of each change in each group."""
        head = ("change", "kind", "parameter", "group", *CELLS, "p_value", "equivalents")
        rows = [
            (c.name, c.kind, n, group, *one.cells(), c.p_value, ", ".join(c.equivalents))
            for c in self.changes
            for n, groups in c.parameters.items()
            for group, one in groups.items()
        ]
        return by_columns(head, rows)

    def _notebook(self) -> tuple[str, Sequence[str], Sequence[Sequence[str]], Sequence[str]]:
        head = ("change", "what happened", "values", "p", "cannot be told from")
        title = f"{self.study.name}: {contrast_headline(self)}"
        return title, head, [change_row(c) for c in self.changes], contrast_notes(self)

    def __repr__(self) -> str:
        names = f" ({', '.join(c.name for c in self.changes)})" if self.changes else ""
        return f"Contrast of {self.study.name}: {self.verdict}{names}"

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
        values = ", ".join(f"{g} {estimate_text(p) if p.std else 'none'}" for g, p in by_group.items())
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
