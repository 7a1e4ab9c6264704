"""Gains on held-out data: errors by unit of evidence, gains with their intervals, likelihoods."""

from collections import Counter
from collections.abc import Collection, Hashable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from fes_pin.infer.covariance import covariance_of
from fes_pin.infer.levels import IDENTIFIABLE_SHARE
from fes_pin.infer.optimum import Optimum
from fes_pin.infer.problem import Linearized, normal_equations
from fes_pin.infer.result import Evidence, Gain
from fes_pin.infer.scatter import at_rest

RESAMPLES = 2000
"""Bootstrap draws of a gain: the standard error of its 95 % bounds is 1.5 % of their distance, of a normal gain."""
FAR = 1e6
"""Limit of whitened residuals, in standard deviations."""
WIDE = 10.0
"""Width of the vague prior of a parameter, in units of its value or scale. For identified parameters it cancels between
the trials and their folds."""

FOLDS = 5
"""Number of folds: each is predicted from the other four, which hold most of the information."""


def deal(order: Sequence[int], groups: Sequence[Hashable] | None = None, count: int = FOLDS) -> list[list[int]]:
    """Return the units of each fold, by their numbers; every group is spread over the folds.

    A unit that is alone in its group is never held out, since the others do not predict it.

    Parameters
    ----------
    order
        Numbers of the units in the order in which they are spread: neighbours come to different folds.
    groups
        Group of each unit, by its number; by default there is one group.
    """
    of = {i: None if groups is None else groups[i] for i in order}
    sizes = Counter(of.values())
    dealt = [i for g in sizes for i in order if of[i] == g and sizes[g] > 1]
    return [sorted(dealt[k::count]) for k in range(min(count, len(dealt)))]


def identified_folds(fitted: Optimum, units: Sequence[Linearized], folds: Sequence[list[int]]) -> list[list[int]]:
    """Return the folds whose other units identify the model, and which identify half of it by themselves.

    A standard deviation may grow by no more than 1 / `IDENTIFIABLE_SHARE`. A prediction from units that do not identify
    the model, as of a joint at rest, says nothing about its causes; nor does a prediction of units that tell little of
    it, as of a pendulum that is balanced. One fold alone has no scatter, and is none.

    Parameters
    ----------
    units
        Residuals and sensitivities of each unit of evidence near the fit.
    folds
        Units that are held out together, by their numbers.
    """
    moving = np.array([n not in fitted.at_bound for n in fitted.free])

    def deviations(some: Collection[int]) -> np.ndarray:
        hessian = normal_equations([units[k] for k in some]).hessian
        return np.sqrt(np.diag(covariance_of(hessian, moving)))

    every = {*range(len(units))}
    whole = deviations(every)
    known = np.isfinite(whole)

    def identified(some: Collection[int]) -> np.ndarray:
        """Return which of the identified parameters some units identify."""
        return np.asarray(IDENTIFIABLE_SHARE * deviations(some)[known] <= whole[known])

    half = 0.5 * np.count_nonzero(known)
    telling = [k for k in folds if identified(every - {*k}).all() and np.count_nonzero(identified(k)) >= half]
    return telling if len(telling) > 1 else []


def percent_of_spread(squares: ArrayLike, around: ArrayLike) -> float:
    """Return E, percent.

    Parameters
    ----------
    squares, around
        Squared errors, and squares of the measurement about the mean of each trial, in the same unit; summed here.
    """
    return 100.0 * float(np.sum(squares)) / max(float(np.sum(around)), 1e-300)


@dataclass(frozen=True)
class Errors:
    """Squared errors of one model, by unit of evidence (trial, or second of a trial where there are few).

    Attributes
    ----------
    squares
        Shape (units,): sums of squares in units of the noise variance, all channels.
    spread
        The same of the measurement about its trial's mean.
    noise
        Expectation of the same for noise alone: for white noise the number of samples.
    variances
        Variance of the same for noise alone; None for white noise, which has twice the number of samples.
    """

    squares: np.ndarray
    spread: np.ndarray
    noise: np.ndarray
    variances: np.ndarray | None = None

    def scatter(self) -> np.ndarray:
        """Variance of the squared error of noise alone in each unit."""
        return 2.0 * self.noise if self.variances is None else self.variances

    def error_percent(self) -> float:
        """Return E of eq. (2), pooled."""
        return percent_of_spread(self.squares, self.spread)

    def ceiling_percent(self) -> float:
        """Return E of a model whose errors are noise alone."""
        return percent_of_spread(self.noise, self.spread)


