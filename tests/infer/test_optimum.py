"""Nonlinear least squares that knows no rig: decays with an offset of each trial's own, against scipy."""

import math

import numpy as np
import pytest
import scipy.optimize

from fes_pin.infer.maximise import alternate
from fes_pin.infer.optimize import TOLERANCE
from fes_pin.infer.optimum import minimise
from fes_pin.infer.problem import Linearized, Problem
from fes_pin.infer.scoring import LITTLE, Evaluation, NoisyProblem

TIME = np.linspace(0.0, 2.0, 80)
SIZE, RATE, OFFSETS, STD = 2.0, 1.5, (0.3, -0.4, 0.1), 0.05


class Decay(Problem):
    """y = size exp(-rate t) + offset of the trial, with white noise of a known deviation."""

    def __init__(self, seed=0, size=(-10.0, 10.0), std=STD):
        rng = np.random.default_rng(seed)
        self.free, self.unknown_names, self.std = ("size", "rate"), ("offset",), std
        self.limits = {"size": size, "rate": (0.0, 20.0)}
        self.trials = [SIZE * np.exp(-RATE * TIME) + o + STD * rng.standard_normal(len(TIME)) for o in OFFSETS]

    def start_unknowns(self):
        return [{"offset": 0.0} for _ in self.trials]

    def linearize(self, values, unknowns):
        bent = np.exp(-values["rate"] * TIME)
        slopes = np.stack([bent, -values["size"] * TIME * bent], axis=1) / self.std
        pairs = zip(self.trials, unknowns, strict=True)
        left = [(y - values["size"] * bent - u["offset"]) / self.std for y, u in pairs]
        logs = 2.0 * len(TIME) * math.log(self.std)
        return [Linearized(r, slopes, np.full((len(TIME), 1), 1.0 / self.std), logs) for r in left]


class NoisyDecay(Decay, NoisyProblem):
    """The same with a deviation that is fitted."""

    @property
    def noise_parameters(self):
        return {"std": self.std}

    @property
    def noise_limits(self):
        return {"std": (1e-3, 10.0)}

    def evaluate(self, points):
        return [self._evaluated(*point) for point in points]

    def _evaluated(self, values, unknowns, noise):
        known, self.std = self.std, noise.get("std", self.std)
        parts, variance = self.linearize(values, unknowns), self.std**2
        self.std = known
        innovations = np.concatenate([p.residual for p in parts])
        variances = np.full(len(innovations), variance)
        cost = float(innovations @ innovations + np.log(variances).sum())
        return Evaluation(cost, innovations, variances, variances, np.zeros(len(variances)))

    def noise_step(self, values, unknowns):
        before = self.evaluate([(values, unknowns, {})])[0]
        self.std *= math.sqrt(float(np.mean(before.innovations**2)))
        return before.cost - self.evaluate([(values, unknowns, {})])[0].cost

    def set_noise(self, parameters):
        self.std = parameters.get("std", self.std)


def by_scipy(problem):
    def left(x):
        unknowns = [{"offset": o} for o in x[2:]]
        return np.concatenate([p.residual for p in problem.linearize({"size": x[0], "rate": x[1]}, unknowns)])

    return scipy.optimize.least_squares(left, [1.0, 1.0, 0.0, 0.0, 0.0], xtol=1e-14, ftol=1e-14)


def test_what_each_trial_has_of_its_own_is_eliminated():
    problem = Decay()
    found, expected = minimise(problem, {"size": 1.0, "rate": 1.0}), by_scipy(problem)
    assert found.converged and found.at_bound == ()
    logs = 6.0 * len(TIME) * math.log(STD)
    assert found.sse == pytest.approx(2.0 * expected.cost + logs, abs=TOLERANCE)
    covariance = np.linalg.inv(expected.jac.T @ expected.jac)
    for k, name in enumerate(found.free):
        assert found.values[name] == pytest.approx(expected.x[k], abs=math.sqrt(TOLERANCE * covariance[k, k]))
        assert found.std(name) == pytest.approx(math.sqrt(covariance[k, k]), rel=0.01)
        assert found.reach(name) == pytest.approx(1.96 * found.std(name), rel=1e-3)
    assert [u["offset"] for u in found.unknowns] == pytest.approx(expected.x[2:].tolist(), abs=5e-3)
    assert found.degrees == 2 and found.samples == 3 * len(TIME)


def test_a_bound_holds_a_parameter_and_its_interval_has_one_side():
    found = minimise(Decay(size=(-10.0, 1.9)), {"size": 1.0, "rate": 1.0})
    assert found.at_bound == ("size",) and found.values["size"] == 1.9
    assert math.isnan(found.std("size")) and 0.0 < found.reach("size") < 0.1
    assert found.within("size", -10.0, 1.9)[1] == 1.9


def test_steps_that_run_out_are_no_optimum():
    assert not minimise(Decay(), {"size": 1.0, "rate": 10.0}, max_iterations=1).converged


def test_noise_is_fitted_by_alternating_maximisation():
    """At the likelihood's maximum the deviation is that of what least squares leave."""
    problem = NoisyDecay(std=1.0)
    found = alternate(problem, {"size": 1.0, "rate": 1.0})
    left = by_scipy(Decay())
    assert found.converged
    assert problem.std == pytest.approx(STD * math.sqrt(2.0 * left.cost / found.samples), rel=0.01)
    assert found.values["rate"] == pytest.approx(left.x[1], abs=math.sqrt(LITTLE) * found.std("rate"))


def test_parameters_and_noise_in_turn_need_no_more_than_a_problem_promises():
    """Where the noise is known there is nothing to take turns with."""
    problem = Decay()
    plain, turns = minimise(problem, {"size": 1.0, "rate": 1.0}), alternate(problem, {"size": 1.0, "rate": 1.0})
    assert turns.converged and turns.sse == pytest.approx(plain.sse, abs=LITTLE)
