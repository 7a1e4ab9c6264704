"""Errors on trials that took no part."""

import copy
import gc
from types import SimpleNamespace

import numpy as np
import pytest
from diagnosis.hidden import study_of
from identify.rigs import as_likely

from fes_pin.diagnosis import errors_ahead
from fes_pin.diagnosis.errors_ahead import free_errors
from fes_pin.diagnosis.held_out import folds_that_tell
from fes_pin.infer.held_out import Errors, held_out_gain
from fes_pin.infer.levels import RUNAWAY
from fes_pin.infer.problem import Linearized
from fes_pin.models.effects import effect_named
from fes_pin.models.nominal import nominal_model
from fes_pin.search.fit import fit


def test_a_prediction_that_runs_away_counts_as_a_large_error():
    """A spring too stiff for any step: the joint leaves the floating-point numbers, and the errors stay numbers."""
    study = study_of("joint", driven=False)
    base = fit(nominal_model(study), study.trials)
    falling = effect_named("parallel_stiffness")(stiffness_nm_per_rad=1e8, rest_angle_rad=0.0)
    errors = free_errors(base.model + falling, study.trials, base.noise)
    most = RUNAWAY * max(np.abs(t["position"]).max() for t in study.trials)
    assert np.isfinite(errors.squares).all()
    assert errors.squares.max() > free_errors(base.model, study.trials, base.noise).squares.max()
    assert (errors.squares <= (1.0 + 1e-9) * errors.noise * (most / base.noise["position"].std) ** 2).all()


def test_a_gain_of_units_with_next_to_no_error_is_no_large_number():
    """One second of a trial holds all of the error; draws without it hold noise, of which nothing is a share."""
    rng = np.random.default_rng(3)
    counts = np.full(12, 200.0)
    extended = rng.chisquare(200.0, size=12)
    without = extended + rng.normal(0.0, 5.0, size=12)
    without[4] += 3000.0
    errors = [Errors(squares, 10.0 * counts, counts) for squares in (without, without, extended)]
    found = held_out_gain(*errors, seed=0)
    assert -30.0 < found.low < 100.0 and found.percent > 90.0 and found.high < 130.0
    nothing = held_out_gain(*(Errors(x, 10.0 * counts, counts) for x in (extended, extended + 1.0, extended)), seed=0)
    assert abs(nothing.percent) < 30.0 and max(abs(nothing.low), abs(nothing.high)) < 30.0


def test_predictions_over_a_horizon_are_kept_as_long_as_their_fit(monkeypatch):
    study = study_of("ankle", n_motion=1, duration_s=2.0)
    fitted, made, kept = as_likely(fit(nominal_model(study), study.trials)), [], set(errors_ahead._PREDICTED)
    monkeypatch.setattr(errors_ahead, "_predict", lambda *given: made.append(given[1:]) or ({}, {}))
    for _ in range(2):
        errors_ahead._predicted(fitted, study.trials[0], 0.1)
    errors_ahead._predicted(copy.copy(fitted), study.trials[0], 0.1)  # equal, and another
    assert len(made) == 2
    del fitted
    gc.collect()
    assert set(errors_ahead._PREDICTED) <= kept


@pytest.mark.parametrize(
    ("sizes", "kept"),
    [
        ([1.0, 1.0, 1.0], [[0], [1], [2]]),
        ([1.0, 1.0, 1e-3], [[0], [1]]),  # a trial that tells nothing is no test
        ([1.0, 1e-3], []),  # without the first nothing is identified, and the second tells nothing
        ([1.0, (1.0, 1e-3), 1.0], [[0], [1], [2]]),  # one that tells of half of the parameters is a test
        ([1.0, (1.0, 1e-3, 1e-3), 1.0], [[0], [2]]),  # one that tells of a third is none
        ([1.0, (1.0, 1e-3, 1e-3), (1e-3, 1.0, 1e-3), (1e-3, 1e-3, 1.0)], []),  # the first alone is no scatter
        ([(1.0, 1e-3), (1e-3, 1.0)], []),  # neither identifies both
    ],
)
def test_folds_predict_trials_that_tell_of_the_model_from_trials_that_identify_it(sizes, kept):
    rng = np.random.default_rng(len(sizes))
    free = "abc"[: max(2, *map(np.size, sizes))]
    slopes = [s * rng.standard_normal((80, len(free))) for s in sizes]
    parts = [Linearized(rng.standard_normal(80), slope, np.zeros((80, 0))) for slope in slopes]
    trials = [SimpleNamespace(kind="motion", conditions={}) for _ in sizes]
    fitted = SimpleNamespace(parts=parts, free=tuple(free), at_bound=(), trials=trials)
    assert sorted(folds_that_tell(fitted)) == kept
