"""Sentences on a walk say what their numbers do."""

import json
import math
from dataclasses import replace
from types import SimpleNamespace

import pytest

import fes_pin as fp
from fes_pin.infer.result import Remainder
from fes_pin.walk.judge import StrideErrors
from fes_pin.walk.models import WalkFit
from fes_pin.walk.verdict import WalkVerdict

pytestmark = pytest.mark.shared


@pytest.fixture(scope="module")
def diagnosed(gait, tmp_path_factory):
    """Return a function of the number of strides: diagnosis of a walk with a right plate that reads 8 % too much."""
    from walks.synthetic import Wrong, make

    def found(strides):
        folder = tmp_path_factory.mktemp("walk")
        make(gait, folder, Wrong("plate_gain", "right", 0.08, strides=strides, tissue=0.3), 3)
        return fp.diagnose(fp.read_study(folder))

    return found


def test_of_a_single_stride_nothing_is_said_of_strides(diagnosed):
    one, many = diagnosed(1), diagnosed(3)
    assert one.models.designs.strides.count == 1 and one.causes[0].name == "plate_gain"
    notes = dict(one.notes())
    assert not any("stride" in f"{topic} {words}" for topic, words in notes.items() if topic != "warning")
    assert "marker noise" in notes["lack of fit"]
    assert notes["judged by twice the log-likelihood, on what was fitted"].startswith("plate_gain")
    assert math.isnan(one.ceiling_percent) and json.loads(one.to_json())["ceiling_percent"] is None
    assert "noise alone" not in one.headline()
    notes = dict(many.notes())
    assert many.ceiling_percent > 0.0 and "noise from stride to stride alone" in notes
    assert "in every stride" in notes["lack of fit"]


def test_no_cause_removes_more_than_all(diagnosed):
    """A smaller set may err more than the nominal model; what a cause adds to it is still no more than all."""
    found = diagnosed(2)
    best = found.best
    worse = WalkFit(best.names, replace(best.fitted, values=-3.0 * best.fitted.values), best.criterion)
    errors = StrideErrors(found.models)
    squares = [errors.errors(one, False).squares.sum() for one in (found.models.nominal(), worse, best)]
    assert squares[1] > 2.0 * squares[0] > squares[2]
    gain = errors.gain(worse, best, False)
    assert 0.0 < gain.percent <= 100.0 and gain.low <= gain.percent <= gain.high <= 100.0


def test_a_cause_that_was_rejected_is_no_residual_that_repeats(diagnosed):
    """Once "a residual repeats in every stride (p = 0.4)": the test of the residual finds none."""
    none, seen = Remainder(False, 0.4, None), Remainder(True, 1e-9, "vertical force, mean")
    rejected = {"plate_gain@both plates": None}
    said = [
        WalkVerdict.lack_of_fit(None, SimpleNamespace(weighed=SimpleNamespace(lack_of_fit=left), rejected=some))
        for left, some in ((none, {}), (none, rejected), (seen, rejected))
    ]
    assert said[0] == none and said[2] == seen
    assert said[1].unexplained and said[1].reason == "strides held out reject plate_gain@both plates"
    words = dict(replace(diagnosed(2), remainder=said[1], reason=said[1].reason, causes=()).notes())["lack of fit"]
    assert words == "none repeats in every stride (p = 0.4)"


def test_a_cause_at_two_sites_is_lacked_once(diagnosed):
    found = diagnosed(2)
    (first,) = found.causes
    other = replace(first, site="left plate")
    assert replace(found, causes=(first, other)).title().startswith("the walking model lacks plate gain")
    assert "plate gain and plate gain" not in replace(found, causes=(first, other)).title()
