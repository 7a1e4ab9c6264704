"""Gains beside errors that are no white noise: as far as the scores of pieces of the data agree on them."""

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest

from fes_pin.infer.distributions import chi2_quantile
from fes_pin.infer.problem import Linearized
from fes_pin.infer.scatter import (
    as_wide_as_estimates_differ,
    as_wide_as_trials_differ,
    at_rest,
    excess_scatter,
    with_honest_intervals,
)

EACH, TRIALS, DRAWS = 500, 4, 200


def fitted(columns, errors, names):
    """What least squares under white noise of deviation 1 leaves, as far as `excess_scatter` looks at it."""
    left = errors - columns @ np.linalg.lstsq(columns, errors, rcond=None)[0]
    cuts = np.split(np.arange(len(errors)), TRIALS)
    parts = [Linearized(left[c], columns[c], np.zeros((len(c), 0)), 0.0) for c in cuts]
    return SimpleNamespace(parts=parts, free=names, at_bound=(), sse=float(left @ left))


def gains(coefficient, seed, each=EACH, **how):
    """Gains of two slow waves that are not there beside a level, and the same over their scatter; noise lasts."""
    rng, n = np.random.default_rng(seed), each * TRIALS
    time = np.arange(n) / n
    columns = np.stack([np.ones(n), *(np.sin(2.0 * np.pi * k * time) for k in (3.0, 7.0))], axis=1)
    out = []
    for _ in range(DRAWS):
        errors = np.zeros(n)
        for k, shock in enumerate(np.sqrt(1.0 - coefficient**2) * rng.normal(size=n)):
            errors[k] = coefficient * errors[k - 1] + shock
        small, large = fitted(columns[:, :1], errors, ("a",)), fitted(columns, errors, ("a", "b", "c"))
        gain = small.sse - large.sse
        out.append((gain, gain / excess_scatter(large, small, **how)))
    return np.array(out)


def test_beside_white_noise_a_gain_stays_what_it_is_but_for_chance():
    plain, scaled = gains(0.0, 0).T
    assert (scaled <= plain).all()
    assert np.mean(scaled / plain) > 0.85
    assert np.mean(plain > chi2_quantile(0.95, 2)) == pytest.approx(0.05, abs=0.04)


def test_beside_noise_that_lasts_it_keeps_its_level_as_the_plain_gain_does_not():
    plain, scaled = gains(0.8, 1).T
    assert np.mean(plain > chi2_quantile(0.95, 2)) > 0.5
    assert np.mean(scaled > chi2_quantile(0.95, 2)) < 0.12


def test_noise_that_lasts_longer_than_pieces_is_seen_by_its_correlation():
    """Pieces of five rows, and a noise that lasts ten."""
    level, (_, pieces), (_, slow) = chi2_quantile(0.95, 2), gains(0.9, 5, 50).T, gains(0.9, 5, 50, is_slow=True).T
    assert np.mean(pieces > level) > 0.15
    assert np.mean(slow > level) < 0.12


def test_what_is_there_in_all_pieces_keeps_its_gain():
    rng, n = np.random.default_rng(2), EACH * TRIALS
    wave = np.sin(40.0 * np.pi * np.arange(n) / n)
    columns = np.stack([np.ones(n), wave], axis=1)
    errors = 0.5 * wave + rng.normal(size=n)
    small, large = fitted(columns[:, :1], errors, ("a",)), fitted(columns, errors, ("a", "b"))
    assert excess_scatter(large, small) < 1.6


def test_what_is_each_trials_own_goes_with_a_parameter():
    """A hum's frequency and its phase in each trial: the slopes of the two are nearly one another's."""
    rng, time, found = np.random.default_rng(4), np.linspace(0.0, 8.0, EACH), []
    for _ in range(20):
        parts = []
        for phase in rng.uniform(0.0, 2.0 * np.pi, TRIALS):
            own = np.stack([np.sin(6.0 * time + phase), np.cos(6.0 * time + phase)], axis=1)
            parts.append(Linearized(rng.normal(size=EACH), (time * own[:, 1])[:, None], own, 0.0))
        errors, everything = np.concatenate([p.residual for p in parts]), _together(parts)
        left = errors - everything @ np.linalg.lstsq(everything, errors, rcond=None)[0]
        parts = [Linearized(r, p.jacobian, p.local) for r, p in zip(np.split(left, TRIALS), parts, strict=True)]
        large = SimpleNamespace(parts=parts, free=("frequency",), at_bound=())
        found.append(excess_scatter(large, SimpleNamespace(free=())))
    assert np.mean(found) < 1.3  # without them 3.2


def _together(parts):
    """Columns of a parameter, and of each trial's own, over all trials."""
    many = [np.zeros((len(parts) * EACH, 2)) for _ in parts]
    for k, (part, rows) in enumerate(zip(parts, many, strict=True)):
        rows[k * EACH : (k + 1) * EACH] = part.local
    return np.concatenate([np.concatenate([p.jacobian for p in parts]), *many], axis=1)


def test_nothing_more_scatters_nothing():
    one = fitted(np.ones((EACH * TRIALS, 1)), np.random.default_rng(3).normal(size=EACH * TRIALS), ("a",))
    assert excess_scatter(one, one) == 1.0


