"""The answer of a diagnosis of walking: causes, how sure, with what gain, what stays open; and it in words."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from fes_pin.body.build import Body
from fes_pin.data.numbers import printed
from fes_pin.data.results import Recorded, Saveable
from fes_pin.data.show import by_columns, explaining, from_to, last_notes
from fes_pin.data.smooth import CUTOFF_HZ
from fes_pin.data.study import Study
from fes_pin.infer.held_out import Gain
from fes_pin.walk.effect import STAGE
from fes_pin.walk.experiment import NextWalk
from fes_pin.walk.extended import extended_body
from fes_pin.walk.fits import Set
from fes_pin.walk.judge import CHANNELS
from fes_pin.walk.nulls import LEVEL
from fes_pin.walk.search import WalkSearch

DIGITS = 5
"""Significant digits printed."""
NEXT_FILE = "next_trial.csv"
CERTAIN = 1e-6
"""Level of a cause in a single stride."""
STOPPED = "stopped"
"""The verdict where a limit of time ended the search: the set is the best so far."""
HEADLINES = {
    STOPPED: "stopped: best set so far: no cause, and no claim about causes that were not tried.",
    "adequate": "the walking model is adequate: these data justify no extension of it.",
    "unexplained": "the walking model misses something, and nothing in the library explains it.",
}


class Estimate(NamedTuple):
    """A value with its standard deviation and unit."""

    value: float
    std: float
    unit: str


@dataclass(frozen=True, eq=False)
class WalkCause(Recorded):
    """One named cause.

    Attributes
    ----------
    name, site
        What, and where or how.
    parameters
        By name.
    equivalents
        Other causes that these data cannot tell from it.
    elsewhere
        Other sites of the same cause that would do as well.
    p_value
        Of such a gain where nothing is wrong, over the whole library.
    gain_fit, gain_held_out
        In percent on all strides, and on strides that took no part in its size; the second is None for one stride.
    evidence
        How much likelier strides are that took no part, in percent of what they are unlikely by without it; or None.
    other_leg_percent
        Gain on one leg's single supports of sizes fitted to the other's; only for what belongs to neither leg.
    """

    name: str
    site: str
    parameters: Mapping[str, Estimate]
    equivalents: tuple[str, ...]
    elsewhere: tuple[str, ...]
    p_value: float
    gain_fit: float
    gain_held_out: Gain | None
    evidence: Gain | None = None
    other_leg_percent: float | None = None
    stage: str = STAGE

    def record(self) -> dict[str, Any]:
        """The cause as `diagnosis.json` has it."""
        held = self.gain_held_out
        return {
            "name": self.name,
            "stage": self.stage,
            "site": self.site,
            "parameters": {
                n: {"value": walk_shown(v), "std": walk_shown(s), "unit": u} for n, (v, s, u) in self.parameters.items()
            },
            "equivalents": list(self.equivalents),
            "p_value": walk_shown(self.p_value),
            "gain_percent": {
                "fit": walk_shown(self.gain_fit),
                "held_out": walk_shown(held.percent) if held else None,
                "ci95": [walk_shown(held.low), walk_shown(held.high)] if held else None,
                "other_leg": walk_shown(self.other_leg_percent),
            },
        }

    def helps(self) -> bool:
        """Whether what took no part speaks for it: strides held out; for what belongs to neither leg, other stances.

        By likelihood: squared errors are mostly what landmarks and plates make in every session.

        What chance does as well without a cause that was refused is none either.

        A single stride leaves nothing out: then only what is certain is named.
        """
        if self.evidence is None:
            return self.p_value < CERTAIN and (self.other_leg_percent is None or self.other_leg_percent > 0.0)
        return (
            self.p_value < LEVEL
            and self.evidence.low > 0.0
            and (self.other_leg_percent is None or self.other_leg_percent > 0.0)
        )


def walk_shown(value: float | None) -> float | None:
    """A number as printed; None for what is not finite."""
    return printed(value, DIGITS)


@dataclass(frozen=True)
class WalkRemainder:
    """Whether what is left comes again in every stride, its p-value, and where it is largest."""

    unexplained: bool
    p_value: float
    where: str | None


def walk_cause_row(cause: WalkCause) -> tuple[str, str, str, str, str]:
    """Cause, site, parameters, held-out gain, what it cannot be told from."""
    values = ", ".join(f"{n} {v:.3g} +- {s:.1g} {u}".strip() for n, (v, s, u) in cause.parameters.items())
    held = cause.gain_held_out
    shown = f"{held.percent:.0f} % [{held.low:.0f}, {held.high:.0f}]" if held else "one stride: none"
    return cause.name, cause.site, values, shown, ", ".join(cause.equivalents) or "-"


@dataclass(frozen=True, eq=False, repr=False)
class WalkDiagnosis(Saveable):
    """What a model of walking gets wrong.

    Attributes
    ----------
    verdict
        "adequate", "causes_found", "unexplained", or "stopped": a limit of time ended the search.
    causes
        By held-out gain, largest first.
    remainder
        Whether what is left comes again in every stride.
    absorbed
        Causes that these data could not show.
    nominal_error, extended_error
        E in percent: on all strides, and held out.
    warnings
        What could not be done, one line each.
    search, best
        The fits behind it.
    """

    study: Study
    verdict: str
    causes: tuple[WalkCause, ...]
    remainder: WalkRemainder
    absorbed: tuple[str, ...]
    nominal_error: tuple[float, float | None]
    extended_error: tuple[float, float | None]
    ceiling_percent: float
    next_experiment: NextWalk | None
    search: WalkSearch
    best: Set
    cutoff_hz: float = CUTOFF_HZ
    wall_s: float = 0.0
    warnings: tuple[str, ...] = ()

    @property
    def model(self) -> Body:
        """The body with the masses, centres and inertias that were found."""
        return extended_body(self.search.fits, self.best)

    def record(self) -> dict[str, Any]:
        """`diagnosis.json` as a dictionary, without the text and the table that a saved result has as well."""
        plan = self.next_experiment
        trial = None
        if plan and plan.conditions is not None:
            trial = {"coordinates": NEXT_FILE, "file": NEXT_FILE, "kind": "motion", **plan.conditions}
        parameters = {
            f"{c.name}.{n}": {"value": walk_shown(v), "std": walk_shown(s)}
            for c in self.causes
            for n, (v, s, _) in c.parameters.items()
        }
        nominal, extended = (
            {"fit": walk_shown(f), "held_out": walk_shown(h)} for f, h in (self.nominal_error, self.extended_error)
        )
        return {
            "study": self.study.name,
            "verdict": self.verdict,
            "causes": [c.record() for c in self.causes],
            "remainder": {
                "unexplained": self.remainder.unexplained,
                "p_value": walk_shown(self.remainder.p_value),
                "where": self.remainder.where,
            },
            "absorbed": list(self.absorbed),
            "nominal": {"parameters": {}, "error_percent": nominal},
            "extended": {"parameters": parameters, "error_percent": extended},
            "noise": self._noise(),
            "ceiling_percent": walk_shown(self.ceiling_percent),
            "next_experiment": {"why": plan.why, "separates": list(plan.separates), "trial": trial} if plan else None,
            "cutoff_hz": self.cutoff_hz,
            "warnings": list(self.warnings),
            "wall_s": round(self.wall_s, 2),
        }

    def _noise(self) -> dict[str, Any]:
        """Root mean square of what the extended model leaves in the mean stride, by channel: N and N m."""
        banks, best = self.search.banks, self.best
        left = banks.bank(best.forms).y
        if best.forms:
            columns = np.concatenate([banks.bank(best.forms).x[i] for i in best.forms], axis=3)
            left = left - columns @ best.fitted.values
        size = np.sqrt(np.sum(left[0] ** 2, axis=1))
        return {
            name.replace(" ", "_"): {"std": walk_shown(float(s)), "ar": []}
            for name, s in zip(CHANNELS, size, strict=True)
        }

    def columns(self) -> dict[str, list[Any]]:
        """The table of `to_frame`, by columns: a row a parameter of each cause, none without a cause."""
        gain = ("gain_percent", "gain_low", "gain_high")
        head = ("cause", "site", "parameter", "value", "std", "unit", "p_value", *gain, "equivalents")
        rows = [
            (c.name, c.site, n, *one, c.p_value, g.percent, g.low, g.high, ", ".join(c.equivalents))
            for c in self.causes
            for n, one in c.parameters.items()
            for g in (c.gain_held_out or Gain(math.nan, math.nan, math.nan),)
        ]
        return by_columns(head, rows)

    def headline(self) -> str:
        """The verdict in one sentence."""
        count = len(self.causes)
        if not count:
            return HEADLINES[self.verdict]
        rest = ", and something is left" if self.remainder.unexplained else ""
        so_far = "stopped: best set so far: " if self.verdict == STOPPED else ""
        return f"{so_far}{explaining(count)} what the walking model gets wrong{rest}."

    def footnotes(self) -> list[str]:
        """What stands beneath the table."""
        shown = from_to(self.nominal_error, self.extended_error, ("fitted", "strides held out"))
        noise = f"stride to stride {self.ceiling_percent:.2f} %; low pass {self.cutoff_hz:g} Hz"
        lines = [f"error E {shown}; {noise}"]
        where = f", most in {self.remainder.where}" if self.remainder.where else ""
        state = "something comes" if self.remainder.unexplained else "nothing more comes"
        lines.append(f"{state} again in every stride (p = {self.remainder.p_value:.2g}{where})")
        for cause in self.causes:
            if cause.other_leg_percent is not None:
                lines.append(
                    f"{cause.name}: fitted to one leg's stances it gains {cause.other_leg_percent:.0f} % on the other's"
                )
            if cause.elsewhere:
                lines.append(f"{cause.name}: as well at {'; '.join(cause.elsewhere[:4])}")
        return [*lines, *last_notes(self.absorbed, self.next_experiment, self.warnings)]

    def _notebook(self) -> tuple[str, Sequence[str], Sequence[Sequence[str]], Sequence[str]]:
        head = ("cause", "site", "parameters", "held-out gain", "cannot be told from")
        return f"{self.study.name}: {self.headline()}", head, [walk_cause_row(c) for c in self.causes], self.footnotes()

    def __repr__(self) -> str:
        names = f" ({', '.join(c.name for c in self.causes)})" if self.causes else ""
        return f"WalkDiagnosis of {self.study.name}: {self.verdict}{names}"
