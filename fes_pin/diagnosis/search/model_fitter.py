"""The ways to fit one model by simulation, to one set of trials, under one noise model."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from fes_pin.data.trial import Trial
from fes_pin.diagnosis.search.cause_sets import Names
from fes_pin.diagnosis.search.score import Scored
from fes_pin.diagnosis.search.starts import STARTS, from_afar, started
from fes_pin.identify.fit import Fit, fit_multistart, fit_problem, go_on
from fes_pin.identify.problem import Problem
from fes_pin.infer.noise import NoiseModel
from fes_pin.infer.optimum import MAX_ITERATIONS
from fes_pin.models.model import Model
from fes_pin.models.stage import Effect

FIRST_ITERATIONS = 15
"""Iterations of a first fit. Most fits end in fewer; the others go on only while they are among the best."""
STEP = 0.2
"""How far from its null an amplitude starts of which a linear estimate says nothing, in its scales."""
REACH = 20.0
"""How far from its null a linear estimate may lead an amplitude, in its scales."""


class ModelFitter:
    """Fits of single models to one set of trials; what has been compiled for one serves all of its structure.

    Attributes
    ----------
    noise
        What is fitted under from now on.
    """

    def __init__(self, model: Model, trials: Sequence[Trial]) -> None:
        self.model, self.trials = model, tuple(trials)
        self.noise: NoiseModel = {}
        self._problems: dict[tuple, Problem] = {}

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

    def go_on(self, fitted: Fit, iterations: int) -> Fit:
        """Go on with a fit, under the present noise."""
        return go_on(self.problem(fitted.model), fitted, iterations)

    def multistart(self, model: Model, white: NoiseModel) -> Fit:
        """Fit a model from where it is: first for least errors, under white noise, then under the present one.

        Slow noise leaves the fast parts of an answer to a fit, and those of a late one meet only where they are near.
        """
        near = fit_multistart(Problem(model, self.trials, white), model.parameters(), None, FIRST_ITERATIONS)
        return fit_problem(self.problem(model), near.values, near.unknowns, FIRST_ITERATIONS)

    def extend(self, base: Fit, scored: Sequence[Scored]) -> Fit:
        """Fit a base with one more effect, from its shapes of largest score.

        Amplitudes start at their linear estimate; where that falls over (a stiffness below zero), at their nulls; and
        at sizes of their own, beside the rig as it was believed.
        """
        starts = [base.model + _at_estimate(s) for s in scored[:STARTS]]
        starts += [Model(self.model.rig, base.model.effects) + one for one in from_afar(scored[0].probe.effect, {})]
        fitted = self.fit_from(starts, base.unknowns)
        if np.isfinite(fitted.sse):
            return fitted
        return self.fit_from([base.model + one.probe.effect for one in scored[:STARTS]], base.unknowns)

    def extend_with_both(self, base: Fit, pair: tuple[Scored, Scored]) -> Fit:
        """Fit a base with two more effects at once."""
        model = base.model
        for one in pair:
            model = model + _at_estimate(one)
        return self.fit_from([model], base.unknowns)

    def without(self, whole: Fit, gone: Names) -> Fit:
        """Fit a model less some of its causes, from its own values."""
        model = whole.model
        for n in gone:
            model = model - n
        return self.fit_from([model], whole.unknowns, MAX_ITERATIONS)


def _choices(model: Model) -> tuple[float, ...]:
    """Values of discrete choices, which compiled problems share but fits must not mix."""
    info = model.parameter_info()
    return tuple(v for n, v in model.parameters().items() if not info[n].fitted)


def _at_estimate(scored: Scored) -> Effect:
    """An effect where its score's linear estimate leads."""
    return started(scored.probe.effect, scored.amplitudes, step=STEP, reach=REACH)
