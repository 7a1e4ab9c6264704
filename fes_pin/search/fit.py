"""The fit of one model to measured trials: by the first estimator of a diagnosis, by least squares, or with weights."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from fes_pin.data.errors import InputError, fault_at
from fes_pin.data.numbers import as_number, instance, number, whole
from fes_pin.data.schema import check_known
from fes_pin.data.study import Study
from fes_pin.data.trial import Trial
from fes_pin.identify.feedback import is_answered
from fes_pin.identify.fit import Fit, fit_multistart
from fes_pin.identify.likelihood import LikelihoodProblem
from fes_pin.identify.likelihood_fit import LikelihoodFit, maximise, maximum_from
from fes_pin.identify.problem import Problem
from fes_pin.infer.noise import NoiseModel
from fes_pin.infer.optimum import MAX_ITERATIONS
from fes_pin.infer.result import Remainder
from fes_pin.models.accepted import accepted_trials
from fes_pin.models.model import Model
from fes_pin.models.plausibility import warn_of_odd_numbers
from fes_pin.models.simulate import simulated_trial
from fes_pin.prepare.long_records import in_parts, searched_part
from fes_pin.prepare.measured import at_noise_rate, measured_study
from fes_pin.remainder.lack_of_fit import lack_of_fit
from fes_pin.search.likelihood_fits import WHITE, LikelihoodFits, first_noise
from fes_pin.workers import one_thread_each


class TestedFit(LikelihoodFit):
    """A fit by the likelihood, with the test of its lack of fit, which is made when it is asked for."""

    @cached_property
    def lack_of_fit(self) -> Remainder:
        """Whether residuals of the model are more than noise; see `remainder.lack_of_fit`."""
        with one_thread_each():
            return lack_of_fit(self)

    def _notes(self) -> list[str]:
        left = self.lack_of_fit
        found = "the model leaves more than noise" if left.unexplained else "none found"
        noise = self.noise
        random = [f"{n} {noise.std[n]:.3g}, time constant {noise.time[n]:.3g} s" for n in noise.acting]
        lines = [f"process noise, standard deviation: {'; '.join(random)}"] * bool(random)
        return [*super()._notes(), *lines, f"lack of fit: {found} ({left.tested()})"]


def fit(
    model: Model,
    trials: Study | Trial | Iterable[Trial],
    noise: NoiseModel | None = None,
    max_iterations: int = MAX_ITERATIONS,
    *,
    fixed: Iterable[str] | Mapping[str, float] = (),
    bounds: Mapping[str, tuple[float, float]] | None = None,
    least_squares: bool = False,
) -> Fit:
    """Fit a model's parameters to trials, from the model's own values, by the estimator of `diagnose`.

    The estimator maximises the likelihood of one-step predictions, with noise that is estimated too: autoregressive
    measurement noise, and process noise in closed loop or of imposed motion. The nominal model of a diagnosis has the
    same values, as long as the diagnosis names this estimator.

    Parameters
    ----------
    model
        The model, whose values are the start values.
    trials
        Measured trials; of a study those whose role is not "held_out", without spikes, as in `diagnose`.
    noise
        Known noise by output column: the fit is then weighted least squares of free simulations.
    max_iterations
        Most steps of a fit with known noise, and an error without it; a fit that has not converged by then says so in
        `converged`.
    fixed
        Names of parameters that are not fitted, or values that they are held at by name: `("gain",)`,
        `{"gain": 0.65}`.
    bounds
        Lower and upper bounds of fitted parameters by name, within those that they have: `{"damping": (0.0, 1.0)}`.
    least_squares
        Whether the estimator is least squares of free simulations, with white noise of each column estimated. Where a
        model is wrong, this fit predicts best from the inputs alone; its intervals take its residuals for white.

    Returns
    -------
    Fit
        Of a fit by the likelihood, its `lack_of_fit` is tested when it is asked for or printed.

    Raises
    ------
    InputError
        No trials to fit, trials that are not of the model's rig or were not measured, names of no fitted parameter,
        values or bounds that cannot be.

    Warns
    -----
    InputWarning
        Of numbers that are odd, as `check` finds them: a unit or a sign may be wrong.
    """
    chosen = trials.to_fit() if isinstance(trials, Study) else trials
    measured = accepted_trials(model, chosen, inputs_only=False)
    if whole(max_iterations, "max_iterations", least=1) != MAX_ITERATIONS and noise is None:
        raise InputError(
            "expected noise as well: without it a fit ends where it has converged", column="max_iterations"
        )
    if noise is not None:
        instance(noise, Mapping, "noise")
    if isinstance(fixed, Mapping):
        model = model.with_parameters({n: number(v, f"fixed.{n}") for n, v in fixed.items()})
    names = [fixed] if isinstance(fixed, str) else list(instance(fixed, Iterable, "fixed"))
    free, narrower = _chosen(model, names, instance({} if bounds is None else bounds, Mapping, "bounds"))
    warn_of_odd_numbers(model, measured, simulated_trial)

    with one_thread_each():  # products this small are slower on several threads
        if noise is not None:
            problem = Problem(model, measured, noise, free)
            problem.limits |= narrower
            return replace(fit_multistart(problem, max_iterations), bounds=narrower, start=model.parameters())
        if isinstance(trials, Study):
            measured = measured_study(trials).study.to_fit()
        found = fitted_alone(model, at_noise_rate(measured, model.rig.schema), least_squares)
        if free != found.free or narrower:
            found = _restricted(found, model, free, narrower)
        made = LikelihoodFit if least_squares else TestedFit
        return made(**{**vars(found), "start": model.parameters()})


def fitted_alone(model: Model, trials: Sequence[Trial], least_squares: bool = False) -> LikelihoodFit:
    """Return the fit of one model by the first estimator of a diagnosis, or by its least squares of free simulations.

    Parameters
    ----------
    trials
        As `prepare.measured.split` returns them.
    """
    answered = is_answered(model.rig, trials)
    some, _, _ = searched_part(trials, model.rig.schema, answered)
    parts, noise = in_parts(model.rig, some, answered), WHITE if least_squares else first_noise(trials, answered)
    first = LikelihoodFits(model, parts, (), answered, noise=noise).nominal()
    return maximum_from(first, parts) if math.isfinite(first.sse) else first


def _restricted(
    whole: LikelihoodFit, model: Model, free: tuple[str, ...], narrower: Mapping[str, tuple[float, float]]
) -> LikelihoodFit:
    """Return a fit again with some parameters held at the values of a model, and others within narrower bounds.

    Autoregressions keep the orders that they have in the fit without restrictions.
    """
    values = {n: v for n, v in whole.values.items() if n in free}
    values |= {n: float(np.clip(values[n], *ends)) for n, ends in narrower.items()}
    problem = LikelihoodProblem(model.with_parameters(values), whole.trials, whole.noise, free)
    problem.limits |= narrower
    return replace(maximise(problem, whole.unknowns), bounds=narrower)


def _chosen(
    model: Model, fixed: Sequence[str], bounds: Mapping[str, tuple[float, float]]
) -> tuple[tuple[str, ...], dict[str, tuple[float, float]]]:
    """Return the parameters that are fitted where some are fixed, and the bounds that were asked for."""
    fitted, info, narrower = model.fitted_parameters(), model.parameter_info(), dict[str, tuple[float, float]]()
    free = tuple(n for n in fitted if n not in map(str, fixed))
    check_known(map(str, fixed), fitted, fault_at("fixed"))
    check_known(map(str, bounds), free, fault_at("bounds"))
    for name, ends in ((str(n), ends) for n, ends in bounds.items()):
        least, most = info[name].lower, info[name].upper
        pair = [as_number(end) for end in ends] if isinstance(ends, tuple | list) else []
        low, high = [end for end in pair if end is not None] if len(pair) == 2 and None not in pair else (1.0, 0.0)
        narrower[name] = (max(low, least), min(high, most))
        if not narrower[name][0] < narrower[name][1]:
            message = f"expected (lower, upper) of {name} within {least:g} to {most:g}, found {ends!r}"
            raise InputError(message, column="bounds")
    return free, narrower
