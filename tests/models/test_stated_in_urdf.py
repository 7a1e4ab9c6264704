"""What a URDF states of its joint: damping as a start value, and the limit of an actuator."""

import numpy as np
import pytest

import fes_pin as fp
from fes_pin.data.errors import InputError
from fes_pin.data.study import Study, read_study, write_study
from fes_pin.data.urdf import stated_of_joint
from fes_pin.prepare.measured import measured_study

RIG = """<robot name="r"><link name="base"/>
  <link name="arm"><inertial><origin xyz="0 0 -0.2"/><mass value="0.8"/>
    <inertia ixx="0.01" ixy="0" ixz="0" iyy="{iyy}" iyz="0" izz="0.01"/></inertial></link>
  <joint name="pivot" type="{kind}"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/>{more}</joint></robot>"""
LIMIT = '<limit lower="-3" upper="3" velocity="9" effort="{}"/>'


def rig(folder, more="", kind="continuous", iyy="0.01"):
    path = folder / "rig.urdf"
    path.write_text(RIG.format(more=more, kind=kind, iyy=iyy))
    return path


def trial(size: float, noise: float, rng: np.random.Generator, name="a") -> fp.Trial:
    time = np.arange(400) * 0.01
    effort = np.clip(1.5 * size * np.sin(2 * time), -size, size) + noise * rng.standard_normal(400)
    columns = {"effort": effort, "position": 0.3 * np.sin(2 * time) + 1e-4 * rng.standard_normal(400)}
    return fp.Trial(name, "imposed", columns, time, {})


def study(urdf, trials, **start) -> Study:
    known = {"inertia_scale": 1.0, "gravity_scale": 1.0, **start}
    return Study("s", "joint", {}, known, tuple(trials), files={"urdf": urdf})


def odd(one: Study) -> str:
    return "\n".join(measured_study(one).odd())


@pytest.mark.parametrize("seed", range(6))
def test_an_effort_beyond_the_limit_is_said(tmp_path, seed):
    rng = np.random.default_rng(seed)
    most = float(f"{10 ** rng.uniform(-1, 2.9):.3g}")
    path = rig(tmp_path, LIMIT.format(most), "revolute")
    beyond, within = most * rng.uniform(1.1, 3.0), most * rng.uniform(0.3, 1.0)
    trials = [trial(within, 0.02 * most, rng), trial(beyond, 0.01 * most, rng, "b")]
    assert f"in trial b, and the URDF's limit is {most:.4g}" in odd(study(path, trials, damping=0.1))
    assert "limit" not in odd(study(path, trials[:1], damping=0.1))


@pytest.mark.parametrize("placeholder", ["0", "1000", "1e6", "0.0"])
def test_a_placeholder_is_no_limit(tmp_path, placeholder):
    path = rig(tmp_path, LIMIT.format(placeholder), "revolute")
    assert "limit" not in odd(study(path, [trial(30.0, 0.1, np.random.default_rng(1))], damping=0.1))


def test_damping_that_the_urdf_states_may_be_left_out(tmp_path):
    one = trial(1.0, 0.01, np.random.default_rng(2))
    path = rig(tmp_path, '<dynamics damping="0.07"/>')
    made = study(path, [one])
    assert made.start["damping"] == 0.07
    assert "damping starts at the URDF's 0.07 N m s/rad" in odd(made)
    assert "damping" not in odd(study(path, [one], damping=0.1))
    write_study(made, tmp_path / "out")
    toml = tmp_path / "out" / "study.toml"
    toml.write_text(toml.read_text().replace("damping = 0.07\n", ""))
    assert read_study(toml) == made
    (tmp_path / "out" / "urdf.urdf").write_text(RIG.format(more="", kind="continuous", iyy="0.01"))
    with pytest.raises(InputError, match="missing; expected a number in N m s/rad") as caught:
        read_study(toml)
    assert caught.value.column == "start.damping"


def test_known_damping_is_not_taken_from_the_urdf(tmp_path):
    path, one = rig(tmp_path, '<dynamics damping="0.07"/>'), trial(1.0, 0.01, np.random.default_rng(2))
    made = Study("s", "joint", {"damping": 0.2}, {"inertia_scale": 1.0}, (one,), files={"urdf": path})
    assert made.start == {"inertia_scale": 1.0}


@pytest.mark.parametrize("said", ["damping='-1'", "friction='-0.1'", "friction='much'"])
def test_what_no_joint_has_is_refused(tmp_path, said):
    with pytest.raises(InputError, match=r"<dynamics>") as caught:
        stated_of_joint(rig(tmp_path, f"<dynamics {said}/>"))
    assert caught.value.column == "pivot" and caught.value.row == 4


def test_moments_that_no_body_has_are_warned_of_in_a_study(tmp_path):
    """The contract has studies that state them read."""
    path = rig(tmp_path, '<dynamics damping="0.07"/>', iyy="0.05")
    said = odd(study(path, [trial(1.0, 0.01, np.random.default_rng(2))]))
    assert "the URDF, row 2, link arm: no body has the principal moments 0.01, 0.01, 0.05 kg m2" in said
