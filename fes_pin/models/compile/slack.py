"""Filter update for a memory that follows with slack: its distribution, and that of the states, after a reading of it.

A memory m follows a position p(x) within w: m+ = p - w where the slack s = p - m is above w, p + w where it is below
-w, and m between. For a Gaussian x each of the three pieces is a truncated Gaussian, in which the reading is linear.
With N_j the density of the reading in piece j without truncation, and P_j the share of the updated x inside the piece,

    weight_j = P_j N_j / sum P N,   x = sum weight_j E_j[x],   P = sum weight_j (cov_j[x] + (E_j[x] - x)(E_j[x] - x)'),

which is exact in mean and covariance; higher moments of the mixture are dropped. While the slack is crossed, a reading
that does not move excludes the states that would have moved it, and carries no information on the others: in a linear
update its noise would move x by many standard deviations.

Source: assumed-density filtering, Maybeck, Stochastic Models, Estimation and Control 2, 1982, section 12.7;
truncated Gaussians: Johnson, Kotz and Balakrishnan, Continuous Univariate Distributions 1, 2nd ed., section 13.10.1.
"""

import math
from dataclasses import dataclass
from functools import cache
from typing import Any

import casadi as ca
import numpy as np
import scipy.special

LEAST = 1e-20
"""Least variance of a slack, and of a memory that is treated as a state, in its unit squared: it avoids 0 / 0."""
MIDDLE, DEGREE = 4.0, 16
"""Degree of the polynomial of Mills' ratio in 4 / (4 + z), of relative error 4e-12 (`tests/models/test_slack.py`)."""
NARROW, TINY = 1e-9, 1e-100
"""Share between two ends, relative to the shares beyond them and absolute, below which only the nearer end is used."""


@dataclass(frozen=True)
class Gaussian:
    """Mean, shape (n, 1), and covariance, shape (n, n)."""

    mean: Any
    covariance: Any

    def seen(self, row: Any, innovation: Any, noise: Any, share: Any) -> "tuple[Gaussian, Any, Any]":
        """Return the Gaussian given a linear reading, the gain and its variance; a share of 0 changes nothing."""
        toward = ca.mtimes(self.covariance, row.T)
        variance = ca.mtimes(row, toward) + noise
        gain = share * toward / variance
        left = Gaussian(self.mean + gain * innovation, self.covariance - ca.mtimes(gain, toward.T))
        return left, gain, variance

    def cut(self, slack: Any, mean: Any, low: Any, high: Any) -> "tuple[Any, Gaussian]":
        """Return the logarithm of the share in which a linear slack is between two ends, with its mean and covariance.

        Parameters
        ----------
        slack
            Slope of the slack, shape (1, n).
        mean
            Mean of the slack.
        low, high
            The ends; None where there is none.
        """
        toward = ca.mtimes(self.covariance, slack.T)
        std = ca.sqrt(ca.fmax(ca.mtimes(slack, toward), 0.0) + LEAST)
        share, middle, spread = _between(*((None if e is None else (e - mean) / std) for e in (low, high)))
        covariance = self.covariance - (1.0 - spread) / (std * std) * ca.mtimes(toward, toward.T)
        return share, Gaussian(self.mean + toward * (middle / std), covariance)


def mixed(shares: list[Any], parts: list[Gaussian]) -> Gaussian:
    """Return mean and covariance of a mixture."""
    mean = _sum([share * one.mean for share, one in zip(shares, parts, strict=True)])
    spread = [one.covariance + ca.mtimes(one.mean - mean, (one.mean - mean).T) for one in parts]
    return Gaussian(mean, _sum([share * one for share, one in zip(shares, spread, strict=True)]))


def normalized(logs: list[Any]) -> list[Any]:
    """Return shares from their logarithms up to a common constant."""
    most = logs[0]
    for one in logs[1:]:
        most = ca.fmax(most, one)
    sizes = [ca.exp(one - most) for one in logs]
    return [one / _sum(sizes) for one in sizes]


def _sum(many: list[Any]) -> Any:
    return sum(many[1:], many[0])


@dataclass(frozen=True)
class Slack:
    """A memory that follows with slack: its place among the states, its target, and half the slack."""

    place: int
    position: Any
    half: Any


