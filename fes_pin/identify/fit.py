"""Fits of models to trials: parameters with their covariance, and each trial's own unknowns."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fes_pin.data.show import frame, table_html
from fes_pin.data.trial import Trial
from fes_pin.identify.covariance import covariance_of, promised_gain
from fes_pin.identify.descent import Descent
from fes_pin.identify.noise import ORDERS, Noise, NoiseModel, as_white, estimate_noise, noise_step, thin, thinning
from fes_pin.identify.problem import Linearized, Problem, Unknowns, normal_equations, whitened_sse
from fes_pin.infer.levels import CONFIDENCE_95, PARAMETER_PRICE
from fes_pin.models.model import Model
from fes_pin.models.predictor import Doubt
from fes_pin.workers import one_thread_each

if TYPE_CHECKING:
    import pandas

MAX_ITERATIONS = 60
"""Steps of a fit, at most; what has not converged then says so."""

GROWTH = (1 / 8, 1 / 4, 1 / 2)
"""Shares of every trial that a fit from afar begins with, one after another."""
SHORTEST = 50
"""Samples of a trial that are worth a fit, at least."""
GROSS = 10.0
"""Reduced chi-square from which a fit may have ended far from the optimum."""


@dataclass(frozen=True, repr=False, eq=False)
class Fit:
    """A model with fitted parameters; it can prove its own quality.

    Attributes
    ----------
    model
        With the fitted values.
    trials
        What it was fitted to.
    noise
        By output column, as assumed in the fit.
    free
        Names of the fitted parameters.
    covariance
        Shape (free, free); infinite where the data identify nothing.
    sse
        Sum of squared whitened residuals: minus twice the log-likelihood, but for a constant.
    samples
        Number of whitened residuals.
    gradient_norm
        Largest Newton decrement of a single free parameter at the end: 0 at an optimum.
    unknowns
        Of each trial.
    parts
        Whitened residuals and sensitivities at the optimum, by trial.
    doubt
        What is random, of a fit by `identify.turns`: its `sse` holds the log-determinant.
    together
        True where slopes for gains as they are lead no further: parameters and what is random move together from there.
    """

    model: Model
    trials: tuple[Trial, ...]
    noise: NoiseModel
    free: tuple[str, ...]
    covariance: np.ndarray
    sse: float
    samples: int
    converged: bool
    gradient_norm: float
    unknowns: Unknowns
    at_bound: tuple[str, ...]
    parts: tuple[Linearized, ...] = field(repr=False)
    doubt: Doubt | None = None
    together: bool = False

    @property
    def values(self) -> dict[str, float]:
        """Every parameter by name."""
        return self.model.parameters()

    def std(self, name: str) -> float:
        """Standard deviation of a fitted parameter."""
        k = self.free.index(name)
        return float(np.sqrt(self.covariance[k, k]))

    def interval(self, name: str) -> tuple[float, float]:
        """95 % interval of a fitted parameter, cut at its bounds."""
        value, half = self.values[name], CONFIDENCE_95 * self.std(name)
        info = self.model.parameter_info()[name]
        return max(value - half, info.lower), min(value + half, info.upper)

    def is_optimal(self, tolerance: float = 0.1) -> bool:
        """True if no free parameter's Newton step would gain more than `tolerance` in twice the log-likelihood."""
        return self.converged and self.gradient_norm <= tolerance

    def not_identified(self) -> tuple[str, ...]:
        """Parameters that these data say nothing about."""
        return tuple(n for n in self.free if not math.isfinite(self.std(n)))

    def __repr__(self) -> str:
        values = ", ".join(f"{n} = {self.values[n]:.4g} +- {self.std(n):.2g}" for n in self.free)
        return f"Fit {' + '.join(self.model.structure())}: {self.samples} samples, chi2 {self.reduced:.3f}; {values}"

    def _repr_html_(self) -> str:
        info, rows = self.model.parameter_info(), []
        for name in self.free:
            low, high = self.interval(name)
            note = (
                "not identified" if name in self.not_identified() else "at its bound" if name in self.at_bound else ""
            )
            rows.append((name, f"{self.values[name]:.5g}", f"[{low:.5g}, {high:.5g}]", info[name].unit or "-", note))
        notes = [] if self.is_optimal() else ["The fit did not end at an optimum."]
        return table_html(
            f"{' + '.join(self.model.structure())}: {self.samples} samples, reduced chi2 {self.reduced:.3f}",
            ("parameter", "value", "95 % interval", "unit", ""),
            rows,
            notes,
        )

    def to_frame(self) -> pandas.DataFrame:
        """The fitted parameters with deviations and 95 % intervals as a frame of pandas; see `data.show.frame`."""
        info = self.model.parameter_info()
        columns = {
            "parameter": list(self.free),
            "value": self.to_numpy(),
            "std": [self.std(n) for n in self.free],
            "low": [self.interval(n)[0] for n in self.free],
            "high": [self.interval(n)[1] for n in self.free],
            "unit": [info[n].unit for n in self.free],
        }
        return frame(columns, index="parameter")

    def to_numpy(self) -> NDArray[np.float64]:
        """Values of the fitted parameters, shape (free,), in the order of `free` and of `covariance`."""
        return np.array([self.values[n] for n in self.free], dtype=np.float64)

    def __str__(self) -> str:
        info = self.model.parameter_info()
        lines = [f"{' + '.join(self.model.structure())}: {self.samples} samples, reduced chi2 {self.reduced:.3f}"]
        for name in self.free:
            note = " (not identified)" if name in self.not_identified() else ""
            note += " (at its bound)" if name in self.at_bound else ""
            lines.append(f"  {name:40s} {self.values[name]:12.6g} +- {self.std(name):9.2g} {info[name].unit}{note}")
        return "\n".join(lines)

    @property
    def reduced(self) -> float:
        """Sum of squares over degrees of freedom: 1 where the noise model is right and the model adequate."""
        return self.sse / max(self.samples - self.degrees, 1)

    @property
    def degrees(self) -> int:
        """Degrees of freedom of parameters and effects: what is free, and in each trial the effects' unknowns it feels.

        Initial states are not counted: all models of a rig have the same.
        """
        own = len(self.model.own_unknowns())
        return len(self.free) + sum(int(p.local[:, -own:].any(axis=0).sum()) for p in self.parts if own)

    @cached_property
    def plain(self) -> float:
        """Sum of squared residuals over the variance of a single sample, not whitened."""
        return whitened_sse(
            Problem(self.model, self.trials, as_white(self.noise), ()).linearize(self.values, self.unknowns)
        )

    @property
    def price(self) -> float:
        """Twice the negative log-likelihood, with what its degrees of freedom and random processes must earn."""
        acting = 2 * len(self.doubt.acting) if self.doubt else 0
        return self.sse + PARAMETER_PRICE * (self.degrees + acting)


