"""Where parameters go when some are moved: the mean of a Gaussian, given those."""

import numpy as np
import pytest

from fes_pin.infer.covariance import moved_with


def test_it_is_the_least_squares_fit_with_those_held():
    rng = np.random.default_rng(0)
    columns, measured = rng.normal(size=(50, 4)), rng.normal(size=50)
    best = np.linalg.lstsq(columns, measured, rcond=None)[0]
    held, free = [1, 3], [0, 2]
    wanted = np.array([0.3, -2.0])
    rest = np.linalg.lstsq(columns[:, free], measured - columns[:, held] @ wanted, rcond=None)[0]
    moved = best + moved_with(np.linalg.inv(columns.T @ columns), held, wanted - best[held])
    assert moved[held] == pytest.approx(wanted)
    assert moved[free] == pytest.approx(rest)


def test_what_is_not_identified_moves_nothing_but_itself():
    covariance = np.diag([1.0, np.inf, 2.0])
    assert moved_with(covariance, [1], np.array([0.5])).tolist() == [0.0, 0.5, 0.0]
    assert moved_with(covariance, [0], np.array([0.5])).tolist() == [0.5, 0.0, 0.0]
