"""The search over sets of causes by one score.

A set's score is twice its negative log-likelihood, maximised over the nominal parameters, its effects' parameters and
everything that is random, with `PARAMETER_PRICE` for each parameter (`Fit.price`). It depends on the set alone. A cause
is claimed where it is significant over the whole library beside the others; errors of form are taken up by the random
effort, so that what stands beside a cause must earn its place against that.
"""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from fes_pin.data.schema import IMPOSED
from fes_pin.diagnosis.decide.claims import FORM_SHARE
from fes_pin.diagnosis.decide.gains_ahead import Fold, gains_of
from fes_pin.diagnosis.decide.significance import Family, level_of
from fes_pin.diagnosis.errors_ahead import are_large, random_parts
from fes_pin.diagnosis.remainder.driven import driven_remainder
from fes_pin.diagnosis.search.cause_sets import MOST_CAUSES
from fes_pin.diagnosis.search.likelihood_fits import LikelihoodFits, Names
from fes_pin.diagnosis.search.score import Scored, best_pairs
from fes_pin.diagnosis.search.simulation_search import NominalFitError
from fes_pin.identify.ahead import default_horizon
from fes_pin.identify.fit import Fit
from fes_pin.identify.scatter import excess_scatter
from fes_pin.infer.distributions import chi2_tail
from fes_pin.infer.levels import UNUSUAL_LEVEL
from fes_pin.workers import OutOfTime, Progress, seconds_left, time_limit

BEAM = 3
"""Sets that each round extends; greedy search (1) loses 5 to 8 points of exact pairs (DESIGN section 6)."""
JOINT_FITS = 8
"""Causes that are fitted beside a set, those of largest score; beside nothing all are."""
SEEDS = 4
"""Pairs that the linear screen proposes by itself, for causes that do nothing alone."""


@dataclass
class Found:
    """What a search found.

    Attributes
    ----------
    nominal, best
        Fits, each with what is random in it.
    p_values
        Family-wise, of each cause of `best`, beside the others.
    rivals
        For each cause, fits in which another took its place.
    without
        For each cause, the fit without it.
    scored
        Score of every effect beside the nominal model, and of those that the best set has not beside that.
    family
        Of tests.
    silent
        Names of causes that act in none of the trials.
    """

    nominal: Fit
    best: Fit
    p_values: dict[str, float]
    rivals: dict[str, list[Fit]]
    without: dict[str, Fit]
    scored: list[Scored]
    family: Family
    silent: tuple[str, ...]


