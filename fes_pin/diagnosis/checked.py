"""Checks of a study before a search: implausible numbers, and the causes that its trials can identify."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from fes_pin.data.read_only import ReadOnly
from fes_pin.data.show import DataFrame, by_columns, frame, table_html
from fes_pin.data.study import Study
from fes_pin.diagnosis.diagnosis import extrapolated, few_trials
from fes_pin.diagnosis.testable import Testable, testable_causes
from fes_pin.infer.result import shown
from fes_pin.models.catalogue import Source, catalogue_of
from fes_pin.prepare.measured import measured_study, split

FAR = 0.3
"""Share of the variance that the nominal model leaves above which a warning says so."""
OF_WALKS = "the noise of a walk is estimated with its causes"


@dataclass(frozen=True, repr=False, eq=False)
class Checked(ReadOnly):
    """Implausible numbers of a study, and the causes that its trials can and cannot identify.

    Attributes
    ----------
    study
        As it was given.
    odd
        Warnings about its numbers, a line each; a diagnosis gives the same.
    limits
        What a verdict on so few trials lacks, a line each.
    testable
        The causes that the trials can identify, or the reason why that is not known before a diagnosis.
    """

    study: Study
    odd: tuple[str, ...]
    limits: tuple[str, ...] = ()
    testable: Testable | str = OF_WALKS

    def as_dict(self) -> dict[str, Any]:
        """Return the check for JSON; `shown` has the share of each cause's sensitivity that is its own."""
        record: dict[str, Any] = {"study": self.study.name, "rig": self.study.rig, "trials": len(self.study.trials)}
        record |= {"odd": list(self.odd), "limits": list(self.limits)}
        found = self.testable
        if isinstance(found, str):
            return {**record, "not_known": found}
        lists = {"absorbed": list(found.absorbed), "silent": list(found.silent), "alike": [*map(list, found.alike)]}
        shares = {name: shown(share, 4) for name, share in found.shown.items()}
        return {**record, "shown": shares, **lists, "unexplained_percent": shown(100.0 * found.unexplained, 4)}

    def to_frame(self) -> DataFrame:
        """Return one row a cause: whether it is identifiable, and the share of its sensitivity that is its own, 0 to 1.

        The share is NaN for a cause that is not identifiable or acts in no trial.
        """
        found, rows = self.testable, list[tuple[str, str, float]]()
        if isinstance(found, Testable):
            rows += [(name, "shown", share) for name, share in found.shown.items()]
            rows += [(name, word, math.nan) for word in ("absorbed", "silent") for name in getattr(found, word)]
        return frame(by_columns(("cause", "testable", "share"), rows), index="cause")

    def _repr_html_(self) -> str:
        first, *notes = str(self).splitlines()
        return table_html(first, (), (), notes)

    def __repr__(self) -> str:
        return str(self)

    def __str__(self) -> str:
        found, lines = self.testable, [*odd_lines(self.study, self.odd)]
        if isinstance(found, Testable):
            if found.unexplained > FAR:
                share = f"{100.0 * found.unexplained:.3g} % of the variance"
                lines.append(f"the nominal model leaves {share}: these lines rest on a linearization far from the data")
            lines += _listed(f"these trials can show {len(found.shown)} causes", found.shown)
            lines += _listed("not identifiable, as fitted parameters can take their place", found.absorbed)
            lines += _listed("not identifiable, as they act in none of the trials", found.silent)
            if found.alike:
                groups = "; ".join(" and ".join(group) for group in found.alike)
                lines.append(f"they look alike on these trials: {groups}")
        else:
            lines.append(f"what these trials can show is not known before a diagnosis: {found}")
        return "\n".join([*lines, *self.limits])


def check_rig(study: Study, *, library: Source | Sequence[Source] | None = None) -> Checked:
    """Check a study of a rig; see `verdict.ask.check`."""
    clean, odd = odd_numbers(study)
    found = testable_causes(clean, catalogue_of(library))
    given_away = () if isinstance(found, str) else found.warnings
    train, test = split(clean)
    count = len(train)
    alone = ["one trial: nothing can be held out, and no other trial can confirm a cause"] * (count == 1)
    return Checked(study, (*odd, *given_away), (*few_trials(count), *alone, *extrapolated(train, test)), found)


def odd_numbers(study: Study) -> tuple[Study, list[str]]:
    """Return a study without spikes and stuck sensors, and warnings about its numbers.

    Raises
    ------
    InputError
        As `check`.
    """
    clean = measured_study(study)
    count = sum(len(k) for columns in clean.left_out.values() for k in columns.values())
    said = [f"{count} samples look like spikes, and are replaced by what their neighbours say"] if count else []
    return clean.study, [*said, *clean.odd()]


def odd_lines(study: Study, odd: Sequence[str] | None) -> list[str]:
    """Return a study in one line, and the warnings about its numbers; None of numbers that were not judged."""
    nothing = "nothing is odd about its numbers"
    return [str(study), *(f"odd: {one}" for one in odd or ())] + [nothing] * (odd is not None and not odd)


def _listed(words: str, names: Sequence[str] | Mapping[str, float]) -> list[str]:
    return [f"{words}: {', '.join(names)}"] if names else []
