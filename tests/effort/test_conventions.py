"""Columns in another convention than is stated are named, and read so where no cause could do the same."""

from dataclasses import replace

import numpy as np
import pytest
from bench import DAMPING, INERTIA, WEIGHT, study, trial
from driven_rigs.draw import draw
from harness.convention import KINDS, said_of, spoiled

import fes_pin as fp
from fes_pin.models.nominal import nominal_model
from fes_pin.prepare.measured import measured_study

CAUSES = [(), ("coulomb_friction",), ("parallel_stiffness",), ("joint_stop",), ("passive_relaxation",)]
UNITS = [k for k in KINDS if k not in ("position in counts", "position that wraps")]


def drawn(causes, seed, folder):
    return fp.read_study(draw(causes, 0.3, seed, folder).study)


@pytest.mark.parametrize("causes", CAUSES, ids=lambda c: "+".join(c) or "nothing")
@pytest.mark.parametrize("kind", [None, *KINDS])
def test_a_wrong_convention_is_named_and_a_right_one_is_not(kind, causes, tmp_path):
    right = drawn(causes, 8100 + len(causes[0] if causes else ""), tmp_path)
    if kind is None:
        assert not said_of(right)
    elif one := spoiled(right, kind):
        found = said_of(one[0])
        assert found and all(said.startswith(one[1]) for said in found)


@pytest.mark.parametrize("kind", UNITS)
def test_what_is_taken_has_the_inertia_that_the_right_columns_have(kind, tmp_path):
    """Trials are as if the convention had been stated, but for a mirror of both columns."""
    right = study(tmp_path, [trial(5), trial(6)])
    wrong, words = spoiled(right, kind)
    measured = measured_study(wrong)
    assert measured.warnings[0].startswith(words) and measured.warnings[0] in fp.check(wrong).odd
    sign = -1.0 if kind == "position with the other sign" and "turned round" in measured.warnings[0] else 1.0
    sign = 1.0 if measured.warnings[0].startswith("position has") else sign
    for a, b in zip(measured.study.trials, right.trials, strict=True):
        for column in ("position", "effort"):
            assert np.allclose(sign * a[column], b[column], rtol=1e-9, atol=1e-12)


def test_a_scale_that_is_stated_is_not_doubted_and_a_unit_that_is_stated_wrongly_is(tmp_path):
    right = study(tmp_path, [trial(7), trial(8)])
    for one in right.trials:
        table = np.column_stack([one.time, one["position"], one["effort"]])
        np.savetxt(tmp_path / f"{one.name}.csv", table, "%.7f", ",", header="time_s,position,effort", comments="")
    text = (
        '[study]\nname = "arm"\nrig = "joint"\n[rig]\nurdf = "rig.urdf"\n[start]\ninertia_scale = 1.2\ndamping = 0.1\n'
    )
    text += 'gravity_scale = 1.0\n[columns]\neffort = { name = "effort", SAID }\n'
    each = "".join(f'[[trial]]\nfile = "{t.name}.csv"\nkind = "motion"\n' for t in right.trials)
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
    assert any(one.startswith("position is in degrees, not rad") for one in found.as_dict()["warnings"])
    assert nominal_model(wrong).rig.constants["inertia"] == pytest.approx(INERTIA)
