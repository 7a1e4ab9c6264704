"""Why each candidate is named or not: the claims that changed an answer, and the last test of every candidate."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from fes_pin.infer.corrected import Correction
from fes_pin.infer.fits import Fitted, Names, Sets, more_degrees
from fes_pin.infer.result import Held, p_shown, shown
from fes_pin.infer.text import listed, probability
from fes_pin.infer.verdict import Rejected, State, Step

PRINTED = 3
"""Significant digits of a gain of a candidate that is not named."""


@dataclass(frozen=True)
class Tried:
    """The nearest fitted set with a candidate that is neither named nor rejected.

    Attributes
    ----------
    names
        That set: the answer with the candidate if it was fitted, else the set of lowest criterion; without rejected
        candidates, where one was fitted.
    gain
        Its gain over the answer in twice the log-likelihood.
    p_value
        Family-wise p-value of the gain; NaN of a set that does not extend the answer.
    is_possible
        Whether its sizes are physically possible.
    """

    names: Names
    gain: float
    p_value: float
    is_possible: bool

    def words(self, level: float) -> str:
        """Return why the candidate is not named, in words."""
        names = listed(list(self.names))
        if not self.is_possible:
            return f"in the nearest set a size is not physically possible ({names})"
        size = f"{shown(abs(self.gain), PRINTED):g}"
        if math.isnan(self.p_value):
            than = f"{'more' if self.gain > 0.0 else 'less'} than that of the answer"
            return f"twice the log-likelihood of the nearest set ({names}) is {size} {than}"
        changes = "raises" if self.gain > 0.0 else "lowers"
        test = f"added to the answer it {changes} twice the log-likelihood by {size} ({probability(self.p_value)}"
        if self.p_value < level:
            return f"{test}), and lowers no error of prediction, or gains no more than an error of form may"
        return f"{test}, level {level:g}): not significant"

    def cells(self) -> tuple[str, str, str]:
        """Return its cells of a table: the set, its gain, and the p-value of the gain."""
        test = "-" if math.isnan(self.p_value) else probability(self.p_value).removeprefix("p = ")
        gain = f"{shown(self.gain, PRINTED):g}" if math.isfinite(self.gain) else "-"
        return ", ".join(self.names), gain if self.is_possible else "impossible size", test

    def record(self) -> dict[str, Any]:
        """As JSON files have it."""
        test = {} if math.isnan(self.p_value) else {"p_value": p_shown(self.p_value)}
        return {"with": list(self.names), "added": shown(self.gain, PRINTED), **test}


@dataclass(frozen=True)
class Why:
    """How an answer was reached.

    Attributes
    ----------
    estimator
        The estimator of the answer.
    level
        Family-wise level of a claim.
    steps
        The claims that changed the answer, in their order.
    rejected
        Candidates that a claim rejected.
    tried
        All other candidates that were fitted and are not named.
    further
        Family-wise p-value of the score of the most significant further candidate; 0 where all were fitted.
    corrections
        The tests of the faults of the record.
    """

    estimator: str
    level: float
    steps: tuple[Step, ...] = ()
    rejected: Mapping[str, Rejected] = field(default_factory=dict)
    tried: Mapping[str, Tried] = field(default_factory=dict)
    further: float = 0.0
    corrections: tuple[Correction, ...] = ()

    def reasons(self) -> dict[str, str]:
        """Return why each candidate is not named, in words, and the tests of faults of the record.

        Those that a claim rejected come first.
        """
        rejected = {n: str(one) for n, one in self.rejected.items()}
        tried = {n: one.words(self.level) for n, one in self.tried.items()}
        return rejected | tried | {one.name: str(one) for one in self.corrections}

    def record(self) -> dict[str, Any]:
        """As JSON files have it."""
        return {
            "estimator": self.estimator,
            "level": self.level,
            "steps": [one.record() for one in self.steps],
            **({"further_p_value": p_shown(self.further)} if self.further else {}),
            "rejected": {n: one.record() for n, one in self.rejected.items()},
            "tried": {n: one.record() for n, one in self.tried.items()},
            "faults_of_record": {one.name: one.record() for one in self.corrections},
        }


def why_of(state: State[Any, Any, Any]) -> Why:
    """Return how the state of a verdict was reached, and why its other candidates are not named."""
    sets, best, named = state.search.sets, state.likeliest, state.names
    nearest: dict[str, Names] = {}
    rejected = set(state.rejected)
    for names in sorted(sets.fits, key=lambda k: (bool(rejected & {*k}), not named < {*k}, sets.fits[k].criterion)):
        for one in {*names} - named - rejected:
            nearest.setdefault(one, names)
    tried = {n: _tried(sets, best, names, named < set(names)) for n, names in sorted(nearest.items())}
    further = sets.extension_p_value(best)
    return Why(state.verdict.estimator, sets.level(best), state.steps, Held(state.rejected), Held(tried), further)


def _tried(sets: Sets[Any], best: Fitted, names: Names, extends: bool) -> Tried:
    """Return the comparison of a set with the answer, and its test if it extends the answer."""
    fitted = sets.fits[names]
    gain = best.sse - fitted.sse
    p_value = sets.noise_p_value(gain, more_degrees(fitted, best)) if extends else math.nan
    if p_value < sets.level(best):
        p_value = sets.p_value(fitted, best)
    return Tried(names, gain, p_value, sets.is_possible(fitted))
