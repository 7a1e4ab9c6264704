"""The diagnosis of walking: what is hidden is named, what is not hidden is not, and all of it is said."""

import json
import pickle
import re
import tomllib
from urllib.parse import unquote

import numpy as np
import pytest

import fes_pin as fp
from fes_pin.body.build import Body
from fes_pin.cohort.one import Work, diagnose_one
from fes_pin.data.study import read_study
from fes_pin.view.report import report_html
from fes_pin.walk.diagnosis import diagnose_walk
from fes_pin.walk.effect import changed_segment
from fes_pin.walk.likelihood import WalkNoise, fit_many
from fes_pin.walk.motion import Session, motion_of
from fes_pin.walk.result import extended_body, with_segments
from fes_pin.walk.white_noise import white_level

pytestmark = pytest.mark.shared


def hidden(gait, folder, seed, *args, **more):
    from walks.synthetic import Wrong, make

    make(gait, folder, Wrong(*args, **{"strides": 2, "tissue": 0.4, **more}), seed)
    return diagnose_walk(read_study(folder))


@pytest.fixture(scope="module")
def heavy(gait, tmp_path_factory):
    return hidden(gait, tmp_path_factory.mktemp("heavy"), 2, "segment_mass", "trunk", 0.15)


def test_a_heavy_trunk_is_in_the_first_set(heavy):
    first = heavy.causes[0]
    assert heavy.verdict == "causes_found"
    assert "segment_mass" in (first.name, *first.equivalents)
    assert first.gain_held_out.low > 0.0 and all(c.judged.low > 0.0 for c in heavy.causes)
    assert heavy.wall_s < 120.0


def test_files_are_as_the_contract_says(heavy):
    files = heavy.files()
    record = json.loads(files["diagnosis.json"])
    keys = {"study", "verdict", "causes", "remainder", "absorbed", "nominal", "extended", "noise", "ceiling_percent",
            "next_experiment", "wall_s"}  # fmt: skip
    assert keys <= set(record)
    assert {"name", "stage", "parameters", "equivalents", "p_value", "gain_percent"} <= set(record["causes"][0])
    assert tomllib.loads(files["model.toml"])["effect"][0]["name"] == heavy.causes[0].name
    if heavy.causes[0].equivalents:
        plan = record["next_experiment"]
        assert set(plan["separates"]) <= {heavy.causes[0].name, *heavy.causes[0].equivalents}
        assert plan["trial"] is None or plan["trial"]["file"] in files
    assert heavy.causes[0].name in str(heavy)
    assert pickle.loads(pickle.dumps(heavy)).files()["diagnosis.json"] == files["diagnosis.json"]
    assert set(record["provenance"]["inputs"]) >= {"study.toml", "coords.csv", "grf.csv"}


def test_the_body_is_saved_as_urdf_and_a_model_that_is_none_is_refused(heavy, tmp_path):
    """`save_model` says how a body is saved; what it says works; `load_model` says the same of a walk's model.toml."""
    with pytest.raises(
        fp.InputError, match=r"found a Body: its write\(\) saves it as URDF, which Body\.from_urdf reads"
    ):
        fp.save_model(heavy.model, tmp_path / "model.toml")
    assert not (tmp_path / "model.toml").exists()
    heavy.model.write(tmp_path / "body.urdf")
    assert fp.Body.from_urdf(tmp_path / "body.urdf").mass_kg == pytest.approx(heavy.model.mass_kg)
    (tmp_path / "model.toml").write_text(heavy.files()["model.toml"])
    with pytest.raises(fp.InputError, match=r"Body\.from_urdf reads the URDF"):
        fp.load_model(tmp_path / "model.toml")
    with pytest.raises(fp.InputError, match="found a dict"):
        fp.save_model({}, tmp_path / "model.toml")


def test_a_cohort_stops_a_walk_at_its_limit_and_writes_its_playback(heavy):
    answer = diagnose_one(Work("walk", str(heavy.study.folder), limit=0.0), "key")
    assert not answer.error
    assert {"diagnosis.json", "model.toml", "body.urdf", "report.html", "playback.html"} <= set(answer.files)
    record = json.loads(answer.files["diagnosis.json"])
    assert record["verdict"] == "stopped" and any("limit of 0 s" in words for words in record["warnings"])


def test_the_report_has_a_style_for_all_that_it_shows(heavy):
    """A class without a rule in the style sheet is shown as plain text."""
    page = report_html(heavy)
    style = page[page.index("<style>") : page.index("</style>")]
    for name in set(re.findall(r'<(?:p|h1|dl|div|span|figure|section|article|table) class="(\w+)', page)):
        assert f".{name}" in style, name
    assert 'class="answers"' in page


