"""Readings in counts taken for the intervals that they stand for."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import norm

from fes_pin.data.counts import count_of
from fes_pin.data.trial import Trial
from fes_pin.models.counted import count_moments, count_told
from fes_pin.models.model import Model
from fes_pin.models.predictor import Doubt, Predictor
from fes_pin.models.rigs import Joint

COUNT = 2.0 * np.pi / 4096
SLIDE = Joint(
    constants={"inertia": 2.0, "gravity_cos": 0.0, "gravity_sin": 0.0, "revolute": 0.0},
    fitted=("inertia_scale", "damping"),
    damping=3.0,
)


def exact(c, d):
    """-2 log(Z / 2d), m and v by quadrature, beside the density at the nearest point: it may be any power of ten."""
    near = np.clip(0.0, c - d, c + d)

    def part(power):
        return quad(lambda z: z**power * np.exp(0.5 * (near**2 - z**2)), c - d, c + d, points=[near], epsabs=1e-13)[0]

    z, first, second = (part(power) for power in range(3))
    m = first / z
    cost = -2.0 * (np.log(z / (2.0 * d)) - 0.5 * near**2 - 0.5 * np.log(2.0 * np.pi))
    return cost, m, second / z - m**2


@pytest.mark.parametrize("c", [0.0, 0.3, -2.0, 4.0, -7.0, 12.0])
@pytest.mark.parametrize("d", [0.01, 0.3, 2.0, 4.5])
def test_it_tells_what_an_integral_does(c, d):
    assert np.allclose(np.ravel(count_told(np.array([c]), np.array([d]))), exact(c, d), rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("c", [0.0, -0.3, 2.0, 4.9, 5.1, -8.0, 30.0])
@pytest.mark.parametrize("d", [1e-5, 0.01, 0.3, 2.0, 20.0])
def test_expressions_are_the_same_numbers(c, d):
    found = [float(v) for v in count_moments(ca.DM(c), ca.DM(d))]
    _, m, v = count_told(np.array([c]), np.array([d]))
    assert found[0] == pytest.approx(m[0], rel=1e-3, abs=1e-9)
    assert found[1] == pytest.approx(v[0], rel=0.06, abs=1e-6)


def test_a_slope_of_the_mean_is_what_the_count_leaves():
    at, step = np.array([-3.0, 0.2, 1.5]), 1e-5
    for d in (0.1, 1.0, 3.0):
        above, below = (count_told(at + s, np.full(3, d))[1] for s in (step, -step))
        assert np.allclose((above - below) / (2.0 * step), 1.0 - count_told(at, np.full(3, d))[2], atol=1e-6)


def test_a_count_is_found_in_what_was_read():
    rng = np.random.default_rng(0)
    smooth = 0.3 * np.sin(np.linspace(0.0, 9.0, 4000))
    read = COUNT * np.round(smooth / COUNT)
    assert count_of(read) == pytest.approx(COUNT, rel=1e-9)
    assert count_of(np.round(0.1 + read, 6)) == pytest.approx(COUNT, rel=1e-5)  # as a file keeps it
    assert count_of(smooth) == count_of(read + 1e-5 * rng.normal(size=4000)) == 0.0
    assert count_of(np.zeros(10)) == count_of(np.array([1.0])) == 0.0
    assert count_of(1e-6 * np.round(rng.normal(size=4000) / 1e-6)) == 0.0  # far below its noise


@pytest.mark.parametrize("values", [(0.0, 1e-300, 1e300), (-1e308, 1e308, 1e308), (0.0, 1e-17, 1.0)], ids=str)
def test_what_no_encoder_reads_is_in_no_counts(values):
    assert count_of(np.repeat(values, 5)) == 0.0


def recorded(seed, n=300):
    """A slide that a slow torque moves by a few counts, read with little noise."""
    rng = np.random.default_rng(seed)
    time = 0.005 * np.arange(n)
    moved = 0.004 * np.sin(1.3 * time + seed) + 1e-4 * rng.normal(size=n)
    return Trial("a", "motion", {"effort": np.zeros(n), "position": COUNT * np.round(moved / COUNT)}, time)


def foretold(trial, in_counts, white=2e-4, columns=()):
    doubt = Doubt({"position": white}, {"effort": 0.05}, {"effort": 0.1}, in_counts=in_counts)
    predictor = Predictor(
        Model(SLIDE),
        [trial],
        columns,
        doubt.processes,
        [{"initial_position": 0.01, "initial_velocity": 0.05}],
        in_counts=in_counts,
    )
    begin = {"initial_position": float(trial["position"][0]), "initial_velocity": 0.0}
    return lambda values: predictor.run(values, doubt, [begin])[0]


def test_a_count_far_below_the_noise_is_a_number():
    trial = recorded(1)
    values = Model(SLIDE).parameters()
    counted, plain = (foretold(trial, flag, white=0.05)(values) for flag in (True, False))
    assert counted.half_counts == pytest.approx(0.5 * COUNT)
    runs = np.diff(trial["position"]) == 0.0
    assert runs.mean() > 0.1
    assert np.abs(counted.values - plain.values).max() < 1e-3  # but for what a run of counts repeats


def test_it_is_the_filter_of_a_count_by_a_grid():
    """Of a mass that stands, whose place alone is unknown, Bayes' rule on a grid: a Gaussian is all that it errs by."""
    place = np.linspace(-0.02, 0.02, 40001)
    belief = norm.pdf(place, 0.0, 0.01)
    read = COUNT * np.array([2.0, 2.0, 2.0, 3.0, 2.0, 3.0])
    white, cost = 4e-4, []
    for y in read:
        chance = norm.cdf((y + 0.5 * COUNT - place) / white) - norm.cdf((y - 0.5 * COUNT - place) / white)
        cost.append(-2.0 * np.log(np.sum(belief * chance) / np.sum(belief) / COUNT) - np.log(2.0 * np.pi))
        belief = belief * chance
    trial = Trial("a", "motion", {"effort": np.zeros(6), "position": read}, 0.005 * np.arange(6))
    counted = Doubt({"position": white}, {"effort": 1e-9}, {"effort": 0.1}, in_counts=True)
    plain = replace(counted, white={"position": np.hypot(white, COUNT / 12.0**0.5)}, in_counts=False)
    prior = {"initial_position": 0.01, "initial_velocity": 1e-9}
    begin = {"initial_position": 0.0, "initial_velocity": 0.0}

    def missed(doubt):
        predictor = Predictor(Model(SLIDE), [trial], (), doubt.processes, [prior], in_counts=doubt.in_counts)
        (found,) = predictor.run(Model(SLIDE).parameters(), doubt, [begin])
        return np.abs(found.costs() - cost).max()

    assert missed(counted) < 0.15
    assert missed(plain) > 0.5


