"""One gain: what is printed, drawn and saved of it says against what, on what and by which measure, with its errors."""

import json
import re
from dataclasses import replace

import pytest
from view.reported import ankle_diagnosis
from view.test_report import diagnosis_of

from fes_pin.diagnosis.errors_ahead import Ahead, AheadErrors
from fes_pin.infer.held_out import is_supported
from fes_pin.infer.result import CROSS_VALIDATED, FITTED, STOPPED, Cause, Evidence, Explained, Gain, ParameterEstimate
from fes_pin.view.report import report_html


def cause(**given):
    named = {"name": "external_force", "stage": "body", "site": "trunk, up", "equivalents": (), "p_value": 1e-9}
    size = {"up_n": ParameterEstimate(-42.0, 1.3, "N")}
    gains = {"gain_fit": 0.0, "gain_held_out": Gain(-0.003, -0.01, 0.004)}
    return Cause(parameters=size, **named, **(gains | given))


def test_a_gain_is_measured_against_a_constant_the_nominal_model_and_the_noise():
    found = Explained("predictions 0.3 s ahead", CROSS_VALIDATED, 5.9, 4.3, 4.5)
    gains = found.record()["gain_percent"]
    assert gains["constant"] == pytest.approx(95.7)
    assert gains["nominal"] == pytest.approx(100.0 * 1.6 / 5.9, rel=1e-5)
    assert gains["above_noise"] == 100.0


def test_a_gain_is_one_share_with_the_errors_that_it_is_of():
    """A sentence with a second share, of another reference, was read as a contradiction."""
    words = str(Explained("predictions 0.3 s ahead", CROSS_VALIDATED, 5.9, 4.3, 4.5))
    share, errors = words.split(": ")
    assert share == "100 % of the squared error above the noise of predictions 0.3 s ahead"
    assert errors == "E 5.9 % -> 4.3 %, cross-validated; noise alone leaves 4.5 %"
    assert str(Explained("free simulations", FITTED, 5.0, 4.0)).startswith("20 % of the squared error of free sim")


def shares(text):
    """What a headline says is explained: percent, of what, on what."""
    return re.search(r"explains (-?\d+) % of the squared error above the noise of (.*?): E .*?, (.*?);", text).groups()


def test_an_error_that_grows_is_explained_by_none():
    words = str(Explained("free simulations", FITTED, 0.030, 0.042, 0.001))
    said = "none of the squared error above the noise of free simulations: E 0.03 % -> 0.042 %"
    assert words.startswith(said), words


def test_one_cause_by_two_measures_says_which(tmp_path):
    """Once a study said "explains 56 %" and "explains 2 %" of one cause and its values, depending on the limit."""
    found = replace(diagnosis_of(tmp_path, 310.0), nominal_error=(100.0, None), extended_error=(44.0, None))
    ahead = AheadErrors(0.3, Ahead(0.1, 5.0, 100.0, 1.0), Ahead(0.1, 4.9, 44.0, 1.0), None, None)
    by_likelihood = replace(found, ahead=ahead, held_out_by=FITTED)
    free = ankle_diagnosis()
    stopped = replace(free, verdict="stopped", nominal_error=(100.0, None), extended_error=(44.0, None))
    for one, said in (
        (by_likelihood, ("2", "predictions 0.3 s ahead", "on what was fitted")),
        (stopped, ("57", "free simulations", "on what was fitted, as the search was stopped")),
    ):
        assert shares(one.headline()) == said
        record = json.loads(one.to_json())["explained"]
        assert record["gain_percent"]["above_noise"] == pytest.approx(float(said[0]), abs=0.5)
        assert record["measure"] == f"squared error of {said[1]}"
        assert record["on"] == (STOPPED if one is stopped else FITTED)
        assert str(one.explained).replace("->", "\N{RIGHTWARDS ARROW}") in report_html(one)


def test_a_cause_is_named_by_a_measure_that_is_stated():
    """Once an external force was named with a gain of -0.003 %, and it was not told by what it was judged."""
    named = cause(evidence=Evidence(60.0, 60.0))
    assert is_supported(named.evidence, named.gain_held_out, alone=True)
    assert named.judged.low > 0.0
    assert named.record()["judged_by"]["measure"] == "twice the log-likelihood"
    assert named.record()["judged_by"]["low"] == pytest.approx(60.0 - 2.0 * 1.959964 * 60.0**0.5, rel=1e-5)
    found = replace(ankle_diagnosis(), causes=(named,))
    assert "judged by twice the log-likelihood, cross-validated: external_force 60 [30, 90]" in str(found)


def test_no_cause_is_named_by_errors_that_do_not_fall():
    by_errors = cause()
    assert by_errors.judged is by_errors.gain_held_out
    assert not is_supported(None, by_errors.gain_held_out, alone=True)


def test_what_is_fitted_alone_is_no_held_out_gain():
    held, fitted = cause(), cause(gain_held_out=Gain(50.0, 40.0, 60.0, on=FITTED))
    assert held.record()["gain_percent"]["held_out"] == -0.003
    assert fitted.record()["gain_percent"]["held_out"] is None
    assert fitted.record()["judged_by"]["on"] == "fitted"
    assert replace(ankle_diagnosis(), causes=(fitted,)).head()[3] == "lost without it, fitted"


def test_a_driven_rig_is_judged_over_the_horizon_and_another_by_free_simulations(tmp_path):
    assert diagnosis_of(tmp_path, 310.0).explained.what == "predictions 0.3 s ahead"
    assert ankle_diagnosis().explained.what == "free simulations"
