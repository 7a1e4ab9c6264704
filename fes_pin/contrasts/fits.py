"""Fits of grouped models to the trials of all groups by the likelihood."""

import math
from collections.abc import Collection, Mapping, Sequence

from fes_pin.contrasts.grouped import Grouped, GroupedModel, GroupedProblem, Weights, by_group
from fes_pin.data.errors import InputError
from fes_pin.data.trial import Trial
from fes_pin.identify.likelihood import LikelihoodProblem
from fes_pin.identify.likelihood_fit import LikelihoodFit, fit_of
from fes_pin.identify.process_noise import first_guess
from fes_pin.infer.keys import Key
from fes_pin.infer.maximise import alternate
from fes_pin.infer.optimum import minimise
from fes_pin.infer.problem import Unknowns
from fes_pin.models.model import Model
from fes_pin.models.stage import Effect
from fes_pin.search.approach import approach
from fes_pin.search.likelihood_fits import FIRST_NOISE_SCALES, MEASUREMENT, PROCESS, LikelihoodFits
from fes_pin.search.likelihood_maxima import SCREEN_ITERATIONS, likeliest, process_noises
from fes_pin.workers import in_parallel

ROUNDS = 6
"""Most alternations of parameters and noise."""


class GroupedFits:
    """Fits of grouped models to some trials, each with its noise.

    Parameters
    ----------
    nominal
        The nominal model of all groups.
    trials
        Trials by group.
    driven
        Whether fits have process noise from the beginning.
    effects
        The causes that are searched.
    """

    def __init__(
        self, nominal: Model, trials: Mapping[str, Sequence[Trial]], driven: bool, effects: Sequence[type[Effect]] = ()
    ) -> None:
        self.nominal, self.trials, self.driven, self.effects = Model(nominal.rig), dict(trials), driven, effects
        self._begun: list[Weights] = []
        self._each: dict[str, LikelihoodFits] = {}

    def first(self) -> Grouped:
        """Fit the nominal model to all groups; the search starts from the noise of each group fitted alone.

        Raises
        ------
        InputError
            If the nominal model predicts nothing finite.
        """
        noise = PROCESS if self.driven else MEASUREMENT
        self._each = {
            g: LikelihoodFits(self.nominal, many, self.effects, self.driven, noise=noise)
            for g, many in self.trials.items()
        }
        alone = in_parallel(LikelihoodFits.nominal, list(self._each.values()))
        if not all(math.isfinite(f.sse) for f in alone):
            raise InputError("the nominal model predicts nothing finite from its start values on")
        noises = Weights(dict(zip(self.trials, (f.noise for f in alone), strict=True)))
        model = GroupedModel(dict.fromkeys(self.trials, self.nominal)).with_parameters(alone[0].values)
        if self.driven:
            known = noises.noise.items()
            little = {g: first_guess(self.nominal, self.trials[g], n.correlation_s) for g, n in known}
            self._begun = [Weights(little), noises]
            return self.fitted(model, noises)
        starts = [noises, self._without_scatter(model, noises, [u for f in alone for u in f.unknowns])]
        return min((self.fitted(model, w) for w in starts), key=lambda f: f.criterion)

    def _without_scatter(self, model: GroupedModel, noises: Weights, unknowns: Unknowns) -> Weights:
        """Return the noise of each group without the part that nominal values of each trial's own explain."""
        known, info = self.nominal.parameters(), self.nominal.parameter_info()
        much = {n: abs(known[n]) or info[n].scale for n in self.nominal.fitted_parameters()}
        problem = GroupedProblem(model, self.trials, Weights(noises.noise, much))
        problem.noise_step(model.parameters(), unknowns)
        return problem.weights

    def apart(self, one: Grouped) -> Grouped:
        """Return the nominal model with every parameter of each group's own, from the noise of another fit."""
        names, groups = self.nominal.fitted_parameters(), list(self.trials)
        model = one.grouped.having({Key(n, group=g) for n in names for g in groups[1:]})
        values = {model.path(n, g): self._each[g].fits[()].values[n] for n in names for g in groups}
        return self.fitted(model.with_parameters(values), one.weights)

    def nearest(self, one: Grouped) -> Grouped | None:
        """Return a set with the causes, in all groups, that bring one group near its data; None where none does.

        It is the group that the nominal model fits best, so that it has the fewest causes of its own. The likelihood of
        a model that is far from its data is that of noise which takes up every error; see `LikelihoodFits.approach`.
        """
        best = min(self._each.values(), key=lambda f: f.misfit(f.fits[()]))
        if not best.is_far(best.fits[()]):
            return None
        found = best.least_squares.fits[approach(best.least_squares)].model
        effects = [e for e in found.effects if not e.each_trial]
        if not effects:
            return None
        begun = Model(found.rig, tuple(effects))
        own = in_parallel(lambda f: f.from_least_squares(begun), list(self._each.values()))
        near = dict(zip(self._each, own, strict=True))
        model = one.grouped.having(one.items | {Key(e.name) for e in effects}, effects)
        values = {model.path(n, g): near[g].values[n] for g, m in model.models.items() for n in m.parameters()}
        return self.fitted(model.with_parameters(values), Weights({g: f.noise for g, f in near.items()}))

    def fitted(
        self, model: GroupedModel, weights: Weights, unknowns: Unknowns | None = None, rounds: int = ROUNDS
    ) -> Grouped:
        """Fit a grouped model and, in some rounds of alternating maximisation, its noise."""
        problem = GroupedProblem(model, self.trials, weights)
        return Grouped.of(problem, alternate(problem, model.parameters(), unknowns, rounds, SCREEN_ITERATIONS))

    def again(self, one: Grouped, weights: Weights | None = None, rounds: int = ROUNDS) -> Grouped:
        """Fit a set from its own values; without rounds, with given weights, so that residuals have their unit."""
        return self.fitted(one.grouped, weights or one.weights, one.unknowns, rounds)

    def go_on(self, one: Grouped) -> Grouped:
        """Fit a set until it converges, also from little process noise and from that of each group alone.

        The process noise of a smaller set explains its error, and may keep doing so: a likelihood can have two maxima.
        """
        return min((self.again(one, w) for w in (one.weights, *self._begun)), key=lambda f: f.criterion)

    def refitted(self, one: Grouped, held: Collection[int]) -> Grouped:
        """Return the set fitted without some trials, by their numbers, with its own weights."""
        kept = by_group(((k, t) for k, t in enumerate(one.trials)), self.trials)
        trials = {g: [t for k, t in many if k not in held] for g, many in kept.items()}
        problem = GroupedProblem(one.grouped, trials, one.weights)
        unknowns = [u for k, u in enumerate(one.unknowns) if k not in held]
        return Grouped.of(problem, minimise(problem, one.values, unknowns))

    def part(self, one: Grouped, group: str, alone: int | None = None) -> LikelihoodFit:
        """Return a group's part of a fit as a fit of that group, to its own trials or to one of them `alone`."""
        rows = slice(None) if alone is None else slice(alone, alone + 1)
        trials, unknowns = self.trials[group][rows], by_group(one.unknowns, self.trials)[group][rows]
        problem = LikelihoodProblem(one.grouped.models[group], trials, one.weights.noise[group])
        return fit_of(problem, minimise(problem, one.grouped.models[group].parameters(), unknowns, SCREEN_ITERATIONS))

    def with_process_noise(self, one: Grouped, least: float) -> Grouped | None:
        """Return a set fitted with process noise; None where that does not lower the criterion by more than `least`."""
        parts = {g: self.part(one, g) for g in self.trials}
        begun = {g: process_noises(f, FIRST_NOISE_SCALES) for g, f in parts.items()}
        if not all(begun.values()):
            return None
        weights = Weights({g: likeliest(f, begun[g]) for g, f in parts.items()})
        found = self.again(one, weights)
        if not found.criterion < one.criterion - least:
            return None
        self._begun = [weights]
        return found
