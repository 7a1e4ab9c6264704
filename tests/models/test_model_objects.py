"""Models check themselves when they are built, cannot be changed afterwards, and are read as they were saved."""

import copy
import dataclasses
import pickle
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from models.cases import ANKLE, JOINT, MUSCLE, RIGS, everything

import fes_pin as fp
from fes_pin.models.effects import CoulombFriction, SensorOffset, effects_for
from fes_pin.models.model import Model
from fes_pin.models.rigs import RIGS as CLASSES
from fes_pin.models.rigs import Ankle, Joint, Muscle
from fes_pin.models.store import model_toml

CONSTANTS = {"ankle": ANKLE, "joint": JOINT, "muscle": MUSCLE}


def within(info):
    return st.floats(max(info.lower, -1e9), min(info.upper, 1e9))


def of(kind):
    """Objects of a class of parameters, each within its bounds."""
    return st.fixed_dictionaries({n: within(i) for n, i in kind.parameters().items()})


@st.composite
def models(draw):
    """A model of any rig, with any of its effects."""
    rig = draw(st.sampled_from(CLASSES))
    factors = draw(st.fixed_dictionaries({n: st.floats(0.5, 2.0) for n in CONSTANTS[rig.name]}))
    constants = {n: v * factors[n] for n, v in CONSTANTS[rig.name].items()}
    if "threshold_us" in constants:
        constants["saturation_us"] += constants["threshold_us"]
    fitted = draw(st.none() | st.lists(st.sampled_from(list(rig.parameters())), unique=True).map(tuple))
    begins = sorted(draw(st.lists(st.floats(0.0, 1e4), max_size=3)))
    session = tuple((a, a + 1.0, draw(st.floats(0.0, 1.0))) for a in begins)
    model = Model(rig(**draw(of(rig)), constants=constants, fitted=fitted, session=session))
    for effect in draw(st.lists(st.sampled_from(list(effects_for(rig.name))), unique=True, max_size=5)):
        model = model + effect(**draw(of(effect)), each_trial=effect.varies and draw(st.booleans()))
    return model


@pytest.mark.parametrize("examples", [60, 1000])
def test_every_model_is_read_as_it_was_saved(examples, tmp_path):
    @settings(max_examples=examples, deadline=None, suppress_health_check=list(HealthCheck), database=None)
    @given(models())
    def saved_and_read(model):
        fp.save_model(model, tmp_path / "model.toml")
        again = fp.load_model(tmp_path / "model.toml")
        assert again == model
        assert hash(again) == hash(model)
        assert model_toml(again) == model_toml(model)
        for other in (pickle.loads(pickle.dumps(model)), copy.copy(model), copy.deepcopy(model)):
            assert other == model
            assert hash(other) == hash(model)

    saved_and_read()


@pytest.mark.parametrize("kind", CLASSES, ids=lambda k: k.name)
def test_every_rig_is_drawn_with_its_constants(kind):
    assert set(kind.needed) <= set(CONSTANTS[kind.name])


@pytest.mark.parametrize("rig", RIGS)
@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy, lambda m: pickle.loads(pickle.dumps(m)), lambda m: m])
def test_no_model_is_changed_through_its_constants(rig, copied):
    model = copied(everything(rig))
    name = next(iter(model.rig.constants))
    with pytest.raises(TypeError):
        model.rig.constants[name] = 0.02
    with pytest.raises(dataclasses.FrozenInstanceError):
        model.rig.constants = {}
    with pytest.raises(dataclasses.FrozenInstanceError):
        model.effects = ()


def test_a_rig_does_not_follow_what_it_was_made_of():
    constants = dict(ANKLE)
    rig = Ankle(constants=constants)
    model = Model(rig) + CoulombFriction(torque_nm=0.04)
    constants["moment_arm_m"] = 0.02
    assert rig.constants["moment_arm_m"] == model.rig.constants["moment_arm_m"] == ANKLE["moment_arm_m"]


def test_models_are_equal_by_their_values_alone():
    model = Model(Ankle(constants=ANKLE)) + SensorOffset(0.01) + CoulombFriction(0.04)
    same = Model(
        Ankle(constants=dict(reversed(ANKLE.items()))), (CoulombFriction(np.float64(0.04)), SensorOffset(0.01))
    )
    assert model == same
    assert len({model, same}) == 1
    for other in (
        Model(Ankle(constants={**ANKLE, "moment_arm_m": 0.02}), model.effects),
        Model(Ankle(0.7, constants=ANKLE), model.effects),
        Model(Ankle(constants=ANKLE, fitted=("gain",)), model.effects),
        model - "sensor_offset",
    ):
        assert other != model


