"""Maximum of the likelihood of one model on the trials of a search: from afar, with process noise, in a few steps."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from fes_pin.data.trial import Trial
from fes_pin.identify.afar import followed, following
from fes_pin.identify.fit import GROSS, from_beginnings
from fes_pin.identify.likelihood import LikelihoodProblem
from fes_pin.identify.likelihood_fit import LikelihoodFit, at_noise, fit_of, maximise
from fes_pin.identify.problem import limits_of
from fes_pin.identify.process_noise import first_guess
from fes_pin.infer.covariance import moved_with
from fes_pin.infer.optimum import minimise
from fes_pin.infer.problem import Unknowns, completed
from fes_pin.models.model import Model
from fes_pin.models.predictor import StateSpaceNoise
from fes_pin.models.stage import Effect

SCREEN_ITERATIONS = 4
"""Steps of a first fit of a set, at the noise of a smaller one."""


def maximum_from_afar(model: Model, trials: Sequence[Trial], noise: StateSpaceNoise) -> LikelihoodFit:
    """Return the maximum from the values of a model; after a gross misfit, also from those of a filter.

    Where no filter follows the trials, the other start is that of fits to ever longer beginnings of every trial. With
    process noise no misfit is gross: a filter follows the state even of a wrong model.
    """
    rough = LikelihoodProblem(model, trials, noise)
    plain = maximise(LikelihoodProblem(model, trials, noise))
    if not rough.is_simulated or at_noise(plain, noise).reduced < GROSS:
        return plain

    def again(values: Mapping[str, float], unknowns: Unknowns) -> LikelihoodFit:
        problem = LikelihoodProblem(model.with_parameters(values), trials, noise)
        return maximise(problem, completed(problem.start_unknowns(), unknowns))

    if (driven := following(model, trials)) is None:
        return from_beginnings(rough, plain, again)
    near = followed([model], trials, driven)
    return min(plain, again(near.values, near.unknowns), key=lambda f: f.sse)


def process_noises(calm: LikelihoodFit, scales: Sequence[float]) -> list[StateSpaceNoise]:
    """Return start values of noise, with several sizes of process noise, for a fit without any.

    There are none where readings were low-passed, as no filter includes a low pass of trials.

    Parameters
    ----------
    scales
        Sizes of process noise together with white measurement noise, in units of the smallest.
    """
    guess = first_guess(calm.model, calm.trials)
    if not guess.std or any(t.low_pass_hz for t in calm.trials):
        return []
    white = {n: (0.0,) * len(own) for n, own in calm.noise.ar.items()}
    little = replace(calm.noise, std=guess.std, time=guess.time, still=())
    return [little, *(replace(guess, std={n: k * v for n, v in guess.std.items()}, ar=white) for k in scales)]


def likeliest(fitted: LikelihoodFit, begun: Sequence[StateSpaceNoise]) -> StateSpaceNoise:
    """Return the noise, of several start values, that is likeliest after one step at the parameters of a fit."""
    tried = []
    for noise in begun:
        problem = LikelihoodProblem(fitted.model, fitted.trials, noise)
        unknowns = completed(problem.start_unknowns(), fitted.unknowns)
        problem.noise_step(fitted.values, unknowns)
        tried.append((problem.costs([(fitted.values, unknowns)])[0], problem.noise))
    return min(tried, key=lambda one: one[0])[1]


def look(start: Model, base: LikelihoodFit) -> LikelihoodFit:
    """Return the fit after a few steps from a start, at the noise of another fit."""
    problem = LikelihoodProblem(start, base.trials, base.noise)
    found = minimise(problem, start.parameters(), base.unknowns, SCREEN_ITERATIONS)
    return replace(fit_of(problem, found), together=base.together)


def less(whole: LikelihoodFit, gone: Sequence[str], effect: Effect) -> Model:
    """Return the model of a fit with some parameters of an effect at their nulls, without it if these are all.

    The other parameters are moved along the fit's covariance or stay, whichever is likelier: without the gain of an
    effort, for example, the estimate of inertia is another.
    """
    nulls = {f"{effect.name}.{n}": effect.nulls()[n] for n in gone if n in effect.common()}
    moving = [n for n in nulls if n in whole.free]
    here = np.array([whole.values[n] for n in whole.free])
    change = np.array([nulls[n] - whole.values[n] for n in moving])
    there = here + moved_with(whole.covariance, [whole.free.index(n) for n in moving], change)
    limits = limits_of(whole.model, whole.trials)
    values = {n: float(np.clip(v, *limits[n])) for n, v in zip(whole.free, there, strict=True)}
    off = whole.model.with_parameters(nulls)
    left = off - effect.name if set(gone) >= set(effect.amplitudes()) else off
    problem = LikelihoodProblem(left, whole.trials, whole.noise)
    unknowns = completed(problem.start_unknowns(), whole.unknowns)
    moved = left.with_parameters({n: v for n, v in values.items() if n in left.fitted_parameters()})
    costs = problem.costs([(one.parameters(), unknowns) for one in (left, moved)])
    return moved if costs[1] < costs[0] else left