@dataclass(frozen=True)
class Means:
    """Means of two quantities, as far as `as_wide_as_trials_differ` looks at them."""

    values: dict[str, float]
    covariance: np.ndarray
    free: tuple[str, ...] = ("steady", "own")


def means(rng, apart):
    """Of 5 trials of variance 1, whose second quantity differs between them as well; and without each trial."""
    trials = rng.normal(size=(5, 2)) * (1.0, np.hypot(1.0, apart))
    known = np.diag([0.2, 0.2])
    kept = [trials, *(np.delete(trials, k, axis=0) for k in range(5))]
    whole, *again = (Means(dict(zip(Means.free, some.mean(axis=0), strict=True)), known) for some in kept)
    return whole, as_wide_as_trials_differ(whole, again)


def covered(apart):
    """How often 95 % intervals hold the truth, 0, of each quantity; and how often they were widened."""
    rng, inside, wider = np.random.default_rng(3), np.zeros(2), np.zeros(2)
    for _ in range(2000):
        plain, wide = means(rng, apart)
        std = np.sqrt(np.diag(wide.covariance))
        inside += np.abs(list(wide.values.values())) < 1.96 * std
        wider += std > np.sqrt(np.diag(plain.covariance)) * (1.0 + 1e-12)
    return inside / 2000, wider / 2000


def test_intervals_are_widened_where_trials_differ_more_than_by_chance():
    inside, wider = covered(0.0)
    assert inside == pytest.approx(0.95, abs=0.02)
    assert wider == pytest.approx(0.05, abs=0.02)
    inside, wider = covered(2.0)
    assert wider[0] == pytest.approx(0.05, abs=0.02) and wider[1] > 0.7
    assert inside[0] == pytest.approx(0.95, abs=0.02)
    assert inside[1] > 0.8  # without it 0.62


def test_a_single_fit_says_nothing_of_how_trials_differ():
    one = Means({"steady": 0.0, "own": 0.0}, np.eye(2))
    assert as_wide_as_trials_differ(one, [one]) is one
    unknown = Means({"steady": 0.0, "own": 0.0}, np.diag([np.inf, 0.0]))
    others = [Means({"steady": x, "own": x}, np.eye(2)) for x in (-9.0, 9.0)]
    assert (as_wide_as_trials_differ(unknown, others).covariance == unknown.covariance).all()


@dataclass(frozen=True)
class Estimated:
    """A level of noisy samples, as far as `as_wide_as_estimates_differ` looks at it."""

    values: dict[str, float]
    covariance: np.ndarray
    parts: tuple[Linearized, ...]
    free: tuple[str, ...] = ("level",)
    at_bound: tuple[str, ...] = ()


def level(samples, weights):
    """The level by least squares of weighted samples, which have a deviation of 1."""
    roots = np.sqrt(weights)[:, None]
    value = float(np.average(samples, weights=weights))
    one = Estimated({"level": value}, np.eye(1), (Linearized((samples - value) * roots[:, 0], roots, roots[:, :0]),))
    return with_honest_intervals(one)


def off_and_wide(bend, seed):
    """How far a level of 0 is off, its deviation, and that with another estimate: most samples stand on a bend."""
    rng, out = np.random.default_rng(seed), []
    on_bend = np.arange(400) % 4 > 0
    for _ in range(500):
        samples = rng.normal(size=400) + bend * on_bend
        one, other = level(samples, np.ones(400)), level(samples, np.where(on_bend, 0.01, 1.0))
        wide = as_wide_as_estimates_differ(one, other)
        out.append((one.values["level"], one.covariance[0, 0] ** 0.5, wide.covariance[0, 0] ** 0.5))
    return np.array(out).T


def test_intervals_hold_what_two_estimates_of_a_right_model_do_by_chance_alone():
    off, plain, wide = off_and_wide(0.0, 0)
    assert np.mean(wide > 1.001 * plain) < 0.08
    assert np.mean(np.abs(off) < 1.96 * wide) == pytest.approx(0.95, abs=0.03)


def test_they_hold_the_truth_where_an_error_of_form_sets_both_apart():
    off, plain, wide = off_and_wide(1.0, 1)
    assert np.mean(np.abs(off) < 1.96 * plain) < 0.05
    assert np.mean(np.abs(off) < 1.96 * wide) > 0.95


def test_a_parameter_that_the_other_estimate_has_not_keeps_its_interval():
    one = level(np.random.default_rng(0).normal(size=400), np.ones(400))
    other = replace(one, values={"another": 9.0}, free=("another",))
    assert as_wide_as_estimates_differ(one, other).covariance == one.covariance


def test_a_trial_in_which_a_parameter_does_not_act_has_no_part_in_its_slope():
    """A stop that one trial of three reaches: the others, with its slope, would gain all their squares by a step."""
    rng = np.random.default_rng(0)
    parts = [Linearized(rng.normal(size=50), rng.normal(size=(50, 2)), np.empty((50, 0))) for _ in range(3)]
    for part in parts[1:]:
        part.jacobian[:, 1] = 0.0
    rested = at_rest(parts)
    assert np.allclose(sum(p.residual @ p.jacobian for p in rested), 0.0)
    assert all(not p.jacobian[:, 1].any() for p in rested[1:])
