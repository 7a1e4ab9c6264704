import base64
import csv
import hashlib
import html
import io
import os
import re
import shutil
import subprocess
import tempfile
import time
from dataclasses import replace
from functools import cache
from html.parser import HTMLParser
from types import SimpleNamespace
from urllib.parse import unquote

import pytest
from identify.rigs import as_likely
from view.reported import NASTY, ankle_diagnosis, ankle_study, diagnosed, joint_study, muscle_study

import fes_pin as fp
from fes_pin.data.outputs import WRITTEN
from fes_pin.diagnosis.errors_ahead import Ahead, AheadErrors, RandomPart
from fes_pin.diagnosis.replay import replayed_trials
from fes_pin.infer.result import STOPPED
from fes_pin.infer.text import plain_name, rounded
from fes_pin.models.predictor import StateSpaceNoise
from fes_pin.view.drawing import panels, svg
from fes_pin.view.mathml import equations_mathml
from fes_pin.view.plots import heat_drawing, trial_drawing
from fes_pin.view.report import report_html
from fes_pin.view.report_trials import got_worse

VOID = {"meta", "br", "hr", "img", "input", "link"}


class Page(HTMLParser):
    """Checks that every element is closed in order, and keeps what a reader sees."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.seen: list[str] = []
        self.tags: set[str] = set()
        self.words: list[str] = []
        self.scripts: list[str] = []
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
        if self.open and self.open[-1] == "script":
            self.scripts.append(data)
        elif not self.open or self.open[-1] != "style":
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
    (script,) = read.scripts
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    assert f"script-src 'sha256-{digest}'" in page, "the page may run its own script and no other"
    assert all(s.startswith(("#", "data:")) for s in read.seen), "the page asks for something outside itself"
    assert not re.search(r"url\((?!#)|@import", page)
    assert "nan" not in read.text.lower().split()
    return read.text


def test_a_report_says_what_the_diagnosis_found():
    text = checked_page(ankle_page())
    for words in (
        "coulomb_friction",
        "The model lacks coulomb friction",
        "80 % [74, 84]",
        "quadratic_damping",
        "sensor_offset",
    ):
        assert words in text
    assert equations_mathml(ankle_diagnosis().causes[0].equation).text in ankle_page()
    assert "--set load_kg" in text
    assert "next_trial.csv" in text


def test_folds_that_choose_something_else_are_told_and_no_others():
    diagnosis = ankle_diagnosis()
    words = "Coulomb_friction chosen again in 3 of 5 folds, each without its trials"
    for share, told in (((3, 5), True), ((5, 5), False), (None, False)):
        causes = tuple(replace(c, chosen_again=share) for c in diagnosis.causes)
        assert (words in checked(replace(diagnosis, causes=causes))) == told


def test_text_of_the_study_cannot_become_markup():
    page = ankle_page()
    assert page.count("<script") == 1
    assert page.count("&lt;script&gt;") >= 3  # title, heading, the trial's name
    assert NASTY in Page(page).text
    assert "default-src 'none'" in page


def test_a_report_of_an_adequate_model_names_nothing():
    text = checked(diagnosed(ankle_study()))
    assert "adequate" in text and "None is named" in text and "extended model" not in text


def test_a_report_of_a_stopped_search_claims_nothing_of_causes_that_were_not_tried():
    text = checked(replace(diagnosed(ankle_study()), verdict=STOPPED))
    assert "Stopped: best set so far: no cause, and no claim about causes that were not tried" in text
    assert "the search ended before it had tried all" in text and "adequate" not in text


def test_a_report_of_something_unexplained_says_where():
    text = checked(diagnosed(muscle_study(), unexplained=True))
    assert "Lack of fit more than noise (p = 1e-05, most on rate)" in text


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
    found = diagnosed(joint_study(tmp_path, kind), ("coulomb_friction",))
    text, sized = checked(found), "torque" if kind == "revolute" else "force"
    assert f"{sized} 0." in str(found) and "coulomb_friction: Dry friction at the joint\n" in str(found)
    assert f"Dry friction at the joint. Size: {sized} 0." in text and f"T = {sized} x =" in text
    assert not re.search("stiction|STIFFEST|load_exponent|softness", text)
    assert label in text and "held out" in text
    assert ("angle (rad)" in text) == (kind == "revolute")


def test_a_long_study_keeps_its_page_small_and_quick():
    diagnosis = diagnosed(ankle_study(seconds=100.0, step=0.002), ("fatigue",))
    began = time.process_time()
    page = report_html(diagnosis)
    assert time.process_time() - began < 4.0  # 1 s where nothing else runs
    assert len(page) < 1_000_000


def data_of(page: str) -> list[tuple[str, list[dict[str, str]]]]:
    """Name and rows of every CSV behind a figure."""
    found = re.findall(r'download="([^"]*)" href="data:text/csv,([^"]*)"', page)
    return [(html.unescape(n), list(csv.DictReader(io.StringIO(unquote(html.unescape(d)))))) for n, d in found]


def test_the_first_screen_answers_what_a_reader_asks():
    text = checked_page(ankle_page())
    for words in (
        "The model lacks coulomb friction",
        "Dry friction at the joint",
        "torque 0.01 [-0.19, 0.21] N m",
        "By chance alone over the whole library: p = 1e-09",
        "These data cannot distinguish this cause from quadratic_damping",
        "Explained 99 % of the squared error above the noise of free simulations",
        "E 9.1 % \u2192 1.8 %",
        "on what was fitted; noise alone leaves 1.7 %",
        "Next to separate coulomb_friction and quadratic_damping: they differ most on this trial",
        "its inputs are in next_trial.csv",
        "E is the squared error of a model",
    ):
        assert words.lower() in text.lower(), words


def test_every_figure_has_its_data_and_its_values_in_words():
    page, study = ankle_page(), ankle_diagnosis().study
    data = dict(data_of(page))
    assert page.count("<figure") == len(data_of(page))
    (trial,) = (t for t in study.trials if t.kind == "motion")
    rows = data["trial_1.csv"]
    assert float(rows[-1]["time_s"]) == pytest.approx(trial.time[-1], abs=0.02)
    measured = [float(r["angle_rad_measured"]) for r in rows]
    assert measured == pytest.approx(trial["angle_rad"][:: round(len(trial) / len(rows))], rel=1e-5)
    labels = re.findall(r'aria-label="([^"]*)"', page)
    assert len(labels) == page.count("<figure") and all(re.search(r"\d", label) for label in labels)
    assert any(f"from {trial['angle_rad'].min():.3g} to {trial['angle_rad'].max():.3g} rad" in x for x in labels)


def test_every_trial_is_drawn_and_those_that_got_worse_are_said():
    study = ankle_study()
    many = replace(study, trials=tuple(replace(study.trials[0], name=f"t{k}") for k in range(9)))
    diagnosis = diagnosed(many, ("coulomb_friction",))
    page = report_html(diagnosis)
    assert [f"trial_{k + 1}.csv" for k in range(9)] == sorted(n for n, _ in data_of(page) if n.startswith("trial_"))
    assert page.count("<details") == 1 and "worse" not in Page(page).text
    swapped = replace(diagnosis, nominal=diagnosis.extended, extended=diagnosis.nominal)
    found = report_html(replace(swapped, extended=replace(swapped.extended, model=diagnosis.nominal.model)))
    assert "9 of 9 trials got worse" in Page(found).text


@pytest.mark.parametrize(
    ("errors", "worse"),
    [
        ({"nominal": 1.0, "extended": 1.005}, False),
        ({"nominal": 1.0, "extended": 1.02}, True),
        ({"nominal": 1.0}, False),
    ],
)
def test_what_got_worse_is_more_than_rounding(errors, worse):
    assert got_worse(SimpleNamespace(errors=errors)) is worse


def texts(svg: str) -> list[str]:
    """Every text of a figure."""
    return [html.unescape(words) for words in re.findall(r"<text[^>]*>([^<]*)</text>", svg)]


def test_a_figure_of_a_trial_has_a_legend_and_its_inputs_are_named_in_full(tmp_path):
    shown = texts(report_html(diagnosis_of(tmp_path, 310.0)))
    for words in ("measured", "nominal model, fitted", "extended model", "effort (N m)", "angle (rad)"):
        assert words in shown, words


def test_what_was_measured_is_in_front_of_the_models():
    diagnosis = ankle_diagnosis()
    colours = re.findall(
        r"stroke: var\(--(measured|nominal|extended)", trial_drawing(replayed_trials(diagnosis)[0]).svg
    )
    first = list(dict.fromkeys(colours))
    assert first == ["extended", "nominal", "measured"]


def test_numbers_of_an_axis_keep_their_digits():
    drawing, ((panel,),) = panels([50.0])
    panel.plot([0.0, 1.0], [0.001, 0.004])
    panel.set_yticks([0.001, 0.0025, 0.004])
    assert {"0.0010", "0.0025", "0.0040"} <= set(texts(svg(drawing, "")))


def test_words_in_backticks_are_code_on_a_page_and_no_backtick_is_left():
    page = report_html(replace(ankle_diagnosis(), warnings=("`diagnose` says <what>",)))
    assert "<code>diagnose</code> says &lt;what&gt;" in page and "`" not in Page(page).text


def test_a_heat_map_says_each_cell_in_words_and_in_its_data():
    cells = {("a", "fatigue"): 79.4, ("b", "fatigue"): "equivalent", ("b", "sensor_offset"): "not testable"}
    drawn = heat_drawing(["a", "b"], ["fatigue", "sensor_offset"], cells)
    assert list(csv.reader(io.StringIO(drawn.csv)))[1:] == [
        ["a", "fatigue", "79.4"],
        ["b", "fatigue", "equivalent"],
        ["b", "sensor_offset", "not testable"],
    ]
    assert {"a", "b", "fatigue", "sensor_offset", "79 %", "=", "x"} == set(texts(drawn.svg))


def test_no_chance_is_zero_and_no_floor_is_a_tiny_number():
    diagnosis = ankle_diagnosis()
    causes = tuple(replace(c, p_value=0.0) for c in diagnosis.causes)
    sure = replace(diagnosis, causes=causes, ceiling_percent=5.8e-8)
    text = checked(sure)
    assert "p < 1e-12" in text and "below 0.001 %" in text and "e-08" not in text
    assert sure.record()["causes"][0]["p_value"] > 0.0
    assert "5.8e-08" not in str(sure)


def diagnosis_of(folder, free):
    """A joint whose effort answers the reading, as if judged so; `free` is its free error."""
    made = diagnosed(joint_study(folder), ("coulomb_friction",))
    white = dict.fromkeys(("position", "velocity"), 1e-3)
    noise = StateSpaceNoise(white, {"effort": 1e-3}, {"effort": 0.1})
    before, after = Ahead(2e-4, 9.5, free, 0.3), Ahead(1e-4, 0.4, free, 0.2)
    return replace(
        made,
        nominal=as_likely(made.nominal, noise),
        extended=as_likely(made.extended, noise),
        ahead=AheadErrors(0.3, before, after, before, after),
        random=(RandomPart("effort", 1e-3, 0.1, 0.02),),
        is_driven=True,
        nominal_error=(free, None),
        extended_error=(free, None),
    )


def test_a_driven_rig_shows_three_errors_side_by_side_and_reasons_along_its_motion(tmp_path):
    text = checked(diagnosis_of(tmp_path, 310.0))
    for words in (
        "of the squared error above the noise of predictions 0.3 s ahead",
        "E 9.5 % \u2192 0.4 %, cross-validated; noise alone leaves 0.2 %",
        "predictions one sample ahead on what was fitted below 0.001 %",
        "free simulations on what was fitted 310 % 310 %",
        "The effort that a model needs for the motion as it was measured, by inverse dynamics",
        "Random effort 0.001 N m, 2 % of what drives the rig",
        "Simulated: 0.3 s ahead of what was measured",
    ):
        assert words in text, words


def test_the_free_error_of_a_rig_that_falls_is_said_to_be_meaningless(tmp_path):
    text = checked(diagnosis_of(tmp_path, None))
    assert "Falls by itself: free errors are meaningless" in text and "free simulations" not in text


def test_the_same_diagnosis_gives_the_same_page():
    assert report_html(ankle_diagnosis()) == ankle_page()


def test_a_report_is_written_whole(tmp_path, monkeypatch):
    monkeypatch.setattr("fes_pin.view.report.report_html", lambda _diagnosis: ankle_page())
    fp.report(ankle_diagnosis(), tmp_path / "report.html")
    assert (tmp_path / "report.html").read_text(encoding="utf-8").rpartition(WRITTEN)[0].endswith("</html>\n")
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
    assert "Rejected to" not in done.stderr


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("stiffness_nm_per_rad", "stiffness"),
        ("rate_us_per_s", "rate"),
        ("slope_s_per_rad", "slope"),
        ("skew_per_rad3", "skew"),
        ("rest_angle_rad", "rest angle"),
        ("second_s", "second"),
        ("half_width", "half width"),
        ("creep_speed", "creep speed"),
    ],
)
def test_words_of_a_size_are_without_its_unit(name, words):
    assert plain_name(name, "") == words


def test_a_bound_at_nothing_is_no_row_of_noughts():
    assert [rounded(v, 3.9e-7) for v in (0.0, 1.05e-6)] == ["0", "1.05e-06"]
