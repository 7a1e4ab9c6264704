"""A search that is stopped tells the best set so far, and says so."""

import json
import time

import pytest
from diagnosis.hidden import study_of

from fes_pin.diagnosis.diagnosis import diagnose_joint
from fes_pin.diagnosis.likelihood_models import LikelihoodModels
from fes_pin.view.report import report_html
from fes_pin.workers import OutOfTime, check_limit, in_parallel, time_limit


@pytest.fixture(scope="module")
def study():
    return study_of("joint", ("coulomb_friction",), seed=1, n_motion=3, duration_s=3.0)


def test_work_ends_at_its_limit_in_every_thread(monkeypatch):
    monkeypatch.setenv("FES_PIN_THREADS", "2")
    with time_limit(0.0):
        time.sleep(0.01)
        with pytest.raises(OutOfTime):
            in_parallel(lambda _: check_limit(), range(4))
        with time_limit(60.0):
            in_parallel(lambda _: check_limit(), range(4))
    check_limit()


def test_without_time_nothing_is_claimed(study):
    stopped = diagnose_joint(study, limit=0.0)
    assert stopped.verdict == "stopped" and not stopped.causes and stopped.reason is None
    assert "stopped: best set so far" in str(stopped) and "nothing in the library explains it" not in str(stopped)
    assert "Stopped: best set so far" in report_html(stopped)
    assert json.loads(stopped.files()["diagnosis.json"])["verdict"] == "stopped"
    assert any("limit of 0 s" in w for w in stopped.warnings)
    assert report_html(stopped) and stopped.files()


def test_what_has_earned_its_place_is_told(study, monkeypatch):
    """The clock runs out when rivals are about to be fitted."""

    def out_of_time(models, base, name):
        raise OutOfTime

    monkeypatch.setattr(LikelihoodModels, "converge_rivals", out_of_time)
    stopped = diagnose_joint(study, limit=1e3)
    assert [c.name for c in stopped.causes] == ["coulomb_friction"] and stopped.verdict == "stopped"
    assert "stopped: best set so far: the model lacks coulomb friction" in stopped.headline()
    assert any("limit of 1000 s" in w for w in stopped.warnings)
    assert report_html(stopped) and stopped.files()
