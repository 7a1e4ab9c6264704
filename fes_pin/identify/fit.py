"""Fits of models to trials: parameters with their covariance, and each trial's own unknowns."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from fes_pin.data.errors import InputError, fault_at
from fes_pin.data.results import Saveable
from fes_pin.data.schema import IMPOSED, check_known
from fes_pin.data.show import by_columns
from fes_pin.data.trial import Trial
from fes_pin.data.units import own_unit
from fes_pin.identify.problem import Problem
from fes_pin.infer.noise import ORDERS, Noise, NoiseModel, estimate_noise, noise_step, thin, thinning
from fes_pin.infer.optimum import MAX_ITERATIONS, Optimum, minimise
from fes_pin.infer.problem import Unknowns, completed
from fes_pin.infer.profile import profile_interval
from fes_pin.infer.result import shown
from fes_pin.infer.scoring import LITTLE
from fes_pin.infer.text import quantity
from fes_pin.models.model import Model
from fes_pin.models.predictor import StateSpaceNoise, measured_outputs
from fes_pin.workers import one_thread_each

GROWTH = (1 / 8, 1 / 4, 1 / 2)
"""Shares of every trial to which a fit from afar is made, one after another."""
SHORTEST = 50
"""Least number of samples of a trial that is fitted by itself."""
HIGH_CORRELATION = 0.9
"""Absolute correlation of two estimates above which the printed table lists the pair."""
GROSS = 10.0
"""Reduced chi-square from which a fit may have ended far from the optimum."""


@dataclass(frozen=True, kw_only=True, repr=False, eq=False)
class Fit(Optimum, Saveable):
    """A model with fitted parameters, their covariance, and tests of its optimality.

    Two are equal if their tables are, to the printed digits. Equality and hash take as long as the table: of a fit at
    a bound as long as the profile of its parameter. A search keys its fits by `id`.

    Attributes
    ----------
    model
        The model with the fitted values.
    trials
        The trials that it was fitted to.
    noise
        Noise by output column, as assumed in the fit; for a fit by the likelihood, its process noise as well.
    bounds
        Bounds by name, where narrower ones were asked for than the parameters have.
    start
        Start values by name, of a fit by `fit`.
    free, parameters, covariance, at_bound, sse, converged, gradient_norm, unknowns, parts, together
        Of every `Optimum`; read-only.
    """

    model: Model
    trials: tuple[Trial, ...]
    noise: NoiseModel
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    start: Mapping[str, float] = field(default_factory=dict)

    def _freeze(self) -> None:
        super()._freeze()
        for part in self.parts:
            for array in (part.residual, part.jacobian, part.local):
                array.setflags(write=False)

    def place(self, name: str) -> int:
        """Return the place of a fitted parameter in `free` and `covariance`.

        Raises
        ------
        InputError
            If the parameter was not fitted.
        """
        check_known([name], self.free, fault_at())
        return super().place(name)

    def unknowns_of(self, trial: Trial) -> Unknowns | None:
        """Return the unknowns of a trial that was fitted from its first sample on; None of another trial."""
        begun, fits = (trial.name, trial.time[0]), zip(self.trials, self.unknowns, strict=True)
        return [dict(u) for t, u in fits if (t.name, t.time[0]) == begun] or None

    def interval(self, name: str, method: str = "wald") -> tuple[float, float]:
        """Return the 95 % interval of a fitted parameter, cut at its bounds; one-sided, by profile, at a bound.

        Parameters
        ----------
        name
            Of the parameter.
        method
            "wald": value +- 1.96 std. "profile": where twice the log-likelihood, all other parameters fitted again,
            falls by 3.84; see `infer.profile`. Estimated noise is held. Fits with process noise, and of a contrast,
            have no such profile. The interval of an estimate with estimated noise at a bound is that of the parabola
            that the fit ended on, but for "profile".

        Raises
        ------
        InputError
            If the parameter was not fitted, the method is another, or the fit has no profile.
        """
        self.place(name)
        if method not in ("wald", "profile"):
            raise InputError(f"expected wald or profile, found {method!r}", column="method")
        if method == "profile" and not self._has_profile:
            raise InputError("expected wald: this fit is of random processes or of groups", column="method")
        if method == "profile" or (type(self) is Fit and name in self.at_bound):
            return self._one_sided[name] if name in self.at_bound else self._profile(name)
        info = self.model.parameter_info()[name]
        return self.within(name, *self.bounds.get(name, (info.lower, info.upper)))

    @property
    def _has_profile(self) -> bool:
        return type(self) is Fit

    def _problem(self) -> Problem:
        return problem_of(self, self.noise)

    @cached_property
    def _one_sided(self) -> dict[str, tuple[float, float]]:
        return {n: self._profile(n) for n in self.at_bound}

    def _profile(self, name: str) -> tuple[float, float]:
        problem = self._problem()
        if not math.isfinite(reach := self.reach(name)):
            return problem.limits[name]
        with one_thread_each():
            return profile_interval(problem, name, self.values, self.unknowns, reach, name in self.at_bound)

    def is_optimal(self, tolerance: float = LITTLE) -> bool:
        """Return whether no free parameter's Newton step gains more than `tolerance` in twice the log-likelihood."""
        return self.converged and self.gradient_norm <= tolerance

    def not_identified(self) -> tuple[str, ...]:
        """Return the parameters that are not identifiable from these data."""
        return tuple(n for n in self.free if math.isinf(self.reach(n)))

    def _note(self, name: str) -> str:
        if math.isinf(self.reach(name)):
            return "not identified"
        return "at its bound" if name in self.at_bound else ""

    def _estimate(self, name: str) -> str:
        """Return a value with its 95 % interval."""
        value, (low, high) = self.values[name], self.interval(name)
        if name in self.at_bound:
            return f"{value:.4g} (at its bound, 95 % in [{low:.3g}, {high:.3g}])"
        return quantity(value, self.std(name), (low, high), "")

    def __repr__(self) -> str:
        values = ", ".join(f"{n} = {self._estimate(n)}" for n in self.free)
        return f"Fit {' + '.join(self.model.structure())}: {self.samples} samples, chi2 {self.reduced:.3f}; {values}"

    def as_table(self) -> tuple[str, Sequence[str], Sequence[Sequence[str]], Sequence[str]]:
        """Return title, head, rows and notes of the printed table."""
        rows = [
            (n, f"{start:.5g}", f"{value:.5g}", f"[{low:.5g}, {high:.5g}]", unit or "-", note)
            for n, value, _, low, high, unit, note, start in zip(*self.columns().values(), strict=True)
        ]
        title = f"{' + '.join(self.model.structure())}: {self.samples} samples, {self._quality()}"
        return title, ("parameter", "start", "value", "95 % interval", "unit", ""), rows, self._notes()

    def _quality(self) -> str:
        known = f"reduced chi2 {self.reduced:.3f}, " if type(self) is Fit else ""  # else 1, as the noise is estimated
        return f"{known}log-likelihood {self.loglikelihood:.6g}, AIC {self.aic:.6g}, BIC {self.bic:.6g}"

    def _notes(self) -> list[str]:
        """Return the notes under the printed table."""
        noise = (f"{n} {one.std:.3g} {own_unit(n)} (AR {len(one.ar)})" for n, one in self.noise.items())
        lines = [f"noise, standard deviation (order of autoregression): {', '.join(noise)}"]
        at = np.argwhere(np.triu(np.abs(np.nan_to_num(self.correlations)) > HIGH_CORRELATION, 1))
        pairs = (f"{self.free[i]}, {self.free[k]} {self.correlations[i, k]:.3f}" for i, k in at)
        lines += [f"correlations above {HIGH_CORRELATION:g}: {'; '.join(pairs)}"] * bool(len(at))
        return lines + ["The fit did not end at an optimum."] * (not self.is_optimal())

    def columns(self) -> dict[str, list[Any]]:
        """Return the fitted parameters with standard deviations, 95 % intervals, units and start values.

        `std` is NaN and `note` is "at its bound" where a value is at its bound; `note` is "not identified" where a
        parameter is not identifiable. `start` is NaN where it is not known.
        """
        head, info = ("parameter", "value", "std", "low", "high", "unit", "note", "start"), self.model.parameter_info()
        own = ((n, self.values[n], self.std(n), *self.interval(n), info[n].unit, self._note(n)) for n in self.free)
        return by_columns(head, [(*row, self.start.get(row[0], math.nan)) for row in own])

    def record(self) -> dict[str, Any]:
        """Return the fit as JSON holds it: see `fes_pin.data.results`."""
        (_, names), *others = self.columns().items()
        cells = {n: [shown(x) if isinstance(x, float) else x for x in column] for n, column in others}
        return {
            "model": list(self.model.structure()),
            "parameters": {one: {n: column[k] for n, column in cells.items()} for k, one in enumerate(names)},
            "samples": self.samples,
            "reduced_chi2": shown(self.reduced),
            "loglikelihood": shown(self.loglikelihood),
            "aic": shown(self.aic),
            "bic": shown(self.bic),
            "converged": self.converged,
        }

    def to_numpy(self) -> NDArray[np.float64]:
        """Return the fitted values, shape (free,), in the order of `free` and of `covariance`."""
        return np.array([self.values[n] for n in self.free], dtype=np.float64)

    @property
    def reduced(self) -> float:
        """Sum of squares over degrees of freedom: 1 where the noise model is right and the model adequate."""
        squares = sum(float(p.residual @ p.residual) for p in self.parts) if math.isfinite(self.sse) else math.inf
        return squares / max(self.samples - self.degrees, 1)

    @cached_property
    def loglikelihood(self) -> float:
        """Natural logarithm of the likelihood of all readings, at the known or estimated noise."""
        return -0.5 * (self._cost() + self.samples * math.log(2.0 * math.pi))

    def _cost(self) -> float:
        """Return twice the negative log-likelihood without n log(2 pi)."""
        return sum(one.cost() for one in self._problem().innovations(self.values, self.unknowns))

    @property
    def noise_degrees(self) -> int:
        """Number of estimated parameters of the noise; 0 of noise that is known."""
        return 0

    @property
    def aic(self) -> float:
        """Akaike's information criterion, 2 k - 2 log L, with k = `degrees` + `noise_degrees`.

        Source: Akaike, IEEE Transactions on Automatic Control 19 (1974) 716.
        """
        return 2.0 * (self.degrees + self.noise_degrees - self.loglikelihood)

    @property
    def bic(self) -> float:
        """Bayesian information criterion, k log n - 2 log L, of n samples.

        Source: Schwarz, Annals of Statistics 6 (1978) 461.
        """
        return (self.degrees + self.noise_degrees) * math.log(self.samples) - 2.0 * self.loglikelihood

    @cached_property
    def correlations(self) -> NDArray[np.float64]:
        """Correlations of the estimates, shape (free, free); NaN at a bound and where a parameter is not identified."""
        with np.errstate(all="ignore"):
            std = np.sqrt(np.diag(self.covariance))
            return np.asarray(self.covariance / np.outer(std, std), dtype=np.float64)

    @property
    def degrees(self) -> int:
        """Degrees of freedom: free parameters, and in each trial the effects' unknowns that act in it.

        Initial states are not counted, as all models of a rig have the same.
        """
        own = len(self.model.own_unknowns())
        return len(self.free) + sum(int(p.local[:, -own:].any(axis=0).sum()) for p in self.parts if own)

    @property
    def doubt(self) -> StateSpaceNoise | None:
        """The noise of a fit by the likelihood, by its old name; None of others. Deprecated: use `noise`."""
        warnings.warn("Fit.doubt is Fit.noise now; it ends with version 0.3", DeprecationWarning, stacklevel=2)
        return self.noise if isinstance(self.noise, StateSpaceNoise) else None

    def _kind(self) -> str:
        return "Fit"


