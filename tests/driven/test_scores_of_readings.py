"""Scores of causes of a reading in a set of other causes."""

import numpy as np
from driven_rigs.draw import draw

import fes_pin as fp
from fes_pin.models.effects.quadratic_damping import QuadraticDamping
from fes_pin.models.effects.sensor_gain import SensorGain
from fes_pin.models.nominal import nominal_model
from fes_pin.search.likelihood_fits import LikelihoodFits


def test_the_score_of_a_reading_includes_the_torques_that_change_with_it(tmp_path):
    """Next to drag, a gain of the reading gains nothing. Without drag in its derivative its score was 132."""
    study = fp.read_study(draw(("quadratic_damping",), 0.3, 20350002, tmp_path).study)
    sets = LikelihoodFits(nominal_model(study), study.trials, [QuadraticDamping, SensorGain])
    sets.nominal()
    sets.extend(())
    drag, both = ("quadratic_damping",), ("quadratic_damping", "sensor_gain")
    score = max(s.gain for s in sets.library.scores(sets.fits[drag]).scored)
    sets.extend(drag)
    gained = sets.fits[drag].sse - sets.fits[both].sse
    assert np.isfinite(score) and score < gained + 10.0
