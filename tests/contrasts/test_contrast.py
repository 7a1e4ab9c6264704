"""Groups between which something was changed on purpose, without the engine: that is named, a repeat is not."""

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from contrast_pairs.driven import driven_pair
from contrast_pairs.free import free_pair
from contrast_pairs.practice import practice_pair
from contrast_pairs.twitch import twitch_pair
from data import studies

import fes_pin as fp
from fes_pin.contrasts.changes import not_changed, ranges
from fes_pin.contrasts.fits import GroupedFits
from fes_pin.contrasts.groups import in_groups
from fes_pin.contrasts.models import ContrastModels
from fes_pin.contrasts.replay import EVERY, errors_by_group
from fes_pin.data.errors import InputError
from fes_pin.data.study import Study
from fes_pin.data.trial import Trial
from fes_pin.infer.levels import CONFIDENCE_95
from fes_pin.models.nominal import nominal_model
from fes_pin.view.report import report_html


def test_nothing_changed(tmp_path):
    found = fp.contrast(free_pair("muscle", (), 80.0, 3, tmp_path))
    assert found.verdict == "nothing_changed"
    assert not found.changes
    assert "nothing changed between before and after" in str(found)
    assert 0.0 < found.unchanged["gain"] < 0.05
    assert found.advice() == "use one model for all groups"
    assert replace(found, untestable=("gain",)).advice().startswith("record trials that show gain")


def stronger_with_zeros(offset_n, folder):
    """A muscle that became stronger by 67 %, with a delay in both groups, and the zero of the force differs."""
    study, rng = twitch_pair("delay", 1.67, 0.0005, 8, folder), np.random.default_rng(4)
    moved = [t.with_columns(force_n=t["force_n"] + offset_n * rng.standard_normal()) for t in study.trials]
    return replace(study, trials=tuple(moved))


@pytest.mark.parametrize("offset_n", [0.0, 0.01, 0.1])
def test_a_stronger_muscle_of_which_the_model_lacks_a_delay(offset_n, tmp_path):
    """An error that all groups share hides no change, nor do zeros that differ between trials."""
    found = fp.contrast(stronger_with_zeros(offset_n, tmp_path))
    (change,) = found.changes
    assert change.name == "gain" and "electromechanical_delay" in found.common
    before, after = (p.value for p in change.parameters["gain"].values())
    assert after / before == pytest.approx(1.67, abs=0.02)


@pytest.mark.long
def test_trials_that_scatter_are_no_change(tmp_path):
    """Strength that differs from trial to trial by ten times what the noise lets see is no change of a group."""
    study = free_pair("muscle", (), 80.0, 4, tmp_path)
    rng = np.random.default_rng(5)
    scale = {t.name: 1.0 + 0.03 * rng.standard_normal() for t in study.trials}
    scale[study.trials[0].name] += 0.04  # by chance one group is stronger
    trials = [t.with_columns(force_n=scale[t.name] * t["force_n"]) for t in study.trials]
    found = fp.contrast(replace(study, trials=tuple(trials)))
    assert found.verdict == "nothing_changed"


def test_one_change_is_named_alone_with_its_size(tmp_path):
    study = free_pair("muscle", (), 80.0, 6, tmp_path)
    trials = [t.with_columns(force_n=t["force_n"] + 0.8) if t.group == "after" else t for t in study.trials]
    found = fp.contrast(replace(study, trials=tuple(trials)))
    (change,) = found.changes
    assert (change.name, change.kind, change.group, change.equivalents) == ("sensor_offset", "effect", "after", ())
    assert change.parameters["offset"]["before"].value == 0.0
    one = change.parameters["offset"]["after"]
    assert one.value == pytest.approx(0.8, abs=max(4.0 * one.std, 0.05))
    assert change.p_value < 1e-3
    (item,), alone = found.fit.changes, found.fit.std("sensor_offset.offset:after")
    assert found.fit.certainty(item) == pytest.approx(one.value / alone)
    assert "sensor_offset" not in found.excluded
    assert found.explain("sensor_offset")[0].startswith("sensor_offset: named (p ")
    for name in (*found.excluded, *found.unchanged):
        assert any("would have been seen in 95 of 100" in line for line in found.explain(name))
    assert found.explain("nonsense")[0].startswith("nonsense: not fitted; candidates were ")
    assert_the_page_shows_both_groups(found)


