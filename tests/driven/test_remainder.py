"""What is left beside a play that was found: slopes of the filter promise what its likelihood does not keep."""

import pytest
from driven_rigs.draw import draw

from fes_pin.data.study import read_study
from fes_pin.diagnose.diagnosis import diagnose_joint
from fes_pin.diagnose.remainder import driven


class Promised(driven._Featured):
    """Features that count as slopes promise them."""

    def __init__(self, fitted):
        super().__init__(fitted)
        self.can_keep = False


@pytest.mark.rounding
def test_a_promise_counts_as_far_as_the_likelihood_keeps_it(tmp_path, monkeypatch):
    """A rig of `scripts/driven --count 60 --seed 1118000 --recorded` where something was "left"."""
    study = read_study(draw(("backlash",), 0.3, 1118025, tmp_path, recorded=True).study)
    found = diagnose_joint(study)
    fitted = found.extended
    assert [e.name for e in fitted.model.effects] == ["backlash"]
    assert not found.remainder.unexplained
    assert not driven.driven_remainder(fitted).unexplained
    monkeypatch.setattr(driven, "_Featured", Promised)
    assert driven.driven_remainder(fitted).unexplained
