"""Errors against the believed model and a regression: the true model has the least, and trials are withheld."""

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from driven_rigs.draw import draw
from driven_rigs.laboratory import draw_laboratory
from harness import measured
from harness.never_worse import errors_against, errors_of_truth, model_of, withheld
from harness.regression import plain
from harness.table import never_worse
from test_harness import row

import fes_pin as fp

SEED = 1600003
"""Of a rig of the laboratory with dry friction."""
MEASURES = ("free", "0.3 s", "1 s", "effort")


@pytest.fixture(scope="module")
def drawn(tmp_path_factory):
    made = draw_laboratory(("coulomb_friction",), SEED, tmp_path_factory.mktemp("laboratory"))
    return fp.read_study(made.study), made.truth


def true_model(study, truth):
    nominal = fp.nominal_model(study).with_parameters({n: truth[n] for n in ("inertia_scale", "damping")})
    return nominal + fp.effects.CoulombFriction(torque_nm=truth["coulomb_friction"])


def test_the_last_trial_is_withheld_or_the_end_of_a_single_one_or_what_is_held_out(drawn):
    study, _ = drawn
    shown, unseen = withheld(study)
    assert shown.trials == study.trials[:-1] and unseen == study.trials[-1:]
    single, (end,) = withheld(replace(study, trials=study.trials[:1]))
    whole = study.trials[0]
    assert len(single.trials[0]) + len(end) == len(whole) and end.time[0] > single.trials[0].time[-1]
    assert np.array_equal(np.concatenate([single.trials[0]["effort"], end["effort"]]), whole["effort"])
    held = replace(study, trials=(replace(whole, role="held_out"), *study.trials[1:]))
    assert withheld(held) == (held, held.trials[:1])


def test_the_true_model_is_better_than_the_believed_one_in_every_error(drawn):
    study, truth = drawn
    shown, unseen = withheld(study)
    found = errors_against(shown, SimpleNamespace(model=true_model(shown, truth)), unseen)
    assert {*found} == {f"{m}, {on}" for m in MEASURES for on in ("fitted", "unseen")}
    for true, believed, regressed in found.values():
        assert true < 0.3 * believed and regressed < 0.5 * believed


def test_free_motion_is_left_out_where_the_answer_prints_no_error_of_it(drawn):
    study, _ = drawn
    answer = SimpleNamespace(model=fp.nominal_model(study), extended_error=(None, None))
    assert {*errors_against(study, answer, ())} == {f"{m}, fitted" for m in MEASURES if m != "free"}


def test_the_errors_of_the_true_model_are_those_of_its_values(drawn):
    study, truth = drawn
    shown, unseen = withheld(study)
    found = errors_of_truth(shown, ("coulomb_friction",), truth, unseen)
    known = errors_against(shown, SimpleNamespace(model=true_model(shown, truth)), unseen)
    assert {*found} == {*known}
    for name, (true, believed, _) in known.items():
        assert found[name] == pytest.approx(true, rel=0.2) and found[name] < 0.3 * believed
    assert errors_of_truth(shown, ("joint_stop",), {**truth, "joint_stop": 5.0}, unseen) == {}  # two values
    assert errors_of_truth(shown, ("effort_offset",), truth, unseen) == {}  # no value


def test_the_believed_model_has_its_own_errors(drawn):
    study, _ = drawn
    shown, unseen = withheld(study)
    found = errors_against(shown, SimpleNamespace(model=fp.nominal_model(shown)), unseen)
    assert all(own == believed for own, believed, _ in found.values())


