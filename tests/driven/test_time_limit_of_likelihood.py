"""A search by the likelihood that is stopped tells the best set so far, and says so."""

import time

import pytest
from driven_rigs.draw import draw

from fes_pin.data.study import read_study
from fes_pin.diagnosis.diagnosis import diagnose_joint
from fes_pin.identify.likelihood import LikelihoodProblem
from fes_pin.models.nominal import nominal_model
from fes_pin.search.likelihood_fits import LikelihoodFits
from fes_pin.view.report import report_html
from fes_pin.workers import OutOfTime, time_limit


@pytest.fixture
def study(tmp_path):
    return read_study(draw(("coulomb_friction",), 0.3, 1119001, tmp_path).study)


def test_a_fit_ends_at_its_limit(study):
    nominal = LikelihoodFits(nominal_model(study), study.trials, []).nominal()
    problem = LikelihoodProblem(nominal.model, study.trials, nominal.noise)
    with time_limit(0.0):
        time.sleep(0.01)
        for work in (problem.linearize, lambda values, unknowns: problem.costs([(values, unknowns)])):
            with pytest.raises(OutOfTime):
                work(nominal.values, nominal.unknowns)


def test_without_time_nothing_is_claimed(study):
    stopped = diagnose_joint(study, limit=0.0)
    assert stopped.verdict == "stopped" and not stopped.causes
    assert any("limit of 0 s" in w for w in stopped.warnings)
    assert report_html(stopped) and stopped.files()


def test_what_has_earned_its_place_is_told(study, monkeypatch):
    """The clock runs out when pairs are about to be fitted."""
    extend = LikelihoodFits.extend

    def out_of_time(sets, base, most=None):
        if len(base) == 1:
            raise OutOfTime
        extend(sets, base, most)

    monkeypatch.setattr(LikelihoodFits, "extend", out_of_time)
    stopped = diagnose_joint(study, limit=1e3)
    assert [c.name for c in stopped.causes] == ["coulomb_friction"] and stopped.verdict == "stopped"
    assert any("limit of 1000 s" in w for w in stopped.warnings)
    assert report_html(stopped) and stopped.files()