F = TypeVar("F", bound=Fit)


def fit_problem(
    problem: Problem, start: Mapping[str, float], unknowns: Unknowns | None = None, max_iterations: int = MAX_ITERATIONS
) -> Fit:
    """Fit a problem from a start value of every parameter; see `infer.optimum.minimise`."""
    found = minimise(problem, start, unknowns, max_iterations)
    return Fit(**ended(problem.model, found), trials=problem.trials, noise=problem.noise)


def from_beginnings(problem: Problem, plain: F, again: Callable[[Mapping[str, float], Unknowns], F]) -> F:
    """Return a fit, or the one from fits to the beginning of every trial, to twice as much of it, and so on, if better.

    The error of an angle by a wrong parameter grows with time, past half a swing. The sum of squares of a long trial
    then has many minima, that of its beginning few. Source: Voss, Timmer and Kurths, Int. J. Bifurc. Chaos 14 (2004).

    Parameters
    ----------
    plain
        The fit from the values of the problem's model.
    again
        Returns the fit from other values of parameters and unknowns.
    """
    values, unknowns = problem.model.parameters(), None
    for share in GROWTH:
        short = problem.on([t.first(max(SHORTEST, round(share * len(t)))) for t in problem.trials])
        near = minimise(short, values, unknowns)
        values, unknowns = near.values, near.unknowns
    grown = again(near.values, near.unknowns)
    return grown if grown.sse < plain.sse or not math.isfinite(plain.sse) else plain


