"""When two models are told apart: rarely the right one from a wrong one, and neither where neither is right."""

from types import SimpleNamespace

import numpy as np
import pytest

from fes_pin.infer.levels import SEPARABLE
from fes_pin.infer.scatter import PIECES, least_apart

LONG, DRAWS = 25, 1000
"""Samples of a piece, and studies."""


def fit(read, predicted):
    left = read - predicted
    return SimpleNamespace(parts=[SimpleNamespace(residual=part) for part in np.array_split(left, 2)], sse=left @ left)


def apart_by(read, one, other):
    """What a model is likelier by than another, over what tells them apart: -1 and less excludes it."""
    fits = fit(read, one), fit(read, other)
    likelier, less = sorted(fits, key=lambda f: f.sse)
    return (fits[1].sse - fits[0].sse) / least_apart(likelier, less)


def some(rng, distance):
    """A difference of two models so many deviations of the noise long."""
    drawn = rng.standard_normal(LONG * PIECES)
    return distance / np.linalg.norm(drawn) * drawn


@pytest.mark.parametrize("distance", [0.5, 1.6, 3.0, 6.0])
def test_of_two_models_the_right_one_is_excluded_in_one_of_twenty_at_most(distance):
    rng = np.random.default_rng(round(10 * distance))
    wrong = some(rng, distance)
    shares = [apart_by(rng.standard_normal(len(wrong)), 0.0 * wrong, wrong) for _ in range(DRAWS)]
    assert np.mean(np.array(shares) <= -1.0) < 0.05 + 3.0 * np.sqrt(0.05 / DRAWS)


def test_the_right_one_of_two_that_are_far_apart_is_told():
    rng = np.random.default_rng(1)
    wrong = some(rng, 6.0)
    shares = [apart_by(rng.standard_normal(len(wrong)), 0.0 * wrong, wrong) for _ in range(DRAWS)]
    assert np.mean(np.array(shares) >= 1.0) > 0.9


def test_where_neither_is_right_the_nearer_is_not_told_by_chance():
    """Each has some parts of the truth, as where a form errs along a motion: which has more of them is chance."""
    rng, alone, judged = np.random.default_rng(2), [], []
    for _ in range(DRAWS):
        other = some(rng, 12.0)
        of_it = np.repeat(rng.integers(2, size=PIECES), LONG) * other
        read = of_it + rng.standard_normal(len(other))
        judged.append(apart_by(read, 0.0 * other, other))
        alone.append((fit(read, other).sse - fit(read, 0.0 * other).sse) / SEPARABLE)
    assert np.mean(np.abs(alone) >= 1.0) > 0.8
    assert np.mean(np.abs(judged) >= 1.0) < 0.15
