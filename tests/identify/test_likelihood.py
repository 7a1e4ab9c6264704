"""The likelihood: what is random is found, gains as they are lead to its maximum, and small randomness stays small."""

import numpy as np
import pytest

from fes_pin.data.trial import Trial
from fes_pin.identify.ahead import one_step, over_horizon
from fes_pin.identify.likelihood import LikelihoodProblem
from fes_pin.identify.likelihood_fit import maximise, with_slow_process_noise
from fes_pin.identify.per_trial import falls
from fes_pin.identify.process_noise import driving_size, first_guess, noise_limits, slowest_of_all
from fes_pin.infer.problem import whitened_sse
from fes_pin.models.effects.coulomb_friction import CoulombFriction
from fes_pin.models.effects.sensor_gain import SensorGain
from fes_pin.models.model import Model
from fes_pin.models.predictor import masked
from fes_pin.models.rigs import Joint

DT, N = 0.004, 2000
TRUE = {"inertia": 0.05, "damping": 0.06, "weight": 0.9}


def held(
    seed: int,
    torque: float,
    tau: float = 0.1,
    weight: float = TRUE["weight"],
    noise: float = 4e-4,
    friction: float = 0.0,
    slow: float = 1.0,
) -> Trial:
    """A pendulum under feedback with a random torque and friction: Euler steps of a twentieth of a sample."""
    rng = np.random.default_rng(seed)
    q = v = lagged = 0.0
    e, h = torque * rng.normal(), DT / 20
    effort, position = np.empty(N), np.empty(N)
    last = 0.0
    for k in range(N):
        position[k] = q + noise * rng.normal()
        lagged = 0.8 * lagged + 0.2 * (position[k] - last) / DT
        last = position[k]
        wanted = 0.5 * np.sin(2.0 * slow * k * DT + seed) + 0.3 * np.sin(5.1 * slow * k * DT)
        effort[k] = 6.0 * (wanted - position[k]) - 0.5 * lagged
        for _ in range(20):
            lost = TRUE["damping"] * v + friction * np.tanh(v / 0.005)
            a = (effort[k] + e - lost - weight * np.sin(q)) / TRUE["inertia"]
            q, v = q + h * v, v + h * a
            e += -e * h / tau + torque * np.sqrt(2.0 * h / tau) * rng.normal()
    return Trial(f"t{seed}", "motion", {"effort": effort, "position": position}, np.arange(N) * DT)


def believed(weight: float = TRUE["weight"]) -> Model:
    constants = {"inertia": TRUE["inertia"], "gravity_cos": 0.0, "gravity_sin": weight, "revolute": 1.0}
    return Model(Joint(constants=constants, inertia_scale=1.3, damping=0.03))


@pytest.fixture(scope="module")
def fitted():
    trials = [held(k, 0.06) for k in range(3)]
    return maximise(LikelihoodProblem(believed(), trials, first_guess(believed(), trials)))


def test_the_rig_and_what_is_random_are_found(fitted):
    truth = {"inertia_scale": 1.0, "damping": TRUE["damping"], "gravity_scale": 1.0}
    for name, value in truth.items():
        assert abs(fitted.values[name] - value) < 4.0 * fitted.std(name), name
    assert fitted.std("inertia_scale") < 0.02
    assert fitted.noise.std["effort"] == pytest.approx(0.06, rel=0.25)
    assert fitted.noise.time["effort"] == pytest.approx(0.1, rel=0.5)
    assert fitted.noise.white["position"] == pytest.approx(4e-4, rel=0.05)


def test_what_is_random_may_change_as_seldom_as_all_trials_together_tell():
    """A process that one trial could not distinguish from an offset is found from five."""
    trials = [held(k, 0.06, tau=2.0) for k in range(5)]
    first = first_guess(believed(), trials)
    usual = maximise(LikelihoodProblem(believed(), trials, first))
    assert usual.noise.time["effort"] == pytest.approx(0.1 * trials[0].duration, rel=1e-3)
    slow = with_slow_process_noise(usual)
    assert slow.noise.time["effort"] == pytest.approx(2.0, rel=0.5) and slow.sse < usual.sse - 10.0
    assert slow.noise.std["effort"] == pytest.approx(0.06, rel=0.3)
    assert slowest_of_all(trials[:1]) == noise_limits(believed(), trials, first)["time.effort"][1]
    assert slowest_of_all(4 * trials) == pytest.approx(trials[0].duration)


