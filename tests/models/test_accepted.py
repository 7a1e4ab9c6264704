"""What the public verbs are given is checked where they are entered, and refused in words of Python."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from identify.rigs import WHITE, measured
from models.cases import RIGS, trial

import fes_pin as fp
from fes_pin.identify.fit import rough_fit
from fes_pin.models.effects import SensorOffset
from fes_pin.models.model import Model
from fes_pin.models.predict import predicted_trial
from fes_pin.models.rigs import Joint, Muscle
from fes_pin.models.simulate import Simulator, simulated_trial

run = Simulator.run

MODELS = {rig: Model(one) for rig, one in RIGS.items()}
KINDS = {"ankle": "motion", "joint": "motion", "muscle": "isometric"}
VERBS = {"simulate": fp.simulate, "predict": fp.predict, "fit": lambda model, one: fp.fit(model, [one], WHITE)}


def recorded(rig):
    rng = np.random.default_rng(0)
    return measured(MODELS[rig], trial(rig, KINDS[rig], rng, 400), rng)


def without_condition(one):
    return replace(one, conditions={})


FAULTY = {
    "widths in s": ("ankle", lambda t: t.with_columns(pulse_width_us=t["pulse_width_us"] * 1e-6), "is it in s?"),
    "widths in ms": ("muscle", lambda t: t.with_columns(pulse_width_us=t["pulse_width_us"] * 1e-3), "is it in ms?"),
    "a negative width": (
        "ankle",
        lambda t: t.with_columns(pulse_width_us=t["pulse_width_us"] - 1.0),
        "pulse_width_us: expected a pulse width of at least 0 us, found -1",
    ),
    "degrees": ("ankle", lambda t: t.with_columns(angle_rad=np.degrees(t["angle_rad"])), "is it in degrees?"),
    "another name of the drive": (
        "joint",
        lambda t: t.without("effort").with_columns(effort_nm=t["effort"]),
        "effort_nm: wrong unit or none; expected effort",
    ),
    "a column that is not read": (
        "muscle",
        lambda t: t.with_columns(skin=t["force_n"]),
        "skin: unknown; ",
    ),
    "no width": ("ankle", lambda t: t.without("pulse_width_us"), "pulse_width_us: missing; this rig needs pulse_width"),
    "no stimulus": ("muscle", lambda t: t.without("pulse_width_us"), "missing; this rig needs pulse_width_us or stim"),
    "another kind": ("ankle", lambda t: replace(t, kind="moving"), "kind: expected one of motion, isometric, imposed"),
    "no load": ("ankle", without_condition, "load_kg: missing; expected the load in kg"),
    "another condition": (
        "ankle",
        lambda t: replace(t, conditions={"load": 1.0}),
        "load: wrong unit or none; expected load_kg",
    ),
    "a negative load": (
        "ankle",
        lambda t: replace(t, conditions={"load_kg": -1.0}),
        "load_kg: expected a numb",
    ),
    "no position": (
        "joint",
        lambda t: replace(t.without("position"), conditions={}),
        "position: missing; expected it (its first sample) or position0 among the conditions",
    ),
}


@pytest.mark.parametrize("verb", VERBS)
@pytest.mark.parametrize("fault", FAULTY)
def test_a_trial_that_the_rig_cannot_have_is_refused(fault, verb):
    rig, change, told = FAULTY[fault]
    with pytest.raises(fp.InputError) as raised:
        VERBS[verb](MODELS[rig], change(recorded(rig)))
    if not (fault == "no position" and verb == "fit"):  # a fit misses what is measured first
        assert told in str(raised.value)
    assert recorded(rig).name in str(raised.value)
    assert "--" not in str(raised.value)


def test_a_fit_needs_what_is_measured():
    with pytest.raises(fp.InputError, match="force_n: missing; a trial of kind isometric measures it"):
        fp.fit(MODELS["muscle"], [recorded("muscle").without("force_n")])


@pytest.mark.parametrize("column", ["pulse_width_us", "force_n"])
def test_a_number_that_is_none_is_refused(column):
    one = recorded("muscle")
    values = one[column].copy()
    values[17] = np.nan
    with pytest.raises(fp.InputError, match=f"{column}: .*finite"):
        fp.fit(MODELS["muscle"], [one.with_columns(**{column: values})])


@pytest.mark.parametrize(
    ("trials", "told"),
    [
        ([], "trials: expected at least one trial, found none"),
        ((), "trials: expected at least one trial, found none"),
        ((t for t in ()), "trials: expected at least one trial, found none"),
        (None, "trials: expected trials, found a NoneType"),
        (["trial"], "trials: expected trials, found a str"),
        (5, "trials: expected trials, found a int"),
    ],
)
def test_no_trials_are_refused(trials, told):
    with pytest.raises(fp.InputError) as raised:
        fp.fit(MODELS["muscle"], trials)
    assert str(raised.value) == told


@pytest.mark.parametrize("verb", VERBS)
def test_pulse_widths_need_a_recruitment_curve(verb):
    with pytest.raises(
        fp.InputError, match=r"constants\.threshold_us: missing; trials with pulse_width_us need thresh"
    ):
        VERBS[verb](Model(Muscle()), recorded("muscle"))


@pytest.mark.parametrize("verb", VERBS)
def test_what_is_no_model_is_refused(verb):
    for wrong in (RIGS["muscle"], None, "model.toml"):
        with pytest.raises(fp.InputError, match="model: expected a Model, found a "):
            VERBS[verb](wrong, recorded("muscle"))
    with pytest.raises(fp.InputError, match="trials: expected trials, found a NoneType"):
        fp.simulate(MODELS["muscle"], None)


@pytest.mark.parametrize("rig", RIGS)
def test_whole_trials_are_taken_and_answered_as_before(rig):
    one = recorded(rig)
    model = MODELS[rig] + SensorOffset(0.01)
    simulated = fp.simulate(model, one)
    for name, values in fp.predict(model, one).columns.items():
        np.testing.assert_array_equal(values, simulated[name])
    assert fp.fit(MODELS[rig], [one], WHITE).converged


def in_degrees(one):
    return one.with_columns(position=np.degrees(one["position"]))


def stuck(values):
    return np.r_[values[:200], np.full(50, values[200]), values[250:]]


ODD = {
    "degrees": ("joint", in_degrees, ["turns: is it in degrees?"]),
    "turned round": ("muscle", lambda t: t.with_columns(force_n=-t["force_n"]), ["is its sign turned round"]),
    "a heavy load and a sensor that sticks": (
        "ankle",
        lambda t: replace(t, conditions={"load_kg": 150.0}).with_columns(angle_rad=stuck(t["angle_rad"])),
        ["load_kg is above 100 kg", "angle_rad stays at"],
    ),
    "a load in g": ("ankle", lambda t: replace(t, conditions={"load_kg": 1e3}), ["load_kg is 1000 kg; no ankle holds"]),
    "ms": ("muscle", lambda t: replace(t, time=1e3 * t.time), ["is time_s in ms?"]),
}


@pytest.mark.parametrize("verb", VERBS)
@pytest.mark.parametrize("odd", ODD)
def test_numbers_that_are_odd_are_warned_of_once_a_call_and_answered(odd, verb):
    rig, change, told = ODD[odd]
    with pytest.warns(fp.InputWarning) as warned:
        answer = VERBS[verb](MODELS[rig], change(recorded(rig)))
    (one,) = warned
    assert all(words in str(one.message) for words in told) and one.filename == __file__
    assert isinstance(answer, fp.Fit | fp.Trial)


def test_what_fits_and_simulates_within_warns_nobody():
    one = in_degrees(recorded("joint"))
    assert isinstance(rough_fit(MODELS["joint"], (one,)), fp.Fit)
    assert isinstance(simulated_trial(MODELS["joint"], one), fp.Trial)
    assert isinstance(predicted_trial(MODELS["joint"], one), fp.Trial)


def test_a_trial_is_simulated_once_where_its_sign_is_judged(monkeypatch):
    made = []
    monkeypatch.setattr(Simulator, "run", lambda self, *given: made.append(self) or run(self, *given))
    fp.predict(MODELS["muscle"], recorded("muscle"))
    assert len(made) == 2  # of them one by `recorded`


def test_a_misspelt_start_names_what_it_may_be(ankle_study):
    for start, told in (
        ({"gian": 1.0}, "start.gian: unknown; did you mean gain?"),
        ({"gain": -1.0}, "gain: expected a number above 0"),
    ):
        study = object.__new__(type(ankle_study))
        vars(study).update({**vars(ankle_study), "start": {**ankle_study.start, **start}})
        with pytest.raises(fp.InputError) as raised:
            fp.nominal_model(study)
        assert told in str(raised.value)


def test_a_joint_without_a_urdf_says_so(ankle_study):
    study = object.__new__(type(ankle_study))
    vars(study).update({**vars(ankle_study), "files": {}})
    with pytest.raises(fp.InputError, match="urdf: missing; expected the joint's URDF"):
        Joint.of_study(study)


@pytest.fixture(scope="module")
def ankle_study():
    return fp.read_study(Path(__file__).parents[2] / "analysis/studies/ankle_demo")


def test_a_models_parameters_are_described_in_units():
    shown = repr(fp.effects.CoulombFriction.parameters()["torque_nm"])
    assert shown == "ParameterInfo: N m (N of a slide) in [0, 1e+06], absent at 0"
    assert "{" not in str([*fp.effects.CoulombFriction.parameters().values(), *Joint.parameters().values()])
    assert "{" not in str(MODELS["joint"]) + MODELS["joint"]._repr_html_()
