"""How long the noise of a reading lasts: nothing of it where each sample has its own, whatever the model misses."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from driven_rigs.draw import draw
from scipy.ndimage import uniform_filter1d
from scipy.signal import lfilter

from fes_pin.data.log import Log
from fes_pin.data.smooth import low_pass
from fes_pin.data.study import read_study
from fes_pin.data.trial import Trial
from fes_pin.identify.correlation_time import FEWEST, with_new_noise
from fes_pin.identify.process_noise import first_guess
from fes_pin.identify.stored import load_random, stored_tables
from fes_pin.models.model import Model
from fes_pin.models.nominal import nominal_model
from fes_pin.models.predictor import StateSpaceNoise, are_news
from fes_pin.models.rigs.joint import Joint
from fes_pin.models.store import model_toml
from fes_pin.search.likelihood_fits import LikelihoodFits


def nominal(study, made=lambda column: column):
    trials = [t.with_columns(**{n: made(v) for n, v in t.columns.items()}) for t in study.trials]
    return LikelihoodFits(nominal_model(study), trials, []).nominal()


CAUSES = ["coulomb_friction", "backlash", "cogging", "sensor_lag", "quadratic_damping", "joint_stop"]


@pytest.mark.parametrize("causes", [(), *((c,) for c in CAUSES)], ids=str)
def test_noise_of_every_sample_is_its_own_whatever_the_model_misses(causes, tmp_path):
    study = read_study(draw(causes, 0.3, 21, tmp_path, recorded=True).study)
    assert nominal(study).noise.correlation_s == 0.0


@pytest.mark.parametrize(
    ("made", "least", "most"),
    [
        (lambda x: uniform_filter1d(x, 5), 4, 8),
        (lambda x: uniform_filter1d(x, 11), 8, 16),
        (lambda x: low_pass(x, 0.002, 40.0), 4, 16),
        (lambda x: low_pass(x, 0.002, 15.0), 16, 64),
    ],
    ids=["5 samples", "11 samples", "40 Hz", "15 Hz"],
)
def test_noise_that_was_averaged_lasts_and_is_no_motion(made, least, most, tmp_path):
    """The random effort is told as it was, and inertia; with every sample as a reading they are far from it."""
    drawn = draw((), 0.3, 22, tmp_path)
    study = read_study(drawn.study)
    recorded, found = nominal(study), nominal(study, made)
    assert least <= found.noise.correlation_s / study.trials[0].dt <= most
    assert found.values["inertia_scale"] == pytest.approx(1.0, abs=0.02)
    size, now = (f.noise.std["effort"] * np.sqrt(f.noise.time["effort"]) for f in (recorded, found))
    assert now == pytest.approx(size, rel=0.35)


def test_readings_that_count_are_apart_and_off_the_ends(tmp_path):
    trial = read_study(draw((), 0.3, 22, tmp_path).study).trials[0].first(101)
    assert are_news(trial, 0.0).all()
    assert list(np.flatnonzero(are_news(trial, 10 * trial.dt))) == [20, 30, 40, 50, 60, 70, 80]


def test_it_is_kept_with_a_model(tmp_path):
    study = read_study(draw((), 0.3, 22, tmp_path).study)
    found = nominal(study, lambda x: uniform_filter1d(x, 5))
    (tmp_path / "model.toml").write_text(model_toml(found.model, stored_tables(found, Log())))
    assert load_random(tmp_path / "model.toml").correlation_s == pytest.approx(found.noise.correlation_s, rel=1e-5)


@pytest.mark.parametrize("correlation_s", [0.0, 0.008])
def test_what_is_random_is_kept_with_a_model(correlation_s, tmp_path):
    """Noise that is new in every sample is written in no key."""
    study = read_study(draw((), 0.3, 22, tmp_path).study)
    model = nominal_model(study)
    noise = replace(first_guess(model, study.trials), correlation_s=correlation_s)
    path = tmp_path / "model.toml"
    path.write_text(model_toml(model, stored_tables(SimpleNamespace(noise=noise, trials=()), Log())))
    assert load_random(path) == noise
    assert ("correlation_s" in path.read_text()) == bool(correlation_s)


def test_a_model_with_the_old_name_of_the_correlation_time_is_read_and_says_so(tmp_path):
    noise = StateSpaceNoise({"position": 2e-3}, {"effort": 0.8}, {"effort": 0.12}, 0.008)
    path = tmp_path / "model.toml"
    rig = Joint(constants={"inertia": 0.05, "gravity_cos": 0.0, "gravity_sin": 1.0, "revolute": 1.0})
    written = model_toml(Model(rig), stored_tables(SimpleNamespace(noise=noise, trials=()), Log()))
    path.write_text(written.replace("correlation_s = ", "lasts_s = "))
    with pytest.warns(DeprecationWarning, match="lasts_s"):
        assert load_random(path) == noise
    with pytest.warns(DeprecationWarning, match="correlation_s now"):
        assert noise.lasts_s == 0.008


def test_where_noise_is_nowhere_new_innovations_have_least_in_common():
    """Fits whose innovations are correlated by as much as is given for each distance of readings."""
    rng, dt, n = np.random.default_rng(5), 0.01, 60_000
    shared = {0: 0.25, 2: 0.4, 4: 0.15, 8: 0.3}

    def fitted(correlation_s):
        rows = round(correlation_s / dt)
        residual = lfilter([1.0], [1.0, -shared[rows]], rng.standard_normal(n))
        model = SimpleNamespace(rig=SimpleNamespace(unknowns=lambda kind: ("initial_position",)))
        return SimpleNamespace(rows=rows, model=model, parts=[SimpleNamespace(residual=residual)])

    assert with_new_noise([Trial("a", "motion", {}, dt * np.arange(8 * FEWEST))], fitted).rows == 4
