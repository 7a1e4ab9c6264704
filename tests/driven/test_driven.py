"""Rigs that a controller drives, made without the engine: what is hidden is named, nothing is not."""

from dataclasses import replace

import numpy as np
import pytest
from driven_rigs.draw import BASES, draw

from fes_pin.data.study import read_study
from fes_pin.diagnosis.diagnosis import diagnose_joint
from fes_pin.diagnosis.rejected import UNMOVED


def found_in(causes, seed, folder, size=0.3):
    drawn = draw(causes, size, seed, folder)
    return drawn, diagnose_joint(read_study(drawn.study))


@pytest.mark.parametrize("seed", [11, 12])
def test_nothing_hidden_is_adequate(seed, tmp_path):
    drawn, found = found_in((), seed, tmp_path)
    assert found.verdict == "adequate"
    assert not found.causes
    for name in ("inertia_scale", "damping"):
        assert abs(found.extended.values[name] - drawn.truth[name]) < 4.0 * found.extended.std(name)
    (random,) = found.random
    assert 0.003 < random.share < 0.05


def test_dry_friction_is_named_alone_with_its_size(tmp_path):
    drawn, found = found_in(("coulomb_friction",), 13, tmp_path)
    (cause,) = found.causes
    assert cause.name == "coulomb_friction"
    assert cause.equivalents == ()
    assert cause.parameters["torque_nm"].value == pytest.approx(drawn.truth["coulomb_friction"], rel=0.15)
    assert cause.gain_held_out.low > 50.0
    assert found.extended.values["inertia_scale"] == pytest.approx(1.0, abs=0.02)
    record = found.record()
    before, after = (record[which]["error_percent"] for which in ("nominal", "extended"))
    assert set(after) == {"fit", "held_out", "one_step", "horizon", "free"}
    assert after["one_step"] < after["horizon"] < 0.2 * before["horizon"]
    assert (after["free"] is None) == (drawn.base == "upright")


def test_play_before_the_encoder_is_named_alone_with_its_width(tmp_path):
    """Within the slack the reading says nothing of the joint: tangents alone would let the filter go astray."""
    drawn, found = found_in(("backlash",), 15, tmp_path)
    (cause,) = found.causes
    assert (cause.name, cause.equivalents) == ("backlash", ())
    assert cause.parameters["half_width"].value == pytest.approx(drawn.truth["backlash"], rel=0.05)
    assert found.extended.values["inertia_scale"] == pytest.approx(1.0, abs=0.03)


def test_what_no_cause_explains_is_said(tmp_path):
    """An effort that is not recorded, for which noise stands: no set of causes predicts better than a mean."""
    drawn = draw((), 0.3, 14, tmp_path)
    study = read_study(drawn.study)
    rng = np.random.default_rng(0)
    trials = tuple(t.with_columns(effort=rng.permutation(t["effort"])) for t in study.trials)
    found = diagnose_joint(replace(study, trials=trials))
    assert found.verdict == "unexplained" and not found.causes
    assert found.remainder.unexplained
    assert found.reason == UNMOVED


@pytest.mark.parametrize(("seed", "until"), [(13, None), (14, 0.4)])
def test_a_sensor_that_is_stuck_is_no_cause(seed, until, tmp_path):
    """From the middle of every trial on, or for a while: it is said, left out, and nothing is named for it."""
    study = read_study(draw((), 0.3, seed, tmp_path).study)
    trials = tuple(t.with_columns(position=stuck_from_the_middle(t, until)) for t in study.trials)
    found = diagnose_joint(replace(study, trials=trials))
    assert (found.verdict, found.causes) == ("adequate", ())
    assert sum("as a stuck sensor does" in w for w in found.warnings) == len(study.trials)


def stuck_from_the_middle(trial, seconds):
    position, half = np.array(trial["position"]), len(trial) // 2
    position[half : None if seconds is None else half + round(seconds / trial.dt)] = position[half]
    return position


def test_the_rigs_of_the_generator_have_the_inertia_that_they_say(tmp_path):
    pin = pytest.importorskip("pinocchio")
    from driven_rigs.draw import urdf

    for base in BASES:
        model = pin.buildModelFromXML(urdf(base))
        data = model.createData()
        assert pin.crba(model, data, np.zeros(model.nq))[0, 0] == pytest.approx(base.inertia, rel=1e-6)
        if base.weight:
            torque = pin.computeGeneralizedGravity(model, data, np.array([np.pi / 2]))[0]
            assert torque == pytest.approx(base.weight, rel=1e-3)
