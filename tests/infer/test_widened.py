"""Intervals of a model that is not quite right: as wide as its scores scatter from piece to piece."""

import numpy as np
import pytest

from fes_pin.infer.covariance import widened

PIECES, EACH = 40, 100


def estimated(errors):
    """Level and slope by least squares under white noise of deviation 1: their covariance, and scores of pieces."""
    columns = np.stack([np.ones(len(errors)), np.linspace(-1.0, 1.0, len(errors))], axis=1)
    covariance = np.linalg.inv(columns.T @ columns)
    left = errors - columns @ (covariance @ columns.T @ errors)
    return covariance, np.add.reduceat(columns * left[:, None], np.arange(0, len(errors), EACH))


def test_where_the_noise_is_as_it_is_taken_for_nothing_changes_but_by_chance():
    rng, ratios = np.random.default_rng(0), []
    for _ in range(50):
        covariance, scores = estimated(rng.normal(size=PIECES * EACH))
        ratios.append(np.sqrt(np.diag(widened(covariance, scores)) / np.diag(covariance)))
    assert np.min(ratios) == 1.0
    assert np.mean(ratios) < 1.1


def test_errors_that_last_widen_intervals_to_what_estimates_scatter_by():
    """A first-order process: a level scatters by the root of (1 + a) / (1 - a) more than white noise lets it."""
    rng, a, ratios = np.random.default_rng(1), 0.8, []
    for _ in range(50):
        errors = np.zeros(PIECES * EACH)
        for k, shock in enumerate(np.sqrt(1.0 - a * a) * rng.normal(size=len(errors))):
            errors[k] = a * errors[k - 1] + shock
        covariance, scores = estimated(errors)
        ratios.append(np.sqrt(np.diag(widened(covariance, scores)) / np.diag(covariance)))
    assert np.mean(ratios, axis=0) == pytest.approx(np.full(2, np.sqrt((1.0 + a) / (1.0 - a))), rel=0.1)


def test_correlations_stay_and_what_is_not_identified_stays_so():
    covariance = np.array([[1.0, 0.5, 0.0], [0.5, 1.0, 0.0], [0.0, 0.0, np.inf]])
    scores = np.array([[3.0, 0.0, 1.0], [-3.0, 0.0, -1.0]])
    wide = widened(covariance, scores)
    assert wide[0, 1] / np.sqrt(wide[0, 0] * wide[1, 1]) == pytest.approx(0.5)
    assert wide[0, 0] > 1.0
    assert np.isinf(wide[2, 2])


def test_a_single_piece_does_not_scatter():
    assert np.array_equal(widened(np.eye(2), np.ones((1, 2))), np.eye(2))
