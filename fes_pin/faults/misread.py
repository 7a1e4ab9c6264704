"""Misread conditions: a trial whose stated load, angle or length contradicts its readings, and the value estimated.

The model is fitted to all trials but one, and the condition of that trial is then estimated. Let z_j be the difference
between the estimated and the stated condition of trial j, in standard deviations by the noise of the others and by the
covariance of their parameters. Then

    t = z_i / sqrt(phi),   phi = max(1, mean of z_j^2 over the others)

has Student's distribution with as many degrees of freedom as there are other trials. Scatter between repeats is
therefore not taken for a misreading. A restated trial must also be explained as well as the others.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from scipy import special

from fes_pin.data.trial import Trial
from fes_pin.identify.fit import Fit, fit_problem, noise_of, rough_fit, under_own_noise
from fes_pin.identify.per_trial import halves
from fes_pin.identify.problem import Problem
from fes_pin.infer.levels import CLAIM_LEVEL, EXPLAINED_AS_WELL, FEWEST_STATED, MISREAD_SCORE
from fes_pin.infer.optimum import MAX_ITERATIONS
from fes_pin.infer.problem import Linearized
from fes_pin.infer.projection import Projection, without_locals
from fes_pin.infer.result import ParameterEstimate
from fes_pin.models.model import Model

NAME = "condition_misread"
DESCRIBED = f"""{NAME} (rig; rigs: ankle, joint, muscle)
  One trial's stated load, angle or length is not what it was.
      condition of one trial = value
  Tell-tale: one trial is off as a whole, as another load or length would have it, and all others are right.
    value, of the condition that the trial states
"""
"""Description for `fes-pin effects`: a misreading belongs to a trial, not to the rig, and is no effect of a model."""
CANDIDATES = 3
"""Trials that are left out in turn: those of the largest scores."""
ENDS = 0.01
"""Step, in standard deviations of the value, at which its estimation ends."""
STEPS = 8
"""Most Gauss-Newton steps of one value; it usually takes fewer."""
SHARE = 1e-4
"""Step of a numerical derivative, as a share of the spread of the stated values, or of their size if all are equal."""


Pick = tuple[int, str]
"""A trial by its number, and one of its conditions."""


@dataclass(frozen=True)
class Misread:
    """A condition of a trial that was not as stated.

    Attributes
    ----------
    trial
        Its name.
    condition
        "load_kg", "angle_rad", "length_m" ...
    stated, value, std
        The stated value, its estimate, and the standard deviation of the estimate.
    p_value
        Family-wise, over all trials.
    halves
        Estimates from the odd quarters of the trial, and from the even ones.
    whole, others
        Fits of the model to all trials as stated, and to all but this one.
    """

    trial: str
    condition: str
    stated: float
    value: float
    std: float
    p_value: float
    halves: tuple[float, float]
    whole: Fit = field(repr=False)
    others: Fit = field(repr=False)

    @property
    def estimate(self) -> ParameterEstimate:
        """Return the estimated value with its unit."""
        known = self.whole.model.rig.schema.conditions.get(self.condition)
        return ParameterEstimate(self.value, self.std, known.unit if known is not None else "m")

    @property
    def words(self) -> str:
        """Return the misreading in words."""
        return f"trial {self.trial} states {self.condition} = {self.stated:.4g}; it was {self.value:.4g}"


class _Estimated(NamedTuple):
    """Estimate of a condition from its own trial: difference from the stated value in its unit, standard deviation, and
    mean square of the residual."""

    value: float
    std: float
    left: float


class _Near(NamedTuple):
    """A trial at a value of a condition: linearized in the parameters, and the whitened derivative by the condition,
    shape (m,)."""

    part: Linearized
    column: np.ndarray


def find_misread(model: Model, trials: Sequence[Trial]) -> Misread | None:
    """Return the trial whose condition was misread, under a model; None if no trial is an outlier.

    Parameters
    ----------
    model
        The model, with start values; it is fitted here by free simulation.
    trials
        Measured trials with their stated conditions.
    """
    sizes = _sizes(model, trials)
    wanted = [(i, n) for i, t in enumerate(trials) for n in model.rig.stated(t)]
    if len({i for i, _ in wanted}) < FEWEST_STATED:
        return None
    whole = rough_fit(model, trials)
    if not math.isfinite(whole.sse):
        return None
    odd = _screen(whole, wanted, sizes)
    found = [one for pick in odd if (one := _left_out(whole, pick, wanted, sizes)) is not None]
    return min(found, key=lambda m: m.p_value, default=None)


def restated_trials(model: Model, trials: Sequence[Trial], found: Misread) -> list[Trial]:
    """Return the trials, one of them with the estimated value of its condition."""
    return [model.rig.restated(t, found.condition, found.value) if t.name == found.trial else t for t in trials]


def takes_most(found: Misread) -> bool:
    """Return whether restating the trial removes more than half of the squared error of the model above the noise."""
    whole = found.whole
    restated = restated_trials(whole.model, whole.trials, found)
    after = fit_problem(Problem(whole.model, restated, whole.noise), whole.values)
    return 2.0 * (after.sse - after.samples) < max(whole.sse - whole.samples, 0.0)


def _sizes(model: Model, trials: Sequence[Trial]) -> dict[str, float]:
    """Return a small step of each condition that changes the simulation."""
    values: dict[str, list[float]] = {}
    for trial in trials:
        for name, value in model.rig.stated(trial).items():
            moved = trial[name] if name in trial.columns else np.array([value])
            values.setdefault(name, []).extend([float(np.min(moved)), float(np.max(moved))])
    return {n: SHARE * max(float(np.ptp(v)), 0.1 * float(np.max(np.abs(v))), 1e-6) for n, v in values.items()}


def _screen(whole: Fit, wanted: Sequence[Pick], sizes: Mapping[str, float]) -> list[Pick]:
    """Return the conditions of largest score in a model whose parameters are free too, under white noise."""
    white = under_own_noise(whole, longest=0)
    projection = Projection(white.parts)

    def score(pick: Pick, near: _Near) -> float:
        left, shared = (own[:, 0] for own in projection.within(pick[0], near.column[:, None]))
        power, before = float(left @ left - shared @ shared), float(near.column @ near.column)
        along = float(left @ projection.residual[projection.trials[pick[0]]])
        return along**2 / power if power > 1e-9 * max(before, 1e-300) else 0.0

    near = _near(white, [(white.trials[i], name) for i, name in wanted], sizes)
    scores = [score(*one) for one in zip(wanted, near, strict=True)]
    return [wanted[k] for k in np.argsort(scores)[::-1][:CANDIDATES] if scores[k] > MISREAD_SCORE]


def _left_out(whole: Fit, pick: Pick, wanted: Sequence[Pick], sizes: Mapping[str, float]) -> Misread | None:
    """Return the misreading of one trial's condition by a fit of the others; None if the trial is no outlier."""
    (i, name), trials = pick, whole.trials
    others = Problem(whole.model, [*trials[:i], *trials[i + 1 :]], noise_of(whole, longest=0))
    fitted = under_own_noise(fit_problem(others, whole.values), max_iterations=MAX_ITERATIONS)
    if not math.isfinite(fitted.sse):
        return None
    own = _estimated(fitted, trials[i], name, sizes)
    steps = [_step(fitted, one) for one in _near(fitted, [(trials[k], n) for k, n in wanted if k != i], sizes)]
    finite = [move / std for move, std in steps if math.isfinite(std)]
    if len(finite) < FEWEST_STATED - 1 or not math.isfinite(own.std):
        return None
    phi = max(1.0, float(np.mean(np.square(finite))))
    t = abs(own.value / own.std) / math.sqrt(phi)
    p = min(1.0, 2.0 * len(wanted) * float(special.stdtr(len(finite), -t)))
    usual = max(float(part.residual @ part.residual) / len(part.residual) for part in fitted.parts)
    if not p < CLAIM_LEVEL or own.left > EXPLAINED_AS_WELL * max(usual, 1.0):
        return None
    stated = whole.model.rig.stated(trials[i])[name]
    odd, even = (stated + _estimated(fitted, trials[i], name, sizes, k).value for k in (0, 1))
    value, std = stated + own.value, own.std * math.sqrt(phi)
    return Misread(trials[i].name, name, stated, value, std, p, (odd, even), whole, fitted)


