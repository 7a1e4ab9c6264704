"""The extended joint as URDF, against what Pinocchio reads in it."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import solve_ivp

from fes_pin.data.errors import InputError
from fes_pin.data.templates import pendulum, rod, slide
from fes_pin.models.effects import CoulombFriction, SensorOffset
from fes_pin.models.model import Model
from fes_pin.models.rigs.joint import joint_model
from fes_pin.models.urdf_out import extended_urdf

TURNED = """<robot name="r"><link name="base"/>
  <link name="arm"><inertial><origin xyz="0.05 0.02 -0.2" rpy="0.3 -0.5 0.9"/><mass value="0.7"/>
    <inertia ixx="0.004" ixy="0.0002" ixz="0.0001" iyy="0.005" iyz="-0.0003" izz="0.003"/></inertial></link>
  <link name="weight"><inertial><origin xyz="0 0 0.01"/><mass value="0.4"/>
    <inertia ixx="1e-4" ixy="0" ixz="0" iyy="1e-4" iyz="0" izz="1e-4"/></inertial></link>
  <joint name="pivot" type="continuous"><origin rpy="0.2 0.1 0"/><parent link="base"/><child link="arm"/>
    <axis xyz="0.6 0.8 0"/></joint>
  <joint name="bolt" type="fixed"><origin xyz="0 0 -0.3" rpy="0 1 0"/><parent link="arm"/><child link="weight"/></joint>
</robot>"""
RIGS = {"pendulum": pendulum(0.3, 0.5), "rod": rod(0.4, 1.2), "turned": TURNED}


def fitted(path, **values):
    start = {"inertia_scale": 1.0, "damping": 0.0, "gravity_scale": 1.0, **values}
    return Model(joint_model(path, {}, start))


@pytest.mark.parametrize("scale", [1.7, 0.1])
@pytest.mark.parametrize("rig", RIGS)
def test_pinocchio_reads_the_fitted_inertia_gravity_damping_and_friction(tmp_path, rig, scale):
    path, out = tmp_path / "a.urdf", tmp_path / "b.urdf"
    path.write_text(RIGS[rig])
    model = fitted(path, inertia_scale=scale, gravity_scale=1.2, damping=0.03) + CoulombFriction(torque_nm=0.2)
    text, left_out, changed = extended_urdf(model + SensorOffset(), path)
    assert left_out == ("sensor_offset",)
    assert bool(changed) == (scale < 0.5)
    out.write_bytes(text)
    before, after = (pin.buildModelFromUrdf(str(p)) for p in (path, out))
    one, two = before.createData(), after.createData()
    for angle in (0.0, 0.7, 2.5):
        q = np.array([np.cos(angle), np.sin(angle)])
        assert pin.crba(after, two, q) == pytest.approx(scale * pin.crba(before, one, q), rel=1e-9)
        g = pin.computeGeneralizedGravity(before, one, q)
        assert pin.computeGeneralizedGravity(after, two, q) == pytest.approx(1.2 * g, rel=1e-9)
    assert (after.damping[0], after.friction[0]) == pytest.approx((0.03, 0.2))


def test_a_slide(tmp_path):
    path, out = tmp_path / "a.urdf", tmp_path / "b.urdf"
    path.write_text(slide(2.0))
    out.write_bytes(extended_urdf(fitted(path, inertia_scale=1.5, damping=3.0), path)[0])
    after = pin.buildModelFromUrdf(str(out))
    assert pin.crba(after, after.createData(), np.zeros(1))[0, 0] == pytest.approx(3.0)
    assert after.damping[0] == 3.0


@pytest.mark.parametrize("scale", [1.7, 0.1])
def test_numpy_numbers_are_written_as_numbers(tmp_path, scale):
    path = tmp_path / "a.urdf"
    path.write_text(TURNED)
    plain = {"inertia_scale": scale, "gravity_scale": 1.2, "damping": 0.03}
    of_numpy = {name: np.float64(value) for name, value in plain.items()}
    model = fitted(path, **of_numpy) + CoulombFriction(torque_nm=np.float64(0.2))
    assert extended_urdf(model, path) == extended_urdf(fitted(path, **plain) + CoulombFriction(torque_nm=0.2), path)
    assert rod(np.float64(0.4), np.float32(1.5)) == rod(0.4, 1.5)


def test_what_no_rigid_body_has_is_refused(tmp_path):
    path, other = tmp_path / "a.urdf", tmp_path / "b.urdf"
    path.write_text(RIGS["pendulum"])
    other.write_text(RIGS["rod"])
    with pytest.raises(InputError, match="no mass weighs so"):
        extended_urdf(fitted(path, gravity_scale=-1.0), path)
    with pytest.raises(InputError, match="expected the URDF of the model's study"):
        extended_urdf(fitted(path), other)


def test_templates_swing_as_their_equations_say(tmp_path):
    """A rod of length L turns about its end like m L^2 / 3; upright its zero is where it stands."""
    for upright in (False, True):
        path = tmp_path / "a.urdf"
        path.write_text(rod(0.4, 1.2, upright))
        constants = fitted(path).rig.constants
        assert constants["inertia"] == pytest.approx(1.2 * 0.4**2 / 3)
        assert constants["gravity_sin"] == pytest.approx((-1 if upright else 1) * 1.2 * 9.81 * 0.2)
        assert constants["gravity_cos"] == pytest.approx(0.0, abs=1e-12)
    swing = solve_ivp(lambda t, x: [x[1], -9.81 / 0.3 * np.sin(x[0])], (0, 1), [0.5, 0], t_eval=[1.0], rtol=1e-9)
    path.write_text(pendulum(0.3, 0.5))
    from fes_pin.data.trial import Trial
    from fes_pin.models.simulate import simulate

    time = np.linspace(0.0, 1.0, 501)
    trial = Trial("a", "motion", {}, time, {"position0": 0.5, "velocity0": 0.0})
    model = fitted(path)
    assert simulate(replace(model), trial)["position"][-1] == pytest.approx(swing.y[0, -1], abs=1e-5)
