"""The best fit with the form of one of a model's effects refined, and whether the data tell what it adds."""

from __future__ import annotations

import itertools

import numpy as np

from fes_pin.diagnosis.search.model_fitter import ModelFitter
from fes_pin.diagnosis.search.starts import fits_rig
from fes_pin.identify.fit import Fit
from fes_pin.infer.levels import CONFIDENCE_95
from fes_pin.infer.optimum import MAX_ITERATIONS
from fes_pin.models.model import Model
from fes_pin.models.stage import Effect
from fes_pin.workers import in_parallel

SCREEN_ITERATIONS = 5
"""Iterations after which the best start of a refinement is chosen, which alone goes on."""


class RefinedForms:
    """The best refinement of each fit, looked for once."""

    def __init__(self, fitter: ModelFitter) -> None:
        self.fitter = fitter
        self._known: dict[int, tuple[Fit, Fit | None]] = {}

    def best(self, base: Fit) -> Fit | None:
        """The best fit with the form of one effect refined; None if no form is, or none is told.

        What a refinement adds must be told from nothing: a form that the data do not determine explains nothing.
        """
        if id(base) not in self._known:
            self._known[id(base)] = (base, self._best(base))
        return self._known[id(base)][1]

    def clear(self) -> None:
        """Forget what was found under another noise."""
        self._known.clear()

    def _best(self, base: Fit) -> Fit | None:
        refinements = [starts for effect in base.model.effects for starts in _refined(base.model, effect) if starts]
        starts = [s for r in refinements for s in r]
        tried = in_parallel(lambda s: self.fitter.fit_from([s], base.unknowns, SCREEN_ITERATIONS), starts)
        at = np.cumsum([0, *map(len, refinements)])
        best = [min(tried[a:b], key=lambda f: f.sse) for a, b in itertools.pairwise(at)]
        fitted = in_parallel(lambda f: f if f.converged else self.fitter.go_on(f, MAX_ITERATIONS), best)
        return min(filter(is_identified, fitted), key=lambda f: f.price, default=None)


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
