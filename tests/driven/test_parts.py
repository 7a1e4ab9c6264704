"""A few long trials are searched in parts, which foretell each other."""

from dataclasses import replace

import numpy as np
import pytest
from driven_rigs.draw import draw
from models.cases import RIGS

from fes_pin.data.study import read_study
from fes_pin.data.trial import Trial
from fes_pin.diagnosis.diagnosis import diagnose_joint
from fes_pin.diagnosis.logged import comparable
from fes_pin.infer.corrected import lead_of
from fes_pin.infer.result import CROSS_VALIDATED
from fes_pin.models.nominal import nominal_model
from fes_pin.prepare.long_records import SHORTEST_S, in_parts
from fes_pin.search.likelihood_fits import LikelihoodFits

DT = 0.01


def trial(seconds: float, name: str = "t", kind: str = "motion", conditions=()) -> Trial:
    time = DT * np.arange(round(seconds / DT))
    columns = {"effort": np.sin(time), "position": np.cos(time)}
    return Trial(name, kind, columns, time, dict(conditions))


@pytest.mark.parametrize(
    ("seconds", "parts"),
    [([65.0], 4), ([25.0, 20.0], 4), ([25.0, 4.0], 3), ([25.0] * 3, 3), ([2.1 * SHORTEST_S], 2), ([2.7], 1)],
    ids=str,
)
def test_as_many_parts_as_run_side_by_side_none_too_short(seconds, parts):
    trials = [trial(s, f"t{k}") for k, s in enumerate(seconds)]
    found = in_parts(RIGS["joint"], trials)
    assert len(found) == parts
    assert len({t.name for t in found}) == parts
    assert sum(map(len, found)) == sum(map(len, trials))
    assert np.array_equal(np.concatenate([t.time for t in found]), np.concatenate([t.time for t in trials]))


def test_what_is_stated_of_the_start_is_said_of_the_first_part_alone():
    first, *others = in_parts(RIGS["joint"], [trial(20.0, conditions={"position0": 1.0, "load_kg": 2.0})])
    assert first.conditions == {"position0": 1.0, "load_kg": 2.0}
    assert all(t.conditions == {"load_kg": 2.0} for t in others)


def test_a_trial_that_no_controller_answers_is_not_cut():
    whole = trial(20.0)
    assert in_parts(RIGS["joint"], [whole], answered=False) == [whole]


def test_a_rig_that_begins_at_rest_is_not_cut():
    whole = trial(20.0, kind="isometric")
    assert in_parts(RIGS["muscle"], [whole]) == [whole]


def test_answers_of_a_whole_trial_and_of_its_parts_are_compared_in_parts(tmp_path):
    """No controller may answer in a corrected record: its trial is whole then, and that of the record in four parts."""
    study = read_study(draw((), 0.3, 33, tmp_path).study)
    longest, nominal = max(study.trials, key=len), nominal_model(study)
    parts = in_parts(nominal.rig, [longest])
    whole, cut = (LikelihoodFits(nominal, trials, ()).nominal() for trials in ([longest], parts))
    assert len(whole.parts) == 1 < len(cut.parts)
    for pair in (comparable(whole, cut), comparable(cut, whole)):
        assert [[len(p.residual) for p in one.parts] for one in pair] == [[len(p.residual) for p in cut.parts]] * 2
        lead, least = lead_of(*pair)
        assert abs(lead) < least


def test_a_single_trial_bears_out_its_cause(tmp_path):
    """Of one trial nothing had been held out."""
    study = read_study(draw(("effort_offset",), 0.3, 33, tmp_path, recorded=True).study)
    longest = max(study.trials, key=len)
    assert longest.duration > 2.0 * SHORTEST_S
    found = diagnose_joint(replace(study, trials=(longest,)))
    assert [c.name for c in found.causes] == ["effort_offset"], str(found)
    assert found.held_out_by == CROSS_VALIDATED
    assert found.causes[0].evidence.low > 0.0
    assert [t.name for t in found.study.trials] == [longest.name]


def test_a_part_that_begins_in_motion_is_read_late_from_its_first_sample(tmp_path):
    """What is slow to follow had been at rest where a part began: its error there hid the lag."""
    study = read_study(draw(("sensor_lag",), 0.3, 33, tmp_path, recorded=True).study)
    longest = max(study.trials, key=len)
    assert longest.duration > 2.0 * SHORTEST_S
    found = diagnose_joint(replace(study, trials=(longest,)))
    assert [c.name for c in found.causes] == ["sensor_lag"], str(found)
