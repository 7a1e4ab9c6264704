"""Columns in another convention than is stated are named, and read so where no cause could do the same."""

from dataclasses import replace

import numpy as np
import pytest
from bench import DAMPING, INERTIA, WEIGHT, study, trial
from driven_rigs.draw import draw
from harness.convention import KINDS, said_of, spoiled

import fes_pin as fp
from fes_pin.prepare.measured import measured_study

RIGS = {0: (), 1: ("coulomb_friction",), 3: ("joint_stop",)}
"""What is hidden in rigs of a seed."""
UNITS = [k for k in KINDS if k not in ("position in counts", "position that wraps")]


@pytest.fixture(scope="module")
def rigs(tmp_path_factory):
    """Studies as they are, by seed."""
    folder = tmp_path_factory.mktemp("rigs")
    return {k: fp.read_study(draw(causes, 0.3, 8100 + k, folder / str(k)).study) for k, causes in RIGS.items()}


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    """Two trials of an arm under gravity."""
    return study(tmp_path_factory.mktemp("arm"), [trial(5), trial(6)])


@pytest.mark.parametrize("kind", [None, *KINDS])
@pytest.mark.parametrize("rig", RIGS)
def test_a_wrong_convention_is_named_and_a_right_one_is_not(rig, kind, rigs):
    if kind is None:
        assert not said_of(rigs[rig])
    elif one := spoiled(rigs[rig], kind):
        found = said_of(one[0])
        assert found and all(said.startswith(one[1]) for said in found)


@pytest.mark.parametrize("kind", UNITS)
def test_what_is_taken_has_the_inertia_that_the_right_columns_have(kind, arm):
    """Trials are as if the convention had been stated, but for a mirror of both columns."""
    wrong, words = spoiled(arm, kind)
    measured = measured_study(wrong)
    assert measured.warnings[0].startswith(words) and measured.warnings[0] in fp.check(wrong).odd
    sign = -1.0 if kind == "position with the other sign" and "turned round" in measured.warnings[0] else 1.0
    sign = 1.0 if measured.warnings[0].startswith("position has") else sign
    for a, b in zip(measured.study.trials, arm.trials, strict=True):
        for column in ("position", "effort"):
            assert np.allclose(sign * a[column], b[column], rtol=1e-9, atol=1e-12)


def test_a_scale_that_is_stated_is_not_doubted_and_a_unit_that_is_stated_wrongly_is(arm, tmp_path):
    (tmp_path / "rig.urdf").write_bytes(arm.urdf.read_bytes())
    for one in arm.trials:
        table = np.column_stack([one.time, one["position"], one["effort"]])
        np.savetxt(tmp_path / f"{one.name}.csv", table, "%.7f", ",", header="time_s,position,effort", comments="")
    text = (
        '[study]\nname = "arm"\nrig = "joint"\n[rig]\nurdf = "rig.urdf"\n[start]\ninertia_scale = 1.2\ndamping = 0.1\n'
    )
    text += 'gravity_scale = 1.0\n[columns]\neffort = { name = "effort", SAID }\n'
    each = "".join(f'[[trial]]\nfile = "{t.name}.csv"\nkind = "motion"\n' for t in arm.trials)
    said = {}
    for how in ("scale = 1.0", "scale = -1.0", 'unit = "mN m"', 'unit = "N m"'):
        (tmp_path / "study.toml").write_text(text.replace("SAID", how) + each)
        said[how] = said_of(fp.read_study(tmp_path))
    assert not said["scale = 1.0"] and not said['unit = "N m"']
    assert said['unit = "mN m"'][0].startswith("effort is in N m, not mN m: inertia_scale ")
    assert said["scale = -1.0"][0].startswith("position has the other sign")  # the one that may have


@pytest.mark.parametrize("seed", range(3))
def test_a_pendulum_in_degrees_that_nothing_drives_is_read_so(seed, tmp_path):
    rng = np.random.default_rng(seed)
    dt, state, read = 0.005, np.array([rng.uniform(0.6, 2.0), 0.0]), []
    for _ in range(1600):
        read.append(state[0] + 1e-4 * rng.standard_normal())
        for _ in range(5):
            pull = -(WEIGHT * np.sin(state[0]) + 0.2 * DAMPING * state[1] + 0.01 * np.tanh(state[1] / 0.02)) / INERTIA
            state = state + dt / 5.0 * np.array([state[1] + 0.1 * dt * pull, pull])
    time = np.arange(len(read)) * dt
    right = study(tmp_path, [fp.Trial("a", "motion", {"position": np.array(read)}, time)])
    assert not said_of(right)
    wrong = replace(right, trials=(right.trials[0].with_columns(position=np.degrees(read)),))
    assert said_of(wrong)[0].startswith("position is in degrees, not rad: gravity leaves ")
    assert np.allclose(measured_study(wrong).study.trials[0]["position"], read)


def test_a_diagnosis_in_degrees_names_what_one_in_rad_does(tmp_path):
    right = study(tmp_path, [trial(k, friction=0.15, seconds=6.0) for k in (1, 2, 3)])
    wrong, _ = spoiled(right, "position in degrees")
    found = fp.diagnose(wrong)
    assert [c.name for c in found.causes] == ["coulomb_friction"]
    assert found.extended.values["coulomb_friction.torque_nm"] == pytest.approx(0.15, rel=0.2)
    assert any(one.startswith("position is in degrees, not rad") for one in found.warnings)


def commanded(seed, slope, folder, coupled):
    """An arm that something else moves, with its load or without, and an effort of this slope over the sine."""
    rng = np.random.default_rng(seed)
    time = np.arange(2000) * 0.005
    waves = zip(rng.uniform(0.2, 1.5, 3), rng.uniform(0.1, 0.3, 3), rng.uniform(0.0, 6.0, 3), strict=True)
    parts = [(a, 2.0 * np.pi * f, p) for f, a, p in waves]
    q = sum(a * np.sin(w * time + p) for a, w, p in parts)
    inertial = INERTIA * sum(-a * w**2 * np.sin(w * time + p) for a, w, p in parts)
    effort = slope * np.sin(q) + (inertial + WEIGHT * np.sin(q)) * coupled
    read = {"position": q + 1e-5 * rng.standard_normal(len(q)), "effort": effort + 1e-3 * rng.standard_normal(len(q))}
    return study(folder, [fp.Trial(f"{seed}", "imposed", read, time)])


@pytest.mark.parametrize("seed", range(3))
def test_an_effort_that_falls_with_the_angle_is_a_command(seed, tmp_path):
    (said,) = (one for one in fp.check(commanded(seed, -71.0, tmp_path, 0.0)).odd if "answers the angle" in one)
    assert said.endswith("with -71 sin(position): it is a controller's command or has the other sign; no load pulls so")


@pytest.mark.parametrize(("slope", "coupled"), [(0.0, 1.0), (40.0, 1.0), (40.0, 0.0)])
def test_a_load_answers_no_angle(slope, coupled, tmp_path):
    assert not [one for one in fp.check(commanded(4, slope, tmp_path, coupled)).odd if "answers the angle" in one]