def fit_problem(
    problem: Problem,
    start: Mapping[str, float],
    unknowns: Unknowns | None = None,
    max_iterations: int = MAX_ITERATIONS,
) -> Fit:
    """Fit a problem from a start value of every parameter.

    Returns
    -------
    Fit
        Also if it did not converge: then `converged` is False.
    """
    return _run(Descent(problem, start, unknowns), max_iterations)


def fit_growing(problem: Problem, start: Mapping[str, float], max_iterations: int = MAX_ITERATIONS) -> Fit:
    """Fit a problem from afar: to the beginning of every trial, to twice as much of it, and so on to the whole.

    What a wrong parameter does to an angle grows with time, past half a swing; the squares of a long trial then have
    many minima, those of its beginning few. Source: Voss, Timmer and Kurths, Int. J. Bifurcation Chaos 14 (2004).
    """
    values, unknowns = start, None
    for share in GROWTH:
        trials = [t.first(max(SHORTEST, round(share * len(t)))) for t in problem.trials]
        short = Problem(problem.model, trials, problem.noise, problem.free)
        short.limits = problem.limits
        near = fit_problem(short, values, unknowns, max_iterations)
        values, unknowns = near.values, near.unknowns
    return fit_problem(problem, values, unknowns, max_iterations)


def fit_multistart(
    problem: Problem,
    start: Mapping[str, float],
    unknowns: Unknowns | None = None,
    max_iterations: int = MAX_ITERATIONS,
) -> Fit:
    """Fit a problem from a start, and from afar as well where that leaves a gross misfit; the better of both."""
    plain = fit_problem(problem, start, unknowns, max_iterations)
    if plain.reduced < GROSS:
        return plain
    grown = fit_growing(problem, start, max_iterations)
    return grown if grown.sse < plain.sse or not np.isfinite(plain.sse) else plain


