"""What is left beside a play that was found: slopes of the filter promise what its likelihood does not keep."""

import pytest
from driven_rigs.draw import draw

from fes_pin.data.study import read_study
from fes_pin.diagnose.remainder import driven
from fes_pin.diagnose.search.likelihood_fits import LikelihoodFits
from fes_pin.models.effects import Backlash
from fes_pin.models.nominal import nominal_model


class Promised(driven._Featured):
    """Features that count as slopes promise them."""

    def __init__(self, fitted):
        super().__init__(fitted)
        self.can_keep = False


@pytest.mark.rounding
def test_a_promise_counts_as_far_as_the_likelihood_keeps_it(tmp_path, monkeypatch):
    """A rig of `scripts/driven --count 60 --seed 1118000 --recorded` where something was "left"."""
    study = read_study(draw(("backlash",), 0.3, 1118025, tmp_path, recorded=True).study)
    sets = LikelihoodFits(nominal_model(study), study.trials, [Backlash])
    sets.nominal()
    sets.extend_all(())
    fitted = sets.fits["backlash",]
    assert not driven.driven_remainder(fitted).unexplained
    monkeypatch.setattr(driven, "_Featured", Promised)
    assert driven.driven_remainder(fitted).unexplained