def test_the_data_of_the_ground_reaction_stand_behind_its_figure(heavy):
    page = report_html(heavy)
    assert page.count("<svg") == len(heavy.study.trials) + 1  # and one of the gains
    csv = unquote(re.search(r'download="coords.csv" href="data:text/csv,([^"]*)"', page)[1]).splitlines()
    trial = heavy.models.designs.as_read.trials[0]
    head = csv[0].split(",")
    assert head[0] == "time_s" and len(head) == 1 + 3 * 6
    rows = np.array([[float(v) for v in line.split(",")] for line in csv[1:]])
    near = np.searchsorted(trial.motion.time, rows[:, 0] - 1e-6)
    assert rows[:, head.index("vertical_force_measured")] == pytest.approx(trial.measured[near, 2], rel=1e-4, abs=1e-3)


def test_the_ground_reaction_has_residuals_and_a_legend_that_names_the_model(heavy):
    shown = re.findall(r"<text[^>]*>([^<]*)</text>", report_html(heavy))
    assert {"measured", "required, nominal body", "required, extended body"} <= set(shown)
    assert shown.count("residual") == 6 * len(heavy.study.trials)


def test_one_question_for_every_study_and_its_limit_of_time_holds(heavy, tmp_path):
    """`fp.diagnose` answers for a body as for a rig; with no time it says what it could not do, and names nothing."""
    study = heavy.study
    found = fp.diagnose(study, limit=0.0)
    assert isinstance(found, type(heavy))
    assert found.warnings == (*heavy.warnings, "the search was stopped at its limit of 0 s: best set so far")
    assert not found.causes
    assert found.verdict == "stopped" and "stopped: best set so far" in found.headline()
    assert json.loads(found.files()["diagnosis.json"])["warnings"] == list(found.warnings)
    assert "stopped at its limit" in str(found)
    assert heavy.model.mass_kg > found.model.mass_kg
    assert heavy.remainder.p_value <= 1.0 and heavy.causes[0].gain_fit > 0.0
    value = next(iter(heavy.causes[0].parameters.values()))
    assert value.std > 0.0
    fp.report(heavy, tmp_path / "report.html")
    assert "<svg" in (tmp_path / "report.html").read_text()
    with pytest.raises(fp.InputError, match="walking has none but its own"):
        fp.diagnose(study, library="own.py")


def test_the_report_is_a_whole_page(heavy):
    text = report_html(heavy)
    assert text.startswith("<!DOCTYPE html>") and text.endswith("</html>\n")
    assert heavy.causes[0].name in text and "<svg" in text and "<script src" not in text


def test_one_who_stands_still_tells_no_gain_from_mass_and_calls_neither_untestable(tmp_path):
    """A reading 6 % above the weight: whatever is named, its twins stand beside it and not among the untestable."""
    from fes_pin.data.motion import REQUIRED

    random, time = np.random.default_rng(0), np.arange(0.0, 4.0, 0.01)
    coordinates = {f"q_{n}": (n == "pelvis_ty") + 1e-4 * random.normal(size=len(time)) for n in REQUIRED}
    plates = {f"{s}_{k}{c}": 0.0 * time for s in "rl" for k in ("F", "cop", "T") for c in "xyz"}
    plates |= {"r_Fy": 1.06 * 72.6 * 9.80665 + random.normal(size=len(time)), "r_copx": -0.09 + 0.0 * time}
    for name, columns in (("c.csv", coordinates), ("g.csv", plates)):
        table = np.stack([time, *columns.values()], axis=1)
        np.savetxt(tmp_path / name, table, delimiter=",", header=",".join(["time_s", *columns]), comments="")
    (tmp_path / "study.toml").write_text(
        '[study]\nname = "stand"\nrig = "body"\n[rig]\nmass_kg = 72.6\nheight_m = 1.8\n'
        '[[trial]]\ncoordinates = "c.csv"\nground_reaction = "g.csv"\n'
    )
    found = diagnose_walk(read_study(tmp_path))
    sets = [{c.name, *c.equivalents} for c in found.causes]
    assert any({"segment_mass", "plate_gain", "external_force"} <= one for one in sets)
    assert not set(found.absorbed) & set.union(*sets)
    assert found.next_experiment is not None


def test_late_plates_are_found(gait, tmp_path):
    from walking_matrix.plan import drawn
    from walks.synthetic import make

    wrong = drawn("clock_offset", 514)  # 47 ms: far beyond what is linear
    make(gait, tmp_path, wrong, 514)
    first = diagnose_walk(read_study(tmp_path)).causes[0]
    assert first.name == "clock_offset"
    late = first.parameters["late_s"]
    assert late.unit == "s" and late.value == pytest.approx(wrong.size, abs=max(3 * late.std, 0.003))


def test_soft_tissue_alone_names_nothing(gait, tmp_path):
    found = hidden(gait, tmp_path, 9, strides=3)
    assert not found.causes
    assert found.verdict == "unexplained"  # soft tissue does come again in every stride