def go_on(problem: Problem, fitted: Fit, max_iterations: int = MAX_ITERATIONS) -> Fit:
    """Fit a problem from where a fit of the same model, to the same trials and perhaps more, has ended.

    Under the same noise what that fit has linearized at its end is where this one begins.
    """
    at = {id(t): i for i, t in enumerate(fitted.trials)}
    rows = [at[id(t)] for t in problem.trials]
    known = [fitted.parts[i] for i in rows] if problem.noise == fitted.noise and problem.free == fitted.free else None
    return _run(Descent(problem, fitted.values, [fitted.unknowns[i] for i in rows], known), max_iterations)


def _run(search: Descent, max_iterations: int) -> Fit:
    problem, done = search.problem, False
    for _ in range(max_iterations):
        done = search.step()
        if done:
            break
    with np.errstate(all="ignore"):
        system = normal_equations(search.parts)
        free = search.free_now(system.gradient)
        decrement = promised_gain(system.hessian, system.gradient, free)
    model = problem.model.with_parameters(search.values(search.x))
    return Fit(
        model=model,
        trials=problem.trials,
        noise=problem.noise,
        free=problem.free,
        covariance=covariance_of(system.hessian, free),
        sse=search.sse,
        samples=sum(len(p.residual) for p in search.parts),
        converged=bool(done and np.isfinite(search.sse)),
        gradient_norm=decrement,
        unknowns=search.unknowns,
        at_bound=tuple(n for n, f in zip(problem.free, free, strict=True) if not f),
        parts=tuple(search.parts),
    )


def fit(
    model: Model,
    trials: Sequence[Trial],
    noise: NoiseModel | None = None,
    max_iterations: int = MAX_ITERATIONS,
) -> Fit:
    """Fit a model's parameters to trials, from the model's own values.

    Parameters
    ----------
    model
        Start values and structure.
    trials
        What was measured.
    noise
        By output column. Without it the noise is taken for white, fitted, and estimated from the residuals; then the
        fit is repeated with it.

    Returns
    -------
    Fit
    """
    with one_thread_each():  # products this small are slower on several threads
        if noise is None:
            first = fit_multistart(Problem(model, trials, rough_noise(model, trials)), model.parameters())
            if not math.isfinite(first.sse):  # the simulation runs away wherever the fit began
                return first
            model, noise = first.model, noise_of(first)
            return fit_problem(Problem(model, trials, noise), first.values, first.unknowns, max_iterations)
        return fit_multistart(Problem(model, trials, noise), model.parameters(), max_iterations=max_iterations)


def rough_noise(model: Model, trials: Sequence[Trial]) -> dict[str, Noise]:
    """White noise at the level of the second differences of each measured column: all that is known before a fit."""
    columns: dict[str, list[np.ndarray]] = {}
    for trial in trials:
        for name in model.rig.outputs(trial.kind):
            if name in trial.columns:
                columns.setdefault(name, []).append(trial[name])
    out = {}
    step = noise_step([t.dt for t in trials])
    for name, pieces in columns.items():
        bend = np.concatenate([np.diff(p, 2) for p in pieces])
        level = 1.4826 * float(np.median(np.abs(bend))) / math.sqrt(6.0)
        floor = 1e-6 * max(float(np.ptp(np.concatenate(pieces))), 1e-9)
        out[name] = Noise(max(level, floor), (), max(level, floor), step)
    return out


def noise_of(fitted: Fit, longest: int = ORDERS[-1], least: int = 0) -> dict[str, Noise]:
    """The noise that a fit's residuals show, by output column, with autoregressions of orders `least` to `longest`.

    Noise of a long order does not hold a trial's initial state: what moves with that in the residuals would be learned
    as noise again, and is taken out first.
    """
    problem = Problem(fitted.model, fitted.trials, fitted.noise, free=())
    step = noise_step([t.dt for t in fitted.trials])
    columns: dict[str, list[np.ndarray]] = {}
    squares: dict[str, list[float]] = {}
    for trial, residuals in zip(fitted.trials, problem.settled(fitted.values, fitted.unknowns), strict=True):
        for name, residual in residuals.items():
            columns.setdefault(name, []).append(thin(residual, thinning(trial.dt, step)))
            squares.setdefault(name, []).append(float(np.mean(residual**2)))
    return {
        name: estimate_noise(pieces, fitted.degrees, math.sqrt(float(np.mean(squares[name]))), step, longest, least)
        for name, pieces in columns.items()
    }