def held_out_gain(nominal: Errors, without: Errors, extended: Errors, seed: int) -> Gain:
    """Return the share of the nominal model's error above the noise that the step from `without` to `extended` removes.

    The interval is a bootstrap over the units of evidence, and so is the share of the error of `without` itself.
    """
    draws = np.random.default_rng(seed).integers(len(nominal.squares), size=(RESAMPLES, len(nominal.squares)))
    squares = (nominal.squares, without.squares, extended.squares, extended.noise, extended.scatter())
    many, one = _share(*(e[draws].sum(axis=1) for e in squares)), _share(*(e.sum() for e in squares))
    low, high = np.quantile(many, (0.025, 0.975))
    given = np.quantile(_share(*(e[draws].sum(axis=1) for e in (without.squares, *squares[1:]))), 0.025)
    return Gain(float(one), float(low), float(high), given=float(given))


def _share(
    nominal: np.ndarray, without: np.ndarray, extended: np.ndarray, noise: np.ndarray, scatter: np.ndarray
) -> np.ndarray:
    """Return the gain in percent of the error above the noise.

    That error is taken as no less than that of the set which is extended, or the part which the extension removes, and
    no less than its own standard deviation, the root of `scatter`: units with hardly any error would otherwise have
    gains of any size.
    """
    most = np.maximum(nominal, without)
    excess = np.maximum(np.maximum(most - noise, most - extended), np.sqrt(scatter))
    return np.asarray(100.0 * (without - extended) / excess)


@np.errstate(all="ignore")
def marginal_cost(fitted: Optimum, scales: Mapping[str, float]) -> float:
    """Return twice the negative log of the marginal likelihood of a fit's trials by Laplace's method.

    It is cost + log det(1 + H S^2), with H the information and S the widths of a prior. By Bayes' rule
    p(held | others) = p(all) / p(others): the value for all trials minus the value for the others is the cost of the
    held-out ones, with the uncertainty of the parameters included.

    Parameters
    ----------
    scales
        Scale of every parameter, by name.
    """
    system = normal_equations(at_rest(fitted.parts))
    widths = [WIDE * max(abs(fitted.parameters[n]), scales[n]) for n in fitted.free]
    scaled = system.hessian * np.outer(widths, widths)
    return fitted.sse + float(np.linalg.slogdet(np.eye(len(widths)) + scaled)[1])


def is_supported(evidence: Evidence | None, gain: Gain, alone: bool) -> bool:
    """Return whether held-out trials support a cause.

    Where the model has no lack of fit, their likelihood must support it, else their errors. In a set of several causes
    both must, since several flexible forms together fit nearly anything. A cause alone may have no gain: if one trial
    of many reaches a stop, the others do not predict it. A significantly negative gain is never accepted. A cause that
    is not judged by errors needs the likelihood alone.

    Parameters
    ----------
    evidence
        Evidence of the likelihood; None where the model has a lack of fit, so that a likelihood says little.
    gain
        Gain in errors of prediction; `NO_GAIN` of a cause that is not judged by them.
    alone
        Whether the set has no other cause.
    """
    likely = evidence is None or evidence.low > 0.0
    return likely and (gain.is_none or gain.is_material or (evidence is not None and alone and gain.high > 0.0))


def within(errors: np.ndarray, most: float) -> np.ndarray:
    """Return errors or readings limited to `most`; values that are not finite become `most`."""
    return np.asarray(np.clip(np.nan_to_num(errors, nan=most, posinf=most, neginf=-most), -most, most))


def added_likelihood(without: np.ndarray, extended: np.ndarray) -> Evidence:
    """Return the evidence for a cause from whitened residuals without it and with it."""
    without, extended = within(without, FAR), within(extended, FAR)
    difference = without - extended
    return Evidence(float(without @ without - extended @ extended), float(difference @ difference))