def test_the_measured_walk_is_honestly_unexplained(walk, tmp_path):
    """Two strides of an adult: nothing in the library survives, and the verdict says that something is there."""
    (tmp_path / "study.toml").write_text(
        '[study]\nname = "subject01"\nrig = "body"\n[rig]\nmass_kg = 72.6\nheight_m = 1.80\n'
        'segments = "segments.json"\n'
        '[[trial]]\ncoordinates = "coords.csv"\nground_reaction = "grf.csv"\nbelt_speed_mps = 1.135\n'
    )
    for source, name in (("coords_mtpfree.csv", "coords.csv"), ("grf_raw_600hz.csv", "grf.csv"),
                         ("reference/subject01_model.json", "segments.json")):  # fmt: skip
        (tmp_path / name).write_bytes((walk / source).read_bytes())
    found = diagnose_walk(read_study(tmp_path))
    assert found.models.designs.strides.count == 2
    assert found.verdict == "unexplained" and not found.causes


def test_the_extended_body_requires_what_the_column_says(measured, hip):
    motion, columns = measured
    parameters = motion.parameters
    heavier = with_segments(motion.body, {"trunk": changed_segment(parameters["trunk"], 0.1 * parameters["trunk"])})
    assert isinstance(heavier, Body)
    assert heavier.mass_kg == pytest.approx(motion.body.mass_kg + 0.1 * parameters["trunk"][0])
    moved = motion_of(heavier, motion.time, columns, hip, Session())
    column = motion.regressors["trunk"] @ parameters["trunk"]
    assert np.abs(moved.required - motion.required - 0.1 * column).max() < 1e-6


def test_the_extended_body_is_the_diagnosiss(heavy):
    body = extended_body(heavy.models, heavy.best)
    name, site = heavy.causes[0].name, heavy.causes[0].site
    if name == "segment_mass" and site == "trunk":
        share = heavy.causes[0].parameters["share"].value
        assert body.mass_kg > heavy.models.designs.as_read.trials[0].motion.body.mass_kg * (1 + 0.3 * share)
    assert len(body.joint_names) == 19


def noise_of(harmonics, rows=1):
    none = np.zeros((rows, 6, len(harmonics), 0))
    return WalkNoise(harmonics, np.eye(6), np.full(6, 4.0), none)


def test_the_fit_is_generalized_least_squares_with_the_noises_own_spectrum():
    random = np.random.default_rng(0)
    harmonics = np.array([0, *(h for h in range(1, 9) for _ in range(2))])
    noise = noise_of(harmonics)
    sd = np.exp(1.0 - 0.2 * harmonics)
    x = random.normal(size=(1, 6, len(harmonics), 1))
    z = []
    for _ in range(300):
        y = 2.0 * x[..., 0] + sd * random.normal(size=x.shape[:3])
        (found,) = fit_many(y[None], x[None], np.array([[100.0]]), noise)
        z.append((found.values[0] - 2.0) / np.sqrt(found.covariance[0, 0]))
    assert abs(np.mean(z)) < 0.2
    assert 0.88 < np.mean(np.abs(z) < 1.96) < 0.98


def test_an_effect_that_is_not_there_costs_evidence():
    random = np.random.default_rng(1)
    harmonics = np.array([0, *(h for h in range(1, 9) for _ in range(2))])
    noise, none = noise_of(harmonics), np.zeros((1, 1, 6, len(harmonics), 0))
    gains = []
    for _ in range(50):
        y, x = random.normal(size=(1, 1, 6, len(harmonics))), random.normal(size=(1, 1, 6, len(harmonics), 1))
        (alone,), (fitted,) = fit_many(y, none, np.zeros((1, 0)), noise), fit_many(y, x, np.ones((1, 1)), noise)
        gains.append(alone.deviance - fitted.deviance)
    assert np.mean(gains) < -2.0


def white_draws(random, count, mixed):
    """Draws of what white noise of one unit leaves: it grows with frequency, and `mixed` waves go together."""
    harmonics = np.array([0, *(h for h in range(1, 8) for _ in range(2))])
    free = random.normal(size=(count, 6, len(harmonics)))
    shared = random.normal(size=(count, 1, 1))
    return harmonics, ((harmonics / 4.0) ** 2 + 1e-3) * (np.sqrt(1.0 - mixed) * free + np.sqrt(mixed) * shared)


@pytest.mark.parametrize("mixed", [0.0, 0.7])
def test_white_noise_of_coordinates_is_measured_by_its_growth_with_frequency(mixed):
    random = np.random.default_rng(2)
    levels, z = [], []
    for _ in range(60):
        harmonics, draws = white_draws(random, 64, mixed)
        y = 3.0 * white_draws(random, 4, mixed)[1] + 0.5 * random.normal(size=(4, 6, 15))
        level, std, saved = white_level(y, noise_of(harmonics), draws)
        assert saved > 20.0
        levels.append(level)
        z.append((level - 3.0) / std)
    assert abs(np.mean(levels) - 3.0) < 0.3
    assert 0.7 < np.std(z) < 1.3  # 1 +- 0.09 for errors that are normal
    quiet = white_level(0.5 * random.normal(size=(4, 6, 15)), noise_of(harmonics), draws)
    assert quiet[0] < 0.6
