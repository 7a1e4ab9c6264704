"""The likelihood under noise that lasts: free simulation where nothing acts at random, and how long it lasts."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from diagnosis.hidden import study_of
from scipy.signal import lfilter

from fes_pin.data.errors import InputError
from fes_pin.data.log import Log
from fes_pin.identify.likelihood import LikelihoodProblem, autoregressions
from fes_pin.identify.problem import Problem
from fes_pin.identify.process_noise import first_guess, stilled
from fes_pin.identify.stored import load_random, stored_tables
from fes_pin.infer.noise import ORDERS, Noise
from fes_pin.models.autoregression import innovations_of
from fes_pin.models.free_run import with_noise
from fes_pin.models.nominal import nominal_model
from fes_pin.models.store import model_toml

AR = (1.1, -0.4)
STD = 1e-3


@pytest.fixture(scope="module")
def study():
    return study_of("ankle", {}, "ar1", 3)


def moved(study):
    return [t for t in study.trials if t.kind == "motion"]


def test_a_filter_beside_nothing_random_leaves_what_free_simulation_leaves(study):
    """Both take the same noise out."""
    model, trials = nominal_model(study), moved(study)
    guess = stilled(model, trials, first_guess(model, trials))
    noise = replace(guess, white={"angle_rad": STD}, ar={"angle_rad": AR})
    problem = LikelihoodProblem(model, trials, noise)
    assert not set(problem.noise_parameters) & {"std.effort", "time.effort"}
    freely = Problem(model, trials, {"angle_rad": Noise(STD, AR, STD)}, problem.free)
    values, unknowns = model.parameters(), problem.start_unknowns()
    both = zip(problem.linearize(values, unknowns), freely.linearize(values, unknowns), strict=True)
    for filtered, simulated in both:
        size = np.abs(simulated.residual).max()
        assert filtered.residual == pytest.approx(simulated.residual, abs=1e-5 * size)
        size = np.abs(simulated.jacobian).max(axis=0)
        apart = np.abs(filtered.jacobian / size - simulated.jacobian / size)
        assert apart.max() < 1e-2  # a filter's tangent is that of the middle of each step


@pytest.mark.parametrize(("ar", "order"), [((), 0), (AR, 2)], ids=["white", "of order 2"])
def test_how_what_is_left_foretells_itself_is_found(study, ar, order):
    model, trials = nominal_model(study), moved(study)
    problem = LikelihoodProblem(model, trials, stilled(model, trials, first_guess(model, trials)))
    run, rng = problem.innovations(model.parameters(), problem.start_unknowns()), np.random.default_rng(5)
    noise = [lfilter([1.0], [1.0, *(-a for a in ar)], rng.normal(size=len(t) + 500))[500:] for t in trials]
    left = [replace(r, values=e[:, None], variances=np.ones((len(e), 1))) for r, e in zip(run, noise, strict=True)]
    (found,) = autoregressions(left, {"angle_rad": ORDERS}).values()
    assert len(found) >= order
    assert found == pytest.approx((*ar, *[0.0] * (len(found) - order)), abs=0.06)
    white, lasting = (
        [with_noise(one, replace(problem.noise, ar=ar)) for one in left] for ar in ({}, {"angle_rad": found})
    )
    gained = sum(one.cost() for one in white) - sum(one.cost() for one in lasting)
    assert gained > 1000.0 if order else 0.0 <= gained < 10.0


def test_noise_of_much_power_at_low_frequencies_is_white_beside_what_is_found(study):
    """ARMA noise: an autoregression that took 0.3 % of it for white left 2 % more than its innovations."""
    model, trials = nominal_model(study), moved(study)
    problem = LikelihoodProblem(model, trials, stilled(model, trials, first_guess(model, trials)))
    run, rng = problem.innovations(model.parameters(), problem.start_unknowns()), np.random.default_rng(6)
    innovations = [rng.normal(size=len(t)) for t in trials]
    noise = [lfilter([1.0, 0.4], [1.0, -1.3, 0.43], e) for e in innovations]
    left = [replace(r, values=e[:, None], variances=np.ones((len(e), 1))) for r, e in zip(run, noise, strict=True)]
    (found,) = autoregressions(left, {"angle_rad": ORDERS}).values()
    over = sum(float(np.sum(innovations_of(x, found) ** 2)) for x in noise) / sum(float(e @ e) for e in innovations)
    assert over < 1.001


def test_what_noise_foretells_of_itself_is_stored_and_read_back(study, tmp_path):
    model, trials = nominal_model(study), moved(study)
    noise = replace(first_guess(model, trials), ar={"angle_rad": AR})
    fitted = SimpleNamespace(model=model, noise=noise, trials=trials)
    path = tmp_path / "model.toml"
    path.write_text(model_toml(model, stored_tables(fitted, Log())), encoding="utf-8")
    assert load_random(path) == noise
    path.write_text(path.read_text(encoding="utf-8").replace("    1.1,", '    "much",'), encoding="utf-8")
    with pytest.raises(InputError, match=r"random\.ar\.angle_rad.*expected a list of numbers"):
        load_random(path)
