"""Sets of common causes and changes for the search of `infer`: their fits, and the rules that judge them."""

from collections.abc import Collection, Mapping, Sequence

import numpy as np

from fes_pin.contrasts.fits import GroupedFits
from fes_pin.contrasts.grouped import Grouped, GroupedModel
from fes_pin.contrasts.screen import ItemScore, Screen
from fes_pin.identify.afar import misfit_percent
from fes_pin.infer.distributions import chi2_tail
from fes_pin.infer.fits import Candidate, FittedSets, Names, more_degrees
from fes_pin.infer.keys import Key
from fes_pin.infer.levels import (
    CLAIM_LEVEL,
    CONFIDENCE_95,
    DRIVEN_LEVEL,
    MOST_CAUSES,
    MOST_ITEMS,
    SEPARABLE,
    UNUSUAL_LEVEL,
)
from fes_pin.infer.scatter import excess_scatter
from fes_pin.infer.search import Policy, Search, SearchResult
from fes_pin.infer.spread import ByUnit, Spread
from fes_pin.infer.text import WHOLE
from fes_pin.models.model import Model
from fes_pin.models.stage import Effect
from fes_pin.search.library import Library
from fes_pin.search.likelihood_forms import demanded_form
from fes_pin.search.possible import are_possible
from fes_pin.search.starts import STARTS, number_of_forms, refinements
from fes_pin.workers import in_parallel

FITTED, FITTED_DRIVEN, CONVERGED = 10, 6, 3
"""Items of largest score that are fitted with a set, as on driven rigs a fit takes some five times as long; and sets of
a size that are fitted until they converge."""

POLICY = Policy(fitted=None, rivals=None)
"""`candidates` are those of largest score."""

Found = SearchResult[Grouped]
"""Result of a search for changes."""


