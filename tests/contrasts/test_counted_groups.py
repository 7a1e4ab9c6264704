"""Groups that are read in counts: how counts stand and hunt where a pendulum is held is no cause of all groups."""

from dataclasses import replace

from driven_rigs.swing_up import draw_swing_up

from fes_pin.contrasts.contrast import contrast
from fes_pin.data.study import read_study


def test_counts_are_no_common_cause(tmp_path):
    """Were readings judged that hunt, they would tell dry friction in both groups."""
    study = read_study(draw_swing_up((), 1810006, tmp_path).study)
    half = len(study.trials) // 2
    trials = tuple(replace(t, group="before" if k < half else "after") for k, t in enumerate(study.trials))
    found = contrast(replace(study, trials=trials))
    assert found.verdict == "nothing_changed", str(found)
    assert found.common == ()