def test_an_answer_without_a_model_is_one_by_its_causes_and_values(drawn):
    study, _ = drawn
    found = plain(study)
    model = model_of(study, found)
    assert {*model.structure()} == {"joint", "effort_offset", "coulomb_friction"}
    values = {n: one["value"] for n, one in found.extended.items()}
    assert model.parameters().items() >= {n: values[n] for n in ("inertia_scale", "damping", "gravity_scale")}.items()
    assert model.parameters()["coulomb_friction.torque_nm"] == values["coulomb_friction"]
    assert model.parameters()["effort_offset.offset"] == values["effort_offset"]


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_stop_whose_side_is_not_stated_is_on_the_side_where_it_is(drawn, side):
    study, truth = drawn
    high = max(float(t["position"].max()) for t in study.trials)
    stop = fp.effects.JointStop(stiffness=20.0, angle_rad=0.3 * side * high, side=side)
    trials = [fp.simulate(true_model(study, truth) + stop, t) for t in study.trials]
    stopped = replace(
        study, trials=tuple(replace(t, columns={n: t[n] for n in ("position", "effort")}) for t in trials)
    )
    known = {n: {"value": truth[n]} for n in ("inertia_scale", "damping")}
    parameters = {"stiffness": {"value": stop.stiffness}, "angle_rad": {"value": stop.angle_rad}}
    causes = [
        {"name": "joint_stop", "parameters": parameters},
        {"name": "coulomb_friction", "parameters": {"torque_nm": {"value": truth["coulomb_friction"]}}},
    ]
    record = {"causes": causes, "extended": {"parameters": known}}
    answer = SimpleNamespace(to_json=lambda: json.dumps(record))
    found = errors_against(stopped, answer, ())
    assert found["free, fitted"][0] < 0.1 and found["effort, fitted"][0] < 1.0


def test_nothing_is_measured_where_no_effort_was_recorded():
    study = SimpleNamespace(rig="muscle", trials=())
    assert errors_against(study, SimpleNamespace(), ()) == {}


def test_ratios_are_counted():
    inf = float("inf")
    rows = [
        row("a", against={"free, unseen": (1.0, 2.0, 1.0), "effort, unseen": (1.0, 2.0, 0.5)}),
        row("b", against={"free, unseen": (60.0, 70.0, 80.0), "effort, unseen": (1.0, 4.0, 2.0)}),
        row("c", against={"free, unseen": (inf, 2.0, 4.0)}),
        row("d", error="E: x"),
    ]
    text = never_worse(rows)
    assert text[0].startswith("effort, unseen, ours over believed: median 0.375, at most 1.02 in 2 of 2")
    assert text[1].startswith("effort, unseen, ours over regression: median 1.25, at most 1.02 in 1 of 2")
    assert "largest 2 (a)" in text[1]
    assert text[2].startswith("free, unseen, ours over believed: median inf, at most 1.02 in 1 of 2")
    assert text[4].startswith("every error at most 1.02 times: 1 of 4") and text[4].endswith("largest inf")
    assert text[5].startswith("the same, or at most 1.02 times that of the true model: 1 of 4")
    assert [line.split(":")[0].strip() for line in text[6:]] == ["a", "c", "d"]


def test_a_model_as_good_as_the_true_one_is_counted_apart():
    """A regression may predict better than the model that made the data: its errors happened to cancel the noise."""
    errors = {"free, unseen": (2.0, 4.0, 1.0), "effort, unseen": (1.0, 2.0, 2.0)}
    rows = [row(name, against=errors, true={"free, unseen": true}) for name, true in (("a", 2.0), ("b", 1.9))]
    text = never_worse([*rows, row("c", against=errors)])
    (counted,) = [line for line in text if line.startswith("the same, or")]
    assert "1 of 3" in counted


def test_what_is_worse_is_printed_with_what_the_true_model_is():
    errors = {"free, unseen": (2.0, 4.0, 1.0), "effort, unseen": (1.0, 2.0, 2.0)}
    (line,) = never_worse([row("a", against=errors, true={"free, unseen": 1.9, "effort, unseen": 0.9})])[-1:]
    assert line.endswith(": 2; the true model 1.9 in free, unseen")
    (line,) = never_worse([row("a", against=errors)])[-1:]
    assert line.endswith(": 2")


def test_a_study_of_ones_own_has_a_table(tmp_path, capsys):
    """It falls by itself, and has no error of free motion."""
    measured.main([str(draw(("coulomb_friction",), 0.3, 7100, tmp_path).study)])
    head, columns, *rows = capsys.readouterr().out.splitlines()
    assert "causes_found coulomb_friction" in head and columns.split()[-1] == "ratio"
    assert [row.split("  ")[1].split(",")[0] for row in rows] == [*MEASURES[1:], *MEASURES[1:]]
    for row_ in rows:
        *_, own, believed, regression, ratio = map(float, row_.split()[-4:])
        assert ratio == pytest.approx(own / min(believed, regression), rel=0.01)
