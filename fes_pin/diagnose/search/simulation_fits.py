"""Sets of causes fitted jointly with the nominal model, under one noise model."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from fes_pin.data.trial import Trial
from fes_pin.diagnose.search.library import Library
from fes_pin.diagnose.search.score import Projection, Scored, Scores
from fes_pin.diagnose.search.starts import STARTS, far_sizes, fits_rig, near_null
from fes_pin.identify.fit import (
    CONFIDENCE_95,
    GROSS,
    MAX_ITERATIONS,
    Fit,
    fit_multistart,
    fit_problem,
    go_on,
    noise_of,
    rough_noise,
)
from fes_pin.identify.noise import NoiseModel, as_white
from fes_pin.identify.noise_floor import rich_noise
from fes_pin.identify.problem import Problem
from fes_pin.models.model import Model
from fes_pin.models.stage import Effect
from fes_pin.workers import in_parallel

FIRST_ITERATIONS = 15
"""Iterations of a first fit. Most fits end in fewer; the others go on only while they are among the best."""
SCREEN_ITERATIONS = 5
"""Iterations after which the best start of a refinement is chosen, which alone goes on."""
CONVERGED_SETS = 6
"""Best sets of a size that are fitted until they converge."""
ANOTHER_MINIMUM = 1.0
"""Twice the log-likelihood between two fits of a set that have ended at different minima, at least."""

Names = tuple[str, ...]


class SimulationFits:
    """Fits of sets of causes to one set of trials, by the names of the causes.

    Attributes
    ----------
    noise
        What all `fits` were made under.
    fits
        By names in alphabetical order; `()` is the nominal model.
    """

    def __init__(self, model: Model, trials: Sequence[Trial], effects: Sequence[type[Effect]] | None = None) -> None:
        self.model, self.trials = Model(model.rig), tuple(trials)
        self.library = Library(self.model, trials, effects)
        self.noise: NoiseModel = {}
        self.fits: dict[Names, Fit] = {}
        self._problems: dict[tuple, Problem] = {}
        self._rounds: dict[Names, int] = {}
        self._scores: dict[int, tuple[Fit, Scores]] = {}
        self._refinements: dict[int, tuple[Fit, Fit | None]] = {}

    def problem(self, model: Model) -> Problem:
        """The problem of a model's structure, under the present noise."""
        unused = tuple(model.unused_parameters().items())  # compiled in, with the values that this model has
        key = (model.structure(), model.fitted_parameters(), _choices(model), unused)
        if key not in self._problems:
            self._problems[key] = Problem(model, self.trials, self.noise)
        self._problems[key].noise = self.noise
        return self._problems[key]

    def fit_from(
        self, starts: Iterable[Model], unknowns: list[dict[str, float]] | None, iterations: int = FIRST_ITERATIONS
    ) -> Fit:
        """The best of several fits of one structure, each of so many iterations at most."""
        fitted = [fit_problem(self.problem(s), s.parameters(), unknowns, iterations) for s in starts]
        return min(fitted, key=lambda f: f.price)

    def extend(self, base: Fit, scored: Sequence[Scored]) -> Fit:
        """Fit a base with one more effect, from its shapes of largest score.

        Amplitudes start at their linear estimate; where that falls over (a stiffness below zero), at their nulls; and
        at sizes of their own, beside the rig as it was believed.
        """
        starts = [base.model + _with_amplitudes(s.probe.effect, s.amplitudes) for s in scored[:STARTS]]
        starts += [Model(self.model.rig, base.model.effects) + one for one in far_sizes(scored[0].probe.effect)]
        fitted = self.fit_from(starts, base.unknowns)
        if np.isfinite(fitted.sse):
            return fitted
        return self.fit_from([base.model + one.probe.effect for one in scored[:STARTS]], base.unknowns)

    def extend_with_both(self, base: Fit, pair: tuple[Scored, Scored]) -> Fit:
        """Fit a base with two more effects at once."""
        model = base.model
        for one in pair:
            model = model + _with_amplitudes(one.probe.effect, one.amplitudes)
        return self.fit_from([model], base.unknowns)

    def add(self, made: dict[Names, Callable[[], Fit]]) -> None:
        """Fit sets side by side, and pursue the best of their size."""
        for names, fitted in zip(made, in_parallel(lambda make: make(), made.values()), strict=True):
            if names not in self.fits or fitted.price < self.fits[names].price:
                self.fits[names] = fitted
        self._rounds.update(dict.fromkeys(made, 1))
        for size in sorted({len(n) for n in made}):
            self._converge(size)

    def restart(self, names: Sequence[Names]) -> None:
        """Fit sets from afar, too: a strong cause has dragged the fit without it away from its nominal values."""
        white = as_white(self.noise)
        self._restart([(n, Model(self.model.rig, self.fits[n].model.effects)) for n in names], white)

    def restart_every(self) -> None:
        """Fit every single cause from afar, with all its discrete choices: where the nominal model says nothing.

        Neither does the noise that it leaves; the errors count in the noise from sample to sample.
        """
        white = rough_noise(self.model, self.trials)
        self._restart([(n, one) for n in self.ranked(1) for one in self._choices(n)], white)

    def restart_beside(self, names: Names) -> None:
        """Fit the single causes that leave a gross misfit from the nominal values of one, if that leaves none."""
        if self.fits[names].reduced > GROSS:
            return
        rig, far = self.fits[names].model.rig, [n for n in self.ranked(1) if self.fits[n].reduced > GROSS]
        starts = [(n, Model(rig, one.effects)) for n in far for one in self._choices(n)]
        self._restart(starts, as_white(self.noise))

    def _restart(self, starts: Sequence[tuple[Names, Model]], white: NoiseModel) -> None:
        for (n, _), found in zip(starts, in_parallel(lambda s: self._multistart(s[1], white), starts), strict=True):
            if found.price < self.fits[n].price:
                self.fits[n] = found

    def _choices(self, names: Names) -> list[Model]:
        """The model of a single cause with every discrete choice that it has, next to its null."""
        (one,) = self.fits[names].model.effects
        info, grids = one.parameters(), one.grids(self.library.measured)
        chosen = [n for n in one.shapes() if not info[n].fitted]
        start: dict[str, Any] = {} if one.each_trial else {n: near_null(type(one), n) for n in one.amplitudes()}
        values = itertools.product(*(grids[n] for n in chosen))
        return [self.model + replace(one, **{**start, **dict(zip(chosen, v, strict=True))}) for v in values]

    def at_null(self) -> list[Names]:
        """Single causes whose fit ended where they are absent, at a bound: another amplitude has not been seen."""
        return [n for n in self.ranked(1) if _is_absent(self.fits[n], self.fits[n].model.effects[-1])]

    def _multistart(self, model: Model, white: NoiseModel) -> Fit:
        """Fit a model from where it is: first for least errors, under white noise, then under the present one.

        Slow noise leaves the fast parts of an answer to a fit, and those of a late one meet only where they are near.
        """
        near = fit_multistart(Problem(model, self.trials, white), model.parameters(), None, FIRST_ITERATIONS)
        return fit_problem(self.problem(model), near.values, near.unknowns, FIRST_ITERATIONS)

    def _converge(self, size: int) -> None:
        """Go on with fits that have not converged, as long as they are among the best of their size."""
        while slow := [n for n in self.ranked(size)[:CONVERGED_SETS] if self._unconverged(n)]:
            self.fits.update(
                zip(slow, in_parallel(lambda n: self._go_on(self.fits[n], FIRST_ITERATIONS), slow), strict=True)
            )
            for names in slow:
                self._rounds[names] += 1

    def _unconverged(self, names: Names) -> bool:
        one = self.fits[names]
        return (
            not one.converged
            and bool(np.isfinite(one.sse))
            and self._rounds.get(names, 9) * FIRST_ITERATIONS < MAX_ITERATIONS
        )

    def _go_on(self, fitted: Fit, iterations: int) -> Fit:
        return go_on(self.problem(fitted.model), fitted, iterations)

    def scores(self, base: Fit) -> Scores:
        """Score of every effect that a fit does not have."""
        if id(base) not in self._scores:
            probes = self.library.probes(base, self.noise, exclude=names_of(base))
            self._scores[id(base)] = (base, Projection(base.parts).score(probes))
        return self._scores[id(base)][1]

    def set_noise(self, noise: NoiseModel) -> None:
        """Fit under this noise from now on."""
        self.noise = noise
        self._scores.clear()
        self._refinements.clear()

    def first_noise(self, base: Fit) -> None:
        """The noise of the nominal model, beside everything that the library could explain: only to rank causes."""
        white = as_white(noise_of(base))
        probes = self.library.probes(base, white, exclude=())
        varying = {p.name: [q.columns for q in probes if q.name == p.name] for p in probes if p.effect.varies}
        self.set_noise(rich_noise(base, white, [p.columns for p in probes], list(varying.values())))

    def refit(self, names: Iterable[Names], noise_from: Names) -> None:
        """Fit sets of causes again under the noise that one of them leaves, and forget all others."""
        kept, old = [n for n in dict.fromkeys(names) if n in self.fits], self.fits
        self.set_noise(noise_of(old[noise_from]))
        self.fits = {}
        self.add({n: lambda n=n: self._go_on(old[n], FIRST_ITERATIONS) for n in kept})  # type: ignore[misc]
        self.finish(noise_from)

    def finish(self, names: Names) -> None:
        """Let one fit converge, whatever its rank."""
        if not self.fits[names].converged:
            self.fits[names] = self._go_on(self.fits[names], MAX_ITERATIONS)

    def base(self, rest: Names, names: Names) -> Fit:
        """The fit of a subset of a set, from the set's own values if there is none yet."""
        if rest not in self.fits:
            self.fits[rest] = self._part(rest, names)
        self.finish(rest)
        return self.fits[rest]

    def better_bases(self, names: Names) -> list[Names]:
        """Fit what a set is without each of its causes again, from the set's own values and forms; those that gain.

        A subset that was fitted before its causes had their forms, or from afar, may have ended at another minimum.
        """
        rests = subsets(names)
        known = [self.base(rest, names) for rest in rests]
        found = in_parallel(lambda rest: self._part(rest, names), rests)
        better = [k for k in range(len(rests)) if found[k].price < known[k].price - ANOTHER_MINIMUM]
        self.fits.update({rests[k]: found[k] for k in better})
        return [rests[k] for k in better]

    def _part(self, rest: Names, names: Names) -> Fit:
        """The fit of a subset of a set, from the set's own values."""
        whole = self.fits[names]
        model = whole.model
        for n in set(names) - set(rest):
            model = model - n
        return self.fit_from([model], whole.unknowns, MAX_ITERATIONS)

    def refinement(self, names: Names) -> Fit | None:
        """The best fit of a set with the form of one of its effects refined; None if no form is, or none is told.

        What a refinement adds must be told from nothing: a form that the data do not determine explains nothing.
        """
        base = self.fits[names]
        if id(base) not in self._refinements:
            self._refinements[id(base)] = (base, self._refinement(base))
        return self._refinements[id(base)][1]

    def _refinement(self, base: Fit) -> Fit | None:
        refinements = [starts for effect in base.model.effects for starts in _refined(base.model, effect) if starts]
        starts = [s for r in refinements for s in r]
        tried = in_parallel(lambda s: self.fit_from([s], base.unknowns, SCREEN_ITERATIONS), starts)
        at = np.cumsum([0, *map(len, refinements)])
        best = [min(tried[a:b], key=lambda f: f.sse) for a, b in itertools.pairwise(at)]
        fitted = in_parallel(lambda f: f if f.converged else self._go_on(f, MAX_ITERATIONS), best)
        return min(filter(is_identified, fitted), key=lambda f: f.price, default=None)

    def ranked(self, size: int) -> list[Names]:
        """Sets of a size, cheapest first."""
        return sorted((n for n in self.fits if len(n) == size), key=lambda n: (self.fits[n].price, n))