class LikelihoodSearch:
    """One search on the sets of one study."""

    def __init__(self, sets: LikelihoodFits, seed: int, progress: Progress, horizon_s: float | None = None) -> None:
        self.sets, self.seed, self.progress = sets, seed, progress
        self._horizon_s = horizon_s
        self.was_stopped, self._end = False, math.inf
        self._formed: set[Names] = set()
        self._unearned: set[Names] = set()

    def run(self) -> Found:
        """Search, as long as the limit of time lets it; the nominal model is fitted and scored anyway."""
        self.progress(0.05, "nominal model")
        self._end = time.monotonic() + seconds_left()
        with time_limit(math.inf):
            nominal = self.sets.nominal()
            if not math.isfinite(nominal.sse):
                raise NominalFitError("the nominal model foretells nothing finite from its start values on", nominal)
            self.family = Family(self.sets.screen.scores(nominal), self.seed)
        self._fallback: Names = ()
        try:
            return self._search()
        except OutOfTime:
            self.was_stopped = True
            with time_limit(math.inf):
                return self.told(self._fallback)

    @property
    def seconds_left(self) -> float:
        """Until the limit of time that the search began with."""
        return self._end - time.monotonic()

    @property
    def horizon_s(self) -> float:
        """How far ahead errors over a horizon look, s."""
        return self._horizon_s or default_horizon(self.sets.trials)

    def nominal(self) -> Fit:
        """The nominal model."""
        return self.sets.fits[()]

    def _search(self) -> Found:
        best = self._fallback
        for size in self._sizes():
            self.progress(min(0.1 + 0.2 * size, 0.7), f"sets of {size}")
            if best and not self._worth_extending(best):
                break
            self._extend(size)
            earned = self._first_that_earns(size, best)
            if earned is None:
                break
            best = self._fallback = earned
        return self.settle(self._backward(best))

    def _sizes(self) -> Iterable[int]:
        """How many causes a set has, round by round, until nothing earns its place.

        An imposed motion excites a rig as nothing else does, and a muscle is a set of such causes.
        """
        imposed = any(t.kind == IMPOSED for t in self.sets.trials)
        return itertools.count(1) if imposed else range(1, MOST_CAUSES + 1)

    def p_value(self, larger: Fit, smaller: Fit) -> float:
        """Family-wise p-value of what a larger set adds, as far as pieces of the data agree on it."""
        return self._p_value(smaller.sse - larger.sse, larger, smaller)

    def _p_value(self, gain: float, larger: Fit, smaller: Fit) -> float:
        """Family-wise p-value of a gain in twice the log-likelihood."""
        degrees = max(larger.degrees - smaller.degrees, 1)
        return self.family.p_value(gain / excess_scatter(larger, smaller), degrees)

    def earns(self, larger: Fit, smaller: Fit, gain: float, explained: float) -> bool:
        """Whether a larger set is worth its degrees of freedom where it gains so much in twice the log-likelihood."""
        return self._p_value(gain, larger, smaller) < level_of(larger) and not _is_of_form(larger, gain, explained)

    def _is_earned(self, larger: Fit, smaller: Fit) -> bool:
        """The same of two fits as they are."""
        explained = self.nominal().sse - larger.sse
        significant = self.p_value(larger, smaller) < level_of(larger)
        return significant and not _is_of_form(larger, smaller.sse - larger.sse, explained)

    def possible(self) -> dict[Names, Fit]:
        """All sets that are fitted, but for those that cannot be, or that were found not to earn their place."""
        return {n: f for n, f in self.sets.fits.items() if n not in self._unearned and self.sets.is_possible(f)}

    def _worth_extending(self, names: Names) -> bool:
        """True where the score of a further cause beside a set is not what chance brings, or where something is left.

        Scores are slopes at what is random in the set, which a cause that is missed is part of: they promise less than
        is there.
        """
        scored = [s for s in self.sets.screen.scores(self.sets.fits[names]).scored if s.gain > 0.0]
        single = min((float(chi2_tail(s.gain, max(len(s.amplitudes), 1))) for s in scored), default=1.0)
        return self.family.adjusted(single) < UNUSUAL_LEVEL or not self._leaves_noise(self.sets.fits[names])

    def _extend(self, size: int) -> None:
        """Fit the sets of a size: the best smaller ones with further causes, and pairs that the screen proposes."""
        sets = self.sets
        for names in sets.near(size - 1)[:BEAM]:
            sets.extend_all(names, None if size == 1 else JOINT_FITS)
        if size == 2:
            base = sets.fits[()]
            pairs = {
                tuple(sorted((a.probe.name, b.probe.name))): (a, b)
                for a, b in best_pairs(sets.screen.scores(base), SEEDS)
            }
            missing = {k: v for k, v in pairs.items() if k not in sets.fits}
            begun = {k: lambda v=v: sets.extend_with_both(base, v) for k, v in missing.items()}
            sets.add(base, begun)

    def _first_that_earns(self, size: int, best: Names) -> Names | None:
        """The cheapest set of a size that earns its place; what comes near it is judged without those that do not."""
        tried: list[Names] = []
        while len(tried) < BEAM and (rest := self._refined(size, tried, best)):
            if self._earns_beside(rest[0], best):
                return rest[0]
            tried.append(rest[0])
            self.sets.converge(size, tried)
        return None

    def _refined(self, size: int, without: Sequence[Names], best: Names) -> list[Names]:
        """The best sets of a size but for some, cheapest first, once each has the form that the data demand."""
        while rough := [n for n in self.sets.near(size, without)[:BEAM] if self._is_rough(n, best)]:
            self._refine(rough[0])
        return self.sets.near(size, without)[:BEAM]

    def _is_rough(self, names: Names, best: Names) -> bool:
        """Whether a set has not had another form yet, and half of what it must gain: a form may give the rest."""
        if names in self._formed:
            return False
        larger, smaller = self.sets.fits[names], self.sets.fits[best]
        degrees = max(larger.degrees - smaller.degrees, 1)
        return self.family.p_value(2.0 * (smaller.sse - larger.sse), degrees) < level_of(larger)

    def _earns_beside(self, names: Names, best: Names) -> bool:
        """Whether a set can be, and is worth more than the best smaller one."""
        larger, smaller = self.sets.fits[names], self.sets.fits[best]
        earned = self._is_earned(larger, smaller) and self._foretells_more(larger, smaller)
        return self._kept(names, earned) and self.sets.is_possible(larger)

    def _foretells_more(self, larger: Fit, smaller: Fit) -> bool:
        """Whether what stands beside a cause lessens the errors ahead of the very trials that it was fitted to.

        Of trials that took no part it must do so to be named, see `speaks_for`. Where the smaller set leaves more than
        noise, a further cause may bring that about.
        """
        if not smaller.model.effects or not self._leaves_noise(smaller):
            return True
        fold = Fold(self.nominal(), larger, {"": smaller}, self.sets.trials)
        return gains_of([fold], fold.without, self.horizon_s, self.seed)[""].is_material

    def _leaves_noise(self, fitted: Fit) -> bool:
        """Whether nothing is left beside a fit but a random effort that is small."""
        return not (are_large(random_parts(fitted)) or driven_remainder(fitted, self.seed).unexplained)

    def _kept(self, names: Names, earned: bool) -> bool:
        """Whether a set earns its place, and keep in mind that it does not."""
        (self._unearned.discard if earned else self._unearned.add)(names)
        return earned

    def _refine(self, names: Names) -> None:
        """Give a set, once, the form that the data demand."""
        forms = self.sets.forms
        while names not in self._formed and (
            self._replaced(names, forms.simplified(self.sets.fits[names]))
            or self._replaced(names, forms.refined(self.sets.fits[names]))
            or self._replaced(names, forms.reformed(self.sets.fits[names]))
        ):
            pass
        self._formed.add(names)

    def _replaced(self, names: Names, better: Fit | None) -> bool:
        """Take a better fit of a set; False if there is none."""
        if better is not None:
            self.sets.fits[names] = better
        return better is not None

    def form_otherwise(self, names: Names) -> bool:
        """Give a set another form than it was led to, if one is better; False if none is, or time is up."""
        try:
            with time_limit(self.seconds_left):
                return self._replaced(names, self.sets.forms.otherwise(self.sets.fits[names]))
        except OutOfTime:
            return False

    def _backward(self, names: Names) -> Names:
        """Drop causes that the others have made superfluous."""
        while names:
            less = {n: self.sets.without(names, n) for n in names}
            p_values = {n: self.p_value(self.sets.fits[names], less[n]) for n in names}
            weakest = max(names, key=lambda n: (p_values[n], -less[n].sse))
            if self._is_earned(self.sets.fits[names], less[weakest]):
                break
            names = tuple(n for n in names if n != weakest)
        return names

    def settle(self, names: Names, refused: Iterable[str] = ()) -> Found:
        """Everything that is to be said of a set of causes: its rivals, and each cause's part in it.

        Where a rival turns out to be the better set, and each of its causes earns its place, it is the answer: sets
        were extended one cause at a time, and what was best beside fewer need not be best beside all.

        Parameters
        ----------
        names
            A set that is fitted.
        refused
            Names that no answer may hold.
        """
        self.progress(0.75, "rivals")
        self._refine(names)
        while True:
            for name in names:
                rest = tuple(n for n in names if n != name)
                self.sets.without(names, name)
                self.sets.extend_all(rest, None if len(names) == 1 else JOINT_FITS)
                self.sets.converge_rivals(rest, name)
            better = next(n for n in self.sets.ranked(len(names)) if n == names or self._may_be(n, refused))
            if better == names:
                return self.told(names)
            names = better

    def _may_be(self, names: Names, refused: Iterable[str]) -> bool:
        """Whether a set can be the answer: it holds nothing refused, and each of its causes earns its place."""
        if set(names) & set(refused):
            return False
        self._refine(names)
        return self._kept(names, self._backward(names) == names)

    def told(self, names: Names) -> Found:
        """What the sets that are fitted say of one of them, which no further rivals are sought for."""
        sets, rivals, without = self.sets, {}, {}
        for name in names:
            rest = tuple(n for n in names if n != name)
            without[name] = sets.without(names, name)
            others = [k for k in sets.fits if len(k) == len(names) and set(rest) <= set(k) and name not in k]
            finite = (f for k in others if math.isfinite((f := sets.fits[k]).sse) and sets.is_possible(f))
            rivals[name] = sorted(finite, key=lambda f: f.price)
        none, best = sets.fits[()], sets.fits[names]
        p_values = {n: self.p_value(best, without[n]) for n in names}
        scored = sets.screen.scores(none).scored + (sets.screen.scores(best).scored if names else [])
        return Found(none, best, p_values, rivals, without, scored, self.family, sets.library.silent())


def _is_of_form(larger: Fit, gain: float, explained: float) -> bool:
    """Whether a gain is no more than errors of form leave of what is explained, and no random effort takes them up."""
    assert larger.doubt is not None
    return not larger.doubt.acting and gain < FORM_SHARE * explained


__all__ = ["Found", "LikelihoodSearch"]
