"""A value at its bound says so wherever it is shown, with a one-sided interval and never a deviation of 0."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from view.reported import ankle_diagnosis, ankle_study, measured

import fes_pin as fp
from fes_pin.diagnosis.decide.rivals import estimates
from fes_pin.diagnosis.reported import words_of_bounds
from fes_pin.infer.result import Change, Gain, ParameterEstimate
from fes_pin.infer.verdict import Rejected
from fes_pin.models.nominal import nominal_model
from fes_pin.view.report import report_html
from fes_pin.view.sections import value_and_interval

AT_ITS_BOUND = ParameterEstimate(0.0, math.nan, "N m", True, (0.0, 0.0123))


@pytest.fixture(scope="module")
def diagnosis():
    """A diagnosis that names friction whose torque is at its bound, 0."""
    found = ankle_diagnosis()
    key = "coulomb_friction.torque_nm"
    extended = replace(found.extended, at_bound=(key,))
    cause = replace(found.causes[0], parameters={**found.causes[0].parameters, "torque_nm": AT_ITS_BOUND})
    return replace(found, extended=extended, causes=(cause,))


def test_the_text_says_so(diagnosis):
    assert str(AT_ITS_BOUND) == "0 N m (at its bound, at most 0.0123)"
    assert str(replace(AT_ITS_BOUND, value=9.0, ends=(4.5, 9.0))) == "9 N m (at its bound, at least 4.5)"
    assert str(replace(AT_ITS_BOUND, ends=(0.0, math.inf))) == "0 N m (at its bound, not identified)"
    assert "torque 0 N m (at its bound, at most 0.0123)" in str(diagnosis)
    assert "at its bound" in diagnosis._repr_html_()


def test_the_frame_says_so(diagnosis):
    pytest.importorskip("pandas")
    (row,) = diagnosis.to_frame().query("parameter == 'torque_nm'").to_dict("records")
    assert row["at_bound"] and np.isnan(row["std"]) and (row["low"], row["high"]) == (0.0, 0.0123)


def test_the_record_says_so(diagnosis, tmp_path):
    known = {"value": 0.0, "std": None, "at_bound": True, "low": 0.0, "high": 0.0123}
    assert diagnosis.record()["causes"][0]["parameters"]["torque_nm"] == known
    extended = diagnosis.record()["extended"]["parameters"]
    assert extended["coulomb_friction.torque_nm"]["at_bound"] and extended["coulomb_friction.torque_nm"]["std"] is None
    gain = extended["gain"]
    assert set(gain) == {"value", "std", "low", "high"} and gain["std"] > 0.0
    assert gain["low"] < gain["value"] < gain["high"]
    fp.save_result(diagnosis, tmp_path / "d.json")
    assert fp.load_result(tmp_path / "d.json").causes[0]["parameters"]["torque_nm"]["at_bound"] is True


def test_the_report_says_so(diagnosis):
    page = report_html(diagnosis)
    assert "at most 0.0123, at its bound" in page and "torque 0 N m (at its bound, at most 0.0123)." in page


def test_a_change_says_so():
    one = {"before": AT_ITS_BOUND, "after": ParameterEstimate(0.05, 0.002, "N m")}
    change = Change(
        name="coulomb_friction",
        kind="effect",
        group="after",
        words="new",
        parameters={"torque_nm": one},
        equivalents=(),
        p_value=1e-9,
    )
    assert "before 0 N m (at its bound, at most 0.0123)" in change.row()[2]
    assert change.record()["parameters"]["torque_nm"]["before"]["at_bound"]
    (row, *_) = [value_and_interval(one) for _, one in change.estimates()]
    assert row == ("0", "N m", "at most 0.0123, at its bound")


def test_friction_that_is_not_there_is_fitted_at_its_bound_or_with_a_deviation():
    """Noise pushes the fit to either side of the bound, half of the time each."""
    at_bound = 0
    for seed in range(8):
        study = measured(ankle_study(), (), seed=seed)
        fitted = fp.fit(nominal_model(study) + fp.effects.CoulombFriction(torque_nm=0.01), study.trials)
        one = estimates(fitted, "coulomb_friction")["torque_nm"]
        assert one.at_bound == ("coulomb_friction.torque_nm" in fitted.at_bound)
        assert one.std > 0.0 or (one.at_bound and math.isnan(one.std))
        assert one.interval == fitted.interval("coulomb_friction.torque_nm")
        at_bound += one.at_bound
    assert at_bound


@pytest.mark.parametrize(("value", "said"), [(10.0, 1), (0.0, 0)])
def test_a_cause_that_a_bound_keeps_from_being_named_is_said(value, said):
    """A bound of 0, as of a damping, keeps none from it."""
    fitted = SimpleNamespace(values={"gravity_scale": value}, at_bound=("gravity_scale",))
    believed = SimpleNamespace(parameters=lambda: {"gravity_scale": 1.0})
    rejected = {"parallel_stiffness": Rejected(1e-172, 1.0, Gain(99.8, 99.6, 99.9), "drop_of_no_model")}
    found = words_of_bounds(rejected, fitted, believed)
    assert len(found) == said and all("parallel_stiffness explains 99.8 %" in one for one in found)
    assert all("gravity_scale = 10 ends at a bound" in one for one in found)