def fit_multistart(problem: Problem, max_iterations: int = MAX_ITERATIONS) -> Fit:
    """Fit a problem from its model's values, and from afar where that leaves a gross misfit; return the better fit.

    The error of an imposed motion does not grow with time.
    """
    plain = fit_problem(problem, problem.model.parameters(), max_iterations=max_iterations)
    if plain.reduced < GROSS or all(t.kind == IMPOSED for t in problem.trials):
        return plain
    return from_beginnings(problem, plain, partial(fit_problem, problem, max_iterations=max_iterations))


def rough_fit(model: Model, trials: Sequence[Trial]) -> Fit:
    """Fit a model from its values under white noise as known before a fit; see `fit_multistart`."""
    return fit_multistart(Problem(model, trials, rough_noise(model, trials)))


def problem_of(fitted: Fit, noise: NoiseModel) -> Problem:
    """Return the problem of a fit at another noise."""
    problem = Problem(fitted.model, fitted.trials, noise, fitted.free)
    problem.limits |= fitted.bounds
    return problem


def under_own_noise(fitted: Fit, longest: int = ORDERS[-1], least: int = 0, max_iterations: int = 0) -> Fit:
    """Return a fit under the noise of its residuals, of orders as in `noise_of`, after some steps more."""
    problem = problem_of(fitted, noise_of(fitted, longest, least))
    return replace(fit_problem(problem, fitted.values, fitted.unknowns, max_iterations), bounds=fitted.bounds)


