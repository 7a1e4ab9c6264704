"""A contrast that is stopped says so as its verdict, keeps the best set so far, and claims nothing else."""

import json

import pytest
from contrast_pairs.free import free_pair

import fes_pin as fp
from fes_pin.infer.search import Search
from fes_pin.view.report import report_html
from fes_pin.workers import OutOfTime


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    return free_pair("muscle", ("gain",), 80.0, 9, tmp_path_factory.mktemp("pair"))


def test_without_time_nothing_is_claimed(study, tmp_path):
    found = fp.contrast(study, limit=0.0)
    assert found.verdict == "stopped" and not found.changes
    assert not found.unchanged and not found.excluded
    assert "stopped: best set so far: nothing changed" in str(found)
    fp.report(found, tmp_path / "report.html")
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "Stopped: best set so far" in page and page.startswith(report_html(found))
    assert json.loads(found.to_json())["verdict"] == "stopped"
    assert any("limit of 0 s" in words for words in found.warnings)


def test_a_change_that_was_found_in_time_is_kept(study, monkeypatch):
    def out_of_time(search, names):
        raise OutOfTime

    monkeypatch.setattr(Search, "settle", out_of_time)
    found = fp.contrast(study, limit=1e3)
    assert found.verdict == "stopped" and [c.name for c in found.changes] == ["gain"]
    assert "stopped: best set so far: gain in " in str(found)
