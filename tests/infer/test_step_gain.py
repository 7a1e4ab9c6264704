"""What a Gauss-Newton step from a fit that has not converged promises: of a linear model, all that is to be had."""

import numpy as np
import pytest

from fes_pin.infer.covariance import step_gain
from fes_pin.infer.problem import Linearized, normal_equations


def linear(seed):
    """Three trials of a line in three unknowns of very different units, as far as it has come: nowhere."""
    rng = np.random.default_rng(seed)
    columns = [rng.normal(size=(40, 3)) * [1.0, 1e-4, 1e3] for _ in range(3)]
    left = [c @ [0.5, 3e3, 1e-3] + rng.normal(size=40) for c in columns]
    return (
        columns,
        left,
        normal_equations([Linearized(r, c, np.zeros((40, 0)), 0.0) for r, c in zip(left, columns, strict=True)]),
    )


@pytest.mark.parametrize("moving", [(True, True, True), (True, False, True), (False, False, True)])
def test_of_a_linear_model_it_is_what_least_squares_gain(moving):
    columns, left, system = linear(0)
    free, whole = np.vstack(columns)[:, list(moving)], np.concatenate(left)
    beyond = whole - free @ np.linalg.lstsq(free, whole, rcond=None)[0]
    assert step_gain(system, moving) == pytest.approx(float(whole @ whole - beyond @ beyond), rel=1e-9)


def test_where_nothing_moves_or_nothing_is_finite_it_is_none():
    _, _, system = linear(1)
    assert step_gain(system, (False,) * 3) == 0.0
    system.gradient[0] = np.nan
    assert step_gain(system, (True,) * 3) == 0.0