class ContrastModels(FittedSets[Grouped, list[ItemScore]]):
    """Sets of items, "cause" or "cause:group", fitted to the trials of several groups.

    Parameters
    ----------
    maxima
        Fits of grouped models to the trials of all groups.
    seed
        Of critical values.
    """

    most_candidates: int | None = MOST_ITEMS
    converged_sets = CONVERGED

    def __init__(self, maxima: GroupedFits, seed: int = 0) -> None:
        super().__init__()
        self.maxima, self.seed = maxima, seed
        self.nominal_model, self.trials, self.driven = maxima.nominal, maxima.trials, maxima.driven
        every = [t for many in self.trials.values() for t in many]
        self._library = Library(self.nominal_model, every, maxima.effects)
        self.screen = Screen(self.nominal_model, self.trials, self._library)
        self._compared: dict[tuple[Names, str], Grouped] = {}

    def nominal(self) -> Grouped:
        """Fit the nominal model to all groups, and simulate the family of the score tests of all changes."""
        self.fits[()] = self.maxima.first()
        self.family = self.screen.family(self.fits[()], self.seed)
        return self.fits[()]

    def first(self) -> Names:
        """Return the causes of all groups that are found where each group has nominal values of its own.

        A change is judged in the model that has them: an error of the model in all groups can hide one. Where no score
        is significant in the nominal model, they are not searched.
        """
        nominal = self.fits[()]
        is_adequate = self.leaves_noise(nominal) and self.extension_p_value(nominal) > UNUSUAL_LEVEL
        begun = nominal if is_adequate else self._common()
        names = tuple(sorted(map(str, begun.items)))
        if names:
            self.family = self.screen.family(begun, self.seed)
        self._act(names, max((s.net_gain for s in self.screen.scores(begun).scored), default=0.0))
        return names

    def _common(self) -> Grouped:
        """Return the nominal model with causes of all groups, and one changed nominal parameter where it needs one.

        Changes of several may be mistaken for the change of a cause.
        """
        search = Search[Grouped, CommonModels](CommonModels(self), lambda share, words: None, Policy(beam=1))
        apart = search.run().best
        alike = self._without(apart, apart.changes) if apart.items - set(apart.changes) else self.fits[()]
        while apart.changes and apart.criterion < alike.criterion:
            less = self._without(apart, [min(apart.changes, key=apart.certainty)])
            if not less.criterion < apart.criterion:
                break
            apart = less
        self.fits |= {tuple(sorted(map(str, f.items))): f for f in (apart, alike)}
        return apart if len(apart.changes) == 1 else alike

    def _without(self, one: Grouped, items: Collection[Key]) -> Grouped:
        """Return the fit of a set without some items, from its noise or from that of the nominal model."""
        model, noises = one.grouped.having(one.items.difference(items)), (one.weights, self.fits[()].weights)
        fits = in_parallel(lambda w: self.maxima.fitted(model, w, one.unknowns), noises)
        return min(fits, key=lambda f: f.criterion)

    def candidates(self, base: Grouped) -> dict[str, Candidate[list[ItemScore]]]:
        """Return the items of largest score, and every parameter and cause of the set with a value of one group's own.

        The noise of the set understates the gain of the latter.
        """
        by_item: dict[Key, list[ItemScore]] = {}
        for one in sorted(self.screen.scores(base).scored, key=lambda s: -s.net_gain):
            if one.gain > 1.0:
                by_item.setdefault(one.item, []).append(one)
        most = FITTED_DRIVEN if base.is_driven else FITTED
        chosen = [many for k, many in enumerate(by_item.values()) if k < most or many[0].effect is None]
        return {str(many[0].item): Candidate(many[0].net_gain, many[:STARTS]) for many in chosen}

    def begin(self, base: Grouped, starts: Mapping[Names, list[ItemScore]]) -> dict[Names, Grouped]:
        """Return first fits of sets with one more item, from its shapes of largest score."""
        looks = in_parallel(lambda many: self._look(base, many), list(starts.values()))
        return dict(zip(starts, looks, strict=True))

    def _look(self, base: Grouped, scores: Sequence[ItemScore]) -> Grouped:
        """Return a first fit of a set, with a round of its own noise where that of the smaller set explains changes."""
        new = [base.grouped.having(base.items | {s.item}, () if s.effect is None else (s.effect,)) for s in scores]
        begun = [model.with_parameters(s.start) for model, s in zip(new, scores, strict=True)]
        rounds = 0 if self.leaves_noise(base) else 1
        looks = (self.maxima.fitted(model, base.weights, base.unknowns, rounds) for model in begun)
        return min(looks, key=lambda f: f.criterion)

    def near(self, size: int, without: Sequence[Names] = ()) -> list[Names]:
        """Return the sets of a size near the best, no more than are fitted until they converge.

        After some that were not accepted, those whose gain over the best smaller set is significant against the noise.
        """
        near = super().near(size, without)[: self.converged_sets]
        if not without:
            return near
        smaller = self.fits[self.ranked(size - 1)[0]]
        return [n for n in near if FittedSets.p_value(self, self.fits[n], smaller) < CLAIM_LEVEL]

    def converge(self, size: int, without: Sequence[Names] = ()) -> None:
        """Fit the best sets of a size until they converge, except some, unless no other can be accepted."""
        if not without or self.near(size, without):
            super().converge(size, without)

    def converged(self, fits: Sequence[Grouped]) -> list[Grouped]:
        """Return the converged fits."""
        return in_parallel(self.maxima.go_on, fits)

    def under_noise_of(self, other: Grouped, fits: Sequence[Grouped]) -> list[Grouped]:
        """First fits again, under the noise of another fit of the same trials."""
        return in_parallel(lambda f: self.maxima.again(f, other.weights, 0), fits)

    def form_of(self, fitted: Grouped) -> frozenset[tuple[str, str, tuple[str, ...]]]:
        """Return for each cause of each group its name and its refinements."""
        models = fitted.grouped.models.items()
        return frozenset((g, e.name, e.refined()) for g, m in models for e in m.effects)

    def without(self, names: Names, name: str) -> Grouped:
        """Return the fit of a set without one item, from the values of the set where that is better."""
        rest, whole = tuple(n for n in names if n != name), self.fits[names]
        if self._compared.get((names, name)) is not whole:
            model = whole.grouped.having({i for i in whole.items if str(i) != name})
            own = self.maxima.fitted(model, whole.weights, whole.unknowns)
            if rest not in self.fits or own.criterion < self.fits[rest].criterion:
                self.fits[rest] = own
            self._converged.add(rest)
            self._compared[names, name] = whole
        return self.fits[rest]

    def is_possible(self, fitted: Grouped) -> bool:
        """Return False if the size of a cause in a group is physically impossible; see `possible.is_possible`."""
        model, measured = fitted.grouped, self._library.measured
        at_bound = {
            g: {n for n in m.parameters() if model.path(n, g) in fitted.at_bound} for g, m in model.models.items()
        }
        return all(are_possible(m.effects, at_bound[g], measured) for g, m in model.models.items())

    def is_a_model(self, fitted: Grouped) -> bool:
        """Return whether a fit is better than a constant in every group, and no nominal parameter is at a bound but 0.

        Where nominal parameters scatter between repeats, the fit is not compared with a constant.
        """
        nominal = self.nominal_model.parameters()
        if any(Key.of(n).name in nominal and fitted.values[n] != 0.0 for n in fitted.at_bound):
            return False
        return not self.leaves_noise(fitted) or all(
            misfit_percent(self.maxima.part(fitted, g)) <= WHOLE for g in self.trials
        )

    def is_certain(self, fitted: Grouped, name: str) -> bool:
        """Return whether a change is twice its deviation."""
        return next(fitted.certainty(i) for i in fitted.changes if str(i) == name) > CONFIDENCE_95

    def is_distinguished(self, best: Grouped, without: Grouped, rival: Grouped, lead: float) -> bool:
        """Return whether a rival is less likely, or not significant by the test of the change itself."""
        return lead >= SEPARABLE or not self.p_value(rival, without) < CLAIM_LEVEL

    def is_claimed(self, name: str) -> bool:
        """Return whether an item is a change: a cause of all groups is none."""
        return bool(Key.of(name).group)

    def excess_scatter(self, larger: Grouped, smaller: Grouped) -> float:
        """See `infer.scatter.excess_scatter`."""
        return excess_scatter(larger, smaller)

    def p_value(self, larger: Grouped, smaller: Grouped, gain: float | None = None) -> float:
        """Return the family-wise p-value of the gain of a larger set.

        For a cause of all groups it is that against the noise. For a change it is the larger of that and of the p-value
        against the spread between trials, as a repeat that differs by more than its noise is no change.
        """
        noise = super().p_value(larger, smaller, gain)
        if not set(larger.changes) - set(smaller.changes) or not noise < CLAIM_LEVEL:
            return noise
        (weighed,) = self.under_noise_of(larger, [smaller])
        between = self.spread(larger, weighed).p_value(weighed.sse - larger.sse, more_degrees(larger, smaller))
        return max(noise, self.family.adjusted(between))

    def spread(self, larger: Grouped, smaller: Grouped) -> Spread:
        """Return the spread between trials of the gain of a larger set over one under its noise; see `infer.spread`.

        The mean of all trials and that of one group are fitted.
        Few trials estimate the scatter of repeats poorly. Where a share q of the gain depends on it, f degrees of
        freedom are reduced to 1 / (1 / f + q^2 / f0), with f0 those of the trials. Source: Satterthwaite, Biometrics
        Bulletin 2 (1946).
        """
        left = np.concatenate([p.residual for p in larger.parts])
        moved = np.concatenate([p.residual for p in smaller.parts]) - left
        units = ByUnit.of(moved, left, larger.parts)
        free = len(units.sizes) - 1 - max(1, len(larger.changes))
        if free < 1:
            return Spread(1.0, free)
        both = units.clustered().pooled(self.screen.scores(larger).usual_spread)
        share = larger.leaning(moved) / float(moved @ moved)
        return Spread(both.phi, 1.0 / (1.0 / both.free + share**2 / free))

    def extension_p_value(self, fitted: Grouped) -> float:
        """Return the family-wise p-value of the largest score of a further item."""
        scores = (float(chi2_tail(s.gain, s.degrees)) for s in self.screen.scores(fitted).scored)
        return self.family.adjusted(min(scores, default=1.0))

    def leaves_noise(self, fitted: Grouped) -> bool:
        """Return False where repeats scatter or process noise acts, as these may be a missed change."""
        return not (fitted.repeats or fitted.is_driven)

    def better_form(self, fitted: Grouped) -> Grouped | None:
        """Return the set with a significant refinement of a cause; None without process noise, or where none is."""
        if not fitted.is_driven:
            return None
        starts, tried = [], 0
        for group, effect in _causes(fitted):
            own = fitted.grouped.models[group]
            tried += number_of_forms(own, [effect])
            forms = refinements(own, effect, self._library.measured)
            starts += [_moved(fitted.grouped, group, m) for m in forms if not m.own_unknowns()]
        looks = in_parallel(lambda start: self.maxima.fitted(start, fitted.weights, fitted.unknowns, 0), starts)
        return demanded_form(fitted, looks, DRIVEN_LEVEL / max(tried, 1), self.converged)

    def begin_again(self, names: Names) -> bool:
        """Fit a set and the nominal model with process noise where that improves the set's penalised likelihood."""
        return self._act(names)

    def _act(self, names: Names, least: float = 0.0) -> bool:
        """Fit a set and the nominal model with process noise where that gains more than an item is expected to gain."""
        fitted = self.fits[names]
        acting = None if fitted.is_driven else self.maxima.with_process_noise(fitted, max(least, 0.0))
        if acting is None:
            return False
        kept = {k: self.fits[k] for k in ((), names)}
        self.fits = {k: self.maxima.again(f, acting.weights) for k, f in kept.items()}
        self.family = self.screen.family(self.fits[names], self.seed)
        self._converged, self._begun, self._compared = set(self.fits), set(), {}
        return True


