"""Pendulums that are held on top before encoders of 4096 counts a turn: counts that stand or hunt are no friction."""

import numpy as np
import pytest
from driven_rigs.swing_up import draw_swing_up

from fes_pin.data.counts import count_of
from fes_pin.data.study import read_study
from fes_pin.diagnosis.diagnosis import diagnose_joint
from fes_pin.diagnosis.likelihood_models import LikelihoodModels, LikelihoodSearch
from fes_pin.identify.correlation_time import words_of_reading
from fes_pin.models import predictor
from fes_pin.models.effects import Cogging, CoulombFriction
from fes_pin.models.nominal import nominal_model

HELD = (1810006, 1810010)
"""Of `scripts/accuracy swing-up --seed 1810000`: those that hide nothing and were told dry friction."""
HUNTING = 2230006
"""That hides nothing, and was told friction."""
MISLED = 2340004
"""That hides cogging, and was told friction."""
STOPPED = 6350039
"""That hides nothing, and was told a stop where it stands: hunts were followed as if every sample were a reading."""
HUMMING = 2270008
"""That hides an offset beside friction, and whose counts are cheapest explained by a hum."""


@pytest.mark.parametrize("seed", [*HELD, HUNTING, STOPPED])
def test_a_count_that_hunts_is_no_friction(seed, tmp_path):
    found = diagnose_joint(read_study(draw_swing_up((), seed, tmp_path).study))
    assert found.verdict == "adequate", str(found)
    assert not any("smoothed or interpolated" in said for said in found.warnings)


@pytest.mark.parametrize("hunting", [False, True])
@pytest.mark.parametrize("seed", HELD)
def test_readings_that_hunt_would_tell_of_friction_that_is_not_there(seed, hunting, tmp_path, monkeypatch):
    """By 36 and 47 in twice the log-likelihood, where they are judged."""
    if hunting:
        monkeypatch.setattr(predictor, "hunts", lambda column: np.zeros(len(column), dtype=bool))
    study = read_study(draw_swing_up((), seed, tmp_path).study)
    sets = LikelihoodModels(nominal_model(study), study.trials, [CoulombFriction])
    none = sets.nominal()
    sets.extend(())
    gained = none.sse - sets.fits["coulomb_friction",].sse
    assert gained > 30.0 if hunting else gained < 4.0


def test_a_count_that_is_read_again_and_again_is_one_reading_of_the_noise(tmp_path):
    """Were each sample one, the noise of rounding, count / sqrt(12), came out a quarter too small."""
    study = read_study(draw_swing_up((), HELD[0], tmp_path).study)
    count = count_of(study.trials[0]["position"])
    sets = LikelihoodModels(nominal_model(study), study.trials, [])
    assert sets.nominal().noise.white["position"] == pytest.approx(count / 12.0**0.5, rel=0.05)


def test_friction_that_is_there_is_found_in_counts(tmp_path):
    study = read_study(draw_swing_up(("coulomb_friction",), HELD[0], tmp_path).study)
    found = diagnose_joint(study)
    assert [c.name for c in found.causes][:1] == ["coulomb_friction"], str(found)


def test_a_hum_of_the_counts_hides_no_offset(tmp_path):
    causes = ("coulomb_friction", "effort_offset")
    found = diagnose_joint(read_study(draw_swing_up(causes, HUMMING, tmp_path).study))
    assert sorted(c.name for c in found.causes) == sorted(causes), str(found)


def test_counts_that_hunt_hide_no_cogging(tmp_path):
    study = read_study(draw_swing_up(("cogging",), MISLED, tmp_path).study)
    sets = LikelihoodModels(nominal_model(study), study.trials, [CoulombFriction, Cogging])
    best = LikelihoodSearch(sets, lambda share, words: None).run().best
    assert [e.name for e in best.model.effects] == ["cogging"]
    assert abs(best.values["inertia_scale"] - 1.0) < 3.0 * best.std("inertia_scale")
    assert best.std("inertia_scale") < 2e-3
    (said,) = words_of_reading(best.noise, best.model.rig, best.trials)
    assert "between two counts" in said
