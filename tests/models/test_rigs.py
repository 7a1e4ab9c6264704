"""The rigs' equations against Pinocchio: inverse dynamics of the URDF minus the force terms must vanish."""

import math
import re

import numpy as np
import pinocchio as pin
import pytest
from models.cases import RIGS, foot

from fes_pin.data.errors import InputError
from fes_pin.data.trial import Trial, derived_trial
from fes_pin.models.compile.equations import derive
from fes_pin.models.compile.layout import make_layout
from fes_pin.models.effects import Backlash, SensorLag, effect_named
from fes_pin.models.model import Model
from fes_pin.models.rigs import Ankle, Muscle
from fes_pin.models.rigs.joint import joint_model
from fes_pin.models.rigs.rigid import (
    configuration,
    gravity_coefficients,
    joint_inertia,
    joint_is_revolute,
    load_urdf,
    point_foot,
    urdf_path,
)
from fes_pin.models.simulate import simulate
from fes_pin.paper.equation_1 import static_torque_nm

STATES = 200
TIMING = {"t0": 0.0, "dt": 5e-3, "step": 2.5e-3, "shift": 0.0}

ROBOT = """<?xml version="1.0"?>
<robot name="rig">
  <link name="world_frame"/>
  <link name="base"/>
  <link name="arm">
    <inertial>
      <origin xyz="{com}" rpy="0.3 -0.2 0.5"/><mass value="{mass}"/>
      <inertia ixx="0.011" ixy="0.001" ixz="-0.002" iyy="0.017" iyz="0.0005" izz="0.009"/>
    </inertial>
  </link>
  <link name="tip">
    <inertial>
      <origin xyz="0.02 0.1 -0.03"/><mass value="0.4"/>
      <inertia ixx="0.002" ixy="0" ixz="0" iyy="0.003" iyz="0" izz="0.0025"/>
    </inertial>
  </link>
  <joint name="mount" type="fixed">
    <parent link="world_frame"/><child link="base"/><origin xyz="0.1 -0.4 0.2" rpy="{base}"/>
  </joint>
  <joint name="moving" type="{kind}">
    <parent link="base"/><child link="arm"/><origin xyz="0 0.05 0.1" rpy="0.1 0.2 -0.3"/><axis xyz="{axis}"/>
    {limit}
  </joint>
  <joint name="weld" type="fixed">
    <parent link="arm"/><child link="tip"/><origin xyz="0.03 -0.02 0.25" rpy="0.4 0.1 0.2"/>
  </joint>
</robot>
"""
LIMIT = '<limit lower="-10" upper="10" effort="100" velocity="100"/>'
AXES = ("1 0 0", "0 1 0", "0 0 1", "0 -1 0", "0.6 0 0.8", "-0.3 0.5 0.81")
BASES = ("0 0 0", "1.5707963267948966 0 0", "0.4 -1.1 2.0", "3.14159 0.2 0")


def robot(folder, kind="revolute", axis="0 1 0", base="0 0 0", com="0.05 -0.02 0.2", mass=1.3):
    path = folder / "rig.urdf"
    limit = "" if kind == "continuous" else LIMIT
    path.write_text(ROBOT.format(kind=kind, axis=axis, base=base, com=com, mass=mass, limit=limit))
    return path


def acceleration(model, kind, inputs, constants, states):
    """The engine's acceleration at states, as a function (q, v, act, u) -> number, through CasADi's interpreter."""
    layout = make_layout(model, kind, inputs, ())
    rates = derive(model, layout).functions["rates"]
    values = {**model.parameters(), **dict.fromkeys(layout.unknowns, 0.0)}
    p = [values[n] for n in layout.values]
    c = [{**constants, **TIMING}[n] for n in layout.constants]
    memory = np.zeros(rates.size1_in(1))

    def at(state, u=()):
        out = np.array(rates([state[n] for n in states], memory, list(u), 0.0, 0.0, 0.0, p, c)).ravel()
        return dict(zip(states, out, strict=True))["v"]

    return at


