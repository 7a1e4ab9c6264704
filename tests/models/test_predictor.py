"""The one-step-ahead predictor against an exact Kalman filter, the virtual machine, and the free simulation."""

import numpy as np
import pytest
import scipy.linalg

from fes_pin.data.counts import hunts
from fes_pin.data.trial import Trial, derived_trial
from fes_pin.models import predictor
from fes_pin.models.effects import CoulombFriction, effect_named
from fes_pin.models.model import Model
from fes_pin.models.predictor import Predictor, StateSpaceNoise, repeated
from fes_pin.models.rigs import Joint
from fes_pin.models.simulate import Simulator

MASS, DAMPING, DT = 2.0, 3.0, 0.005
SLIDE = Joint(
    constants={"inertia": MASS, "gravity_cos": 0.0, "gravity_sin": 0.0, "revolute": 0.0},
    fitted=("inertia_scale", "damping"),
    damping=DAMPING,
)
PENDULUM = Joint(constants={"inertia": 0.05, "gravity_cos": 0.1, "gravity_sin": 1.0, "revolute": 1.0}, damping=0.05)
PRIOR = {"initial_position": 0.5, "initial_velocity": 2.0}
NOISE = StateSpaceNoise({"position": 2e-3}, {"effort": 0.8}, {"effort": 0.12})


def with_gaps(trial, position):
    """The trial with a position that was not measured in some samples (NaN)."""
    return derived_trial(trial, columns={**trial.columns, "position": position})


