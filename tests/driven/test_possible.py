"""What fits only where a cause ends that can be is no answer, however well it fits."""

from dataclasses import replace

import numpy as np
import pytest
from driven_rigs.draw import BASES, draw

from fes_pin.data.study import read_study
from fes_pin.identify.fit import fit_problem
from fes_pin.identify.likelihood import LikelihoodProblem
from fes_pin.identify.problem import answered_columns, measured_columns
from fes_pin.identify.process_noise import first_guess
from fes_pin.models.effects import Backlash, CoulombFriction, EffortGain, SensorGain, SensorLag
from fes_pin.models.nominal import nominal_model
from fes_pin.search.likelihood_fits import LikelihoodFits
from fes_pin.search.possible import are_possible, is_possible

KNEE = next(k for k in range(99) if BASES[np.random.default_rng(k).integers(len(BASES))].name == "knee")
GAIN, FRICTION = ("sensor_gain",), ("coulomb_friction",)


def in_another_unit(folder, scale):
    """A joint under gravity without a hidden cause, whose encoder is read in turns of a third, as it were."""
    study = read_study(draw((), 0.3, KNEE, folder).study)
    return replace(study, trials=tuple(t.with_columns(position=scale * t["position"]) for t in study.trials))


def test_another_unit_is_no_gain(tmp_path):
    study = in_another_unit(tmp_path, 0.3)
    sets = LikelihoodFits(nominal_model(study), study.trials, [SensorGain, CoulombFriction])
    nominal = sets.nominal()
    sets.extend(())
    gain = sets.fits[GAIN]
    assert gain.model.effects[0].error == -0.5 and not sets.is_possible(gain)
    assert nominal.criterion - gain.criterion > 30.0
    assert gain.criterion < sets.fits[FRICTION].criterion
    assert sets.ranked(1) == [FRICTION, GAIN]


def test_a_gain_that_is_small_is_possible(tmp_path):
    study = in_another_unit(tmp_path, 1.0)
    sets = LikelihoodFits(nominal_model(study), study.trials, [SensorGain, CoulombFriction])
    sets.nominal()
    sets.extend(())
    assert all(sets.is_possible(f) for f in sets.fits.values())


@pytest.mark.parametrize(("half_width", "possible"), [(0.4, False), (0.6, True), (0.0, True)])
def test_a_play_of_less_than_a_count_is_the_counts(half_width, possible, tmp_path):
    """An encoder that stands between two counts reads as a play does that is as wide."""
    count = 0.01
    study = in_another_unit(tmp_path, 1.0)
    trials = [t.with_columns(position=count * np.round(t["position"] / count)) for t in study.trials]
    model = nominal_model(study) + Backlash(half_width=half_width * count)
    problem = LikelihoodProblem(model, trials, first_guess(model, trials), free=("damping",))
    fitted = fit_problem(problem, model.parameters())
    assert is_possible(fitted, answered_columns(model, trials)) == possible


@pytest.mark.parametrize(("rows", "possible"), [(0.4, False), (0.6, True), (0.0, True)])
def test_a_lag_of_less_than_half_a_row_is_the_logs(rows, possible, tmp_path):
    """When in its row an effort answers the reading no log says; an effort that answers nothing is when it is."""
    study = in_another_unit(tmp_path, 1.0)
    model = nominal_model(study) + SensorLag(lag_s=rows * study.trials[0].dt)
    problem = LikelihoodProblem(model, study.trials, first_guess(model, study.trials), free=("damping",))
    fitted = fit_problem(problem, model.parameters())
    assert is_possible(fitted, answered_columns(model, study.trials)) == possible
    assert is_possible(fitted, measured_columns(model, study.trials))


@pytest.mark.parametrize(
    ("error", "possible"), [(-0.95, False), (-1.05, False), (-0.8, True), (-2.0, True), (0.3, True)]
)
def test_an_effort_that_hardly_acts_is_no_cause(error, possible):
    """Something else moves such a joint; an effort of the wrong sign is one that acts."""
    assert are_possible([EffortGain(error=error)], (), {}) is possible
