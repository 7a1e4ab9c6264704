"""The result of a contrast, and it in words."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar

from fes_pin.contrasts.grouped import Grouped
from fes_pin.contrasts.replay import errors_by_group, horizon_of, replayed_groups
from fes_pin.data.results import Result
from fes_pin.identify.error_measures import FREE
from fes_pin.identify.replay import Replay
from fes_pin.infer.result import FITTED, SEEN, Change, Explained, Named, ParameterEstimate, shown
from fes_pin.infer.text import listed, percent
from fes_pin.models.assumed import assumed_of
from fes_pin.models.catalogue import Catalogue, installed
from fes_pin.models.nominal import nominal_model
from fes_pin.models.stage import Effect


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Contrast(Result):
    """Verdict on the groups of a study: "nothing_changed", "changed", "unexplained" or "stopped", with the changes.

    Attributes
    ----------
    causes, changes
        Changes, most significant first.
    common
        Causes that act in all groups alike: errors of the model, and no changes.
    unchanged
        For each parameter of the model without a change, the size, as a share of its value, above which a change is
        excluded at 95 % power.
    excluded
        For each cause that no group has, its first parameter: the size above which the cause is excluded.
    untestable
        Parameters and causes whose change is not testable.
    remainder
        Lack of fit in a group that no other group has.
    repeats
        Standard deviation of a nominal parameter between repeats, as a share of its value, for those that scatter
        significantly.
    """

    causes: tuple[Change, ...]
    groups: tuple[str, ...]
    common: tuple[str, ...]
    unchanged: Mapping[str, float]
    excluded: Mapping[str, ParameterEstimate]
    untestable: tuple[str, ...]
    fit: Grouped
    driven: bool
    repeats: Mapping[str, float] = field(default_factory=dict)
    catalogue: Catalogue = field(default_factory=installed)
    FILE: ClassVar[str] = "contrast.json"
    KIND: ClassVar[type[Named]] = Change

    @property
    def changes(self) -> tuple[Change, ...]:
        """The changes, most significant first."""
        return self.causes

    def not_fitted(self) -> list[tuple[str, str]]:
        """Return what is said of changes by their scores, in words."""
        seen = {n: f"{p.value:.2g} {p.unit}".strip() for n, p in self.excluded.items()}
        seen |= {n: percent(100.0 * share) for n, share in self.unchanged.items()}
        said = [(n, f"did not change by its score: more than {size} {SEEN}") for n, size in seen.items()]
        return said + [(n, "not testable with these data") for n in self.untestable]

    @cached_property
    def replays(self) -> tuple[Replay, ...]:
        """Every trial as the models of its group and of another predict it."""
        return replayed_groups(self.fit, self.study.trials, self.groups)

    @cached_property
    def by_own_values(self) -> dict[str, Explained]:
        """Errors of the trials of each group, by the model of another group and by its own; none of one model.

        Errors are of free simulations, of driven rigs of predictions over the horizon.
        """
        horizon_s = horizon_of(self.fit)
        what = f"predictions {horizon_s:g} s ahead" if horizon_s else FREE
        return {
            g: Explained(f"{what} of the trials of {g}, by the model of {n} and by their own", FITTED, e, own[g])
            for g, own in errors_by_group(self.replays).items()
            for n, e in own.items()
            if n != g and g in own
        }

    def errors(self) -> list[Explained]:
        """Return errors of the trials of each group; see `by_own_values`."""
        return list(self.by_own_values.values())

    def assumed(self) -> dict[str, str]:
        """See `Result.assumed`: constants that are held, how trials begin, and the estimator."""
        return {**assumed_of(nominal_model(self.study), self.study.trials), **super().assumed()}

    def title(self) -> str:
        """The verdict in a few words."""
        between = listed(list(self.groups))
        if self.verdict == "unexplained":
            return f"something differs between {between}, and nothing in the library explains it"
        begun = "stopped: best set so far: " if self.is_stopped else ""
        shown = "" if self.changes or self.is_stopped else " that these data show"
        changed = listed(list(map(_size_in_group, self.changes))) if self.changes else "nothing"
        return f"{begun}{changed} changed between {between}{shown}"

    def head(self) -> tuple[str, ...]:
        """Titles of the table of changes."""
        return "change", "what happened", "values", "p", "equivalents"

    def own_record(self) -> dict[str, Any]:
        """Return the part of `contrast.json` about its groups."""
        return {
            "groups": list(self.groups),
            "common": list(self.common),
            "unchanged": {n: {"at_most": shown(v)} for n, v in self.unchanged.items()},
            "excluded": {n: {"at_most": shown(p.value), "unit": p.unit} for n, p in self.excluded.items()},
            "untestable": list(self.untestable),
            "repeats": {n: shown(v) for n, v in self.repeats.items()},
            "judged_by": "predictions" if self.driven else "simulations",
        }

    def effect(self, name: str) -> type[Effect] | None:
        """Return the class of a cause; None of a nominal parameter and of a misread condition."""
        return next((e for e in self.catalogue.effects_for(self.fit.grouped.rig) if e.name == name), None)

    def notes(self) -> list[tuple[str, str]]:
        """Return notes in addition to the changes, by topic."""
        left = self.remainder
        where = "in every group" if left.everywhere else "in one group alone" if left.unexplained else "none found"
        sizes = [f"{n} {p.value:.2g} {p.unit}".strip() for n, p in self.excluded.items()]
        changed = dict.fromkeys(one.group for one in self.changes)
        gains = [str(self.by_own_values[g]) for g in changed if g in self.by_own_values]
        rows = [
            ("explained", "; ".join(gains)),
            ("in all groups alike, so no change", ", ".join(self.common)),
            ("repeats scatter by (standard deviation)", _shares(self.repeats)),
            (f"did not change ({SEEN} beyond)", _shares(self.unchanged)),
            (f"did not come ({SEEN} beyond)", ", ".join(sizes)),
            ("could have changed unseen", ", ".join(self.untestable)),
            ("fitted by", "predictions one sample ahead" if self.driven else "simulations from the inputs"),
            ("lack of fit", f"{where} ({left.tested()})"),  # of every group: an error of the model, and a warning
        ]
        return [(topic, words) for topic, words in rows if words] + super().notes()

    def advice(self) -> str:
        """The next step, in words."""
        if self.is_stopped or self.next_experiment is not None:
            return super().advice()
        if self.verdict == "unexplained":
            return "look at the trials of the group that differs, or write the cause that you suspect as your own"
        if self.changes:
            return "take each group's own values"
        if self.untestable:
            return f"record trials that show {listed(list(self.untestable))}; one model for all groups fits these"
        return "use one model for all groups"


def _size_in_group(change: Change) -> str:
    """Return a change in a few words: its name, its group, and its first value there and elsewhere."""
    groups = dict(next(iter(change.parameters.values())))
    here, name = groups.pop(change.group), change.name.replace("_", " ")
    before = [f"{one.value:.3g} -> " for one in groups.values()][:1]
    where = change.group if change.trial is None else f"trial {change.trial}"
    return f"{name} in {where} ({''.join(before)}{here.value:.3g} {here.unit}".rstrip() + ")"


def _shares(shares: Mapping[str, float]) -> str:
    return ", ".join(f"{name} {percent(100.0 * share)}" for name, share in shares.items())
