"""Groups whose efforts were recorded with noise: it is taken out of all of them, and is no friction in any."""

from dataclasses import replace

import pytest
from driven_rigs.swing_up import draw_swing_up

from fes_pin.contrasts.contrast import contrast
from fes_pin.data.study import read_study

NOISY = 1830006
"""A pendulum whose effort is read with noise of a hundredth of it."""


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    study = read_study(draw_swing_up((), NOISY, tmp_path_factory.mktemp("noisy")).study)
    trials = tuple(replace(t, group=g) for t, g in zip(study.trials, ("before", "after"), strict=True))
    return contrast(replace(study, trials=trials))


def test_nothing_changed_and_nothing_is_common(found):
    assert found.verdict == "nothing_changed", str(found)
    assert found.common == ()


def test_it_is_said(found):
    assert any("recorded with noise" in said for said in found.warnings)