def ended(model: Model, found: Optimum) -> dict[str, Any]:
    """Return the attributes of a fit at the optimum of a model's problem, without trials and noise."""
    fitted = model.with_parameters(found.values)
    return {**vars(found), "model": fitted, "parameters": fitted.parameters()}


def rough_noise(model: Model, trials: Sequence[Trial], correlation_s: float = 0.0) -> dict[str, Noise]:
    """Return white noise at the level of the second differences of each measured column, as known before a fit.

    Parameters
    ----------
    correlation_s
        Correlation time of the noise, s: of readings so far apart.
    """
    step, out = noise_step([t.dt for t in trials]), {}
    for name in dict.fromkeys(n for t in trials for n in measured_outputs(model, t)):
        own = [t for t in trials if name in measured_outputs(model, t)]
        pieces = [t[name][:: max(1, round(correlation_s / t.dt))] for t in own]
        bend = np.concatenate([np.diff(p, 2) for p in pieces])
        level = 1.4826 * float(np.median(np.abs(bend))) / math.sqrt(6.0)
        floor = 1e-6 * max(float(np.ptp(np.concatenate(pieces))), 1e-9)
        out[name] = Noise(max(level, floor), (), max(level, floor), step)
    return out


def errors_of(fitted: Fit) -> list[dict[str, np.ndarray]]:
    """Return for each trial of a fit the errors of its free simulation, shape (n,), by output."""
    units = {n: Noise(1.0) for t in fitted.trials for n in fitted.model.rig.outputs(t.kind)}
    problem = Problem(fitted.model, fitted.trials, units, ())
    run = problem.innovations(fitted.values, completed(problem.start_unknowns(), fitted.unknowns))
    return [dict(zip(one.outputs, one.values.T, strict=True)) for one in run]


def noise_of(fitted: Fit, longest: int = ORDERS[-1], least: int = 0) -> dict[str, Noise]:
    """Return the noise of a fit's residuals, by output column, with autoregressions of orders `least` to `longest`."""
    step, run, out = noise_step([t.dt for t in fitted.trials]), errors_of(fitted), {}
    for name in dict.fromkeys(n for errors in run for n in errors):
        own = [(t.dt, one[name]) for t, one in zip(fitted.trials, run, strict=True) if name in one]
        std = math.sqrt(float(np.mean([float(np.mean(residual**2)) for _, residual in own])))
        pieces = [thin(residual, thinning(dt, step)) for dt, residual in own]
        out[name] = estimate_noise(pieces, fitted.degrees, std, step, longest, least)
    return out
