"""Dry friction that a URDF states: part of the nominal joint, and no missing cause."""

import numpy as np
import pytest

import fes_pin as fp
from fes_pin.effort.search import searched
from fes_pin.models.effects.coulomb_friction import FrictionBeyond
from fes_pin.models.rigs.joint import joint_model
from fes_pin.models.simulate import simulate
from fes_pin.models.store import load_model, model_toml, save_model

RIG = """<robot name="r"><link name="base"/>
  <link name="arm"><inertial><origin xyz="0 0 -0.2"/><mass value="0.8"/>
    <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial></link>
  <joint name="pivot" type="continuous"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/>{}</joint></robot>"""
INERTIA, WEIGHT, DAMPING = 0.8 * 0.2**2 + 0.01, 0.8 * 9.81 * 0.2, 0.05
START = {"inertia_scale": 1.0, "damping": 0.04, "gravity_scale": 1.0}


def joint(folder, stated=None, **start):
    path = folder / f"{stated}.urdf"
    path.write_text(RIG.format("" if stated is None else f'<dynamics friction="{stated}"/>'))
    return joint_model(path, {}, {**START, **start})


def imposed(true: float, seed: int) -> list[fp.Trial]:
    """Two trials of a joint that a lever moves, with white noise of position and effort."""
    rng, time, out = np.random.default_rng(seed), np.arange(900) * 0.005, []
    for k in range(2):
        sines = [(rng.uniform(0.2, 0.5), 2 * np.pi * f, rng.uniform(0, 6)) for f in rng.uniform(0.2, 1.3, 3)]
        q = sum(a * np.sin(w * time + p) for a, w, p in sines)
        v = sum(a * w * np.cos(w * time + p) for a, w, p in sines)
        bend = -sum(a * w**2 * np.sin(w * time + p) for a, w, p in sines)
        effort = INERTIA * bend + WEIGHT * np.sin(q) + DAMPING * v + true * np.sign(v)
        noisy = {"effort": effort + 0.02 * rng.standard_normal(900), "position": q + 2e-4 * rng.standard_normal(900)}
        out.append(fp.Trial(f"t{k}", "imposed", noisy, time, {}))
    return out


CASES = [
    *((0.2, 0.2), (0.1, 0.1), (0.05, 0.05)),  # right: nothing is missing
    *((0.3, 0.1), (0.1, 0.02)),  # too small
    *((0.05, 0.2), (0.1, 0.4), (0.0, 0.2)),  # too large, and no friction at all
    *((0.2, None), (0.2, 0.0), (0.0, None), (0.0, 0.0)),  # none is stated
]


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize(("true", "stated"), CASES)
def test_stated_friction_is_not_missing_and_a_wrong_one_is_named(tmp_path, true, stated, seed):
    found = searched(joint(tmp_path, stated), imposed(true, seed))
    wrong = true != (stated or 0.0)
    assert found.names == (("coulomb_friction",) if wrong else ())
    if wrong:
        (friction,) = found.model(found.final(found.state.found.best)).effects
        assert friction.torque_nm == pytest.approx(true - (stated or 0.0), abs=0.01)
        assert isinstance(friction, FrictionBeyond) == bool(stated)


@pytest.mark.parametrize("form", [{}, {"softness": 0.5}, {"stiction": 0.3}, {"presliding": 0.02}, {"stretch": 0.003}])
@pytest.mark.parametrize("kind", ["motion", "imposed"])
def test_stated_friction_and_what_is_beyond_it_act_as_one(tmp_path, kind, form):
    time = np.arange(400) * 0.005
    columns = {"effort": 0.8 * np.sin(5 * time), "position": 0.4 * np.sin(5 * time)}
    trial = fp.Trial("a", kind, columns, time, {})
    plain = fp.Model(joint(tmp_path)) + fp.effects.CoulombFriction(torque_nm=0.2, **form)
    name = "effort" if kind == "imposed" else "position"
    wanted = simulate(plain, trial)[name]
    for stated in (0.05, 0.6):
        model = fp.Model(joint(tmp_path, stated)) + FrictionBeyond(torque_nm=0.2 - stated, **form)
        assert simulate(model, trial)[name] == pytest.approx(wanted, abs=1e-9)
    if not form:
        assert simulate(fp.Model(joint(tmp_path, 0.2)), trial)[name] == pytest.approx(wanted, abs=1e-9)


def test_a_model_with_less_than_is_stated_is_stored(tmp_path):
    model = fp.Model(joint(tmp_path, 0.3)) + FrictionBeyond(torque_nm=-0.2)
    save_model(model, tmp_path / "model.toml")
    assert load_model(tmp_path / "model.toml") == model


def test_without_friction_the_nominal_joint_is_as_it_was(tmp_path):
    texts = {model_toml(fp.Model(joint(tmp_path, stated))) for stated in (None, 0.0, "0.000")}
    assert len(texts) == 1 and "friction" not in texts.pop()


def test_a_gain_that_only_the_stated_friction_determines_is_no_candidate(tmp_path):
    def names(rig):
        return {e.name for e in fp.load_library().effects_for(rig)}

    assert "effort_gain" not in names(joint(tmp_path, 0.2))
    path = tmp_path / "0.2.urdf"
    assert "effort_gain" in names(joint_model(path, {"gravity_scale": 1.0}, {"inertia_scale": 1.0, "damping": 0.1}))
    assert names(joint(tmp_path)) == names(joint(tmp_path, 0.2)) | {"effort_gain"}
