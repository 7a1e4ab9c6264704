"""What is left beside a cause that bends sharply: slopes of the filter promise what its likelihood does not keep."""

import pytest
from driven.linear_play import LinearPlay
from driven_rigs.draw import draw

from fes_pin.data.study import read_study
from fes_pin.identify.likelihood import LikelihoodProblem
from fes_pin.identify.likelihood_fit import fit_of
from fes_pin.infer.optimum import minimise
from fes_pin.models.nominal import nominal_model
from fes_pin.models.predictor import StateSpaceNoise
from fes_pin.remainder import lack_of_fit

END = {"inertia_scale": 1.0014, "damping": 0.018945, "gravity_scale": 1.0007, "backlash.half_width": 0.0064904}
"""Where a fit ended on one computer, 6e-5 rad beside what is hidden; on another it ends elsewhere."""
THERE = StateSpaceNoise({"position": 3.0424e-4}, {"effort": 3.9652e-3}, {"effort": 0.023385})
BESIDE = (0.99, 1.0, 1.01)
"""Random efforts about that: the likelihood jumps by some 500 between them, and a fit ends where it is high."""


class Promised(lack_of_fit._Featured):
    """Features that count as slopes promise them."""

    def __init__(self, fitted):
        super().__init__(fitted)
        self.can_keep = False


@pytest.fixture(scope="module")
def beside_a_play(tmp_path_factory):
    """A rig of `scripts/accuracy recorded --seed 1118000`, at `END`: no step is taken from there."""
    study = read_study(draw(("backlash",), 0.3, 1118025, tmp_path_factory.mktemp("play"), recorded=True).study)
    noises = [THERE.with_values({"std.effort": k * THERE.std["effort"]}) for k in BESIDE]
    problems = [LikelihoodProblem(nominal_model(study) + LinearPlay(), study.trials, noise) for noise in noises]
    fits = [fit_of(p, minimise(p, END, max_iterations=0)) for p in problems]
    return min(fits, key=lambda fitted: fitted.sse)


def test_slopes_promise_that_something_is_left(beside_a_play, monkeypatch):
    monkeypatch.setattr(lack_of_fit, "_Featured", Promised)
    found = lack_of_fit.lack_of_fit(beside_a_play)
    assert found.unexplained and found.p_value < 1e-10, found


def test_a_promise_counts_as_far_as_the_likelihood_keeps_it(beside_a_play):
    assert not lack_of_fit.lack_of_fit(beside_a_play).unexplained