def test_machine_code_and_virtual_machine_agree(monkeypatch):
    trial, model = recorded(2, 80), Model(SLIDE)
    fast = foretold(trial, True, columns=model.fitted_parameters())(model.parameters())
    monkeypatch.setenv("FES_PIN_ENGINE", "casadi")
    slow = foretold(trial, True, columns=model.fitted_parameters())(model.parameters())
    assert np.allclose(fast.values, slow.values, rtol=0.0, atol=1e-12)
    assert np.allclose(fast.sensitivities, slow.sensitivities, rtol=1e-6, atol=1e-10)


def test_slopes_of_the_cost_are_differences():
    """As far as gains stay as they are: within what a filter's gains tell of a parameter."""
    trial, model = recorded(3), Model(SLIDE)
    run = foretold(trial, True, columns=("damping",))
    at = {**model.parameters(), "damping": 4.0}
    residual, scale, _ = run(at).whitened()
    slope = float(np.sum(residual * scale * run(at).sensitivities[:, 0, 0]))
    above, below = (run({**at, "damping": 4.0 + s}).cost() for s in (0.05, -0.05))
    assert slope == pytest.approx((above - below) / 0.1 / 2.0, rel=0.35, abs=0.02)


def test_the_noise_of_what_is_read_in_counts_is_that_of_rounding_too():
    """An independent sum: the variance of many roundings of numbers anywhere within a count."""
    count, white = 0.1, 0.02
    rng = np.random.default_rng(3)
    true = rng.uniform(0.0, 50.0, 200_000)
    read = np.round((true + white * rng.standard_normal(len(true))) / count) * count
    trial = Trial("t", "free", {"position": np.repeat(read, 2)}, 1e-3 * np.arange(2 * len(read)))
    doubt = Doubt({"position": white}, in_counts=True)
    assert doubt.variance(trial, "position") == pytest.approx(float(np.var(read - true)), rel=0.02)
    assert replace(doubt, in_counts=False).variance(trial, "position") == white**2