def assert_the_page_shows_both_groups(found):
    """Trials of both groups are drawn, with the models of both, and the error of each is in a table."""
    page, errors = report_html(found), errors_by_group(found.replays)
    for words in ("measured, before", "measured, after", "model of before", "model of after", "force (N)"):
        assert f">{words}</text>" in page, words
    assert errors["after"]["after"] < 0.1 * errors["after"]["before"]
    removed = 100.0 * (1.0 - errors["after"]["after"] / errors["after"]["before"])
    gone = f"{removed:.0f} % of the squared error of free simulations of the trials of after, by the model of before"
    assert gone in page and gone.partition(" % of the squared error of ")[2] in str(found)
    assert "before absent, after" in page and "after none" not in page and "held" not in found.changes[0].row()[2]


def test_groups_without_a_change_share_one_model(tmp_path):
    found = fp.contrast(free_pair("muscle", (), 80.0, 3, tmp_path))
    assert all(list(one.models) == [EVERY] for one in found.replays)
    assert f">model of {EVERY}</text>" in report_html(found)


def test_no_size_beyond_the_range_of_the_data_is_excluded(tmp_path):
    """A hum of more than all that was read is none that these data bound."""
    study = free_pair("muscle", (), 80.0, 3, tmp_path)
    known = ranges(study.trials, revolute=True)
    assert known["N"] == max(float(np.ptp(t["force_n"])) for t in study.trials) and known["us"] > known["N"]
    found = fp.contrast(study)
    assert found.excluded["mains_hum"].value < known["N"]
    best = found.fit
    nominal = nominal_model(study)
    effects = found.catalogue.effects_for(nominal.rig)
    models = ContrastModels(GroupedFits(nominal, in_groups(study.trials), False, effects))
    models.fits[()], models.family = best, models.screen.family(best, 0)
    still = replace(best, trials=tuple(t.with_columns(force_n=1e-6 * t["force_n"]) for t in best.trials))
    _, excluded, untestable = not_changed(models, still)
    assert "mains_hum" in untestable and "mains_hum" not in excluded and "electromechanical_delay" in excluded


def test_the_certainty_of_a_change_is_that_of_the_difference_between_groups(tmp_path):
    best = fp.contrast(stronger_with_zeros(0.0, tmp_path)).fit
    (item,), at = best.changes, [best.place("gain"), best.place("gain:after")]
    variance = np.array([1.0, -1.0]) @ best.covariance[np.ix_(at, at)] @ np.array([1.0, -1.0])
    assert best.certainty(item) == pytest.approx((best.values["gain:after"] - best.values["gain"]) / np.sqrt(variance))
    assert replace(best, covariance=np.full_like(best.covariance, np.inf)).certainty(item) == 0.0


@pytest.mark.parametrize(
    ("values", "at_bound", "is_a_model"),
    [({}, (), True), ({}, ("gain",), False), ({"gain": 0.0}, ("gain",), True), ({}, ("sensor_offset.offset",), True)],
)
def test_no_change_is_named_in_a_model_at_a_bound(values, at_bound, is_a_model, tmp_path):
    """A nominal parameter may end at 0; a cause at its bound is impossible by another rule."""
    study = stronger_with_zeros(0.0, tmp_path)
    nominal = nominal_model(study)
    models = ContrastModels(GroupedFits(nominal, in_groups(study.trials), True))
    fitted = SimpleNamespace(at_bound=at_bound, values={**nominal.parameters(), **values}, repeats={}, is_driven=True)
    assert models.is_a_model(fitted) is is_a_model


def test_two_changes_are_both_named(tmp_path):
    study = free_pair("muscle", ("gain",), 80.0, 9, tmp_path)
    trials = [t.with_columns(force_n=t["force_n"] + 0.8) if t.group == "after" else t for t in study.trials]
    found = fp.contrast(replace(study, trials=tuple(trials)))
    assert {c.name for c in found.changes} == {"gain", "sensor_offset"}


@pytest.mark.long
def test_a_nominal_parameter_is_told_in_plain_words(tmp_path):
    """A driven rig, judged by predictions: inertia is added, and nothing else is."""
    study = driven_pair(("inertia_scale",), 0.4, 41, tmp_path)
    found = fp.contrast(study)
    assert found.driven
    (change,) = found.changes
    assert (change.name, change.kind, change.group) == ("inertia_scale", "nominal", "after")
    assert change.words.startswith(("inertia was added, 0.299 kg m2", "inertia was added, 0.3 kg m2"))
    assert change.parameters["inertia_scale"]["before"].value == pytest.approx(1.0, abs=0.02)
    record = found.record()
    json.dumps(record, allow_nan=False)
    assert record["changes"][0]["parameters"]["inertia_scale"]["after"]["std"] > 0.0
    assert record["unchanged"]["damping"]["at_most"] < 0.5
    page = report_html(found)
    assert "Inertia was added" in page
    assert "inertia_scale" in page


