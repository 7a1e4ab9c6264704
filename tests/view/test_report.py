import os
import re
import shutil
import subprocess
import tempfile
import time
from functools import cache
from html.parser import HTMLParser

import pytest
from view.reported import NASTY, ankle_diagnosis, ankle_study, diagnosed, joint_study, muscle_study

import fes_pin as fp
from fes_pin.models.describe import equation
from fes_pin.models.effects import effect
from fes_pin.view.report import report_html

VOID = {"meta", "br", "hr", "img", "input", "link"}


class Page(HTMLParser):
    """Checks that every element is closed in order, and keeps what a reader sees."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.seen: list[str] = []
        self.tags: set[str] = set()
        self.words: list[str] = []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attrs):
        self.tags.add(tag)
        self.seen += [v or "" for n, v in attrs if n in ("src", "href", "xlink:href")]
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.tags.add(tag)
        self.seen += [v or "" for n, v in attrs if n in ("src", "href", "xlink:href")]

    def handle_endtag(self, tag):
        assert self.open, f"</{tag}> closes nothing"
        assert self.open.pop() == tag

    def handle_data(self, data):
        if not self.open or self.open[-1] != "style":
            self.words.append(data)

    @property
    def text(self) -> str:
        return " ".join(" ".join(self.words).split())


@cache
def ankle_page() -> str:
    return report_html(ankle_diagnosis())


def checked(diagnosis) -> str:
    """The text of a report, after what holds of all of them was checked."""
    return checked_page(report_html(diagnosis))


def checked_page(page: str) -> str:
    read = Page(page)
    assert not read.open
    assert "script" not in read.tags
    assert all(s.startswith(("#", "data:")) for s in read.seen), "the page asks for something outside itself"
    assert not re.search(r"url\((?!#)|@import", page)
    assert "nan" not in read.text.lower().split()
    return read.text


def test_a_report_says_what_the_diagnosis_found():
    text = checked_page(ankle_page())
    for words in ("coulomb_friction", "One cause explains", "80 % [74, 84]", "quadratic_damping", "sensor_offset"):
        assert words in text
    assert " ".join(equation(effect("coulomb_friction")).split()) in text
    assert "--set load_kg" in text
    assert "next_trial.csv" in text


def test_text_of_the_study_cannot_become_markup():
    page = ankle_page()
    assert "<script" not in page
    assert page.count("&lt;script&gt;") >= 3  # title, heading, the trial's name
    assert NASTY in Page(page).text
    assert "default-src 'none'" in page


def test_a_report_of_an_adequate_model_names_nothing():
    text = checked(diagnosed(ankle_study()))
    assert "adequate" in text and "None is named" in text and "extended model" not in text


def test_a_report_of_something_unexplained_says_where():
    text = checked(diagnosed(muscle_study(), unexplained=True))
    assert "It depends most on rate" in text


def test_a_report_of_three_causes_shows_each():
    names = ("coulomb_friction", "fatigue", "load_error")
    page = report_html(diagnosed(ankle_study(), names, unexplained=True))
    assert page.count("<article") == 3
    assert all(f'class="cause {stage}"' in page for stage in ("joint", "muscle", "rig"))
    assert "verdict causes_found partly" in page


def test_pulses_of_a_muscle_are_drawn():
    checked(diagnosed(muscle_study("stim"), ("fatigue",)))


@pytest.mark.parametrize(("kind", "label"), [("revolute", "angle (rad)"), ("prismatic", "position (m)")])
def test_a_joint_with_velocity_has_the_units_of_its_kind(tmp_path, kind, label):
    text = checked(diagnosed(joint_study(tmp_path, kind), ("coulomb_friction",)))
    assert label in text and "held out" in text
    assert ("angle (rad)" in text) == (kind == "revolute")


def test_a_long_study_keeps_its_page_small_and_quick():
    diagnosis = diagnosed(ankle_study(seconds=100.0, step=0.002), ("fatigue",))
    began = time.process_time()
    page = report_html(diagnosis)
    assert time.process_time() - began < 4.0  # 1 s where nothing else runs
    assert len(page) < 1_000_000


def test_the_same_diagnosis_gives_the_same_page():
    assert report_html(ankle_diagnosis()) == ankle_page()


def test_a_report_is_written_whole(tmp_path, monkeypatch):
    monkeypatch.setattr("fes_pin.view.report.report_html", lambda _diagnosis: ankle_page())
    fp.report(ankle_diagnosis(), tmp_path / "report.html")
    assert (tmp_path / "report.html").read_text(encoding="utf-8").endswith("</html>\n")
    with pytest.raises(fp.InputError):
        fp.report(ankle_diagnosis(), tmp_path / "no folder" / "report.html")


def chromium() -> str:
    """Path of a Chromium or Chrome, or the test is skipped."""
    found = next((p for n in ("chromium", "chromium-browser", "google-chrome") if (p := shutil.which(n))), None)
    if found is None:
        pytest.skip("no chromium or google-chrome on this machine")
    return found


def test_the_page_renders_in_chromium_without_asking_for_anything(tmp_path):
    browser = chromium()
    page = tmp_path / "report.html"
    page.write_text(ankle_page(), encoding="utf-8")
    with tempfile.TemporaryDirectory() as profile:
        flags = (
            "--headless --no-sandbox --disable-gpu --disable-quic --no-first-run --disable-background-networking "
            "--disable-component-update --disable-sync --hide-scrollbars --window-size=390,1200"
        )
        where = [f"--user-data-dir={profile}", f"--screenshot={tmp_path / 'shot.png'}"]
        command = [browser, *flags.split(), *where, page.as_uri()]
        done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False, env=os.environ)
    assert (tmp_path / "shot.png").stat().st_size > 20_000, done.stderr[-500:]
    assert "Refused to" not in done.stderr