def names_of(fitted: Fit) -> Names:
    """The causes in a fit."""
    return tuple(sorted(e.name for e in fitted.model.effects))


def subsets(names: Names) -> list[Names]:
    """The sets with one cause less."""
    return [tuple(m for m in names if m != n) for n in names]


def _is_absent(fitted: Fit, effect: Effect) -> bool:
    """True if a parameter of the effect stands at a bound that is its null."""
    info = effect.parameters()
    return any(f"{effect.name}.{n}" in fitted.at_bound and getattr(effect, n) == one.null for n, one in info.items())


def _choices(model: Model) -> tuple[float, ...]:
    """Values of discrete choices, which compiled problems share but fits must not mix."""
    info = model.parameter_info()
    return tuple(v for n, v in model.parameters().items() if not info[n].fitted)


def _refined(model: Model, effect: Effect) -> list[list[Model]]:
    """Starts with one refinement of an effect switched on, for each refinement; none if one is on already."""
    if effect.refined():
        return []
    out, info = [], effect.parameters()
    for names in effect.refinements():
        if not fits_rig(model, info[names[0]]):
            continue
        paths = [f"{effect.name}.{n}" for n in names]
        choices = itertools.product(*(info[n].grid for n in names))
        out.append([model.with_parameters(dict(zip(paths, values, strict=True))) for values in choices])
    return out


def is_identified(fitted: Fit, before: Fit | None = None) -> bool:
    """True if the data tell every parameter that has a null from it, within its bounds, in all refined effects.

    Parameters
    ----------
    before
        The fit that was refined: what stood at its bound there already speaks not against another form.
    """
    there = before.at_bound if before is not None else ()
    for one in fitted.model.effects:
        if not one.refined():
            continue
        for n, info in one.parameters().items():
            name = f"{one.name}.{n}"
            if name not in fitted.free or name in there:
                continue
            if name in fitted.at_bound:
                return False
            std, away = fitted.std(name), getattr(one, n) - info.null if info.null is not None else np.inf
            if not np.isfinite(std) or abs(away) < CONFIDENCE_95 * std:
                return False
    return True


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