@pytest.mark.parametrize(
    ("built", "told"),
    [
        (lambda: Ankle(-1.0, constants=ANKLE), "gain: expected a number above 0, found -1.0"),
        (lambda: Ankle("0.65", constants=ANKLE), "gain: expected a number, found the text '0.65'"),
        (lambda: Ankle(None, constants=ANKLE), "gain: expected a number, found nothing"),
        (lambda: Ankle(True, constants=ANKLE), "gain: expected a number, found true"),
        (lambda: Ankle(np.nan, constants=ANKLE), "gain: expected a finite number, found nan"),
        (lambda: Ankle(damping_nms=np.float32(-1), constants=ANKLE), "damping_nms: expected a number of at least 0"),
        (lambda: Joint(gravity_scale=-11, constants=JOINT), "gravity_scale: expected a number of at least 0"),
        (
            lambda: Ankle(constants={**ANKLE, "moment_arm_m": 0.0}),
            "constants.moment_arm_m: expected a number above 0 in m, found 0.0",
        ),
        (lambda: Muscle(constants={"other": np.inf}), "constants.other: expected a finite number, found inf"),
        (lambda: Ankle(constants={**ANKLE, "saturation_us": 180}), "constants.saturation_us: expected more than 180"),
        (lambda: Ankle(constants=ANKLE, fitted=("gian",)), "fitted: expected names among gain, time_constant_s"),
        (lambda: Ankle(constants=ANKLE, fitted="gain"), "fitted: expected names among gain, time_constant_s"),
        (lambda: Ankle(constants=ANKLE, session=((1.0, 0.0, 0.5),)), "session: expected rows of a begin, a later end"),
        (lambda: Ankle(constants=ANKLE, session=5), "session: expected rows of a begin, a later end"),
        (lambda: CoulombFriction(-0.04), "torque_nm: expected a number from 0 to "),
        (lambda: CoulombFriction("0.04"), "torque_nm: expected a number, found the text '0.04'"),
        (lambda: Model("ankle"), "rig: expected a Rig, found a str"),
        (lambda: fp.save_model(Ankle(constants=ANKLE), "model.toml"), "model: expected a Model, found a Ankle"),
        (lambda: Model(Ankle()), "constants: expected com_distance_m, f0_n"),
        (lambda: Model(RIGS["ankle"], (SensorOffset(), SensorOffset())), "the model has sensor_offset already"),
        (lambda: Model(RIGS["muscle"]) + CoulombFriction(), "coulomb_friction is not for the rig muscle"),
        (lambda: Model(RIGS["ankle"]) + CoulombFriction, "expected an effect, as in CoulombFriction(torque_nm=0.04)"),
        (lambda: Model(RIGS["ankle"]).with_parameters({"gian": 1.0}), "gian: unknown; did you mean gain?"),
        (lambda: Model(RIGS["ankle"]).with_parameters({"gain": -1.0}), "gain: expected a number above 0"),
    ],
)
def test_what_cannot_be_is_refused_where_it_is_built(built, told):
    with pytest.raises(fp.InputError) as raised:
        built()
    assert str(raised.value).startswith(told)


def test_a_negative_scale_of_gravity_that_a_fit_may_reach_is_saved_and_read(tmp_path):
    model = Model(Joint(gravity_scale=-0.5, constants=JOINT))
    fp.save_model(model, tmp_path / "model.toml")
    assert fp.load_model(tmp_path / "model.toml") == model


@pytest.mark.parametrize(
    ("changed", "told"),
    [
        (("gain = 0.65", "gain = -1.0"), "row {row}, column nominal.gain: expected a number above 0, found -1.0"),
        (("torque_nm = 0.04", "torque_nm = -0.04"), "column effects.coulomb_friction.torque_nm: expected a number fr"),
        (("moment_arm_m = 0.034", "moment_arm_m = 0"), "column constants.moment_arm_m: expected a number above 0 in m"),
        (("moment_arm_m = 0.034", ""), "column constants: expected moment_arm_m as well"),
        (('    "gain",\n', '    "gian",\n'), "column fitted: expected names among gain"),
    ],
)
def test_the_file_names_the_row_of_what_the_object_refuses(changed, told, tmp_path):
    text = model_toml(Model(RIGS["ankle"]) + CoulombFriction(0.04))
    assert changed[0] in text
    file = Path(tmp_path / "model.toml")
    file.write_text(text.replace(*changed))
    row = text.splitlines().index(changed[0]) + 1 if changed[0] in text.splitlines() else 0
    with pytest.raises(fp.InputError) as raised:
        fp.load_model(file)
    assert told.format(row=row) in str(raised.value)
    assert raised.value.row is not None


def test_what_is_taken_from_a_model_is_gone():
    friction = CoulombFriction(torque_nm=0.04)
    nominal = Model(RIGS["ankle"])
    model = nominal + friction
    for named in ("coulomb_friction", friction, CoulombFriction(torque_nm=0.01), CoulombFriction):
        assert model - named == nominal


@pytest.mark.parametrize("named", ["coloumb_friction", SensorOffset(), SensorOffset, "gain"])
def test_what_a_model_does_not_have_cannot_be_taken_from_it(named):
    model = Model(RIGS["ankle"]) + CoulombFriction(torque_nm=0.04)
    with pytest.raises(fp.InputError, match=r"unknown; (did you mean|expected) coulomb_friction"):
        model - named
    with pytest.raises(fp.InputError, match="unknown"):
        Model(RIGS["ankle"]) - named
