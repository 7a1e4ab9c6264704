"""Models of several groups that share their parameters, but for what an item gives one of them."""

import pytest
from data import studies

import fes_pin as fp
from fes_pin.contrasts.grouped import GroupedModel
from fes_pin.infer.keys import Key
from fes_pin.models.effects.coulomb_friction import CoulombFriction
from fes_pin.models.nominal import nominal_model


@pytest.fixture
def shared(tmp_path):
    nominal = nominal_model(fp.read_study(studies.ankle(tmp_path / "study")))
    return GroupedModel(dict.fromkeys(("a", "b", "c"), nominal))


FRICTION = CoulombFriction(torque_nm=0.05)


def test_a_parameter_differs_in_one_group(shared):
    model = shared.having({Key("gain", group="b")})
    assert set(model.free) == {*shared.free, "gain:b"}
    moved = model.with_parameters({"gain:b": 2.0 * model.parameters()["gain"]})
    assert moved.models["b"].parameters()["gain"] == 2.0 * moved.models["c"].parameters()["gain"]


def test_a_cause_of_one_group_is_wholly_its_own(shared):
    model = shared.having({Key("coulomb_friction", group="c")}, (FRICTION,))
    assert [len(m.effects) for m in model.models.values()] == [0, 0, 1]
    assert all(n.endswith(":c") for n in model.parameters() if n.startswith("coulomb_friction"))


def test_a_cause_of_all_groups_differs_in_its_size_alone(shared):
    model = shared.having({Key("coulomb_friction"), Key("coulomb_friction", group="b")}, (FRICTION,))
    assert all(len(m.effects) == 1 for m in model.models.values())
    own = {n for n, g in model.own}
    assert own == {f"coulomb_friction.{n}" for n in FRICTION.amplitudes()}


def test_without_the_cause_of_all_groups_the_change_keeps_its_form(shared):
    both = {Key("coulomb_friction"), Key("coulomb_friction", group="b")}
    model = shared.having(both, (FRICTION,)).having({Key("coulomb_friction", group="b")})
    assert [len(m.effects) for m in model.models.values()] == [0, 1, 0]
    assert model.models["b"].effects == (FRICTION,)


def test_what_groups_share_again_has_the_value_of_the_first(shared):
    model = shared.having({Key("gain", group="b")}).with_parameters({"gain:b": 9.0})
    values = {m.parameters()["gain"] for m in model.having(()).models.values()}
    assert values == {shared.parameters()["gain"]}
