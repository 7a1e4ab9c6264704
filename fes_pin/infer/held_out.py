"""Gains on data that took no part in choosing or fitting: errors by unit of evidence, gains, likelihoods."""

from __future__ import annotations

from collections import Counter
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from fes_pin.infer.optimum import Optimum
from fes_pin.infer.problem import normal_equations
from fes_pin.infer.result import Evidence, Gain
from fes_pin.infer.scatter import at_rest

RESAMPLES = 2000
"""Bootstrap draws of a gain: the standard error of its 95 % bounds is 1.5 % of their distance, of a normal gain."""
FAR = 1e6
"""Whitened residuals count as no larger, in standard deviations."""
WIDE = 10.0
"""Width of the prior of a parameter, in units of its value or scale: nothing is known beforehand but its size. Of what
the data tell it cancels between the trials and their folds."""

FOLDS = 5
"""Parts that units are dealt to: each is predicted by the other four, which hold most of what is known."""


def deal(order: Sequence[int], groups: Sequence[Hashable] | None = None, count: int = FOLDS) -> list[list[int]]:
    """Units to hold out together, by their numbers; each group is dealt round, and stays in what is fitted.

    A unit that is alone in its group is never held out: the others say nothing of it.

    Parameters
    ----------
    order
        Numbers of the units as they are dealt: neighbours come to different folds.
    groups
        Of each unit, by its number; by default all are of one.
    """
    of = {i: None if groups is None else groups[i] for i in order}
    sizes = Counter(of.values())
    dealt = [i for g in sizes for i in order if of[i] == g and sizes[g] > 1]
    return [sorted(dealt[k::count]) for k in range(min(count, len(dealt)))]


def percent_of_spread(squares: ArrayLike, around: ArrayLike) -> float:
    """E, percent.

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
        The same that noise alone leaves, by expectation: of white noise the number of samples.
    variances
        Of that; None where it is white, which leaves twice the number of samples.
    """

    squares: np.ndarray
    spread: np.ndarray
    noise: np.ndarray
    variances: np.ndarray | None = None

    def scatter(self) -> np.ndarray:
        """Variance of what noise alone leaves in each unit."""
        return 2.0 * self.noise if self.variances is None else self.variances

    def error_percent(self) -> float:
        """E of eq. (2), pooled."""
        return percent_of_spread(self.squares, self.spread)

    def ceiling_percent(self) -> float:
        """E of a model that leaves the noise alone."""
        return percent_of_spread(self.noise, self.spread)


def held_out_gain(nominal: Errors, without: Errors, extended: Errors, seed: int) -> Gain:
    """What the step from `without` to `extended` removes of the nominal model's error above the noise.

    The interval is a bootstrap over the units of evidence.
    """
    draws = np.random.default_rng(seed).integers(len(nominal.squares), size=(RESAMPLES, len(nominal.squares)))
    squares = (nominal.squares, without.squares, extended.squares, extended.noise, extended.scatter())
    many, one = _share(*(e[draws].sum(axis=1) for e in squares)), _share(*(e.sum() for e in squares))
    low, high = np.quantile(many, (0.025, 0.975))
    return Gain(float(one), float(low), float(high))


def _share(
    nominal: np.ndarray, without: np.ndarray, extended: np.ndarray, noise: np.ndarray, scatter: np.ndarray
) -> np.ndarray:
    """Percent; the error above the noise is at least what the extension removes.

    It is at least its own scatter, too, of which `scatter` is the variance: units of evidence in which there is next to
    no error would else show gains of any size.
    """
    excess = np.maximum(np.maximum(nominal - noise, nominal - extended), np.sqrt(scatter))
    return np.asarray(100.0 * (without - extended) / excess)


@np.errstate(all="ignore")
def marginal_cost(fitted: Optimum, scales: Mapping[str, float]) -> float:
    """Twice the negative log of the probability of a fit's trials, integrated over its parameters (Laplace).

    cost + log det(1 + H S^2), with H the information and S the widths of a prior. By Bayes' rule
    p(held | others) = p(all) / p(others): of the fit to all trials less that to the others it is the cost of the held
    ones, in which what the others leave uncertain of a parameter is uncertainty about the held ones as well.

    Parameters
    ----------
    scales
        Of every parameter, by name.
    """
    system = normal_equations(at_rest(fitted.parts))
    widths = [WIDE * max(abs(fitted.parameters[n]), scales[n]) for n in fitted.free]
    scaled = system.hessian * np.outer(widths, widths)
    return fitted.sse + float(np.linalg.slogdet(np.eye(len(widths)) + scaled)[1])


def is_supported(evidence: Evidence | None, gain: Gain, alone: bool) -> bool:
    """Whether trials that took no part speak for a cause.

    By their likelihood where the model leaves only noise, by their errors over time where it does not; where other
    causes stand beside it by both, for several flexible forms together come near to anything. A cause alone may have no
    gain: if one trial of many reaches a stop, the others do not foretell it. None may be sure to do harm.

    Parameters
    ----------
    evidence
        By likelihood; None where the model leaves more than noise, and a likelihood says little.
    gain
        Of its errors over time.
    alone
        Whether no other cause stands beside it.
    """
    likely = evidence is None or evidence.low > 0.0
    return likely and (gain.is_material or (evidence is not None and alone and gain.high > 0.0))


def within(errors: np.ndarray, most: float) -> np.ndarray:
    """Errors, or readings, no larger than `most`; what is no number is as large."""
    return np.asarray(np.clip(np.nan_to_num(errors, nan=most, posinf=most, neginf=-most), -most, most))


def added_likelihood(without: np.ndarray, extended: np.ndarray) -> Evidence:
    """What a cause adds, from whitened residuals without it and with it."""
    without, extended = within(without, FAR), within(extended, FAR)
    difference = without - extended
    return Evidence(float(without @ without - extended @ extended), float(difference @ difference))


def joined_errors(errors: Sequence[Errors]) -> Errors:
    """Errors of several folds, all units of evidence together."""
    return Errors(*(np.concatenate([getattr(e, name) for e in errors]) for name in ("squares", "spread", "noise")))