def test_gains_as_they_are_lead_to_the_maximum_of_the_whole_likelihood(fitted):
    """Differences of the cost itself, gains moving: no parameter's step would gain more than a tenth of a deviation."""
    problem = LikelihoodProblem(fitted.model, fitted.trials, fitted.noise)
    for name in fitted.free:
        step = 0.5 * fitted.std(name)
        up, down = (
            problem.cost({**fitted.values, name: fitted.values[name] + s * step}, fitted.unknowns) for s in (1.0, -1.0)
        )
        slope, bend = (up - down) / (2.0 * step), (up + down - 2.0 * fitted.sse) / step**2
        assert bend > 0.0
        assert abs(slope / bend) < 0.1 * fitted.std(name), name


def test_the_maximum_of_a_model_that_is_wrong_is_found_from_anywhere():
    """It lacks friction: gains as they are promise steps that none keeps, and differences of the cost decide."""
    trials = [read_in_counts(held(k, 0.02, noise=1e-6, friction=0.3, slow=0.3), 1e-5) for k in range(2)]
    ends = []
    for scale, damping in ((0.5, 0.03), (2.0, 0.3)):
        begun = believed().with_parameters({"inertia_scale": scale, "damping": damping})
        ends.append(maximise(LikelihoodProblem(begun, trials, first_guess(believed(), trials))))
    assert ends[0].sse == pytest.approx(ends[1].sse, abs=0.2)
    problem = LikelihoodProblem(believed(), trials, ends[0].noise)
    for name in ends[0].free:
        step = ends[0].std(name)
        sides = [
            problem.cost({**ends[0].values, name: ends[0].values[name] + s * step}, ends[0].unknowns) for s in (-1, 1)
        ]
        assert min(sides) > ends[0].sse, name


def read_in_counts(trial: Trial, count: float) -> Trial:
    """The trial as an encoder reads it."""
    return trial.with_columns(position=np.round(trial["position"] / count) * count)


def test_innovations_are_white_at_the_maximum(fitted):
    problem = LikelihoodProblem(fitted.model, fitted.trials, fitted.noise)
    for part in problem.linearize(fitted.values, fitted.unknowns):
        r = part.residual[20:]
        assert np.std(r) == pytest.approx(1.0, abs=0.06)
        for lag in (1, 2, 5, 20):
            assert abs(float(np.mean(r[lag:] * r[:-lag]))) < 4.0 / np.sqrt(len(r))


@pytest.fixture(scope="module")
def rubbing():
    """Slow motion with dry friction, read so coarsely that the sign of the velocity is often in doubt; fitted."""
    trials = [held(k, 0.01, noise=2e-3, friction=0.2, slow=0.3) for k in range(12)]
    model = believed() + CoulombFriction(torque_nm=0.2)
    return maximise(LikelihoodProblem(model, trials, first_guess(model, trials)))


def test_the_likelihood_of_dry_friction_is_smooth(rubbing):
    """Steps of a hundredth of a deviation find the slope that a whole one does: no sign flips between."""
    problem = LikelihoodProblem(rubbing.model, rubbing.trials, rubbing.noise)
    name = "coulomb_friction.torque_nm"

    def slope(step: float) -> float:
        moved = [{**rubbing.values, name: rubbing.values[name] + s * step} for s in (1, -1)]
        up, down = (problem.cost(values, rubbing.unknowns) for values in moved)
        return (up - down) / (2.0 * step)

    deviation = rubbing.std(name)
    for k in (0.01, 0.03, 0.1):
        assert abs(slope(k * deviation) - slope(deviation)) * deviation < 0.1


def test_friction_that_is_felt_near_standstill_is_not_underestimated(rubbing):
    for name, truth in (("coulomb_friction.torque_nm", 0.2), ("damping", TRUE["damping"])):
        assert abs(rubbing.values[name] - truth) < 3.0 * rubbing.std(name), name


