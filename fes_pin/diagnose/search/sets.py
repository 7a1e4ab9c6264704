"""Sets of causes, each fitted with everything that is random about the rig: one score for a set, whatever led to it."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from fes_pin.data.trial import Trial
from fes_pin.diagnose.search.library import Library, Probe, near_null
from fes_pin.diagnose.search.promise import Projection, Scored, Scores, best_by_effect
from fes_pin.identify.fit import Fit
from fes_pin.identify.likelihood import LikelihoodProblem, first_guess, maximise
from fes_pin.models.model import Model
from fes_pin.models.predictor import Doubt
from fes_pin.models.stage import Effect
from fes_pin.workers import in_parallel

Names = tuple[str, ...]

STARTS = 2
"""Shapes that a fit of a set starts from, most promising first."""
FIRST_DOUBTS = (1.0, 30.0)
"""Sizes of random effort that the nominal fit begins with, in units of the smallest: a likelihood can have two optima,
one in which the model explains and one in which randomness does."""


class Sets:
    """Fits of sets of causes to one set of trials, by the names of the causes; `()` is the nominal model.

    Parameters
    ----------
    model
        The nominal model with its start values.
    trials
        What was measured.
    """

    def __init__(self, model: Model, trials: Sequence[Trial]) -> None:
        self.model, self.trials = Model(model.rig), tuple(trials)
        self.library = Library(self.model, trials)
        self.fits: dict[Names, Fit] = {}
        self._scores: dict[int, tuple[Fit, Scores]] = {}
        self._probing: dict[str, LikelihoodProblem] = {}

    def nominal(self) -> Fit:
        """Fit the nominal model, from several sizes of what is random."""
        guess = first_guess(self.model, self.trials)
        starts = [replace(guess, std={n: k * v for n, v in guess.std.items()}) for k in FIRST_DOUBTS]
        self.fits[()] = min(in_parallel(lambda d: self._maximised(self.model, d), starts), key=lambda f: f.sse)
        return self.fits[()]

    def _maximised(self, model: Model, doubt: Doubt, unknowns: list[dict[str, float]] | None = None) -> Fit:
        return maximise(LikelihoodProblem(model, self.trials, doubt), model.parameters(), unknowns)

    def scores(self, base: Fit) -> Scores:
        """Promise of every effect that a fit does not have, at what is random in it."""
        if id(base) not in self._scores:
            wanted = [e for e in self.library.effects if e.name not in names_of(base) and self.library.felt(e)]
            groups = in_parallel(lambda e: self._probes(e, base), wanted)
            self._scores[id(base)] = (base, Projection(base.parts).score([p for g in groups for p in g]))
        return self._scores[id(base)][1]

    def _probes(self, effect: type[Effect], base: Fit) -> list[Probe]:
        """The effect with every choice of its shapes beside the nominal parameters of a fit.

        Causes that the fit has are left out: the predictor follows what was measured with them or without.
        """
        nominal = Model(base.model.rig)
        free = tuple(f"{effect.name}.{n}" for n in effect.amplitudes())
        assert base.doubt is not None
        if effect.name not in self._probing:
            self._probing[effect.name] = LikelihoodProblem(nominal + effect.absent(), self.trials, base.doubt, free)
        problem = self._probing[effect.name]
        out = []
        for one in self.library.grid(effect):
            run = problem.innovations((nominal + one).parameters(), problem.start_unknowns(), base.doubt, slopes=True)
            columns = [-i.sensitivities[i.seen] / np.sqrt(i.variances[i.seen])[:, None] for i in run]
            out.append(Probe(one, np.nan_to_num(np.concatenate(columns))))
        return out

    def extend(self, base: Fit, scored: Sequence[Scored]) -> Fit:
        """Fit a base with one more effect, from its most promising shapes, at their linear estimate and at their null."""
        assert base.doubt is not None
        starts = [base.model + started(s.probe.effect, s.amplitudes) for s in scored[:STARTS]]
        fitted = [self._maximised(one, base.doubt, base.unknowns) for one in starts]
        return min(fitted, key=lambda f: f.price)

    def add(self, made: Mapping[Names, Callable[[], Fit]]) -> None:
        """Fit sets side by side; of two fits of a set the better stays."""
        for names, fitted in zip(made, in_parallel(lambda make: make(), made.values()), strict=True):
            if names not in self.fits or fitted.price < self.fits[names].price:
                self.fits[names] = fitted

    def extend_all(self, base: Names, only: Sequence[str] | None = None) -> list[Names]:
        """Fit a set with each further cause beside it; returns the names of what is fitted now."""
        fitted = self.fits[base]
        by_effect = best_by_effect(self.scores(fitted).scored)
        chosen = [n for n in by_effect if only is None or n in only]
        keys = {tuple(sorted((*base, n))): by_effect[n] for n in chosen}
        missing = {k: v for k, v in keys.items() if k not in self.fits}
        self.add({k: lambda v=v: self.extend(fitted, v) for k, v in missing.items()})  # type: ignore[misc]
        return list(keys)

    def without(self, names: Names, name: str) -> Fit:
        """The fit of a set less one cause, from the set's own values where that is better."""
        rest, whole = tuple(n for n in names if n != name), self.fits[names]
        assert whole.doubt is not None
        own = self._maximised(whole.model - name, whole.doubt, whole.unknowns)
        if rest not in self.fits or own.price < self.fits[rest].price:
            self.fits[rest] = own
        return self.fits[rest]

    def refined(self, names: Names) -> Fit | None:
        """The best fit of a set with the form of one of its effects refined; None where no form is."""
        base = self.fits[names]
        assert base.doubt is not None
        starts = [s for effect in base.model.effects for s in refinements(base.model, effect)]
        doubt = base.doubt
        fitted = in_parallel(lambda s: self._maximised(s, doubt, base.unknowns), starts)
        return min(fitted, key=lambda f: f.price, default=None)

    def ranked(self, size: int) -> list[Names]:
        """Sets of a size, cheapest first."""
        return sorted((n for n in self.fits if len(n) == size), key=lambda n: (self.fits[n].price, n))


def names_of(fitted: Fit) -> Names:
    """The causes in a fit."""
    return tuple(sorted(e.name for e in fitted.model.effects))


def started(effect: Effect, amplitudes: Mapping[str, float]) -> Effect:
    """The effect at a linear estimate of its amplitudes, or a step from its null where that says nothing."""
    info = effect.parameters()
    values: dict[str, Any] = {}
    for name, value in amplitudes.items():
        null, one = info[name].null, info[name]
        assert null is not None
        nothing = abs(value - null) < 1e-6 * one.scale
        values[name] = near_null(type(effect), name) if nothing else float(np.clip(value, one.lower, one.upper))
    return replace(effect, **values)


def refinements(model: Model, effect: Effect) -> list[Model]:
    """Starts with one refinement of an effect switched on; none if one is on already."""
    if effect.refined():
        return []
    out, info = [], effect.parameters()
    for names in effect.refinements():
        if model.rig.name not in (info[names[0]].rigs or effect.rigs):
            continue
        paths = [f"{effect.name}.{n}" for n in names]
        for values in itertools.product(*(info[n].grid for n in names)):
            out.append(model.with_parameters(dict(zip(paths, values, strict=True))))
    return out
