"""An angle that wraps is unwrapped where it is read, and said; true jumps, coarse sensors and slides stay."""

import shutil
import sys

import numpy as np
import pytest

import fes_pin as fp
from fes_pin.cli import main
from fes_pin.data import templates
from fes_pin.data.recorded.wraps import unwrapped
from fes_pin.data.turns import with_whole_turns

TURN = 2.0 * np.pi
SEEDS = range(40)


def motion(rng, dt, seconds=8.0):
    """A swing, a motion that turns round, or one that runs out; rad."""
    time = np.arange(round(seconds / dt)) * dt
    kind = rng.integers(3)
    if kind == 0:
        waves = zip(rng.uniform(0.2, 1.2, 3), rng.uniform(0.3, 1.2, 3), rng.uniform(0.0, 6.0, 3), strict=True)
        q = sum(size * np.sin(TURN * f * time + p) for f, size, p in waves)
    elif kind == 1:
        q = rng.choice([-1.0, 1.0]) * rng.uniform(0.5, 2.0) * TURN * time + 0.5 * np.sin(3.0 * time)
    else:
        q = rng.choice([-1.0, 1.0]) * rng.uniform(8.0, 40.0) * (1.0 - np.exp(-time / rng.uniform(1.0, 4.0)))
    return time, q, np.gradient(q, dt)


def wrapped(q, period, low):
    return np.mod(q - low, period) + low


def joint(folder, trials):
    (folder / "rig.urdf").write_text(templates.pendulum(0.4, 1.0))
    start = {"inertia_scale": 1.0, "damping": 0.01, "gravity_scale": 1.0}
    return fp.Study("rig", "joint", {}, start, tuple(trials), folder, {"urdf": folder / "rig.urdf"})


def free(name, q, time, **more):
    return fp.Trial(name, "motion", {"position": q, **more}, time)