@pytest.mark.long
def test_one_change_stands_for_several(tmp_path):
    """Twice the inertia of a pendulum held upright is half the effort, half the weight and half the damping."""
    found = fp.contrast(driven_pair(("inertia_scale",), 0.4, 998066, tmp_path))
    (change,) = found.changes
    assert (change.name, change.group) == ("inertia_scale", "after")
    assert not change.equivalents
    before, after = (change.parameters["inertia_scale"][g].value for g in ("before", "after"))
    assert before == pytest.approx(1.0, abs=0.02)
    assert after == pytest.approx(1.94, abs=0.03)


def test_a_common_cause_is_no_change(tmp_path, shared):
    """Both halves of a study whose sensor is turned the same way by the same amount."""
    study = practice_pair(fp.read_study(shared / "practice" / "n00_none"), ())
    moved = [t.with_columns(angle_rad=t["angle_rad"] + 0.02) if t.kind == "motion" else t for t in study.trials]
    found = fp.contrast(replace(study, trials=tuple(moved)))
    assert found.verdict == "nothing_changed"
    assert found.common


def test_a_cause_of_all_groups_that_differs_in_one_is_one_change(tmp_path):
    """The sensor is off by 0.5 N before, and by 1.3 N after: one change, by 0.8 N, and no common cause beside it."""
    study = free_pair("muscle", (), 80.0, 6, tmp_path)
    off = {"before": 0.5, "after": 1.3}
    trials = [t.with_columns(force_n=t["force_n"] + off[t.group]) for t in study.trials]
    found = fp.contrast(replace(study, trials=tuple(trials)))
    (change,) = found.changes
    assert change.name == "sensor_offset"
    told = {g: v.value for g, v in change.parameters["offset"].items()}
    assert told == pytest.approx(off, abs=0.05)
    assert not found.common


@pytest.mark.parametrize("changes", [(), ("threshold_shift",)])
def test_a_misread_trial_is_told_as_such(shared, changes):
    """One trial of a group states another load than it had; that is no change of the rig, and hides none."""
    study = practice_pair(fp.read_study(shared / "practice" / "n00_none"), changes)
    late = [t for t in study.trials if t.group == "after" and "load_kg" in t.conditions]
    odd, load = late[1].name, late[1].conditions["load_kg"]
    trials = [replace(t, conditions={"load_kg": 1.2 * load}) if t.name == odd else t for t in study.trials]
    found = fp.contrast(replace(study, trials=tuple(trials)))
    assert {c.name for c in found.changes} == {"condition_misread", *changes}
    one = next(c for c in found.changes if c.kind == "condition")
    assert (one.group, one.trial) == ("after", odd)
    value = one.parameters["load_kg"]["after"]
    assert value.value == pytest.approx(load, abs=2.0 * CONFIDENCE_95 * value.std)
    assert found.record()["changes"]
    assert "condition_misread" in report_html(found)


STAND = """<?xml version="1.0"?>
<robot name="stand"><link name="base"/>
  <link name="rod"><inertial><mass value="2.0"/>
    <inertia ixx="1e-3" ixy="0" ixz="0" iyy="1e-3" iyz="0" izz="1e-3"/></inertial></link>
  <joint name="slide" type="prismatic"><parent link="base"/><child link="rod"/><axis xyz="1 0 0"/>
    <limit lower="-9" upper="9" effort="1e5" velocity="99"/></joint>
</robot>
"""


