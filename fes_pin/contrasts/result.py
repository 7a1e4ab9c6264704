"""The answer of a contrast, and it in words."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

from fes_pin.data.results import Result
from fes_pin.identify.fit import Fit
from fes_pin.infer.result import Change, Named, ParameterEstimate, shown
from fes_pin.infer.text import listed, probability


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Contrast(Result):
    """What differs between the groups of a study: "nothing_changed", "changed", "unexplained" or "stopped".

    Attributes
    ----------
    causes, changes
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
        Lack of fit in a group that no other group has.
    repeats
        Standard deviation of a nominal parameter between trials that are meant to be alike, as a share of its value: of
        those that scatter by more than their noise.
    """

    causes: tuple[Change, ...]
    groups: tuple[str, ...]
    common: tuple[str, ...]
    unchanged: Mapping[str, float]
    excluded: Mapping[str, ParameterEstimate]
    untestable: tuple[str, ...]
    fit: Fit
    driven: bool
    repeats: Mapping[str, float] = field(default_factory=dict)
    KIND: ClassVar[type[Named]] = Change

    @property
    def changes(self) -> tuple[Change, ...]:
        """What changed, surest first."""
        return self.causes

    def headline(self) -> str:
        """The answer in one sentence."""
        between = listed(list(self.groups))
        begun = "stopped: best set so far: " if self.is_stopped else ""
        if self.verdict == "unexplained":
            return f"something differs between {between}, and nothing in the library explains it."
        if not self.changes:
            return (
                f"{begun}no change between {between}."
                if begun
                else f"nothing changed between {between} that these data show."
            )
        many = "one thing" if len(self.changes) == 1 else f"{len(self.changes)} things"
        return f"{begun}{many} changed between {between}."

    def head(self) -> tuple[str, ...]:
        """Titles of the table of changes."""
        return "change", "what happened", "values", "p", "cannot be told from"

    def own_record(self) -> dict[str, Any]:
        """What `contrast.json` has of its groups."""
        return {
            "groups": list(self.groups),
            "common": list(self.common),
            "unchanged": {n: {"at_most": shown(v)} for n, v in self.unchanged.items()},
            "excluded": {n: {"at_most": shown(p.value), "unit": p.unit} for n, p in self.excluded.items()},
            "untestable": list(self.untestable),
            "repeats": {n: shown(v) for n, v in self.repeats.items()},
            "judged_by": "predictions" if self.driven else "simulations",
        }

    def notes(self) -> list[str]:
        """What is said below the changes."""
        lines = []
        if self.common:
            lines.append(f"in all groups alike, so no change: {', '.join(self.common)}")
        if self.repeats:
            sizes = ", ".join(f"{n} by {100.0 * v:.2g} %" for n, v in self.repeats.items())
            lines.append(f"repeats scatter by themselves: {sizes} (standard deviation)")
        if self.unchanged:
            sizes = ", ".join(f"{n} by {100.0 * v:.2g} %" for n, v in self.unchanged.items())
            lines.append(f"did not change; would have been seen in 95 of 100: {sizes}")
        if self.excluded:
            sizes = ", ".join(f"{n} {p.value:.2g} {p.unit}".strip() for n, p in self.excluded.items())
            lines.append(f"did not come; would have been seen in 95 of 100: {sizes}")
        if self.untestable:
            lines.append(f"could have changed unseen: {', '.join(self.untestable)}")
        left = self.remainder
        if left.unexplained:
            lines.append(f"something is left unexplained in one group alone ({probability(left.p_value)})")
        else:  # what every group leaves is the model's error, and is a warning
            lines.append("nothing is left unexplained in one group alone")
        return [*lines, *(f"warning: {words}" for words in self.warnings)]
