"""Sets of causes fitted jointly with the nominal model, under one noise model."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

import numpy as np

from fes_pin.data.trial import Trial
from fes_pin.diagnosis.search.cause_sets import Names, names_of, subsets
from fes_pin.diagnosis.search.library import Library
from fes_pin.diagnosis.search.model_fitter import FIRST_ITERATIONS, ModelFitter
from fes_pin.diagnosis.search.possible import is_possible
from fes_pin.diagnosis.search.refined_forms import RefinedForms
from fes_pin.diagnosis.search.score import Scores, score_test
from fes_pin.identify.fit import Fit, noise_of
from fes_pin.identify.noise_floor import rich_noise
from fes_pin.infer.noise import NoiseModel, as_white
from fes_pin.infer.optimum import MAX_ITERATIONS
from fes_pin.models.model import Model
from fes_pin.models.stage import Effect
from fes_pin.workers import in_parallel

CONVERGED_SETS = 6
"""Best sets of a size that are fitted until they converge."""
ANOTHER_MINIMUM = 1.0
"""Twice the log-likelihood between two fits of a set that have ended at different minima, at least."""


class SimulationFits:
    """Fits of sets of causes to one set of trials, by the names of the causes.

    Attributes
    ----------
    fitter
        Makes single fits; all `fits` were made under its noise.
    fits
        By names in alphabetical order; `()` is the nominal model.
    """

    def __init__(self, model: Model, trials: Sequence[Trial], effects: Sequence[type[Effect]] | None = None) -> None:
        self.model, self.trials = Model(model.rig), tuple(trials)
        self.library = Library(self.model, trials, effects)
        self.fitter = ModelFitter(self.model, self.trials)
        self.fits: dict[Names, Fit] = {}
        self._rounds: dict[Names, int] = {}
        self._absurd: dict[int, tuple[Fit, bool]] = {}
        self._scores: dict[int, tuple[Fit, Scores]] = {}
        self._forms = RefinedForms(self.fitter)

    def set_noise(self, noise: NoiseModel) -> None:
        """Fit under this noise from now on."""
        self.fitter.noise = noise
        self._scores.clear()
        self._forms.clear()

    def first_noise(self, base: Fit) -> None:
        """The noise of the nominal model, beside everything that the library could explain: only to rank causes."""
        white = as_white(noise_of(base))
        probes = self.library.probes(base, white, exclude=())
        varying = {p.name: [q.columns for q in probes if q.name == p.name] for p in probes if p.effect.varies}
        self.set_noise(rich_noise(base, white, [p.columns for p in probes], list(varying.values())))

    def scores(self, base: Fit) -> Scores:
        """Score of every effect that a fit does not have."""
        if id(base) not in self._scores:
            probes = self.library.probes(base, self.fitter.noise, exclude=names_of(base))
            self._scores[id(base)] = (base, score_test(base.parts, probes))
        return self._scores[id(base)][1]

    def ranked(self, size: int) -> list[Names]:
        """Sets of a size, cheapest first; those that have converged to what cannot be come last."""
        of_size = [n for n in self.fits if len(n) == size]
        return sorted(of_size, key=lambda n: (self.is_absurd(self.fits[n]), self.fits[n].price, n))

    def is_absurd(self, fitted: Fit) -> bool:
        """True of a fit that has converged to what cannot be; see `is_possible`."""
        if self._absurd.get(id(fitted), (None,))[0] is not fitted:
            self._absurd[id(fitted)] = (fitted, fitted.converged and not is_possible(fitted, self.library.measured))
        return self._absurd[id(fitted)][1]

    def add(self, made: dict[Names, Callable[[], Fit]]) -> None:
        """Fit sets side by side, and pursue the best of their size."""
        for names, fitted in zip(made, in_parallel(lambda make: make(), made.values()), strict=True):
            if names not in self.fits or fitted.price < self.fits[names].price:
                self.fits[names] = fitted
        self._rounds.update(dict.fromkeys(made, 1))
        for size in sorted({len(n) for n in made}):
            self._converge(size)

    def _converge(self, size: int) -> None:
        """Go on with fits that have not converged, as long as they are among the best of their size."""
        while slow := [n for n in self.ranked(size)[:CONVERGED_SETS] if self._unconverged(n)]:
            gone_on = in_parallel(lambda n: self.fitter.go_on(self.fits[n], FIRST_ITERATIONS), slow)
            self.fits.update(zip(slow, gone_on, strict=True))
            for names in slow:
                self._rounds[names] += 1

    def _unconverged(self, names: Names) -> bool:
        one = self.fits[names]
        return (
            not one.converged
            and bool(np.isfinite(one.sse))
            and self._rounds.get(names, 9) * FIRST_ITERATIONS < MAX_ITERATIONS
        )

    def refit(self, names: Iterable[Names], noise_from: Names) -> None:
        """Fit sets of causes again under the noise that one of them leaves, and forget all others."""
        kept, old = [n for n in dict.fromkeys(names) if n in self.fits], self.fits
        self.set_noise(noise_of(old[noise_from]))
        self.fits = {}
        self.add({n: lambda n=n: self.fitter.go_on(old[n], FIRST_ITERATIONS) for n in kept})  # type: ignore[misc]
        self.finish(noise_from)

    def finish(self, names: Names) -> None:
        """Let one fit converge, whatever its rank."""
        if not self.fits[names].converged:
            self.fits[names] = self.fitter.go_on(self.fits[names], MAX_ITERATIONS)

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
        return self.fitter.without(self.fits[names], tuple(n for n in names if n not in rest))

    def refinement(self, names: Names) -> Fit | None:
        """The best fit of a set with the form of one of its effects refined; None if no form is, or none is told."""
        return self._forms.best(self.fits[names])
