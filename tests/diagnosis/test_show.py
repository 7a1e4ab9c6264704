"""What results show of themselves: in a notebook, as frames, and without dumping arrays."""

from html.parser import HTMLParser

import numpy as np
import pytest
from view.reported import NASTY, ankle_diagnosis, joint_study

from fes_pin.data.errors import InputError
from fes_pin.data.show import frame, table_html
from fes_pin.models.nominal import nominal_model


def results():
    diagnosis = ankle_diagnosis()
    return [diagnosis.study, diagnosis.model, diagnosis.extended, diagnosis]


class Balanced(HTMLParser):
    def __init__(self, text):
        super().__init__()
        self.open, self.tags, self.words = [], set(), []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.open.append(tag)
        self.tags.add(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.words.append(data)


@pytest.mark.parametrize("one", results(), ids=lambda r: type(r).__name__)
def test_a_result_is_a_line_and_a_table(one):
    assert "\n" not in repr(one) and len(repr(one)) < 600 and "array(" not in repr(one)
    read = Balanced(one._repr_html_())
    assert not read.open and read.tags <= {"div", "p", "strong", "table", "thead", "tbody", "tr", "th", "td"}
    assert len(read.words) > 5


def test_text_of_a_study_cannot_become_markup_in_a_notebook():
    assert "<script" not in ankle_diagnosis().study._repr_html_()
    assert NASTY in "".join(Balanced(ankle_diagnosis()._repr_html_()).words)
    assert table_html("<b>", ("<i>",), [("<u>",)], ["<s>"]).count("&lt;") == 4


def test_frames_hold_what_the_results_say():
    pytest.importorskip("pandas")
    diagnosis = ankle_diagnosis()
    trial, fitted, study = diagnosis.study.trials[0], diagnosis.extended, diagnosis.study
    assert (trial.to_frame()["angle_rad"].to_numpy() == trial["angle_rad"]).all()
    assert (trial.to_frame().index.to_numpy() == trial.time).all()
    table = study.to_frame()
    assert table.loc["held", "angle_rad"] == 1.9 and np.isnan(table.loc["held", "load_kg"])
    parameters = fitted.to_frame()
    assert list(parameters.index) == list(fitted.free)
    assert (parameters["value"].to_numpy() == fitted.to_numpy()).all()
    assert parameters.loc["gain", "std"] == fitted.std("gain")
    assert diagnosis.model.to_frame().loc["coulomb_friction.torque_nm", "unit"] == "N m"
    (row,) = diagnosis.to_frame().query("parameter == 'torque_nm'").to_dict("records")
    assert row["cause"] == "coulomb_friction" and row["gain_percent"] == 79.5


def test_without_pandas_a_frame_says_what_is_missing(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "pandas", None)
    with pytest.raises(InputError, match=r"fes-pin\[pandas\]"):
        frame({"a": [1.0]})


def test_a_model_without_units_shows(tmp_path):
    assert "inertia_scale" in nominal_model(joint_study(tmp_path))._repr_html_()
