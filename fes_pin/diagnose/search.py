"""The search for causes: every candidate fitted jointly with the nominal model, one, two and three at a time."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy.stats

from fes_pin.data.trial import Trial
from fes_pin.diagnose.held_out import predictive_error
from fes_pin.diagnose.library import Library, Projection, Scored, Scores, best_by_effect, best_pairs
from fes_pin.diagnose.noise_floor import rich_noise, whiteless
from fes_pin.diagnose.open_set import smooth_remainder
from fes_pin.diagnose.significance import Family, coherence_p_value
from fes_pin.diagnose.workers import in_parallel
from fes_pin.identify.fit import Fit, fit_problem, noise_of, rough_noise
from fes_pin.identify.noise import NoiseModel
from fes_pin.identify.problem import Problem
from fes_pin.models.model import Model
from fes_pin.models.stage import Effect

CLAIM_LEVEL = 0.01
"""Family-wise error of each round of claims; with the tests of the remainder (0.02) a diagnosis stays below 5 %, with
room for noise that is not quite autoregressive."""
FORM_SHARE = 0.05
"""A further cause must explain at least this share of what all causes do: a real cause differs from its equation, and
an error of 22 % in its form leaves 5 % of its likelihood to whatever else comes near."""
HOPE_LEVEL = 0.1
"""A round of joint fits is left out only if neither a linear promise nor smooth features reach this level."""
PROMISING = 25.0
"""Linear promise of a further cause, in twice the log-likelihood, that keeps a set from being complete: 5 sigma."""
SLOWEST_NOISE = 10.0
"""Standard deviation of a residual over that of its sample-to-sample part beyond which it counts as misfit. First-order
autoregressive noise has 3.8 at a coefficient of 0.9, 5.5 at 0.95, 12 at 0.99."""
REFINE_LEVEL = 1e-3
"""Level at which a refinement of an effect's form is adopted."""
MOST_CAUSES = 3
BEAM = 3
"""Sets that each round extends; greedy search (1) loses 5 to 8 points of exact pairs (DESIGN section 6)."""
POOL = 6
"""Sets of each size that are compared by prediction."""
SEEDS = 4
"""Pairs that the linear screen proposes by itself, for causes that do nothing alone."""
JOINT_FITS = 8
"""Extensions of a round that are fitted jointly, best linear promise first."""
STARTS = 2
"""Shapes that a joint fit starts from."""

