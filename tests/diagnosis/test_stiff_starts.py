"""A damping that is believed far too large: a time constant of a tenth of an integration step ends no fit."""

from dataclasses import replace

import pytest
from diagnosis.hidden import diagnosed, study_of

from fes_pin.diagnosis.diagnosis import diagnose_joint


@pytest.mark.parametrize("times", [30.0, 1000.0])
def test_an_ankle_with_a_far_larger_damping_has_the_same_answer(times):
    study = study_of("ankle", ("base_tilt",))
    far = replace(study, start={**study.start, "damping_nms": times * study.start["damping_nms"]})
    near, found = diagnosed("ankle", ("base_tilt",)), diagnose_joint(far)
    assert found.verdict == near.verdict == "causes_found"
    assert [c.name for c in found.causes] == [c.name for c in near.causes] == ["base_tilt"]
    for name in near.extended.free:
        moved = found.extended.values[name] - near.extended.values[name]
        assert abs(moved) <= 0.3 * near.extended.std(name)