def random_ankle(rng):
    m, length = rng.uniform(0.05, 0.4), rng.uniform(0.04, 0.2)
    known = {
        "foot_mass_kg": m,
        "com_distance_m": length,
        "moment_arm_m": rng.uniform(0.02, 0.06),
        "force_scale_n": rng.uniform(30.0, 90.0),
        "threshold_us": 180.0,
        "saturation_us": 1000.0,
        "f0_n": rng.uniform(1.0, 8.0),
        "f1_per_rad": rng.uniform(1.0, 3.5),
        "theta_r_rad": rng.uniform(0.8, 1.7),
    }
    inertia = m * length**2 * rng.uniform(1.0, 2.0)
    return Ankle(rng.uniform(0.3, 1.2), 0.05, inertia, rng.uniform(0.0, 0.2), constants=known)


def test_ankle_is_equation_1_and_pinocchio_to_1e_12():
    rng = np.random.default_rng(1)
    for _ in range(20):
        rig = random_ankle(rng)
        k, load = rig.constants, rng.uniform(0.3, 3.0)
        gravity = gravity_coefficients(point_foot(k["foot_mass_kg"], k["com_distance_m"]))
        constants = {**k, "gravity_cos": gravity[0], "gravity_sin": gravity[1], "load_kg": load}
        engine = acceleration(Model(rig), "motion", ("pulse_width_us",), constants, ("act", "q", "v"))
        body = foot(k["foot_mass_kg"], k["com_distance_m"], rig.inertia_kgm2)
        data = body.createData()
        for _ in range(STATES // 20):
            q, v, act = rng.uniform(0.0, math.pi), rng.uniform(-10.0, 10.0), rng.uniform(0.0, 1.0)
            a = engine({"q": q, "v": v, "act": act}, (0.0,))
            muscle = rig.gain * k["force_scale_n"] * act
            static = static_torque_nm(k, q, muscle, load)
            weight = k["foot_mass_kg"] * 9.81 * k["com_distance_m"] * math.cos(q)
            forces = static - weight - rig.damping_nms * v
            rnea = pin.rnea(body, data, np.array([q]), np.array([v]), np.array([a]))[0]
            size = abs(rig.inertia_kgm2 * a) + abs(forces) + 1.0
            assert abs(rnea - forces) <= 1e-12 * size
            assert abs(rig.inertia_kgm2 * a - (forces + weight)) <= 1e-12 * size


def test_the_ankle_urdf_is_the_rig_of_the_paper():
    model = load_urdf(urdf_path("ankle_rig.urdf"))
    assert gravity_coefficients(model) == pytest.approx((-0.12 * 9.81 * 0.08, 0.0), abs=1e-12)
    assert joint_inertia(model) == pytest.approx(1.0e-3, abs=1e-12)
    assert joint_inertia(foot(0.12, 0.08, 1.0e-3)) == pytest.approx(1.0e-3, rel=1e-12)


@pytest.mark.parametrize("kind", ["revolute", "continuous", "prismatic"])
@pytest.mark.parametrize("axis", AXES)
@pytest.mark.parametrize("base", BASES)
def test_any_joint_is_pinocchio_to_1e_12(tmp_path, kind, axis, base):
    rng = np.random.default_rng(2)
    path = robot(tmp_path, kind, axis, base)
    body = load_urdf(path)
    data = body.createData()
    assert (body.nv, joint_is_revolute(body)) == (1, kind != "prismatic")
    scales = {"inertia_scale": 1.0, "damping": 0.3, "gravity_scale": 1.0}
    rig = joint_model(path, {}, scales)
    engine = acceleration(Model(rig), "motion", ("effort",), {**rig.constants, "idle": 0.0}, ("q", "v"))
    for _ in range(20):
        q, v, effort = rng.uniform(-4.0, 4.0), rng.uniform(-5.0, 5.0), rng.uniform(-3.0, 3.0)
        a = engine({"q": q, "v": v}, (effort,))
        rnea = pin.rnea(body, data, configuration(body, q), np.array([v]), np.array([a]))[0]
        assert rnea == pytest.approx(effort - 0.3 * v, abs=1e-12 * (abs(effort) + 20.0))


def test_gravity_pulls_downwards(tmp_path):
    """A mass beside a horizontal axis falls, an upright slider sinks, a level one stays; signs without Pinocchio."""
    body = load_urdf(urdf_path("ankle_rig.urdf"))
    down = pin.aba(body, body.createData(), np.array([0.0]), np.zeros(1), np.zeros(1))[0]
    assert down == pytest.approx(0.12 * 9.81 * 0.08 / 1.0e-3)  # +y turns +x towards -z
    upright = ROBOT.replace('rpy="0.1 0.2 -0.3"', 'rpy="0 0 0"')
    for axis, expected in (("0 0 1", 9.81), ("0 0 -1", -9.81), ("1 0 0", 0.0)):
        path = tmp_path / "slide.urdf"
        path.write_text(upright.format(kind="prismatic", axis=axis, base="0 0 0", com="0 0 0", mass=1.3, limit=LIMIT))
        mass = 1.3 + 0.4
        cosine, sine = gravity_coefficients(load_urdf(path))
        assert cosine == pytest.approx(expected * mass, abs=1e-12)
        assert sine == pytest.approx(9.81 * mass if expected == 0.0 else 0.0, abs=1e-6)
        assert joint_inertia(load_urdf(path)) == pytest.approx(mass)


def test_a_prismatic_joint_weighs_the_same_everywhere(tmp_path):
    path = robot(tmp_path, "prismatic", "0.6 0 0.8", "0.4 -1.1 2.0")
    rig = joint_model(path, {}, {"inertia_scale": 1.0, "damping": 0.0, "gravity_scale": 1.0})
    engine = acceleration(Model(rig), "motion", (), {**rig.constants, "idle": 0.0}, ("q", "v"))
    assert engine({"q": 0.0, "v": 0.0}) == pytest.approx(engine({"q": 2.7, "v": 0.0}), rel=1e-14)
    assert engine({"q": 0.0, "v": 0.0}) != 0.0


@pytest.mark.parametrize("tilt", [-0.3, 0.1])
def test_a_tilted_slide_is_the_slide_of_a_tilted_urdf(tmp_path, tilt):
    """An axis along x that is raised towards +z: a rotation of the base by -tilt about y."""
    level = ROBOT.replace('rpy="0.1 0.2 -0.3"', 'rpy="0 0 0"')
    coefficients = []
    for turned in (0.2, 0.2 + tilt):
        path = tmp_path / "slide.urdf"
        base = f"0 {-turned} 0"
        path.write_text(level.format(kind="prismatic", axis="1 0 0", base=base, com="0 0 0", mass=1.3, limit=LIMIT))
        coefficients.append(gravity_coefficients(load_urdf(path)))
    (along, across), (expected, _) = coefficients
    assert along * math.cos(tilt) + across * math.sin(tilt) == pytest.approx(expected, abs=1e-12)


def test_fixed_links_are_part_of_the_body(tmp_path):
    with_tip = joint_inertia(load_urdf(robot(tmp_path)))
    text = robot(tmp_path).read_text().replace('<mass value="0.4"/>', '<mass value="0.8"/>')
    heavier = tmp_path / "heavier.urdf"
    heavier.write_text(text)
    assert joint_inertia(load_urdf(heavier)) > with_tip


def test_known_values_of_a_joint_are_not_fitted(tmp_path):
    rig = joint_model(robot(tmp_path), {"gravity_scale": 1.2}, {"inertia_scale": 0.9, "damping": 0.1})
    assert rig.fitted_parameters() == ("inertia_scale", "damping")
    assert (rig.inertia_scale, rig.damping, rig.gravity_scale) == (0.9, 0.1, 1.2)


def test_a_urdf_that_pinocchio_refuses_is_an_input_error(tmp_path, monkeypatch):
    path = robot(tmp_path)
    text = path.read_text()
    path.write_text(text.replace('link="base"/><child link="arm"', 'link="base"/><child link="no"'))
    with pytest.raises(InputError, match="expected a <child> that is a link of this file, found 'no'"):
        load_urdf(path)
    path.write_text(text)
    monkeypatch.setattr("fes_pin.models.rigs.rigid.mechanics", lambda _: "<robot/>")
    with pytest.raises(InputError, match="Pinocchio cannot read"):
        load_urdf(path)


def test_what_does_not_bear_on_the_motion_is_not_read(tmp_path):
    """Shapes that no parser accepts, or a robot without a name, are no matter of mass and gravity."""
    path = robot(tmp_path)
    expected = load_urdf(path)
    spoilt = path.read_text().replace("</inertial>", '</inertial><visual><geometry><box size="x"/></geometry></visual>')
    path.write_text(re.sub('<robot name="[^"]*"', "<robot", spoilt))
    found = load_urdf(path)
    assert found.inertias[1] == expected.inertias[1] and found.jointPlacements[1] == expected.jointPlacements[1]


@pytest.mark.parametrize("base", ["0 0 0", "0.4 -1.1 2.0"])
def test_a_joint_idles_where_it_hangs(tmp_path, base):
    """Gravity is zero there, and brings the joint back."""
    rig = joint_model(robot(tmp_path, "revolute", "0 1 0", base), {}, {"inertia_scale": 1.0, "damping": 0.0})
    idle = rig.trial_constants(Trial("swing", "motion", {"position": np.zeros(3)}, np.arange(3.0)))["idle"]
    engine = acceleration(Model(rig), "motion", (), {**rig.constants, "idle": idle}, ("q", "v"))
    beside = [engine({"q": idle + x, "v": 0.0}) for x in (-0.1, 0.0, 0.1)]
    assert beside[0] > 0 > beside[2]
    assert abs(beside[1]) < 1e-12 * beside[0]


@pytest.mark.parametrize(("held", "turns"), [(0.1, 0.0), (-0.1, 0.0), (3.0, 1.0), (-3.3, -1.0), (6.4, 2.0)])
def test_a_joint_that_an_effort_holds_idles_beside_it(tmp_path, held, turns):
    """A gain about where an upright joint would hang is an offset by another name."""
    rig = joint_model(robot(tmp_path, "revolute", "0 1 0"), {}, {"inertia_scale": 1.0, "damping": 0.0})
    hanging = rig.trial_constants(Trial("swing", "motion", {"position": np.zeros(3)}, np.arange(3.0)))["idle"]
    columns = {"position": np.full(3, hanging + held), "effort": np.zeros(3)}
    measured = Trial("held", "motion", columns, np.arange(3.0))
    stated = Trial("held", "motion", {"effort": np.zeros(3)}, np.arange(3.0), {"position0": hanging + held})
    unread = {**columns, "position": np.full(3, np.nan)}
    hidden = derived_trial(measured, columns=unread, conditions=stated.conditions)
    for trial in (measured, stated, hidden):
        assert rig.trial_constants(trial)["idle"] == pytest.approx(hanging + turns * np.pi)


@pytest.mark.parametrize(
    ("kind", "units"),
    [("revolute", ("N m/rad", "rad", "rad/s", "N m s/rad")), ("prismatic", ("N/m", "m", "m/s", "N s/m"))],
)
def test_units_are_those_of_the_rig(tmp_path, kind, units):
    rig = joint_model(robot(tmp_path, kind), {}, {"inertia_scale": 1.0, "damping": 0.0})
    info = (Model(rig) + effect_named("parallel_stiffness")() + effect_named("sensor_drift")()).parameter_info()
    names = ("parallel_stiffness.stiffness_nm_per_rad", "parallel_stiffness.rest_angle_rad", "sensor_drift.rate_per_s")
    assert tuple(info[n].unit for n in (*names, "damping")) == units


def test_a_force_sensor_is_off_by_newtons():
    assert (Model(Muscle()) + effect_named("sensor_offset")()).parameter_info()["sensor_offset.offset"].unit == "N"


def test_a_sensor_lags_behind_a_play_and_not_beside_it():
    """Where a play stands its reading comes to rest; a low pass of the play, by its exact recursion."""
    lag, dt = 0.03, 1e-3
    time = np.arange(3000) * dt
    swung = Trial("t", "motion", {"effort": 0.4 * np.sin(4.0 * time)}, time, {"position0": 0.0, "velocity0": 0.0})
    plain = Model(RIGS["joint"]) + Backlash(half_width=0.02)
    play, late = (simulate(m, swung)["position"] for m in (plain, plain + SensorLag(lag_s=lag)))
    keep, expected = np.exp(-dt / lag), np.zeros(len(time))
    for k in range(1, len(time)):
        expected[k] = keep * expected[k - 1] + (1.0 - keep) * 0.5 * (play[k] + play[k - 1])
    assert np.ptp(play) > 0.1
    assert np.abs(late - expected).max() < 2e-3 * np.ptp(play)
