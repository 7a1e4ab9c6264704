"""Fits against scipy's least squares on the whole system, bounds, what is not identified, intervals."""

import math
from dataclasses import dataclass, replace

import numpy as np
import pytest
import scipy.stats
from identify.rigs import SIZE, WHITE, by_scipy, measured, off, trials_of
from models.cases import JOINT, RIGS, trial

from fes_pin.data.trial import Trial
from fes_pin.identify.fit import GROSS, fit_multistart, fit_problem
from fes_pin.identify.problem import Problem
from fes_pin.infer.noise import Noise
from fes_pin.infer.optimize import TOLERANCE
from fes_pin.infer.problem import normal_equations
from fes_pin.models.effects import effect_named
from fes_pin.models.model import Model
from fes_pin.models.parameters import parameter
from fes_pin.models.rigs import Joint
from fes_pin.models.stage import Effect, Stage
from fes_pin.search.fit import fit


@pytest.mark.parametrize(("rig", "velocity"), [("ankle", False), ("joint", False), ("joint", True), ("muscle", False)])
def test_scipy_finds_the_same(rig, velocity):
    model, trials = trials_of(rig, np.random.default_rng(0), velocity=velocity)
    fitted = fit(off(model), trials, WHITE)
    values, covariance, sse = by_scipy(Problem(model, trials, WHITE), off(model).parameters())
    std = np.sqrt(np.diag(covariance))
    assert fitted.converged and fitted.is_optimal()
    assert fitted.sse == pytest.approx(sse, abs=TOLERANCE)
    assert np.abs(np.array([fitted.values[n] for n in fitted.free]) - values).max() < math.sqrt(TOLERANCE) * std.max()
    assert (np.abs([fitted.values[n] for n in fitted.free] - values) < math.sqrt(TOLERANCE) * std).all()
    assert np.allclose(fitted.covariance / np.outer(std, std), covariance / np.outer(std, std), atol=1e-3)


def test_scipy_finds_the_same_under_coloured_noise():
    model, trials = trials_of("joint", np.random.default_rng(1))
    noise = {"position": Noise(2e-3, (0.5, 0.2), 3e-3)}
    fitted = fit(off(model), trials, noise)
    values, covariance, sse = by_scipy(Problem(model, trials, noise), off(model).parameters())
    std = np.sqrt(np.diag(covariance))
    assert fitted.sse == pytest.approx(sse, abs=TOLERANCE)
    assert (np.abs([fitted.values[n] for n in fitted.free] - values) < math.sqrt(TOLERANCE) * std).all()
    assert np.allclose(fitted.covariance / np.outer(std, std), covariance / np.outer(std, std), atol=1e-3)


def test_the_unknowns_of_a_trial_are_eliminated_exactly():
    """The Schur complement gives the step of the full system, and the unknowns' steps with it."""
    model, trials = trials_of("joint", np.random.default_rng(2))
    problem = Problem(model, trials, WHITE)
    parts = problem.linearize(off(model, 1.05).parameters(), problem.start_unknowns())
    system = normal_equations(parts)
    own = parts[0].local.shape[1]
    blocks = [
        np.hstack([p.jacobian, *(p.local if i == k else np.zeros_like(p.local) for k in range(len(parts)))])
        for i, p in enumerate(parts)
    ]
    whole, residual = np.vstack(blocks), np.concatenate([p.residual for p in parts])
    full = np.linalg.lstsq(whole, residual, rcond=None)[0]
    step = np.linalg.solve(system.hessian, system.gradient)
    size = len(problem.free)
    assert own == 2
    assert np.allclose(step, full[:size], rtol=1e-7)
    assert np.allclose(np.concatenate(system.local_steps(step)), full[size:], rtol=1e-6, atol=1e-12)
    assert np.allclose(np.linalg.inv(system.hessian), np.linalg.inv(whole.T @ whole)[:size, :size], rtol=1e-6)
    promised = system.local_gain + 2.0 * system.gradient @ step - step @ system.hessian @ step
    left = residual - whole @ full
    assert promised == pytest.approx(residual @ residual - left @ left, rel=1e-9)


@dataclass(frozen=True)
class Pushing(Effect):
    """What drives a joint along its velocity."""

    name, stage, signal, rigs = "pushing", Stage.JOINT, "torque", ("joint",)
    size: float = parameter(0.004, null=0.0)

    def apply(self, value, s):
        return value + self.size * s.v