Names = tuple[str, ...]
Progress = Callable[[float, str], None]


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
    floor
        The noise that no model can beat: as fitted, or, where the best set leaves more than noise, the sample-to-sample
        noise of the measurement.
    complete
        Whether the best set leaves only noise.
    """

    nominal: Fit
    best: Fit
    p_values: dict[str, float]
    rivals: dict[str, list[Fit]]
    judged: Fit
    without: dict[str, Fit]
    family: Family
    scored: list[Scored]
    floor: NoiseModel
    complete: bool = True


class Search:
    """One search on one set of trials; `recorded` are the same trials before any thinning."""

    def __init__(
        self, model: Model, trials: Sequence[Trial], recorded: Sequence[Trial], seed: int, progress: Progress
    ) -> None:
        self.model, self.trials, self.seed, self.progress = Model(model.rig), tuple(trials), seed, progress
        self.recorded = tuple(recorded)
        self.library = Library(self.model, trials)
        self.noise: NoiseModel = {}
        self.fits: dict[Names, Fit] = {}
        self._problems: dict[tuple, Problem] = {}

    def fit_from(self, starts: Iterable[Model], unknowns: list[dict[str, float]] | None) -> Fit:
        """The best of several fits of one structure."""
        best: Fit | None = None
        for start in starts:
            key = (start.structure(), start.fitted_parameters(), _choices(start))
            if key not in self._problems:
                self._problems[key] = Problem(start, self.trials, self.noise)
            problem = self._problems[key]
            problem.noise = self.noise
            fitted = fit_problem(problem, start.parameters(), unknowns)
            if best is None or fitted.price < best.price or not np.isfinite(best.sse):
                best = fitted
        assert best is not None
        return best

    def extend(self, base: Fit, scored: Sequence[Scored]) -> Fit:
        """Fit a base with one more effect, from its most promising shapes.

        Amplitudes start at their linear estimate; where that falls over (a stiffness below zero), at their nulls.
        """
        starts = []
        for one in scored[:STARTS]:
            effect = _with_amplitudes(one.probe.effect, one.amplitudes)
            starts.append(base.model + effect)
        fitted = self.fit_from(starts, base.unknowns)
        if np.isfinite(fitted.sse):
            return fitted
        return self.fit_from([base.model + one.probe.effect for one in scored[:STARTS]], base.unknowns)

    def scores(self, base: Fit) -> Scores:
        """Promise of every effect that a fit does not have."""
        return Projection(base.parts).score(self.library.probes(base, self.noise, exclude=_names(base)))

    def first_noise(self, base: Fit) -> None:
        """The noise of the nominal model, beside everything that the library could explain: only to rank causes."""
        white = whiteless(noise_of(base))
        probes = self.library.probes(base, white, exclude=())
        varying = {p.name: [q.columns for q in probes if q.name == p.name] for p in probes if p.effect.varies}
        self.noise = rich_noise(base, white, [p.columns for p in probes], list(varying.values()))

    def refit(self, names: Iterable[Names], noise_from: Names) -> None:
        """Fit sets of causes again under the noise that one of them leaves, and forget all others."""
        self.noise = noise_of(self.fits[noise_from])
        kept = [n for n in dict.fromkeys(names) if n in self.fits]
        old = self.fits
        fitted = in_parallel(lambda n: self.fit_from([old[n].model], old[n].unknowns), kept)
        self.fits = dict(zip(kept, fitted, strict=True))

    def ranked(self, size: int) -> list[Names]:
        """Sets of a size, cheapest first."""
        return sorted((n for n in self.fits if len(n) == size), key=lambda n: (self.fits[n].price, n))

    def run(self) -> Searched:
        """Search."""
        self._nominal()
        family = self._singles()
        best: Names = ()
        for size in range(1, MOST_CAUSES + 1):
            self.progress(0.35 + 0.12 * size, f"sets of {size}")
            if size > 1 and not self._extend_beam(size, family):
                break
            first = self._swap(self.ranked(size)[0])
            if size == 2 and not self._complete(first):
                self._extend_beam(size, family, every=True)
                first = self._swap(self.ranked(size)[0])
            if self._better(first, best, family):
                self._refine(first)
                best = first
            if best == first and self._complete(best):
                keep = [(), best, *self.ranked(1)[:6], *self.ranked(size)[:6], *_subsets(best)]
                self.refit(keep, best)
                best = self.ranked(size)[0]
            elif size > 1 and best != first:
                break
        best = self._backward(best, family)
        if not self._complete(best):
            best = self._backward(self._by_prediction(best), family)
            self._refine(best)
        self.refit([(), best, *self.ranked(1), *self.ranked(len(best) or 1)[:JOINT_FITS], *_subsets(best)], best)
        return self.settle(best)

    def settle(self, names: Names) -> Searched:
        """Everything that is to be said of a set of causes: its rivals, and each cause's part in it."""
        searched = self._finish(names, self.family)
        if self._complete(names):
            return searched
        floor = rough_noise(self.model, self.trials)
        return replace(self._for_prediction(searched) if names else searched, floor=floor, complete=False)

    def _for_prediction(self, searched: Searched) -> Searched:
        """Fit for least open-loop error, to the trials as recorded.

        What the best set leaves is more than noise, and not to be whitened. Rivals stay as they were judged.
        """
        noise = whiteless(noise_of(searched.best))

        def again(fitted: Fit) -> Fit:
            return fit_problem(Problem(fitted.model, self.recorded, noise), fitted.values)

        nominal, best, *rest = in_parallel(again, [searched.nominal, searched.best, *searched.without.values()])
        without = dict(zip(searched.without, rest, strict=True))
        return replace(searched, nominal=nominal, best=best, without=without)

    def _complete(self, names: Names) -> bool:
        """True if a set leaves only noise: no further cause promises anything, and neither do smooth features.

        The promise is judged by the present noise; noise learned from the set itself can swallow a slow cause.
        """
        fitted, none = self.fits[names], self.fits[()]
        if slow_misfit(fitted):
            return False
        promise = max(s.gain for s in self.scores(fitted).scored)
        if promise > max(PROMISING, FORM_SHARE * (none.sse - fitted.sse)):
            return False
        own = fit_problem(Problem(fitted.model, self.trials, noise_of(fitted)), fitted.values, fitted.unknowns)
        return not smooth_remainder(own, self.seed).unexplained

    def _nominal(self) -> None:
        self.progress(0.02, "nominal model")
        self.noise = rough_noise(self.model, self.trials)
        first = self.fit_from([self.model], None)
        self.first_noise(first)
        self.fits[()] = self.fit_from([first.model], first.unknowns)

    def _singles(self) -> Family:
        base = self.fits[()]
        self.progress(0.08, "screening")
        scores = self.scores(base)
        family, scored = Family(scores, self.seed), best_by_effect(scores.scored)
        self.family = family
        self._seeds = best_pairs(scores, SEEDS)
        self.progress(0.12, "every cause, fitted jointly")
        fitted = in_parallel(lambda v: self.extend(base, v), scored.values())
        for name, one in zip(scored, fitted, strict=True):
            self.fits[(name,)] = one
        return family

    def _extend_beam(self, size: int, family: Family, every: bool = False) -> bool:
        """Fit the most promising sets of a size, or every one; False if nothing at all is left to find."""
        promised: dict[Names, tuple[float, Names, list[Scored]]] = {}
        for names in self.ranked(size - 1)[:BEAM]:
            base = self.fits[names]
            for name, scored in best_by_effect(self.scores(base).scored).items():
                key = tuple(sorted((*names, name)))
                promise = base.sse - scored[0].gain
                if key not in self.fits and (key not in promised or promise < promised[key][0]):
                    promised[key] = (promise, names, scored)
        if size == 2:
            self._plant(promised)
        chosen = sorted(promised.items(), key=lambda item: (item[1][0], item[0]))
        if not every:
            chosen = chosen[:JOINT_FITS]
        if not chosen or not (every or self._hopeful(size, chosen[0][1][0], family)):
            return False
        fitted = in_parallel(lambda item: self.extend(self.fits[item[1][1]], item[1][2]), chosen)
        for (key, _), one in zip(chosen, fitted, strict=True):
            self.fits[key] = one
        return True

    def _plant(self, promised: dict[Names, tuple[float, Names, list[Scored]]]) -> None:
        """Fit the pairs of the linear screen that no single leads to."""
        base = self.fits[()]
        wanted = {tuple(sorted((a.probe.name, b.probe.name))): (a, b) for a, b in self._seeds}
        missing = [(k, v) for k, v in wanted.items() if k not in self.fits]
        fitted = in_parallel(lambda item: self.fit_from([_both(base.model, *item[1])], base.unknowns), missing)
        for (key, _), one in zip(missing, fitted, strict=True):
            self.fits[key] = one
            promised.pop(key, None)

    def _hopeful(self, size: int, promise: float, family: Family) -> bool:
        """True unless both the linear promise and the smooth features say that the best smaller set is complete."""
        best, none = self.fits[self.ranked(size - 1)[0]], self.fits[()]
        gain = best.sse - promise
        if gain > 0.5 * FORM_SHARE * (none.sse - best.sse) and family.p_value(gain, 1) < HOPE_LEVEL:
            return True
        return smooth_remainder(best, self.seed).p_value < HOPE_LEVEL

    def _better(self, names: Names, best: Names, family: Family) -> bool:
        """True if a larger set earns its place beside the best smaller one."""
        larger, smaller, none = self.fits[names], self.fits[best], self.fits[()]
        if smaller.sse - larger.sse < FORM_SHARE * (none.sse - larger.sse):
            return False
        return self.p_value(larger, smaller, family) < CLAIM_LEVEL

    def p_value(self, larger: Fit, smaller: Fit, family: Family) -> float:
        """Family-wise p-value of what a larger model adds.

        It must be significant under the present noise, and either under the noise that the smaller model leaves (which
        can swallow a slow cause) or against the spread between trials (which no noise model enters).
        """
        degrees = max(larger.degrees - smaller.degrees, 1)
        p_value = family.p_value(smaller.sse - larger.sse, degrees)
        coherent = family.adjusted(coherence_p_value(smaller, larger, degrees))
        if coherent < p_value:
            return p_value
        if p_value < CLAIM_LEVEL:
            noise = noise_of(smaller)
            few, many = (
                fit_problem(Problem(f.model, self.trials, noise), f.values, f.unknowns) for f in (smaller, larger)
            )
            p_value = max(p_value, min(coherent, family.p_value(few.sse - many.sse, degrees)))
        return p_value

    def _refine(self, names: Names) -> None:
        """Adopt refinements of the effects' forms that the data demand."""
        refined, base = self._refinement(names), self.fits[names]
        if refined is not None:
            degrees = max(refined.degrees - base.degrees, 1)
            if scipy.stats.chi2.sf(base.sse - refined.sse, degrees) < REFINE_LEVEL:
                self.fits[names] = refined

    def _refinement(self, names: Names) -> Fit | None:
        """The best fit of a set with the form of one of its effects refined."""
        base = self.fits[names]
        starts = [s for name in names if (s := _refined(base.model, name))]
        fitted = in_parallel(lambda s: self.fit_from(s, base.unknowns), starts)
        return min(fitted, key=lambda f: f.sse, default=None)

    def _swap(self, names: Names) -> Names:
        """Replace single causes as long as that helps."""
        for _ in range(2 if len(names) > 1 else 0):
            for name in names:
                self.replace(names, name)
            now = self.ranked(len(names))[0]
            if now == names:
                break
            names = now
        return names

    def replace(self, names: Names, name: str, count: int = 5) -> list[Names]:
        """Fit the sets in which another cause takes the place of `name`; returns their names."""
        rest = tuple(n for n in names if n != name)
        base = self.base(rest, names)
        scored = {n: v for n, v in best_by_effect(self.scores(base).scored).items() if n != name}
        order = sorted(scored, key=lambda n: (-scored[n][0].gain, n))[:count]
        keys = [tuple(sorted((*rest, n))) for n in order]
        missing = [(k, n) for k, n in zip(keys, order, strict=True) if k not in self.fits]
        for (key, _), one in zip(
            missing, in_parallel(lambda item: self.extend(base, scored[item[1]]), missing), strict=True
        ):
            self.fits[key] = one
        return keys

    def base(self, rest: Names, names: Names) -> Fit:
        """The fit of a subset of a set, from the set's own values if there is none yet."""
        if rest not in self.fits:
            whole = self.fits[names]
            model = whole.model
            for n in set(names) - set(rest):
                model = model - n
            self.fits[rest] = self.fit_from([model], whole.unknowns)
        return self.fits[rest]

    def _backward(self, names: Names, family: Family) -> Names:
        """Drop causes that the others have made superfluous."""
        while len(names) > 1:
            rests = {n: tuple(m for m in names if m != n) for n in names}
            weakest = min(names, key=lambda n: self.base(rests[n], names).sse)
            if self._better(names, rests[weakest], family):
                break
            names = rests[weakest]
        return names

    def _by_prediction(self, names: Names) -> Names:
        """Choose by open-loop errors on trials left out, where no set leaves only noise.

        Then likelihoods compare wrong models, and a flexible one can win by what it does to single trials; a cause must
        help on trials that it was not fitted to.
        """
        self.progress(0.72, "prediction of trials left out")
        if len(self.trials) < 3:
            return names
        pool = dict.fromkeys(
            [names, *_subsets(names), *(n for k in range(1, MOST_CAUSES + 1) for n in self.ranked(k)[:POOL])]
        )
        errors = dict(zip(pool, in_parallel(lambda n: predictive_error(self.fits[n]), pool), strict=True))
        for one in sorted(errors, key=lambda n: (errors[n], n))[:POOL]:
            refined = self._refinement(one)
            if refined is not None and (error := predictive_error(refined)) < errors[one]:
                self.fits[one], errors[one] = refined, error
        best = min(errors, key=lambda n: (errors[n], n))
        good = [n for n in errors if errors[n] <= errors[best] + FORM_SHARE]
        return min(good, key=lambda n: (len(n), errors[n], n))

    def _finish(self, names: Names, family: Family) -> Searched:
        self.progress(0.8, "rivals")
        best, without, rivals, p_values = self.fits[names], {}, {}, {}
        for name in names:
            rest = tuple(n for n in names if n != name)
            without[name] = self.base(rest, names)
            keys = [k for k in dict.fromkeys([*self.replace(names, name), *self._siblings(names, name)]) if k != names]
            rivals[name] = sorted((self.fits[k] for k in keys), key=lambda f: f.sse)
            p_values[name] = self.p_value(best, without[name], family)
        scored = self.scores(self.fits[()]).scored
        return Searched(self.fits[()], best, p_values, rivals, best, without, family, scored, best.noise)

    def _siblings(self, names: Names, name: str) -> list[Names]:
        """Sets fitted already that differ from `names` in `name` alone."""
        rest = {n for n in names if n != name}
        return [
            k for k in self.fits if len(k) == len(names) and rest < set(k) | {""} and rest <= set(k) and name not in k
        ]


