"""A play: its likelihood is smooth, its width is found, and nothing is named or left beside it."""

from dataclasses import replace

import numpy as np
import pytest
from driven.linear_play import LinearPlay
from driven_rigs.draw import draw

from fes_pin.data.study import read_study
from fes_pin.diagnose.diagnosis import diagnose_joint
from fes_pin.identify.fit import fit_problem
from fes_pin.identify.likelihood import LikelihoodProblem
from fes_pin.identify.roughness import roughness
from fes_pin.models.model import Model

WIDTH = "backlash.half_width"


@pytest.mark.rounding
def test_a_play_is_named_alone_and_its_likelihood_is_a_parabola(tmp_path):
    """Its cost jumped by some 500 within 1e-5 rad: where a fit ended hung on a processor's rounding."""
    drawn = draw(("backlash",), 0.3, 1118025, tmp_path, recorded=True)
    found = diagnose_joint(read_study(drawn.study))
    assert [c.name for c in found.causes] == ["backlash"], str(found)
    assert not found.remainder.unexplained
    fitted = found.extended
    width, std = fitted.values[WIDTH], fitted.std(WIDTH)
    assert width == pytest.approx(drawn.truth["backlash"], abs=4.0 * std)
    assert std < 0.02 * width
    problem, steps = LikelihoodProblem(fitted.model, fitted.trials, fitted.doubt), np.linspace(-1.0, 1.0, 21)
    costs = problem.bounds([({**fitted.values, WIDTH: width + k * std}, fitted.unknowns) for k in steps])
    left = np.array(costs) - np.polynomial.Polynomial.fit(steps, costs, 2)(steps)
    assert np.abs(left).max() < 1.0  # what a deviation is worth
    assert roughness(fitted) < 4.0
    (play,) = fitted.model.effects
    linear = Model(fitted.model.rig, (LinearPlay(play.half_width),))
    bent = LikelihoodProblem(linear, fitted.trials, fitted.doubt)
    assert roughness(replace(fit_problem(bent, fitted.values, max_iterations=0), doubt=fitted.doubt)) > 10.0
