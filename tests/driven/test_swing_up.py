"""The generator of pendulums that are swung up: they come up, stay there, and are the engine's."""

import numpy as np
import pytest
from driven_rigs.swing_up import CAUSES, draw_swing_up

from fes_pin.data.study import read_study
from fes_pin.models.nominal import nominal_model
from fes_pin.search.likelihood_fits import LikelihoodFits

FINE = 1800005
"""A seed of an encoder that tells more than the pendulum's noise hides."""


@pytest.mark.parametrize("causes", [(), *((c,) for c in CAUSES)], ids=str)
def test_it_comes_up_and_is_held(causes, tmp_path):
    for trial in read_study(draw_swing_up(causes, FINE, tmp_path).study).trials:
        top = np.abs(np.mod(trial["position"], 2.0 * np.pi) - np.pi)
        assert top[0] > 2.5
        assert np.median(top) < 0.3


def test_without_a_cause_the_rig_is_the_engines(tmp_path):
    drawn = draw_swing_up((), FINE, tmp_path)
    study = read_study(drawn.study)
    found = LikelihoodFits(nominal_model(study), study.trials, []).nominal()
    for name in ("inertia_scale", "damping"):
        assert found.values[name] == pytest.approx(drawn.truth[name], abs=4.0 * found.std(name))


def test_a_seed_makes_the_same_study_again(tmp_path):
    one, other = (read_study(draw_swing_up(CAUSES[:1], FINE, tmp_path / n).study) for n in "ab")
    assert all(np.array_equal(a["position"], b["position"]) for a, b in zip(one.trials, other.trials, strict=True))
