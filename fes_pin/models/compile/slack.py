"""What is known of a memory that follows with slack, and of what it follows, once a reading of it has come.

A memory m follows a position p(x) within w: m+ = p - w where the slack s = p - m is beyond w, p + w where it is below
-w, and m between. For a Gaussian x each of the three pieces is a Gaussian cut off where s leaves it, and the reading is
linear in it. With N_j the density of the reading in piece j, uncut, and P_j the share of what it then leaves of x that
lies inside,

    weight_j = P_j N_j / sum P N,   x = sum weight_j E_j[x],   P = sum weight_j (cov_j[x] + (E_j[x] - x)(E_j[x] - x)'),

which is exact in mean and covariance; what they leave out of the three is not carried on. Where the slack is crossed a
reading that stands still cuts off what would have moved it, and says nothing of the rest: taken for linear, its noise
would move x by many deviations.

Source: assumed-density filtering, Maybeck, Stochastic Models, Estimation and Control 2, 1982, section 12.7; cut
Gaussians: Johnson, Kotz and Balakrishnan, Continuous Univariate Distributions 1, 2nd ed., section 13.10.1.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import casadi as ca

LEAST = 1e-20
"""Variance that a slack has at least, in its unit squared: nothing is divided by 0."""
FAR = 5.0
"""Deviations beyond which tails are those of a continued fraction: there 1 - erf has few digits left."""
TERMS = 12
"""Of that fraction: right to ten digits from `FAR` on."""
NARROW = 1e-9
"""Share of a Gaussian between two ends below which it is as if only the nearer one cut it."""


@dataclass(frozen=True)
class Gaussian:
    """Mean, shape (n, 1), and covariance, shape (n, n)."""

    mean: Any
    covariance: Any

    def seen(self, row: Any, innovation: Any, noise: Any, share: Any) -> tuple[Gaussian, Any]:
        """What a linear reading leaves of it, and the logarithm of the reading's density; nothing for a share of 0."""
        toward = ca.mtimes(self.covariance, row.T)
        variance = ca.mtimes(row, toward) + noise
        gain = share * toward / variance
        log_density = -0.5 * share * (innovation * innovation / variance + ca.log(variance))
        left = Gaussian(self.mean + gain * innovation, self.covariance - ca.mtimes(gain, toward.T))
        return left, log_density

    def cut(self, slack: Any, mean: Any, low: Any, high: Any) -> tuple[Any, Gaussian]:
        """Logarithm of the share in which a linear slack is between two ends, and the mean and covariance of that.

        Parameters
        ----------
        slack
            Slope of it, shape (1, n).
        mean
            Of it.
        low, high
            The ends; None where there is none.
        """
        toward = ca.mtimes(self.covariance, slack.T)
        std = ca.sqrt(ca.fmax(ca.mtimes(slack, toward), 0.0) + LEAST)
        share, middle, spread = _between(*((None if e is None else (e - mean) / std) for e in (low, high)))
        less = (1.0 - spread) / (std * std)
        return share, Gaussian(
            self.mean + toward * (middle / std), self.covariance - less * ca.mtimes(toward, toward.T)
        )

    def mapped(self, slopes: Any, mean: Any) -> Gaussian:
        """What a linear map makes of it, whose mean is known."""
        return Gaussian(mean, ca.mtimes([slopes, self.covariance, slopes.T]))


def mixed(shares: list[Any], parts: list[Gaussian]) -> Gaussian:
    """Mean and covariance of a mixture."""
    mean = sum((share * one.mean for share, one in zip(shares, parts, strict=True)), ca.SX(0))
    covariance = ca.SX(0)
    for share, one in zip(shares, parts, strict=True):
        away = one.mean - mean
        covariance = covariance + share * (one.covariance + ca.mtimes(away, away.T))
    return Gaussian(mean, covariance)


def normalized(logs: list[Any]) -> list[Any]:
    """Shares whose logarithms are known but for what all have in common."""
    most = logs[0]
    for one in logs[1:]:
        most = ca.fmax(most, one)
    sizes = [ca.exp(one - most) for one in logs]
    return [one / sum(sizes[1:], sizes[0]) for one in sizes]


def _between(low: Any, high: Any) -> tuple[Any, Any, Any]:
    """Logarithm of the share of a standard Gaussian between two ends, mean and variance there; an end may be None."""
    if high is None:
        hazard = _hazard(low)
        return _log_beyond(low, hazard), hazard, ca.fmax(1.0 + low * hazard - hazard * hazard, 0.0)
    if low is None:
        share, mean, spread = _between(-high, None)
        return share, -mean, spread
    below, above = _density(low), _density(high)
    share = 0.5 * (ca.erf(high / math.sqrt(2.0)) - ca.erf(low / math.sqrt(2.0)))
    wide, safe = share > NARROW, ca.fmax(share, NARROW)
    mean = (below - above) / safe
    spread = 1.0 + (low * below - high * above) / safe - mean * mean
    from_above = _without(_between(None, high), _between(None, low))
    from_below = _without(_between(low, None), _between(high, None))
    near = [ca.if_else(high < -low, a, b) for a, b in zip(from_above, from_below, strict=True)]
    whole = (ca.log(safe), mean, ca.fmax(spread, 0.0))
    share, mean, spread = (ca.if_else(wide, a, b) for a, b in zip(whole, near, strict=True))
    return share, mean, spread


def _without(nearer: tuple[Any, Any, Any], farther: tuple[Any, Any, Any]) -> tuple[Any, Any, Any]:
    """What one end cuts off, where the other cuts off little of that: its share alone feels the other."""
    share = ca.log(ca.fmax(1.0 - ca.exp(farther[0] - nearer[0]), 1e-300))
    return nearer[0] + share, *nearer[1:]


def _density(z: Any) -> Any:
    return ca.exp(-0.5 * z * z) / math.sqrt(2.0 * math.pi)


def _hazard(z: Any) -> Any:
    """Density over the share beyond: the mean of what is beyond z."""
    far, near = ca.fmax(z, FAR), ca.fmin(z, FAR)
    fraction = far
    for k in range(TERMS, 0, -1):
        fraction = far + k / fraction
    return ca.if_else(z > FAR, fraction, _density(near) / (0.5 - 0.5 * ca.erf(near / math.sqrt(2.0))))


def _log_beyond(z: Any, hazard: Any) -> Any:
    """Logarithm of the share beyond z."""
    near = ca.fmin(z, FAR)
    tail = -0.5 * z * z - 0.5 * math.log(2.0 * math.pi) - ca.log(ca.fmax(hazard, 1e-300))
    return ca.if_else(z > FAR, tail, ca.log(0.5 - 0.5 * ca.erf(near / math.sqrt(2.0))))
