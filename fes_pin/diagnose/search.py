"""The search for causes: every candidate fitted jointly with the nominal model, one, two and three at a time."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.stats

from fes_pin.data.trial import Trial
from fes_pin.diagnose.library import Library, Projection, Scored, Scores, best_by_effect
from fes_pin.diagnose.noise_floor import rich_noise, whiteless
from fes_pin.diagnose.open_set import remainder
from fes_pin.diagnose.significance import Family, coherence_p_value
from fes_pin.diagnose.workers import in_parallel
from fes_pin.identify.fit import Fit, fit_problem, noise_of, rough_noise
from fes_pin.identify.noise import NoiseModel
from fes_pin.identify.problem import Problem
from fes_pin.models.model import Model
from fes_pin.models.stage import Effect

CLAIM_LEVEL = 0.01
"""Family-wise error of each round of claims; with the test of the remainder (0.01) a diagnosis stays below 5 %, with
room for noise that is not quite autoregressive."""
FORM_SHARE = 0.02
"""A further cause must explain at least this share of what all causes do: a real cause differs from its equation, and
an error of 14 % in its form leaves 2 % of its likelihood to whatever else comes near."""
HOPE_LEVEL = 0.1
"""A round of joint fits is left out only if neither a linear promise nor smooth features reach this level."""
REFINE_LEVEL = 1e-3
"""Level at which a refinement of an effect's form is adopted."""
MOST_CAUSES = 3
BEAM = 3
"""Sets that each round extends; greedy search (1) loses 5 to 8 points of exact pairs (DESIGN section 6)."""
JOINT_FITS = 8
"""Extensions of a round that are fitted jointly, best linear promise first."""
STARTS = 2
"""Shapes that a joint fit starts from."""
PARAMETER_PRICE = 3.84
"""Twice the log-likelihood that one more parameter must earn: chi-square with one degree of freedom at 95 %."""

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
    without
        For each cause, the fit without it.
    """

    nominal: Fit
    best: Fit
    p_values: dict[str, float]
    rivals: dict[str, list[Fit]]
    without: dict[str, Fit]
    family: Family
    scored: list[Scored]
    singles: list[Fit]


class Search:
    """One search on one set of trials."""

    def __init__(self, model: Model, trials: Sequence[Trial], seed: int, progress: Progress) -> None:
        self.model, self.trials, self.seed, self.progress = Model(model.rig), tuple(trials), seed, progress
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
            if best is None or fitted.sse < best.sse or not np.isfinite(best.sse):
                best = fitted
        assert best is not None
        return best

    def extend(self, base: Fit, scored: Sequence[Scored]) -> Fit:
        """Fit a base with one more effect, from its most promising shapes."""
        starts = []
        for one in scored[:STARTS]:
            effect = _with_amplitudes(one.probe.effect, one.amplitudes)
            starts.append(base.model + effect)
        return self.fit_from(starts, base.unknowns)

    def scores(self, base: Fit) -> Scores:
        """Promise of every effect that a fit does not have."""
        return Projection(base.parts).score(self.library.probes(base, self.noise, exclude=_names(base)))

    def first_noise(self, base: Fit) -> None:
        """The noise of the nominal model, beside everything that the library could explain: only to rank causes."""
        white = whiteless(noise_of(base))
        probes = self.library.probes(base, white, exclude=())
        self.noise = rich_noise(base, white, [p.columns for p in probes])

    def refit(self, names: Iterable[Names], noise_from: Names) -> None:
        """Fit sets of causes again under the noise that one of them leaves, and forget all others."""
        self.noise = noise_of(self.fits[noise_from])
        kept = [n for n in dict.fromkeys(names) if n in self.fits]
        old = self.fits
        fitted = in_parallel(lambda n: self.fit_from([old[n].model], old[n].unknowns), kept)
        self.fits = dict(zip(kept, fitted, strict=True))

    def price(self, fitted: Fit) -> float:
        """Twice the negative log-likelihood, with what its parameters must earn."""
        return fitted.sse + PARAMETER_PRICE * len(fitted.free)

    def ranked(self, size: int) -> list[Names]:
        """Sets of a size, cheapest first."""
        return sorted((n for n in self.fits if len(n) == size), key=lambda n: (self.price(self.fits[n]), n))

    def run(self) -> Searched:
        """Search."""
        self._nominal()
        family = self._singles()
        best: Names = ()
        for size in range(1, MOST_CAUSES + 1):
            self.progress(0.35 + 0.15 * size, f"sets of {size}")
            if size > 1 and not self._extend_beam(size, family):
                break
            ranked = self.ranked(size)
            if not ranked or not self._better(ranked[0], best, family):
                break
            best = self._swap(ranked[0])
            self._refine(best)
            keep = [(), best, *self.ranked(1)[:6], *self.ranked(size)[:6], *_subsets(best)]
            self.refit(keep, best)
            best = self.ranked(size)[0]
        best = self._backward(best, family)
        return self._finish(best, family)

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
        self.progress(0.12, "every cause, fitted jointly")
        fitted = in_parallel(lambda v: self.extend(base, v), scored.values())
        for name, one in zip(scored, fitted, strict=True):
            self.fits[(name,)] = one
        return family

    def _extend_beam(self, size: int, family: Family) -> bool:
        """Fit the most promising sets of a size; False if nothing at all is left to find."""
        promised: dict[Names, tuple[float, Names, list[Scored]]] = {}
        for names in self.ranked(size - 1)[:BEAM]:
            base = self.fits[names]
            for name, scored in best_by_effect(self.scores(base).scored).items():
                key = tuple(sorted((*names, name)))
                promise = base.sse - scored[0].gain
                if key not in self.fits and (key not in promised or promise < promised[key][0]):
                    promised[key] = (promise, names, scored)
        chosen = sorted(promised.items(), key=lambda item: (item[1][0], item[0]))[:JOINT_FITS]
        if not chosen or not (self._hopeful(size, chosen[0][1][0], family)):
            return False
        fitted = in_parallel(lambda item: self.extend(self.fits[item[1][1]], item[1][2]), chosen)
        for (key, _), one in zip(chosen, fitted, strict=True):
            self.fits[key] = one
        return True

    def _hopeful(self, size: int, promise: float, family: Family) -> bool:
        """True unless both the linear promise and the smooth features say that the best smaller set is complete."""
        best, none = self.fits[self.ranked(size - 1)[0]], self.fits[()]
        gain = best.sse - promise
        if gain > 0.5 * FORM_SHARE * (none.sse - best.sse) and family.p_value(gain, 1) < HOPE_LEVEL:
            return True
        return remainder(best, self.seed).p_value < HOPE_LEVEL

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
        degrees = max(len(larger.free) - len(smaller.free), 1)
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
        for name in names:
            base = self.fits[names]
            starts = _refined(base.model, name)
            if not starts:
                continue
            fitted = self.fit_from(starts, base.unknowns)
            degrees = len(fitted.free) - len(base.free)
            if degrees > 0 and scipy.stats.chi2.sf(base.sse - fitted.sse, degrees) < REFINE_LEVEL:
                self.fits[names] = fitted

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
        return Searched(
            self.fits[()], best, p_values, rivals, without, family, scored, [self.fits[k] for k in self.ranked(1)]
        )

    def _siblings(self, names: Names, name: str) -> list[Names]:
        """Sets fitted already that differ from `names` in `name` alone."""
        rest = {n for n in names if n != name}
        return [
            k for k in self.fits if len(k) == len(names) and rest < set(k) | {""} and rest <= set(k) and name not in k
        ]


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


def _with_amplitudes(effect: Effect, amplitudes: dict[str, float]) -> Effect:
    """The effect at a linear estimate of its amplitudes, or a step from its null where that says nothing."""
    info = effect.parameters()
    values = {}
    for name, value in amplitudes.items():
        null, one = info[name].null, info[name]
        assert null is not None
        step = 0.2 * one.scale if one.upper > null else -0.2 * one.scale
        far = 20.0 * one.scale
        values[name] = (
            null + step if abs(value - null) < 1e-6 * one.scale else float(np.clip(value, null - far, null + far))
        )
    return type(effect)(**{**{n: getattr(effect, n) for n in info}, **values})