def stroke_study(folder, tensions, damping=(400.0, 400.0)):
    """A band around a drum on a test stand: strokes of different lengths are imposed, the force is written out."""
    rng, trials = np.random.default_rng(12), []
    for group, tension, viscous in zip(("slack", "tight"), tensions, damping, strict=True):
        for k, (seconds, rate) in enumerate(((4.0, 0.8), (6.0, 0.5))):
            time = np.arange(round(250 * seconds)) / 250.0
            sweep = 0.02 * np.sin(2 * np.pi * rate * time * (1.0 + 0.1 * time))
            speed = np.gradient(sweep, time)
            force = 2.4 * np.gradient(speed, time) + viscous * speed + tension * (2.0 / np.pi) * np.arctan(speed / 1e-3)
            columns = {"position": sweep + 1e-7 * rng.standard_normal(len(time)), "effort": force}
            columns["effort"] = force + (0.4 if group == "slack" else 0.8) * rng.standard_normal(len(time))
            trials.append(Trial(f"{group}{k}", "imposed", columns, time, group=group))
    (folder / "stand.urdf").write_text(STAND)
    start = {"inertia_scale": 1.0, "damping": 300.0}
    return Study(
        "stand", "joint", {"gravity_scale": 0.0}, start, tuple(trials), folder, {"urdf": folder / "stand.urdf"}
    )


def test_a_band_that_was_tightened_on_a_test_stand(tmp_path):
    """Imposed strokes are judged by predictions, and dry friction of both groups differs in one."""
    found = fp.contrast(stroke_study(tmp_path, (20.0, 50.0)))
    assert found.driven
    assert "coulomb_friction" in {n for c in found.changes for n in (c.name, *c.equivalents)}
    change = next(c for c in found.changes if "coulomb_friction" in (c.name, *c.equivalents))
    if change.name == "coulomb_friction":
        ratio = change.parameters["torque_nm"]["tight"].value / change.parameters["torque_nm"]["slack"].value
        assert ratio == pytest.approx(2.5, rel=0.05)
    assert "damping" not in {c.name for c in found.changes}


@pytest.mark.long
def test_a_measured_band_that_was_tightened(shared):
    """One trial for each tension; the stand rings, which the model does not have."""
    found = fp.contrast(fp.read_study(shared / "data" / "friction_damper"), groups=["20 lb", "70 lb"])
    (change,) = found.changes
    assert (change.name, change.equivalents) == ("coulomb_friction", ())
    loose, tight = (change.parameters["torque_nm"][g].value for g in ("20 lb", "70 lb"))
    assert 1.8 < tight / loose < 3.2  # 2.69 on the loops


def test_strokes_that_are_repeated_are_no_change(tmp_path):
    assert fp.contrast(stroke_study(tmp_path, (30.0, 30.0))).verdict == "nothing_changed"


def _of(study, group):
    return replace(study, name=group, trials=tuple(t for t in study.trials if t.group == group))


def test_two_studies_are_two_groups(tmp_path):
    study = free_pair("muscle", ("gain",), 80.0, 9, tmp_path)
    halves = [_of(study, g) for g in ("before", "after")]
    found = fp.contrast(*halves)
    assert found.groups == ("before", "after")
    assert [c.name for c in found.changes] == ["gain"]


def _labelled(tmp_path):
    study = fp.read_study(studies.ankle(tmp_path / "study"))
    labels = ["a" if k % 2 else "b" for k in range(len(study.trials))]
    return replace(study, trials=tuple(replace(t, group=g) for t, g in zip(study.trials, labels, strict=True)))


@pytest.mark.parametrize(
    ("change", "asked", "words"),
    [
        (lambda s: s, {"groups": ["a", "c"]}, "no group 'c'"),
        (lambda s: s, {"groups": ["a"]}, "at least two groups"),
        (lambda s: replace(s, trials=s.trials[:1]), {}, "only 'b'"),
        (lambda s: replace(s, trials=tuple(replace(t, group=None) for t in s.trials)), {}, "has no group"),
        (lambda s: s, {"by": "lod_kg"}, "has no lod_kg"),
    ],
)
def test_groups_that_cannot_be_contrasted(change, asked, words, tmp_path):
    with pytest.raises(InputError, match=words):
        fp.contrast(change(_labelled(tmp_path)), **asked)


def test_a_model_that_runs_away_in_every_group(tmp_path):
    study = free_pair("joint", (), 80.0, 5, tmp_path)
    with pytest.raises(InputError, match="predicts nothing finite"):
        fp.contrast(replace(study, start={**study.start, "damping": 1e9}))


def test_studies_of_different_rigs(tmp_path):
    study = _labelled(tmp_path)
    constants = {**study.constants, "moment_arm_m": 2.0 * study.constants["moment_arm_m"]}
    with pytest.raises(InputError, match="moment_arm_m"):
        fp.contrast(study, replace(study, constants=constants))