def slow_misfit(fitted: Fit) -> bool:
    """True if a residual is so much slower than the sample-to-sample noise that it cannot be told from misfit."""
    rough, own = rough_noise(Model(fitted.model.rig), fitted.trials), noise_of(fitted)
    return any(own[n].std > SLOWEST_NOISE * rough[n].std for n in own)


def _names(fitted: Fit) -> Names:
    return tuple(sorted(e.name for e in fitted.model.effects))


def _subsets(names: Names) -> list[Names]:
    return [tuple(m for m in names if m != n) for n in names]


def _choices(model: Model) -> tuple[float, ...]:
    """Values of discrete choices, which compiled problems share but fits must not mix."""
    info = model.parameter_info()
    return tuple(v for n, v in model.parameters().items() if not info[n].fitted)


def _refined(model: Model, name: str) -> list[Model]:
    """Starts with the refinements of one effect switched on."""
    (effect,) = (e for e in model.effects if e.name == name)
    info = {n: effect.parameters()[n] for n in effect.refinements()}
    if not info or effect.refined():
        return []
    choices = itertools.product(*(i.grid for i in info.values()))
    return [model.with_parameters({f"{name}.{n}": v for n, v in zip(info, values, strict=True)}) for values in choices]


def _both(model: Model, first: Scored, second: Scored) -> Model:
    for one in (first, second):
        model = model + _with_amplitudes(one.probe.effect, one.amplitudes)
    return model


def _with_amplitudes(effect: Effect, amplitudes: dict[str, float]) -> Effect:
    """The effect at a linear estimate of its amplitudes, or a step from its null where that says nothing."""
    info = effect.parameters()
    values: dict[str, Any] = {}
    for name, value in amplitudes.items():
        null, one = info[name].null, info[name]
        assert null is not None
        step = 0.2 * one.scale if one.upper > null else -0.2 * one.scale
        far = 20.0 * one.scale
        values[name] = (
            null + step if abs(value - null) < 1e-6 * one.scale else float(np.clip(value, null - far, null + far))
        )
    return replace(effect, **values)
