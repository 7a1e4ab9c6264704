"""A play: its likelihood is smooth, its width is found, and nothing is named or left beside it."""

import numpy as np
import pytest
from driven.linear_play import LinearPlay
from driven_rigs.draw import draw

from fes_pin.data.study import read_study
from fes_pin.diagnosis.diagnosis import diagnose_joint
from fes_pin.identify.likelihood import LikelihoodProblem
from fes_pin.infer.scatter import with_honest_intervals
from fes_pin.models.model import Model

WIDTH = "backlash.half_width"


def missed_by_a_parabola(model, fitted):
    """What the cost differs by from one, a deviation of the width to either side of where a fit ended."""
    problem, steps = LikelihoodProblem(model, fitted.trials, fitted.noise), np.linspace(-1.0, 1.0, 21)
    widths = fitted.values[WIDTH] + steps * with_honest_intervals(fitted).std(WIDTH)
    costs = problem.costs([({**fitted.values, WIDTH: float(w)}, fitted.unknowns) for w in widths])
    return float(np.abs(costs - np.polynomial.Polynomial.fit(steps, costs, 2)(steps)).max())


@pytest.mark.rounding
def test_a_play_is_named_alone_and_its_likelihood_is_a_parabola(tmp_path):
    """Its cost jumped by some 500 within 1e-5 rad: where a fit ended hung on a processor's rounding."""
    drawn = draw(("backlash",), 0.3, 1118025, tmp_path, recorded=True)
    found = diagnose_joint(read_study(drawn.study))
    assert [c.name for c in found.causes] == ["backlash"], str(found)
    assert not found.remainder.unexplained
    fitted = found.extended
    width, std = fitted.values[WIDTH], with_honest_intervals(fitted).std(WIDTH)  # without the estimate by efforts
    assert width == pytest.approx(drawn.truth["backlash"], abs=4.0 * std)
    assert std < 0.02 * width
    assert missed_by_a_parabola(fitted.model, fitted) < 1.0  # what a deviation is worth
    (play,) = fitted.model.effects
    assert missed_by_a_parabola(Model(fitted.model.rig, (LinearPlay(play.half_width),)), fitted) > 10.0


def test_a_sensor_that_lags_behind_a_play_is_named_beside_it(tmp_path):
    """A lag that had the joint's own motion for its input, beside the play, gained 0 in such rigs; now 4000."""
    drawn = draw(("sensor_lag", "backlash"), 0.3, 4520031, tmp_path, recorded=True)
    found = diagnose_joint(read_study(drawn.study))
    assert {c.name for c in found.causes} == {"sensor_lag", "backlash"}, str(found)
    assert not found.remainder.unexplained
    fitted = found.extended
    for name, true in (("sensor_lag.lag_s", "sensor_lag"), (WIDTH, "backlash"), ("inertia_scale", "inertia_scale")):
        assert fitted.values[name] == pytest.approx(drawn.truth[true], rel=0.02)