def driven(seed: int, n: int = 400, size: float = 1.0) -> Trial:
    rng = np.random.default_rng(seed)
    time = np.arange(n) * DT
    effort = size * np.repeat(rng.normal(size=-(-n // 20)), 20)[:n]
    position = 0.1 * np.sin(3.0 * time + seed) + 2e-3 * rng.normal(size=n)
    return Trial(f"t{seed}", "motion", {"effort": effort, "position": position}, time)


def exact(trial: Trial, noise: StateSpaceNoise) -> tuple[np.ndarray, np.ndarray]:
    """Innovations and variances of the slide by matrix exponentials (Van Loan) and the textbook's filter."""
    tau, std = noise.time["effort"], noise.std["effort"]
    a = np.array([[0.0, 1.0, 0.0], [0.0, -DAMPING / MASS, 1.0 / MASS], [0.0, 0.0, -1.0 / tau]])
    b = np.array([[0.0], [1.0 / MASS], [0.0]])
    whole = scipy.linalg.expm(DT * np.block([[a, b], [np.zeros((1, 4))]]))
    phi, gamma = whole[:3, :3], whole[:3, 3]
    spread = np.diag([0.0, 0.0, 2.0 * std**2 / tau])
    loan = scipy.linalg.expm(DT * np.block([[-a, spread], [np.zeros((3, 3)), a.T]]))
    driven = loan[3:, 3:].T @ loan[:3, 3:]
    x = np.array([trial["position"][0], 0.3, 0.0])
    p = np.diag([PRIOR["initial_position"] ** 2, PRIOR["initial_velocity"] ** 2, std**2])
    out, variances = [], []
    for u, y, count in zip(trial["effort"], trial["position"], repeated(trial["position"]), strict=True):
        variance = p[0, 0] + count * noise.white["position"] ** 2
        out.append(y - x[0] if np.isfinite(y) else 0.0)
        variances.append(variance)
        if np.isfinite(y):
            gain = p[:, 0] / variance
            x = x + gain * out[-1]
            p = p - np.outer(gain, p[0])
        x = phi @ x + gamma * u
        p = phi @ p @ phi.T + driven
    return np.array(out), np.array(variances)


def predicted(model, trials, noise=NOISE, columns=(), velocity=0.3):
    predictor = Predictor(model, trials, columns, noise.processes, [PRIOR] * len(trials))
    begin = [{"initial_position": float(t["position"][0]), "initial_velocity": velocity} for t in trials]
    return predictor.run(model.parameters(), noise, begin)


@pytest.mark.parametrize("count", [1, 3, 5])
def test_on_a_linear_rig_it_is_the_exact_kalman_filter(count):
    trials = [driven(k, 200 + 37 * k) for k in range(count)]
    for trial, found in zip(trials, predicted(Model(SLIDE), trials), strict=True):
        innovations, variances = exact(trial, NOISE)
        assert np.allclose(found.values[:, 0], innovations, rtol=0.0, atol=1e-6)
        assert np.allclose(found.variances[:, 0], variances, rtol=2e-3)


def test_what_was_not_measured_corrects_nothing_and_counts_for_nothing():
    trial = driven(3)
    column = np.array(trial["position"])
    column[50:120] = np.nan
    column[200] = np.nan
    (found,) = predicted(Model(SLIDE), [derived_trial(trial, columns={**trial.columns, "position": column})])
    innovations, variances = exact(derived_trial(trial, columns={**trial.columns, "position": column}), NOISE)
    assert np.allclose(found.values[:, 0], innovations, rtol=0.0, atol=1e-6)
    seen = np.isfinite(column)
    cost = np.sum(innovations[seen] ** 2 / variances[seen] + np.log(variances[seen]))
    assert found.cost() == pytest.approx(cost, rel=1e-4)


@pytest.mark.parametrize("name", ["quadratic_damping", "joint_stop", "frame_vibration", "sensor_lag", "backlash"])
def test_the_step_of_a_smooth_model_leaves_its_likelihood(name, monkeypatch):
    """Models that are integrated in other steps are compared by their likelihood."""
    trial = driven(3, n=2000)
    model = Model(PENDULUM) + effect_named(name)()
    (one,) = predicted(model, [trial])
    monkeypatch.setattr(predictor, "max_step", lambda model: DT / 16.0)
    (finer,) = predicted(model, [trial])
    assert one.cost() == pytest.approx(finer.cost(), abs=0.05)


def test_without_randomness_it_is_the_free_simulation():
    trial, model = driven(1), Model(PENDULUM)
    begin = {"initial_position": float(trial["position"][0]), "initial_velocity": 0.3}
    predictor = Predictor(model, [trial], (), (), [dict.fromkeys(PRIOR, 0.0)])
    (found,) = predictor.run(model.parameters(), StateSpaceNoise({"position": 1e-3}), [begin])
    (free,) = Simulator(model, [trial]).run(model.parameters(), [begin])
    assert np.allclose(found.values[:, 0], trial["position"] - free.readings[:, 0], rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("names", [(), ("coulomb_friction",), ("sensor_lag", "passive_relaxation"), ("backlash",)])
def test_machine_code_and_virtual_machine_agree(names, monkeypatch):
    model = Model(PENDULUM)
    for name in names:
        model = model + effect_named(name)()
    trials, columns = [driven(1, 60), driven(2, 80)], model.fitted_parameters()
    fast = predicted(model, trials, columns=columns)
    monkeypatch.setenv("FES_PIN_ENGINE", "casadi")
    slow = predicted(model, trials, columns=columns)
    for one, other in zip(fast, slow, strict=True):
        assert np.allclose(one.values, other.values, rtol=0.0, atol=1e-11)
        assert np.allclose(one.variances, other.variances, rtol=1e-9)
        scale = np.abs(other.sensitivities).max(axis=(0, 1)) + 1e-12
        assert np.abs((one.sensitivities - other.sensitivities) / scale).max() < 1e-8


def test_sensitivities_are_derivatives_where_the_gains_do_not_move():
    """On a slide neither the offset of its effort nor of its sensor moves the gains: differences are the truth."""
    model = Model(SLIDE) + effect_named("effort_offset")(offset=0.2) + effect_named("sensor_offset")(offset=0.01)
    columns = ("effort_offset.offset", "sensor_offset.offset")
    trial, values, step = driven(4), model.parameters(), 1e-4
    (found,) = predicted(model, [trial], columns=columns)
    for k, name in enumerate(columns):
        ends = [model.with_parameters({**values, name: values[name] + s * step}) for s in (1.0, -1.0)]
        up, down = (predicted(one, [trial])[0].values for one in ends)
        assert np.allclose(found.sensitivities[:, :, k], (down - up) / (2.0 * step), rtol=0.0, atol=1e-7)


def test_lags_shorter_than_a_step_do_not_blow_up():
    model = Model(PENDULUM) + effect_named("sensor_lag")(lag_s=0.0)
    (found,) = predicted(model, [driven(5, 2000)], columns=model.fitted_parameters())
    (without,) = predicted(Model(PENDULUM), [driven(5, 2000)])
    assert np.isfinite(found.sensitivities).all()
    assert found.cost() == pytest.approx(without.cost(), rel=1e-3)


def test_a_count_that_is_read_again_and_again_is_one_reading(monkeypatch):
    monkeypatch.setattr(predictor, "max_step", lambda model: DT / 4.0)
    column = np.array([0.0, 0.1, 0.1, 0.1, np.nan, np.nan, 0.3, 0.3, 0.1])
    assert repeated(column).tolist() == [1.0, 3.0, 3.0, 3.0, 1.0, 1.0, 2.0, 2.0, 1.0]
    trial = driven(4)
    coarse = trial.with_columns(position=np.round(trial["position"] / 0.02) * 0.02)
    assert repeated(coarse["position"]).mean() > 5.0
    (one,) = predicted(Model(SLIDE), [coarse])
    innovations, variances = exact(coarse, NOISE)
    judged = one.seen[:, 0]
    assert judged.sum() > 100
    assert one.values[judged, 0] == pytest.approx(innovations[judged], abs=1e-6)
    assert one.variances[:, 0] == pytest.approx(variances, rel=1e-6)


def test_numbers_that_are_the_same_by_chance_are_each_a_reading():
    """A file's digits make three pairs in 100 equal; taken for one reading, their noise seemed twice as large."""
    noisy = np.random.default_rng(0).normal(scale=1e-3, size=2000).round(4)
    assert np.sum(np.diff(noisy) == 0.0) > 20
    assert (repeated(noisy) == 1.0).all()


def test_a_rig_that_stands_is_known_no_better_the_longer_it_is_read():
    """Without a random effort a hundred equal readings of a rig at rest leave its place as doubtful as one."""
    still = driven(5, n=100, size=0.0)
    noise, white = StateSpaceNoise({"position": 2e-3}, {"effort": 1e-9}, {"effort": 0.1}), 2e-3**2
    known = {}
    for name, column in {"same": np.zeros(100), "noisy": 1e-6 * np.arange(100.0)}.items():
        (one,) = predicted(
            Model(SLIDE), [derived_trial(still, columns={**still.columns, "position": column})], noise, velocity=0.0
        )
        known[name] = one.variances[-1, 0] - repeated(column)[-1] * white
    assert known["same"] > 0.5 * white
    assert known["noisy"] < 0.1 * white


def test_what_hunts_between_two_counts_is_known_no_better_the_longer_it_is_read():
    """A rig that stands near the edge of two counts, four samples of each in turn: one reading, which errs by half."""
    still, n = driven(5, n=200, size=0.0), 200
    noise, white = StateSpaceNoise({"position": 2e-3}, {"effort": 1e-9}, {"effort": 0.1}), 2e-3**2
    column = np.tile(np.repeat([0.0, 7e-3], 4), n // 8)
    hunting = hunts(column)
    (one,) = predicted(
        Model(SLIDE), [derived_trial(still, columns={**still.columns, "position": column})], noise, velocity=0.0
    )
    assert hunting.mean() > 0.9 and not one.seen[hunting].any()
    last = np.flatnonzero(hunting)[-1]
    assert one.variances[last, 0] - hunting.sum() * white > 0.5 * white


def discrete(noise: StateSpaceNoise) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The slide from sample to sample: transition, what an effort does, a root of the covariance of what is random."""
    tau, std = noise.time["effort"], noise.std["effort"]
    a = np.array([[0.0, 1.0, 0.0], [0.0, -DAMPING / MASS, 1.0 / MASS], [0.0, 0.0, -1.0 / tau]])
    whole = scipy.linalg.expm(DT * np.block([[a, np.array([[0.0], [1.0 / MASS], [0.0]])], [np.zeros((1, 4))]]))
    spread = np.diag([0.0, 0.0, 2.0 * std**2 / tau])
    loan = scipy.linalg.expm(DT * np.block([[-a, spread], [np.zeros((3, 3)), a.T]]))
    values, vectors = np.linalg.eigh(loan[3:, 3:].T @ loan[:3, 3:])
    return whole[:3, :3], whole[:3, 3], vectors * np.sqrt(np.maximum(values, 0.0))


ROUGH = StateSpaceNoise({"position": 5e-3}, {"effort": 5.0}, {"effort": 0.05})
NEAR = {"initial_position": 0.01, "initial_velocity": 0.1}


def with_play(width: float, seed: int, n: int = 1500) -> Trial:
    """A slide that is read through a play, by its exact recursion."""
    rng, (phi, gamma, root) = np.random.default_rng(seed), discrete(ROUGH)
    effort = 15.0 * np.cos(6.0 * np.arange(n) * DT)
    x, read, column = np.array([0.0, 0.3, ROUGH.std["effort"] * rng.normal()]), rng.uniform(-width, width), np.empty(n)
    for k in range(n):
        read = float(np.clip(read, x[0] - width, x[0] + width))
        column[k] = read + ROUGH.white["position"] * rng.normal()
        x = phi @ x + gamma * effort[k] + root @ rng.normal(size=3)
    return Trial("play", "motion", {"effort": effort, "position": column}, np.arange(n) * DT)


def through_play(model: Model, trial: Trial) -> float:
    begin = {"initial_position": float(trial["position"][0]), "initial_velocity": 0.3}
    return Predictor(model, [trial], (), ROUGH.processes, [NEAR]).run(model.parameters(), ROUGH, [begin])[0].cost()


def by_particles(trial: Trial, width: float, seed: int, count: int = 8000) -> float:
    """Twice the negative log-likelihood, but for n log(2 pi), by a bootstrap particle filter."""
    rng, (phi, gamma, root) = np.random.default_rng(seed), discrete(ROUGH)
    white, total = ROUGH.white["position"], 0.0
    x = rng.normal(size=(count, 3)) * [NEAR["initial_position"], NEAR["initial_velocity"], ROUGH.std["effort"]]
    x += [trial["position"][0], 0.3, 0.0]
    read = x[:, 0] + rng.uniform(-width, width, size=count)
    for u, y in zip(trial["effort"], trial["position"], strict=True):
        read = np.clip(read, x[:, 0] - width, x[:, 0] + width)
        logs = -0.5 * ((y - read) / white) ** 2
        weights = np.exp(logs - logs.max())
        total -= 2.0 * (logs.max() + np.log(weights.mean())) - 2.0 * np.log(white)
        places = (np.arange(count) + rng.random()) / count
        kept = np.searchsorted(np.cumsum(weights) / weights.sum(), places).clip(max=count - 1)
        x = x[kept] @ phi.T + gamma * u + rng.normal(size=(count, 3)) @ root.T
        read = read[kept]
    return total


@pytest.mark.parametrize("seed", [1, 2])
def test_through_a_play_it_is_near_the_exact_likelihood(seed):
    """Against particles: a Gaussian loses up to a quarter of what a play explains, and the true width is the best."""
    trial, widths = with_play(0.03, seed), (0.015, 0.03, 0.045)
    model = Model(SLIDE)
    without = through_play(model, trial)
    found = [without - through_play(model + effect_named("backlash")(half_width=w), trial) for w in widths]
    exact = without - by_particles(trial, 0.03, seed)
    assert int(np.argmax(found)) == 1
    assert 0.75 * exact < found[1] < 1.05 * exact


def test_a_play_without_width_is_none():
    trial = driven(6)
    (one,) = predicted(Model(SLIDE) + effect_named("backlash")(half_width=0.0), [trial])
    (none,) = predicted(Model(SLIDE), [trial])
    assert one.values == pytest.approx(none.values, abs=1e-9)
    assert one.variances == pytest.approx(none.variances, rel=1e-6)


def flown(stretch: float | None) -> tuple[float, float]:
    """Where a body with dry friction is 58 ms after it was read, and its deviation; it moves at 0.03 +- 0.05 rad/s."""
    time = np.arange(30) * 0.002
    read = np.where(time > 0.0, np.nan, 0.0)
    model = Model(
        Joint(damping=0.0, constants={"inertia": 1.0, "gravity_cos": 0.0, "gravity_sin": 0.0, "revolute": 1.0})
    )
    model = model if stretch is None else model + CoulombFriction(0.05, stretch=stretch)
    trial = with_gaps(Trial("a", "motion", {"effort": np.zeros(len(time)), "position": time}, time), read)
    prior = {"initial_position": 1e-4, "initial_velocity": 0.05}
    begun = [{"initial_position": 0.0, "initial_velocity": 0.03}]
    noise = StateSpaceNoise({"position": 1e-4}, {"effort": 1e-9}, {"effort": 0.1})
    told = Predictor(model, [trial], (), ("effort",), [prior]).predict(model.parameters(), noise, begun)[0]["position"]
    return float(told.values[-1]), float(np.sqrt(told.variances[-1]))


def flown_by_many() -> tuple[float, float]:
    """The same of bodies that begin at random, by steps of 0.1 ms, less the same without friction."""
    rng, h, count = np.random.default_rng(1), 1e-4, 100_000
    v, q = 0.03 + 0.05 * rng.standard_normal(count), 1e-4 * rng.standard_normal(count)
    freely = q + 0.058 * v
    for _ in range(580):
        v -= np.minimum(np.abs(v), 0.05 * h) * np.sign(v)
        q += h * v
    return float(np.mean(q - freely)), float(np.std(q) / np.std(freely))


@pytest.mark.parametrize("stretch", [0.0, 1e-9, 1e-6, 1e-4])
def test_friction_of_a_motion_that_is_not_known_is_the_mean_over_what_it_may_be(stretch):
    """With a stretch as without: a contact that breaks away at once took the likeliest motion for the only one."""
    (free, free_std), (held, held_std) = flown(None), flown(stretch)
    late, narrower = flown_by_many()
    assert late == pytest.approx(-0.45 * 0.5 * 0.05 * 0.058**2, rel=0.02)
    assert held - free == pytest.approx(late, rel=0.03)
    assert held_std / free_std == pytest.approx(narrower, abs=0.002)
