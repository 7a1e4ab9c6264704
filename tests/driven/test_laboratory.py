"""The second generator of driven rigs: its nominal rigs are the engine's, and what it hides acts as it says."""

import numpy as np
import pytest
from driven_rigs.laboratory import CAUSES, draw_laboratory

from fes_pin.data.study import read_study
from fes_pin.models.nominal import nominal_model
from fes_pin.search.likelihood_fits import LikelihoodFits

SEED = 1600003
"""Of any rig."""


@pytest.mark.parametrize("cause", CAUSES)
def test_what_is_hidden_changes_what_is_read(cause, tmp_path):
    plain, other = (read_study(draw_laboratory(c, SEED, tmp_path / str(c)).study) for c in ((), (cause,)))
    moved = plain.trials[0]["position"] - other.trials[0]["position"]
    assert np.abs(moved).max() > 10.0 * np.std(np.diff(plain.trials[0]["position"], 2))


@pytest.mark.parametrize("seed", [SEED, SEED + 1])
def test_without_a_cause_the_rig_is_the_engines(seed, tmp_path):
    drawn = draw_laboratory((), seed, tmp_path)
    study = read_study(drawn.study)
    found = LikelihoodFits(nominal_model(study), study.trials, []).nominal()
    for name in ("inertia_scale", "damping"):
        assert found.values[name] == pytest.approx(drawn.truth[name], abs=4.0 * found.std(name))


def test_a_seed_makes_the_same_study_again(tmp_path):
    one, other = (read_study(draw_laboratory(CAUSES[:1], SEED, tmp_path / n).study) for n in "ab")
    assert all(
        np.array_equal(a["position"], b["position"]) and np.array_equal(a["effort"], b["effort"])
        for a, b in zip(one.trials, other.trials, strict=True)
    )
