"""A rig that a controller drives, recorded for longer than a search needs."""

import pytest
from driven_rigs.draw import draw

from fes_pin.data.study import read_study
from fes_pin.diagnosis.diagnosis import diagnose_joint
from fes_pin.prepare import long_records


@pytest.mark.parametrize("seed", [1152000, 1152001, 1152002])
def test_nothing_is_named_in_every_second_sample(monkeypatch, tmp_path, seed):
    """Of 132 000 samples, averaged about the middle of their steps, a rig that lacked nothing answered 1 ms early."""
    monkeypatch.setattr(long_records, "MOST_DRIVEN", 1000)
    study = read_study(draw((), 0.3, seed, tmp_path, recorded=True).study)
    diagnosis = diagnose_joint(study)
    assert diagnosis.verdict == "adequate", str(diagnosis)
    assert any("they were thinned to" in said for said in diagnosis.warnings)