@pytest.mark.parametrize("seed", range(10))
def test_a_joint_that_rests_where_its_angle_wraps_is_unwrapped(seed):
    """A joint is swung up to the seam of its angle and held there, where noise or a count flips each second sample."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, 8.0, 0.002)
    q = np.pi * np.minimum(time / 2.0, 1.0) ** 2 * (3.0 - 2.0 * np.minimum(time / 2.0, 1.0)) * rng.choice([-1.0, 1.0])
    q += 1e-3 * rng.standard_normal(len(q))
    if seed % 2:
        q = np.rint(q * 4096 / TURN) * TURN / 4096
    found = unwrapped("position", time, wrapped(q, TURN, -np.pi))
    jumps = np.abs(np.diff(wrapped(q, TURN, -np.pi))) > 1.0
    assert jumps.mean() > 0.2
    assert found is not None
    assert np.ptp(found.values - q) < 1e-9


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_trials_that_are_swung_up_begin_where_they_hang(side, tmp_path):
    """All are swung up from 0 to half a turn, some to the other side, and held there for most of the time."""
    time = np.arange(0.0, 8.0, 0.002)
    up = np.pi * np.minimum(time / 2.0, 1.0) ** 2 * (3.0 - 2.0 * np.minimum(time / 2.0, 1.0))
    rng = np.random.default_rng(3)
    motions = [turn * up + 1e-3 * rng.standard_normal(len(up)) for turn in (side, side, -side)]
    motions.append(0.95 * side * up)  # which does not wrap, and has a spike
    motions[-1][100] = 1e5
    trials = [free(f"{k}", wrapped(q, TURN, -np.pi), time) for k, q in enumerate(motions[:-1])]
    trials.append(free("3", motions[-1], time))
    read = with_whole_turns(trials, joint(tmp_path, trials).files)
    for one, q in zip(read, motions, strict=True):
        assert np.abs(one["position"] - q).max() < 1e-9


@pytest.mark.parametrize("seed", SEEDS)
def test_a_reading_that_wraps_is_unwrapped(seed):
    """In rad, in degrees, or in counts of an encoder; with noise, printed digits and missing samples."""
    rng = np.random.default_rng(seed)
    time, q, v = motion(rng, float(rng.choice([0.002, 0.005, 0.01])))
    unit, words = [(1.0, "360 deg"), (360.0 / TURN, "360"), (4096 / TURN, "4096 counts"), (2000 / TURN, "2000 counts")][
        seed % 4
    ]
    low = float(rng.choice([0.0, -0.5])) * TURN
    if seed % 4 == 3:  # which is no power of two: it must be seen to visit all of its range
        q, v = q + 1.5 * TURN * time, v + 1.5 * TURN
    read = q + 1e-3 * rng.standard_normal(len(q))
    x = wrapped(read * unit, TURN * unit, low * unit)
    x = np.rint(x) if seed % 4 >= 2 else np.round(x, 4)
    lost = rng.choice(len(x), 5, replace=False)
    x[lost] = np.nan
    if not (np.abs(np.diff(x)) > 0.5 * TURN * unit).any():
        assert unwrapped("position", time, x) is None
        return
    for velocity, more in ((None, ""), (3.0 * v, ", which velocity confirms")):
        found = unwrapped("position", time, x, velocity)
        assert found.said.startswith(f"position jumps by {words} at") and found.said.endswith(f"unwrapped{more}")
        left = found.values / unit - read
        left = left[np.isfinite(left)]
        assert np.abs(left - left[0]).max() < 2e-3 + 1.5 / unit * (seed % 4 >= 2)


def spike(q, rng):
    q[rng.integers(20, len(q) - 20)] += rng.choice([-1.0, 1.0]) * TURN * 1.05


def dropouts(q, rng):
    for at in rng.integers(20, len(q) - 60, 3):
        q[at : at + 30] = 0.0


def slip(q, rng):
    q[len(q) // 2 :] += 0.7 * TURN


def slips(q, rng):
    q[len(q) // 3 :] += 1.1 * TURN
    q[len(q) // 2 :] -= 1.2 * TURN


def stop(q, rng):
    np.clip(q, np.quantile(q, 0.2), np.quantile(q, 0.8), out=q)


def coarse(q, rng):
    q[:] = np.rint(q / 1.3) * 1.3


def two_levels(q, rng):
    q[:] = TURN * (np.sin(2.0 * np.arange(len(q)) * 0.01) > 0.0) + 0.02 * rng.standard_normal(len(q)).cumsum()


@pytest.mark.parametrize("odd", [spike, dropouts, slip, slips, stop, coarse, two_levels])
@pytest.mark.parametrize("seed", range(12))
def test_what_jumps_otherwise_stays(odd, seed):
    rng = np.random.default_rng([seed, 1])
    time, q, _ = motion(rng, 0.005)
    q = 0.8 * q + 1e-3 * rng.standard_normal(len(q))
    odd(q, rng)
    for unit in (1.0, 4096 / TURN):
        found = unwrapped("position", time, np.rint(q * unit) if unit > 1.0 else q)
        assert found is None, found.said


def test_a_study_is_read_without_jumps_and_in_one_turn(tmp_path):
    """Trials about half a turn, of which some wrap: in memory, from a file, and resampled."""
    time = np.arange(0.0, 6.0, 0.01)
    swings = [np.pi + away + 0.4 * np.sin(4.0 * time + away) for away in (-0.6, 0.1, 0.2)]
    made = joint(tmp_path, [free(f"{k}", wrapped(q, TURN, -np.pi), time) for k, q in enumerate(swings)])
    for trial, q in zip(made.trials, swings, strict=True):
        assert np.allclose(trial["position"], q)
    assert [len(t.remarks) for t in made.trials] == [0, 1, 1]
    assert sum("jumps by 360 deg" in one for one in fp.check(made).odd) == len({t.remarks for t in made.trials[1:]})
    for k, q in enumerate(swings):
        table = np.column_stack([time, np.degrees(wrapped(q, TURN, -np.pi))])
        np.savetxt(tmp_path / f"{k}.csv", table, "%.5f", ",", header="time_s,angle", comments="")
    text = (
        '[study]\nname = "rig"\nrig = "joint"\n[rig]\nurdf = "rig.urdf"\n[start]\ninertia_scale = 1.0\ndamping = 0.01\n'
    )
    text += 'gravity_scale = 1.0\n[columns]\ntime_s = "time_s"\nposition = { name = "angle", unit = "deg" }\n'
    each = "".join(f'[[trial]]\nfile = "{k}.csv"\nkind = "motion"\n' for k in range(3))
    for more in ("", "[columns.file]\nresample_hz = 170\n"):
        (tmp_path / "study.toml").write_text(text + more + each)
        read = fp.read_study(tmp_path)
        assert not read.trials[1].is_edited and "jumps by 360 deg" in read.trials[1].remarks[0]
        at = {"": 0.01, "[columns.file]\nresample_hz = 170\n": 1.0 / 170.0}[more] * np.arange(500)
        for trial, away in zip(read.trials[:2], (-0.6, 0.1), strict=True):
            off = trial["position"][:500] - (np.pi + away + 0.4 * np.sin(4.0 * at + away))
            assert np.abs(off - TURN * np.rint(off[0] / TURN)).max() < 2e-3
    fp.write_study(read, tmp_path / "written")
    assert fp.read_study(tmp_path / "written") == read


def test_a_slide_and_a_stated_start_stay_where_they_are(tmp_path):
    time, q = np.arange(0.0, 4.0, 0.01), 3.0 * np.arange(0.0, 4.0, 0.01)
    read = wrapped(q, TURN, 0.0)
    (tmp_path / "slide.urdf").write_text(templates.slide(1.0))
    slide = {"start": {"inertia_scale": 1.0, "damping": 0.1}, "constants": {"gravity_scale": 0.0}}
    made = fp.Study("s", "joint", **slide, trials=(free("a", read, time),), files={"urdf": tmp_path / "slide.urdf"})
    assert np.array_equal(made.trials[0]["position"], read) and not made.trials[0].remarks
    stated = fp.Trial("a", "motion", {"position": read}, time, {"position0": 2.0 * TURN})
    assert joint(tmp_path, [stated]).trials[0]["position"][0] == pytest.approx(2.0 * TURN)


@pytest.mark.shared
def test_an_encoder_that_wraps_where_a_pendulum_hangs_hides_no_cause(shared, tmp_path, monkeypatch, capsys):
    shutil.copy(shared / "cases/wrapped_encoder/s0.csv", tmp_path)
    column = ("--column", "position=Angle [deg]:deg,zero=175")
    monkeypatch.setattr(
        sys, "argv", ["fes-pin", "new-study", str(tmp_path / "s0.csv"), "--pendulum", "0.6", "1", *column]
    )
    with pytest.raises(SystemExit) as ended:
        main.main()
    assert not ended.value.code and "position jumps by 360 deg at 15 samples: unwrapped" in capsys.readouterr().out
    study = fp.read_study(tmp_path)
    assert np.abs(study.trials[0]["position"]).max() < 1.0
    found = fp.diagnose(study)
    assert [c.name for c in found.causes] == ["coulomb_friction"] and found.extended_error[0] < 0.1