def test_without_a_random_torque_none_is_found():
    trials = [held(k, 0.0) for k in range(2)]
    found = maximise(LikelihoodProblem(believed(), trials, first_guess(believed(), trials)))
    assert found.noise.std["effort"] < 0.01 * driving_size(believed(), trials)["effort"]


def test_three_errors_of_a_rig_that_falls():
    """On its head free simulation says nothing; 0.1 s ahead errors are small, one sample ahead they are noise."""
    trials = [held(k, 0.02, weight=-TRUE["weight"]) for k in range(2)]
    model = believed(-TRUE["weight"])
    found = maximise(LikelihoodProblem(model, trials, first_guess(model, trials)))
    assert falls(found.model, trials)
    near = one_step(found.model, trials[0], found.noise)["position"]
    missed = trials[0]["position"] - over_horizon(found.model, trials[0], found.noise, 0.1)["position"]
    assert np.std(near[5:]) < 1.3 * 4e-4
    assert 2.0 * np.std(near[5:]) < np.std(missed) < 0.05


def test_a_horizon_uses_all_that_is_older():
    """As a run to which nothing was shown from there on; runs that share a trial's predictions hide parts of it."""
    (trial,) = trials = [held(7, 0.03)]
    found = maximise(LikelihoodProblem(believed(), trials, first_guess(believed(), trials)))
    shared = over_horizon(found.model, trial, found.noise, 0.1)["position"]
    for last in range(900, 930, 6):  # the newest that a prediction uses, every quarter of 25 samples
        older = masked(trial, ["position"], [range(last + 1, len(trial))])
        alone = LikelihoodProblem(found.model, [older], found.noise, ())
        rows = slice(last + 25, last + 31)
        told = alone.predicted(found.model.parameters())[0]["position"].values[rows]
        assert np.abs(shared[rows] - told).max() < 1e-4 * np.ptp(trial["position"])


def test_a_horizon_uses_nothing_younger():
    """What is foretold of a sample does not change when the samples within the horizon before it do."""
    trials = [held(7, 0.03)]
    found = maximise(LikelihoodProblem(believed(), trials, first_guess(believed(), trials)))
    column = np.array(trials[0]["position"])
    column[1000 - 24 : 1000] += 0.05  # 0.1 s are 25 samples
    changed = trials[0].with_columns(position=column)
    before, after = (over_horizon(found.model, t, found.noise, 0.1)["position"] for t in (trials[0], changed))
    assert after[1000] == before[1000]
    assert after[1060] != before[1060]


@pytest.mark.parametrize("error", [-0.4, 0.6])
def test_another_scale_of_the_reading_is_another_inertia_and_nothing_more(error):
    """Of a slide without weight: what is known of a start beforehand, however many the trials, tells them no better."""
    trials = [held(k, 0.06, weight=0.0) for k in range(3)]
    slide = Joint(constants={"inertia": TRUE["inertia"], "gravity_cos": 0.0, "gravity_sin": 0.0, "revolute": 0.0})
    plain, scaled = Model(slide), Model(slide) + SensorGain(place=2.0)
    noise, own = first_guess(plain, trials), 1.0 + error
    values = {**plain.parameters(), "inertia_scale": 1.3, "damping": 0.03}
    same = {**scaled.parameters(), "sensor_gain.error": error, "inertia_scale": 1.3 * own, "damping": 0.03 * own}
    costs = []
    for model, at, begin in ((plain, values, 1.0), (scaled, same, own)):
        problem = LikelihoodProblem(model, trials, noise)
        problem.begins = [{n: v / begin for n, v in b.items()} for b in problem.begins]
        costs.append(problem.cost(at, problem.start_unknowns()))
    assert costs[0] == pytest.approx(costs[1], abs=1e-3)


def test_costs_of_points_side_by_side_are_those_of_each_linearized(fitted):
    problem = LikelihoodProblem(fitted.model, fitted.trials[:2], fitted.noise)
    points = [
        ({**fitted.values, "inertia_scale": k * fitted.values["inertia_scale"]}, fitted.unknowns[:2])
        for k in (1.0, 1.1, 0.8)
    ]
    assert problem.batch > 1
    costs = [whitened_sse(problem.linearize(*point)) for point in points]
    assert problem.costs(points) == pytest.approx(costs, rel=1e-12)
    assert len(set(costs)) == len(points)