def test_a_bound_holds():
    """Data of a joint that gains energy: the damping ends at 0, exactly, and the rest is the best that is left."""
    rng = np.random.default_rng(3)
    true = Model(RIGS["joint"]).with_parameters({"damping": 0.0}) + Pushing()
    trials = [measured(true, trial("joint", "motion", rng), rng) for _ in range(3)]
    start = Model(RIGS["joint"])
    fitted = fit(start, trials, WHITE)
    values, covariance, sse = by_scipy(Problem(start, trials, WHITE), start.parameters())
    assert fitted.at_bound == ("damping",)
    assert fitted.values["damping"] == fitted.interval("damping")[0] == 0.0 < fitted.interval("damping")[1]
    assert math.isnan(fitted.std("damping"))
    assert values[fitted.free.index("damping")] == pytest.approx(0.0, abs=1e-6)
    assert fitted.sse == pytest.approx(sse, rel=1e-6, abs=TOLERANCE)
    others = [k for k, n in enumerate(fitted.free) if n != "damping"]
    std = np.sqrt(np.diag(covariance))[others]
    close = np.abs([fitted.values[fitted.free[k]] - values[k] for k in others]) < 0.2 * std
    assert close.all()


@pytest.mark.filterwarnings("ignore:the longest trial lasts 1.198 s:fes_pin.InputWarning")
@pytest.mark.parametrize("start", [{"gain": 22.0, "time_constant_s": 2.0}, {"gain": 5.0, "time_constant_s": 1.0}])
def test_a_step_beyond_two_bounds_is_no_end(start):
    """One train, a start so slow that the first step would leave both bounds: the fit goes on to the optimum."""
    time = np.arange(0.0, 1.2, 2e-3)
    train = Trial("train", "isometric", {"pulse_width_us": np.where(time < 0.94, 900.0, 0.0)}, time)
    true, rng = Model(RIGS["muscle"]), np.random.default_rng(5)
    trials = [measured(true, train, rng) for _ in range(3)]
    fitted = fit(true.with_parameters(start), trials, WHITE)
    assert fitted.is_optimal()
    assert fitted.sse == pytest.approx(fit(true, trials, WHITE).sse, abs=TOLERANCE)


def test_free_motion_shows_ratios_only():
    """Inertia, gravity and damping by one common factor: the same motion."""
    rng = np.random.default_rng(4)
    model = Model(Joint(1.0, 0.02, 1.0, constants=JOINT, fitted=("inertia_scale", "damping", "gravity_scale")))
    n, dt = 400, 5e-3
    trials = [
        measured(model, Trial(f"{k}", "motion", {}, np.arange(n) * dt, {"position0": p, "velocity0": 0.0}), rng)
        for k, p in enumerate((0.9, -0.7, 0.5))
    ]
    fitted = fit(off(model, 1.1), trials, WHITE)
    assert fitted.converged
    assert set(fitted.not_identified()) == {"inertia_scale", "damping", "gravity_scale"}
    assert all(math.isinf(fitted.std(n)) for n in fitted.free)
    assert "not identified" in str(fitted)
    info = model.parameter_info()["damping"]
    assert fitted.interval("damping") == (info.lower, info.upper)
    held = Model(replace(model.rig, fitted=("damping", "gravity_scale")))
    known = fit(off(held, 1.1), trials, WHITE)
    assert not known.not_identified()
    ratio = fitted.values["gravity_scale"] / fitted.values["inertia_scale"]
    assert ratio == pytest.approx(known.values["gravity_scale"], abs=2.0 * known.std("gravity_scale"))


@pytest.mark.filterwarnings("ignore:pulse_width_us is never above the threshold:fes_pin.InputWarning")
def test_nothing_is_identified_without_a_stimulus():
    rng = np.random.default_rng(5)
    model = Model(RIGS["muscle"])
    bare = Trial("rest", "isometric", {"pulse_width_us": np.zeros(300)}, np.arange(300) * 5e-3)
    fitted = fit(model, [measured(model, bare, rng)], WHITE)
    assert set(fitted.not_identified()) == set(model.fitted_parameters())


def test_a_shape_is_not_identified_where_its_effect_is_absent():
    """A muscle that gains force with use: fatigue stays at its bound, so its recovery is nowhere in the data."""
    rng = np.random.default_rng(6)
    model = Model(RIGS["muscle"]) + effect_named("potentiation")(gain=0.5, decay_s=30.0)
    trials = [measured(model, trial("muscle", "isometric", rng, 400), rng) for _ in range(3)]
    fitted = fit(Model(RIGS["muscle"]) + effect_named("fatigue")(rate_per_s=0.02, recovery_s=30.0), trials, WHITE)
    assert "fatigue.rate_per_s" in fitted.at_bound
    assert fitted.not_identified() == ("fatigue.recovery_s",)


def test_a_start_that_cannot_be_simulated_is_infinitely_bad():
    model, trials = trials_of("joint", np.random.default_rng(7))
    broken = model + effect_named("parallel_stiffness")(stiffness_nm_per_rad=1e8)
    fitted = fit_problem(Problem(broken, trials, WHITE, ("damping",)), broken.parameters())
    assert not fitted.converged and not fitted.is_optimal()
    assert math.isinf(fitted.sse) and math.isinf(fitted.std("damping"))