def _near(fitted: Fit, wanted: Sequence[tuple[Trial, str]], sizes: Mapping[str, float]) -> list[_Near]:
    """Return trials near the values of a condition of each, by central differences; one run for all."""
    rig, each = fitted.model.rig, list[Trial]()
    for trial, name in wanted:
        there, size = rig.stated(trial)[name], sizes[name]
        each += [trial, *(rig.restated(trial, name, there + s) for s in (-size, size))]
    parts = _linearized(fitted, each)
    found = zip(parts[::3], parts[1::3], parts[2::3], [sizes[n] for _, n in wanted], strict=True)
    return [_Near(part, (low.residual - high.residual) / (2.0 * size)) for part, low, high, size in found]


def _linearized(fitted: Fit, trials: Sequence[Trial]) -> list[Linearized]:
    problem = Problem(fitted.model, trials, fitted.noise, fitted.free)
    return problem.linearize(fitted.values, problem.start_unknowns())


def _step(fitted: Fit, near: _Near, half: int | None = None) -> tuple[float, float]:
    """Return the Gauss-Newton step of a condition and its standard deviation, infinite where it is not identifiable.

    Parameters
    ----------
    half
        0 or 1: from the odd or from the even quarters of the trial alone.
    """
    part, covariance = near.part, np.where(np.isfinite(fitted.covariance), fitted.covariance, 0.0)
    column = without_locals(part, near.column[:, None])[:, 0]
    r, j = without_locals(part, part.residual[:, None])[:, 0], without_locals(part, part.jacobian)
    if half is not None:
        column = np.where(halves(len(column))[half], column, 0.0)
    power = float(column @ column)
    if not power > 0.0 or not math.isfinite(power):
        return 0.0, math.inf
    shift = column @ j / power
    return float(column @ r) / power, math.sqrt(1.0 / power + max(float(shift @ covariance @ shift), 0.0))


def _estimated(fitted: Fit, trial: Trial, name: str, sizes: Mapping[str, float], half: int | None = None) -> _Estimated:
    """Estimate a condition from its own trial by Gauss-Newton steps; see `_step`."""
    rig, now = fitted.model.rig, trial
    begun = rig.stated(trial)[name]
    for _ in range(STEPS):
        (near,) = _near(fitted, [(now, name)], sizes)
        move, std = _step(fitted, near, half)
        if not math.isfinite(std):
            return _Estimated(0.0, math.inf, math.inf)
        now = rig.restated(now, name, rig.stated(now)[name] + move)
        if abs(move) < ENDS * std:
            break
    (there,) = _linearized(fitted, [now])
    r = without_locals(near.part, there.residual[:, None])[:, 0]
    return _Estimated(rig.stated(now)[name] - begun, std, float(r @ r) / max(len(r), 1))
