"""Parameters and what is random, moved together: a regression whose maximum is known in closed form."""

from dataclasses import replace

import numpy as np
import pytest

from fes_pin.infer.covariance import covariance_of
from fes_pin.infer.scoring import Evaluation, fisher_scoring

X = np.linspace(-1.0, 2.0, 400)
SLOPE, OFFSET, STD = 3.0, -1.0, 0.2


class Line:
    """y = slope x + offset, with white noise."""

    batch = 1

    def __init__(self, slope=(-1e3, 1e3)):
        self.y = SLOPE * X + OFFSET + STD * np.random.default_rng(0).standard_normal(len(X))
        self.limits = {"slope": slope, "offset": (-1e3, 1e3)}
        self.noise_parameters, self.noise_limits = {"std": 1.7}, {"std": (1e-3, 10.0)}
        self.asked = 0

    def evaluate(self, points):
        self.asked += len(points)
        return [self.one(values, random) for values, _, random in points]

    def one(self, values, random):
        left = self.y - values["slope"] * X - values["offset"]
        std = random.get("std", self.noise_parameters["std"])
        variance = np.full(len(X), std**2)
        cost = float(np.sum(left**2 / variance + np.log(variance)))
        return Evaluation(cost, left / std, variance, variance, np.zeros_like(variance))

    def sizes(self):
        return {"slope": float(np.linalg.norm(X)) / STD, "offset": len(X) ** 0.5 / STD}


def climbed(line, steps=12, **how):
    return fisher_scoring(line, {"slope": 0.5, "offset": 4.0}, [], line.sizes(), steps, **how)


def test_the_maximum_is_that_of_least_squares_and_the_residual_is_the_noise():
    line = Line()
    found = climbed(line)
    (slope, offset), left, *_ = np.linalg.lstsq(np.stack([X, np.ones_like(X)], 1), line.y, rcond=None)
    std = float(np.sqrt(left[0] / len(X)))
    begin, end, best = (
        line.one(values, {"std": s}).cost
        for values, s in (
            ({"slope": 0.5, "offset": 4.0}, 1.7),
            (found.values, found.noise["std"]),
            ({"slope": slope, "offset": offset}, std),
        )
    )
    assert found.converged
    assert best <= end < best + 0.1
    assert found.values == pytest.approx({"slope": slope, "offset": offset}, rel=1e-3)
    assert found.noise["std"] == pytest.approx(std, rel=0.02)
    assert found.gained == pytest.approx(begin - end)
    assert found.left < 0.1


def test_what_is_not_asked_for_does_not_move():
    line = Line()
    found = climbed(line, with_noise=False)
    assert found.noise == {}
    assert found.values["slope"] == pytest.approx(SLOPE, abs=0.05)


def test_what_a_prediction_runs_away_beside_stays_and_the_others_move():
    """One such fit among a library's is no maximum; a diagnosis of all the others goes on."""

    class RunsAway(Line):
        def one(self, values, random):
            told = super().one(values, random)
            beside = random.get("std", self.noise_parameters["std"]) != self.noise_parameters["std"]
            return replace(told, innovations=told.innovations * 1e200 * 1e200) if beside else told

    line = RunsAway()
    with np.errstate(over="ignore"):
        found = climbed(line)
    assert found.noise["std"] == line.noise_parameters["std"]
    assert found.values["slope"] == pytest.approx(SLOPE, abs=0.05)


def test_a_bound_holds_a_parameter_and_the_others_move_beside_it():
    line = Line(slope=(-1e3, 1.0))
    found = climbed(line)
    assert found.held == ("slope",)
    assert found.values["slope"] == 1.0
    assert found.values["offset"] == pytest.approx(float(np.mean(line.y - X)), abs=0.03)


def test_steps_that_run_out_are_no_maximum():
    assert not climbed(Line(), steps=1).converged


def test_near_the_maximum_one_step_that_keeps_its_promise_is_the_last():
    """Nothing is asked once more about a slope that the step has just used up."""
    line = Line()
    best = climbed(line)
    line.noise_parameters, line.asked = best.noise, 0
    near = {n: v + 0.1 / s for (n, v), s in zip(best.values.items(), line.sizes().values(), strict=True)}
    found = fisher_scoring(line, near, [], line.sizes(), 12)
    assert found.converged
    assert line.asked <= 2 * (1 + 3)


def test_a_parameter_beside_which_a_prediction_runs_away_stays_where_it_is():
    class Runaway(Line):
        def one(self, values, random):
            told, left = super().one(values, random), np.full(len(X), np.nan)
            return told if abs(values["slope"] - 0.5) < 1e-9 else replace(told, cost=np.inf, innovations=left)

    line = Runaway()
    found = climbed(line)
    assert found.values["slope"] == pytest.approx(0.5)
    assert found.held == ()
    assert found.values["offset"] == pytest.approx(float(np.mean(line.y - 0.5 * X)), abs=0.05)


def test_a_fit_of_which_nothing_moves_is_its_beginning():
    found = fisher_scoring(Line(), {"slope": 0.5, "offset": 4.0}, [], {}, 12, with_noise=False)
    assert found.converged and found.values == {} and found.gained == 0.0
    assert covariance_of(np.zeros((0, 0)), np.array([])).shape == (0, 0)