@pytest.mark.parametrize("size", [1e160, 1e290, math.inf, math.nan])
def test_sensitivities_that_run_away_end_a_fit(size, monkeypatch):
    """While the residuals stay finite."""
    model, trials = trials_of("muscle", np.random.default_rng(7))
    problem = Problem(model, trials, WHITE)
    tame = problem.linearize
    monkeypatch.setattr(problem, "linearize", lambda *a: [replace(p, jacobian=size * p.jacobian) for p in tame(*a)])
    fitted = fit_problem(problem, model.parameters())
    assert math.isinf(fitted.sse) and not fitted.converged


@pytest.mark.parametrize("seed", range(3))
def test_a_joint_that_tumbles_is_fitted_from_its_beginning(seed):
    """Driven over the top by a square wave, from an inertia 30 % too large and two thirds of the damping."""
    rng, time = np.random.default_rng(seed), np.arange(1500) * 5e-3
    model = Model(RIGS["joint"]).with_parameters({"inertia_scale": 1.0, "damping": 0.006})
    rate, trials = math.sqrt(JOINT["gravity_sin"] / JOINT["inertia"]), []
    for phase in rng.uniform(0.0, 2.0 * math.pi, 4):
        effort = 0.5 * JOINT["gravity_sin"] * np.sign(np.sin(0.8 * rate * time + phase))
        begin = {"position0": 0.3, "velocity0": 0.0}
        made = measured(model, Trial("tumbling", "motion", {"effort": effort}, time, begin), rng)
        trials.append(Trial(made.name, made.kind, made.columns, time))
    assert min(np.ptp(t["position"]) for t in trials) > 3.0 * math.pi
    start = model.with_parameters({"inertia_scale": 1.3, "damping": 0.004})
    problem = Problem(start, trials, WHITE)
    assert fit_problem(problem, start.parameters()).reduced > 1e3 * GROSS
    fitted = fit_multistart(problem)
    assert fitted.reduced == pytest.approx(1.0, abs=0.1)
    for name in fitted.free:
        assert abs(fitted.values[name] - model.parameters()[name]) < 4.0 * fitted.std(name)


def test_unequal_lengths_and_rates():
    """One joint recorded at 200 Hz, 500 Hz and 1 kHz, for 4, 3 and 2 s: one fit, one noise, the truth within it."""
    rng = np.random.default_rng(8)
    model = Model(RIGS["joint"])
    bare = [trial("joint", "motion", rng, n, dt) for n, dt in ((800, 5e-3), (1500, 2e-3), (2000, 1e-3))]
    trials = [measured(model, b, rng) for b in bare]
    fitted = fit(off(model), trials)
    assert fitted.converged
    (noise,) = fitted.noise.values()
    assert noise.std == pytest.approx(SIZE["position"], rel=0.1)
    assert fitted.samples == sum(map(len, trials))
    for name in fitted.free:
        assert abs(fitted.values[name] - model.parameters()[name]) < 4.0 * fitted.std(name)
    alone = fit(off(model), [trials[2]])
    assert alone.std("inertia_scale") > fitted.std("inertia_scale")


def test_rates_of_one_signal_tell_the_same():
    """The same recording with every second sample: the same values within what the lost samples knew."""
    rng = np.random.default_rng(9)
    model = Model(RIGS["joint"])
    fine = [measured(model, trial("joint", "motion", rng, 1600, 2.5e-3), rng) for _ in range(2)]
    coarse = [Trial(t.name, t.kind, {n: v[::2] for n, v in t.columns.items()}, t.time[::2], t.conditions) for t in fine]
    one, other = fit(model, fine, None), fit(model, coarse, None)
    for name in one.free:
        apart = abs(one.values[name] - other.values[name])
        assert apart < 4.0 * math.sqrt(other.std(name) ** 2 + one.std(name) ** 2)


STUDIES = 150


@pytest.mark.parametrize("ar", [0.0, 0.6])
def test_intervals_cover_the_truth(ar):
    """Of 150 studies' 95 % intervals, the share that covers is binomial: outside its 99.9 % range is a defect."""
    rng = np.random.default_rng(10)
    model = Model(RIGS["muscle"])
    bare = [trial("muscle", "isometric", np.random.default_rng(k), 300) for k in range(2)]
    clean = [measured(model, b, rng, noise=False) for b in bare]
    covered = dict.fromkeys(model.fitted_parameters(), 0)
    for _ in range(STUDIES):
        noisy = [t.with_columns(force_n=t["force_n"] + _ar1(rng, len(t), ar, SIZE["force_n"])) for t in clean]
        fitted = fit(model, noisy)
        for name in covered:
            low, high = fitted.interval(name)
            covered[name] += low <= model.parameters()[name] <= high
    low, high = scipy.stats.binom.interval(0.999, STUDIES, 0.95)
    assert all(low <= count <= high for count in covered.values()), covered


def _ar1(rng, n, coefficient, size):
    out = size * rng.standard_normal(n)
    for k in range(1, n):
        out[k] = coefficient * out[k - 1] + math.sqrt(1.0 - coefficient**2) * out[k]
    return out