class CommonModels(ContrastModels):
    """Sets of causes that act in all groups alike, where every nominal parameter has a value of each group's own."""

    most_candidates = MOST_CAUSES

    def __init__(self, models: ContrastModels) -> None:
        super().__init__(models.maxima, models.seed)
        self.screen, self._library, self.family = models.screen, models._library, models.family
        self.fits[()] = self.maxima.apart(models.fits[()])

    def nominal(self) -> Grouped:
        """Return the nominal model with values of each group's own."""
        return self.fits[()]

    def first(self) -> Names:
        """Return the causes by which one group is near its data."""
        near = self.maxima.nearest(self.fits[()])
        names = tuple(sorted(str(i) for i in near.items if not i.group)) if near else ()
        if near:
            self.fits[names] = near
        return names

    def candidates(self, base: Grouped) -> dict[str, Candidate[list[ItemScore]]]:
        """Return the causes of all groups of largest score, where an error of all groups is significant.

        What a cause of one group explains better is no error of all groups.
        """
        if not (base.is_driven or self.extension_p_value(base) < UNUSUAL_LEVEL):
            return {}
        best = max(self.screen.scores(base).scored, key=lambda s: s.net_gain)
        known = super().candidates(base) if not best.item.group else {}
        return {n: one for n, one in known.items() if not self.is_claimed(n)}

    def begin_again(self, names: Names) -> bool:
        """Return False: the kind of noise is chosen with the changes."""
        return False


def _causes(fitted: Grouped) -> list[tuple[str, Effect]]:
    """Return the causes of a set, each once for all groups that share it, with the first group that has it."""
    each = [(g, e) for g, m in fitted.grouped.models.items() for e in m.effects]
    shared = {i.name for i in fitted.items if not i.group}
    return list({(e.name, "" if e.name in shared else g): (g, e) for g, e in reversed(each)}.values())


def _moved(model: GroupedModel, group: str, own: Model) -> GroupedModel:
    """Return a grouped model with the values that differ in one group's model."""
    known = model.models[group].parameters()
    return model.with_parameters({model.path(n, group): v for n, v in own.parameters().items() if v != known[n]})


ContrastSearch = Search[Grouped, ContrastModels]
"""A search for changes between groups."""

__all__ = ["POLICY", "ContrastModels", "ContrastSearch", "Found"]