def read_across(
    slack: Slack, x: Any, reading: Any, given: tuple[Any, Any, Any], known: Gaussian
) -> tuple[Gaussian, Gaussian]:
    """Return the one-step prediction of a reading without its noise, and the states given the reading; see the module.

    Parameters
    ----------
    x
        Symbols of the states, in which slack and reading are expressed.
    given
        The measured value, the variance of its noise, and 1 where it was measured, else 0.
    known
        The states before the memory is updated.
    """
    measured, noise, seen = given
    position, along = (ca.substitute(e, x, known.mean) for e in (slack.position, ca.jacobian(slack.position, x)))
    across, away = along - ca.SX.eye(x.numel())[slack.place, :], position - known.mean[slack.place]
    shares, weights = list[Any](), list[Any]()
    predicted, posterior = list[Gaussian](), list[Gaussian]()
    for low, high, behind in (
        (-slack.half, slack.half, None),
        (slack.half, None, slack.half),
        (None, -slack.half, -slack.half),
    ):
        turned, moved = ca.SX.eye(x.numel()), ca.SX.zeros(x.numel())
        if behind is not None:
            turned[slack.place, :] = along
            moved[slack.place] = position - ca.mtimes(along, known.mean) - behind
        share, part = known.cut(across, away, low, high)
        middle = ca.mtimes(turned, part.mean) + moved
        value, row = (ca.substitute(e, x, middle) for e in (reading, ca.jacobian(reading, x)))  # linear about it
        row = ca.mtimes(row, turned)
        missed = measured - (value + ca.mtimes(row, known.mean - part.mean))
        updated, _, variance = known.seen(row, missed, noise, seen)
        density = -0.5 * seen * (missed * missed / variance + ca.log(variance))
        left, cut = updated.cut(across, away + ca.mtimes(across, updated.mean - known.mean), low, high)
        shares.append(share)
        weights.append(left + density)
        predicted.append(Gaussian(value, ca.mtimes([row, part.covariance, row.T])))
        after = ca.mtimes([turned, cut.covariance, turned.T])
        posterior.append(Gaussian(ca.mtimes(turned, cut.mean) + moved, after))
    return mixed(normalized(shares), predicted), mixed(normalized(weights), posterior)


class _End:
    """An end that truncates a standard Gaussian: logarithms of the shares above and below it, and their means."""

    def __init__(self, z: Any) -> None:
        self.density = ca.exp(-0.5 * z * z) / math.sqrt(2.0 * math.pi)
        size = ca.fabs(z)
        mills = _mills(size)
        self.tail = self.density * mills
        """Share on the side without the Gaussian's middle."""
        far = ca.log(mills) - 0.5 * z * z - 0.5 * math.log(2.0 * math.pi), 1.0 / mills
        near = ca.log(1.0 - self.tail), self.density / (1.0 - self.tail)
        self.z, is_above = z, z > 0.0
        self.beyond, self.hazard = (ca.if_else(is_above, a, b) for a, b in zip(far, near, strict=True))
        self.below, self.other = (ca.if_else(is_above, b, a) for a, b in zip(far, near, strict=True))

    def as_low(self) -> tuple[Any, Any, Any]:
        """Return the logarithm of the share above it, with mean and variance there."""
        return self.beyond, self.hazard, ca.fmax(1.0 + self.z * self.hazard - self.hazard * self.hazard, 0.0)

    def as_high(self) -> tuple[Any, Any, Any]:
        """Return the same below it."""
        return self.below, -self.other, ca.fmax(1.0 - self.z * self.other - self.other * self.other, 0.0)


def _between(low: Any, high: Any) -> tuple[Any, Any, Any]:
    """Return the logarithm of a standard Gaussian's share between two ends, mean and variance; an end may be None."""
    if high is None:
        return _End(low).as_low()
    if low is None:
        return _End(high).as_high()
    a, b = _End(low), _End(high)
    share = ca.if_else(low > 0.0, a.tail - b.tail, ca.if_else(high < 0.0, b.tail - a.tail, 1.0 - a.tail - b.tail))
    wide, safe = share > NARROW * (a.tail + b.tail) + TINY, ca.fmax(share, TINY)
    mean = (a.density - b.density) / safe
    spread = 1.0 + (low * a.density - high * b.density) / safe - mean * mean
    near = [
        ca.if_else(high < -low, one, other)
        for one, other in zip(_without(b.as_high(), a.below), _without(a.as_low(), b.beyond), strict=True)
    ]
    whole = (ca.log(safe), mean, ca.fmax(spread, 0.0))
    share, mean, spread = (ca.if_else(wide, one, other) for one, other in zip(whole, near, strict=True))
    return share, mean, spread


def _without(inside: tuple[Any, Any, Any], beyond: Any) -> tuple[Any, Any, Any]:
    """Return the share by the nearer of two ends alone, minus the share beyond the other."""
    share = ca.log(ca.fmax(1.0 - ca.exp(beyond - inside[0]), TINY))
    return inside[0] + share, *inside[1:]


def _mills(z: Any) -> Any:
    """Return the share of a standard Gaussian above z > 0 over its density there, to eleven digits."""
    t = MIDDLE / (MIDDLE + z)
    terms, power = list(_coefficients()), 2.0 * t - 1.0
    while len(terms) > 1:  # in pairs of pairs: a short chain
        pairs = [terms[k] + power * terms[k + 1] for k in range(0, len(terms) - 1, 2)]
        terms, power = pairs + terms[2 * len(pairs) :], power * power
    return t * terms[0]


@cache
def _coefficients() -> tuple[float, ...]:
    """Return coefficients of the polynomial in 2 t - 1, t = MIDDLE / (MIDDLE + z), that is Mills' ratio over t."""

    def over_t(x: np.ndarray) -> np.ndarray:
        t = 0.5 * (x + 1.0)
        return math.sqrt(0.5 * math.pi) * scipy.special.erfcx(MIDDLE * (1.0 - t) / t / math.sqrt(2.0)) / t

    found = np.polynomial.Chebyshev.interpolate(over_t, DEGREE).convert(kind=np.polynomial.Polynomial)
    return tuple(float(c) for c in found.coef)
