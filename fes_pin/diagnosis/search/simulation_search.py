"""The search for causes: every candidate fitted jointly with the nominal model, one, two and three at a time."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from fes_pin.data.trial import Trial
from fes_pin.diagnosis.decide.claims import Claims
from fes_pin.diagnosis.search.cause_sets import MOST_CAUSES, Names, subsets
from fes_pin.diagnosis.search.misspecified import choose_by_prediction, fit_for_prediction
from fes_pin.diagnosis.search.model_fitter import FIRST_ITERATIONS
from fes_pin.diagnosis.search.restarts import at_null, restart, restart_beside, restart_every
from fes_pin.diagnosis.search.score import Scored, best_by_effect, best_pairs
from fes_pin.diagnosis.search.simulation_fits import CONVERGED_SETS, SimulationFits
from fes_pin.identify.fit import Fit, fit_multistart, rough_noise
from fes_pin.infer.noise import NoiseModel
from fes_pin.models.model import Model
from fes_pin.models.stage import Effect
from fes_pin.workers import OutOfTime, Progress, time_limit

BEAM = 3
"""Sets that each round extends; greedy search (1) loses 5 to 8 points of exact pairs (DESIGN section 6)."""
SEEDS = 4
"""Pairs that the linear screen proposes by itself, for causes that do nothing alone."""
JOINT_FITS = 8
"""Extensions of a round that are fitted jointly, largest score first."""
SWAPS = 5
"""Causes that are tried in the place of another, largest score first."""
POOL = 6
"""Sets of each size that are compared by prediction."""

MISSPECIFIED = 1e3
"""Reduced chi-square, in the noise from sample to sample, of a nominal model so wrong that nothing follows from it:
every cause is then fitted from afar."""


class NominalFitError(Exception):
    """A study to which not even the nominal model can be fitted.

    Parameters
    ----------
    why
        One line.
    nominal
        As far as its fit came.
    """

    def __init__(self, why: str, nominal: Fit) -> None:
        super().__init__(why)
        self.nominal = nominal


@dataclass
class Searched:
    """What a search found.

    Attributes
    ----------
    nominal, best
        Fits under the final noise.
    p_values
        Family-wise, of each cause of `best`, beside the others.
    rivals
        For each cause, fits in which another took its place.
    judged
        The best set, fitted as its rivals are.
    without
        For each cause, the fit without it.
    scored
        Score of every effect beside the nominal model, and of those that the best set has not beside that.
    floor
        The noise that no model can beat: as fitted, or, where the best set leaves more than noise, the sample-to-sample
        noise of the measurement.
    complete
        Whether the best set leaves only noise.
    stopped
        Whether the search ended at its limit of time: then rivals are those that were fitted by chance, and nothing was
        tried on trials left out.
    """

    nominal: Fit
    best: Fit
    p_values: dict[str, float]
    rivals: Mapping[str, Sequence[Fit]]
    judged: Fit
    without: Mapping[str, Fit]
    scored: list[Scored]
    floor: NoiseModel
    complete: bool = True
    stopped: bool = False


class SimulationSearch:
    """One search on one set of trials; `recorded` are the same trials before any thinning.

    Among `effects`; by default those that are written here or installed, of the rig.
    """

    def __init__(
        self,
        model: Model,
        trials: Sequence[Trial],
        recorded: Sequence[Trial],
        seed: int,
        progress: Progress,
        effects: Sequence[type[Effect]] | None = None,
    ) -> None:
        self.sets, self.seed, self.progress = SimulationFits(model, trials, effects), seed, progress
        self.recorded, self.library = tuple(recorded), self.sets.library
        self._scored: list[Scored] = []
        self.was_stopped = False

    def run(self) -> Searched:
        """Search, as long as the limit of time lets it; the nominal model is fitted anyway."""
        try:
            self._nominal()
            self._singles()
            return self._best_set()
        except OutOfTime:
            self.was_stopped = True
            with time_limit(math.inf):
                return self.stopped(self._fallback[0])

    def _best_set(self) -> Searched:
        """The best set of causes, and everything that is to be said of it."""
        best: Names = ()
        for size in range(1, MOST_CAUSES + 1):
            self.progress(0.35 + 0.12 * size, f"sets of {size}")
            if size > 1 and not self._extend_beam(size):
                break
            first = self._swap(self.sets.ranked(size)[0])
            if size == 1:
                first = self._refine_best()
            if size == 2 and not self.claims.complete(first):
                self._extend_beam(size, every=True)
                first = self._swap(self.sets.ranked(size)[0])
            if self.claims.better(first, best):
                self._refine(first)
                best = first
            self._keep(best)
            if best == first and self.claims.complete(best):
                ranked = self.sets.ranked
                self.sets.refit([(), best, *ranked(1)[:6], *ranked(size)[:6], *subsets(best)], best)
                best = ranked(size)[0]
            elif size > 1 and best != first:
                break
        best = self._backward(best)
        if not self.claims.complete(best):
            best = self._backward(self._by_prediction(best))
            self._refine(best)
        self.sets.refit([(), best, *self._beside(best), *subsets(best)], best)
        return self.settle(best)

    def _keep(self, best: Names) -> None:
        """Keep what a search that is stopped falls back on."""
        self._fallback = (best, self.sets.fitter.noise, dict(self.sets.fits))

    def stopped(self, names: Names) -> Searched:
        """What is known of a set of causes where the search was stopped, without another search for its rivals."""
        sets = self.sets
        _, noise, fits = self._fallback
        sets.set_noise(noise)
        sets.fits = dict(fits)
        without = {n: sets.base(tuple(m for m in names if m != n), names) for n in names}
        beside = {n: [sets.fits[k] for k in self._siblings(names, n) if k != names] for n in names}
        rivals = {n: sorted(fits, key=lambda f: f.sse) for n, fits in beside.items()}
        p_values = {n: self.claims.p_value(sets.fits[names], without[n]) for n in names}
        best, floor = sets.fits[names], rough_noise(sets.model, sets.trials)
        return Searched(sets.fits[()], best, p_values, rivals, best, without, self._scored, floor, False, True)

    def nominal(self) -> Fit:
        """The nominal model as far as it has been fitted."""
        return self.sets.fits.get((), self._begun)

    def settle(self, names: Names) -> Searched:
        """Everything that is to be said of a set of causes: its rivals, and each cause's part in it."""
        searched = self._finish(names)
        if self.claims.complete(names):
            return searched
        floor = rough_noise(self.sets.model, self.sets.trials)
        return replace(self.for_prediction(searched) if names else searched, floor=floor, complete=False)

    def for_prediction(self, searched: Searched) -> Searched:
        """Fit for least open-loop error, to the trials as recorded; rivals stay as they were judged."""
        many = [searched.best, searched.nominal, *searched.without.values()]
        best, nominal, *rest = fitted = fit_for_prediction(many, self.recorded)
        if not all(math.isfinite(f.sse) for f in fitted):
            return searched
        return replace(searched, nominal=nominal, best=best, without=dict(zip(searched.without, rest, strict=True)))

    def _by_prediction(self, names: Names) -> Names:
        """Choose among the best sets of each size by what they predict."""
        self.progress(0.72, "prediction of trials left out")
        ranked = [n for k in range(1, MOST_CAUSES + 1) for n in self.sets.ranked(k)[:POOL]]
        return choose_by_prediction(self.sets, names, list(dict.fromkeys([names, *subsets(names), *ranked])))

    def _beside(self, names: Names) -> list[Names]:
        """Sets that stand beside a chosen one as its rivals: all single causes, or the best sets of its size."""
        return self.sets.ranked(1) if len(names) == 1 else self.sets.ranked(len(names))[:JOINT_FITS]

    def _nominal(self) -> None:
        sets = self.sets
        self.progress(0.02, "nominal model")
        sets.set_noise(rough_noise(sets.model, sets.trials))
        with time_limit(math.inf):
            first = fit_multistart(sets.fitter.problem(sets.model), sets.model.parameters(), None, FIRST_ITERATIONS)
        self._begun = first
        self._fallback = ((), first.noise, {(): first})
        if not math.isfinite(first.sse):
            raise NominalFitError(
                "the nominal model's simulation leaves the floating-point numbers from its start values on", first
            )
        self._misspecified = first.reduced > MISSPECIFIED
        sets.first_noise(first)
        sets.fits[()] = sets.fitter.fit_from([first.model], first.unknowns)
        sets.finish(())
        self._keep(())

    def _singles(self) -> None:
        sets, base = self.sets, self.sets.fits[()]
        self.progress(0.08, "screening")
        scores = sets.scores(base)
        self.claims, self._scored = Claims(sets, scores, self.seed), scores.scored
        self._seeds = best_pairs(scores, SEEDS)
        self.progress(0.12, "every cause, fitted jointly")
        by_effect = best_by_effect(scores.scored)
        sets.add({(n,): lambda v=v: sets.fitter.extend(base, v) for n, v in by_effect.items()})  # type: ignore[misc]
        if self._misspecified:
            restart_every(sets)
        else:
            restart(sets, list(dict.fromkeys([*sets.ranked(1)[:CONVERGED_SETS], *at_null(sets)])))

    def _extend_beam(self, size: int, every: bool = False) -> bool:
        """Fit the sets of a size that score best, or every one; False if nothing at all is left to find."""
        sets, extend = self.sets, self.sets.fitter.extend
        scored_sets: dict[Names, tuple[float, Names, list[Scored]]] = {}
        for names in sets.ranked(size - 1)[:BEAM]:
            base = sets.fits[names]
            for name, scored in best_by_effect(sets.scores(base).scored).items():
                key = tuple(sorted((*names, name)))
                left = base.sse - scored[0].gain
                if key not in sets.fits and (key not in scored_sets or left < scored_sets[key][0]):
                    scored_sets[key] = (left, names, scored)
        if size == 2:
            for key in self._fit_screened_pairs():
                scored_sets.pop(key, None)
        chosen = sorted(scored_sets.items(), key=lambda item: (item[1][0], item[0]))
        if not every:
            chosen = chosen[:JOINT_FITS]
        if not chosen or not (every or self.claims.worth_extending(size, chosen[0][1][0])):
            return False
        sets.add({k: lambda n=n, v=v: extend(sets.fits[n], v) for k, (_, n, v) in chosen})  # type: ignore[misc]
        return True

    def _fit_screened_pairs(self) -> list[Names]:
        """Fit the pairs of the linear screen that no single leads to; returns their names."""
        sets, base, extend = self.sets, self.sets.fits[()], self.sets.fitter.extend_with_both
        wanted = {tuple(sorted((a.probe.name, b.probe.name))): (a, b) for a, b in self._seeds}
        missing = {k: v for k, v in wanted.items() if k not in sets.fits}
        sets.add({k: lambda v=v: extend(base, v) for k, v in missing.items()})  # type: ignore[misc]
        return list(missing)

    def _refine(self, names: Names) -> None:
        """Adopt refinements of the effects' forms that the data demand."""
        refined = self.sets.refinement(names)
        if refined is not None and self.claims.demanded(refined, self.sets.fits[names]):
            self.sets.fits[names] = refined

    def _refine_best(self) -> Names:
        """The best single cause, once each of the best has the form that the data demand."""
        for names in self.sets.ranked(1)[:BEAM]:
            self._refine(names)
        return self.sets.ranked(1)[0]

    def _swap(self, names: Names) -> Names:
        """Replace single causes as long as that helps."""
        for _ in range(2 if len(names) > 1 else 0):
            for name in names:
                self._replace(names, name, SWAPS)
            now = self.sets.ranked(len(names))[0]
            if now == names:
                break
            names = now
        return names

    def _replace(self, names: Names, name: str, count: int | None, again: bool = False) -> list[Names]:
        """Fit the sets in which another cause takes the place of `name`, or fit them again; returns their names."""
        sets, rest = self.sets, tuple(n for n in names if n != name)
        base = sets.base(rest, names)
        scored = {n: v for n, v in best_by_effect(sets.scores(base).scored).items() if n != name}
        order = sorted(scored, key=lambda n: (-scored[n][0].gain, n))[:count]
        keys = {tuple(sorted((*rest, n))): scored[n] for n in order}
        missing = {k: v for k, v in keys.items() if again or k not in sets.fits}
        sets.add({k: lambda v=v: sets.fitter.extend(base, v) for k, v in missing.items()})  # type: ignore[misc]
        return list(keys)

    def _backward(self, names: Names) -> Names:
        """Drop causes that the others have made superfluous."""
        while len(names) > 1:
            weakest = min(subsets(names), key=lambda rest: self.sets.base(rest, names).sse)
            if self.claims.better(names, weakest):
                break
            names = weakest
        return names

    def _finish(self, names: Names) -> Searched:
        self.progress(0.8, "rivals")
        sets, without, rivals, p_values = self.sets, {}, {}, {}
        better = sets.better_bases(names)
        for name in names:
            rest = tuple(n for n in names if n != name)
            without[name] = sets.base(rest, names)
            alone = len(names) == 1 and len(sets.ranked(1)) < SWAPS  # what was withdrawn left no rivals behind
            replaced = self._replace(names, name, None if alone else SWAPS, rest in better)
            if len(names) == 1:
                restart_beside(sets, names)
            keys = [*replaced, *self._siblings(names, name)]
            others = (sets.fits[k] for k in dict.fromkeys(keys) if k != names)
            rivals[name] = sorted((f for f in others if not sets.is_absurd(f)), key=lambda f: f.sse)
            p_values[name] = self.claims.p_value(sets.fits[names], without[name])
        none, best = sets.fits[()], sets.fits[names]
        scored = sets.scores(none).scored + (sets.scores(best).scored if names else [])
        return Searched(none, best, p_values, rivals, best, without, scored, best.noise)

    def _siblings(self, names: Names, name: str) -> list[Names]:
        """Sets fitted already that differ from `names` in `name` alone."""
        rest = {n for n in names if n != name}
        return [k for k in self.sets.fits if len(k) == len(names) and rest <= set(k) and name not in k]


__all__ = ["NominalFitError", "Searched", "SimulationSearch"]
