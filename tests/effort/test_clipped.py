"""An actuator clips its commands: the limit is estimated from the data, and the hidden friction is found."""

from dataclasses import replace

import numpy as np
import pytest
from bench import DAMPING, INERTIA, WEIGHT, study, trial
from driven_rigs.laboratory import draw_laboratory
from scipy.integrate import odeint

import fes_pin as fp
from fes_pin.data.direction import band_hz
from fes_pin.models.clipped import LEFT, _Commands

DT, SECONDS, FRICTION, STIFFNESS = 0.01, 8.0, 0.15, 20.0
BEYOND = "a command beyond what the actuator gave"


def driven(seed, stall, slope):
    """Return a trial of a joint whose motor gives at most `stall` N m, less where it drives, by LSODA."""
    rng = np.random.default_rng(seed)
    time = np.arange(round(SECONDS / DT)) * DT
    waves = zip(rng.uniform(0.5, 8.0, 4), rng.uniform(0.0, 6.0, 4), rng.uniform(0.1, 0.4, 4), strict=True)
    goals = sum(size * np.sin(w * time + phase) for w, phase, size in waves)
    goals += 0.4 * np.sign(np.sin(2.0 * np.pi * 0.3 * time + rng.uniform(0.0, 6.0)))
    state, read, commands = np.zeros(2), [], []

    def moves(x, _, command):
        limit = max(stall - slope * max(x[1] * np.sign(command), 0.0), 0.0)
        torque = np.clip(command, -limit, limit) - DAMPING * x[1] - WEIGHT * np.sin(x[0])
        return [x[1], (torque - FRICTION * np.tanh(x[1] / 0.02)) / INERTIA]

    for goal in goals:
        read.append(state[0] + 3e-4 * rng.standard_normal())
        commands.append(STIFFNESS * (goal - read[-1]) - 0.05 * STIFFNESS * state[1])
        state = odeint(moves, state, [0.0, DT], args=(commands[-1],))[-1]
    return fp.Trial(f"{seed}", "motion", {"effort": np.array(commands), "position": np.array(read)}, time)


@pytest.mark.parametrize("stall", [2.5, 4.0])
@pytest.mark.parametrize("slope", [0.0, 0.2])
@pytest.mark.parametrize("seed", range(2))
def test_a_limit_is_said_with_its_size(seed, slope, stall, tmp_path):
    clipped = study(tmp_path, [driven(seed + 10 * k, stall, slope) for k in range(3)])
    (said,) = (w for w in fp.check(clipped).odd if BEYOND in w)
    at_rest, falls = (float(said.split(word)[1].split(" N m")[0]) for word in ("is above ", ", less "))
    assert at_rest == pytest.approx(stall, rel=0.06) and falls == pytest.approx(slope, abs=0.06)


def test_friction_is_found_behind_a_limit(tmp_path):
    found = fp.diagnose(study(tmp_path, [driven(10 * k, 2.5, 0.2) for k in range(3)]))
    assert [c.name for c in found.causes] == ["coulomb_friction"]
    values = found.extended.values
    assert values["coulomb_friction.torque_nm"] == pytest.approx(FRICTION, rel=0.1)
    assert values["damping"] == pytest.approx(DAMPING, rel=0.2) and values["inertia_scale"] == pytest.approx(
        1, rel=0.02
    )


@pytest.mark.parametrize("seed", range(3))
def test_no_limit_is_seen_where_there_is_none(seed, tmp_path):
    studies = [study(tmp_path, [trial(seed), trial(seed + 50)]), study(tmp_path, [driven(seed, np.inf, 0.0)])]
    studies += [fp.read_study(draw_laboratory(("coulomb_friction",), 7300 + seed, tmp_path / "a").study)]
    assert not [w for one in studies for w in fp.check(one).odd if BEYOND in w]


def test_trials_that_are_held_out_have_no_part_in_the_limit(tmp_path):
    trials = [driven(10 * k, 2.5, 0.2) for k in range(3)]
    held = study(tmp_path, [*trials[:2], replace(trials[2], role="held_out")])
    both = (fp.check(one).odd for one in (held, study(tmp_path, trials[:2])))
    limits = [line.split("above ")[1] for odd in both for line in odd if BEYOND in line]
    assert len(limits) == 2 and limits[0] == limits[1]


def share_left(trials):
    """Return what the likeliest limit leaves unexplained, as a share of what the whole command leaves; 1 of none."""
    usable = [t for t in trials if np.ptp(t["effort"]) > 0.0]
    commands = _Commands(usable, band_hz(usable))
    return commands.left(*commands.likeliest()) / commands.left(np.inf, 0.0)


@pytest.mark.parametrize(("stall", "slope"), [(2.5, 0.0), (2.5, 0.3), (3.5, 0.2)])
def test_a_limit_leaves_a_hundredth(stall, slope):
    assert share_left([driven(10 * k, stall, slope) for k in range(3)]) < 0.02


@pytest.mark.shared
def test_a_limit_explains_little_of_the_practice_loops_and_of_a_measured_servo(shared):
    folders = [*sorted((shared / "practice_loops").glob("c*")), shared / "data" / "servo_pendulum"]
    driven_by = {f.name: [t for t in fp.read_study(f).trials if "effort" in t.columns] for f in folders}
    shares = {n: share_left(trials) for n, trials in driven_by.items() if np.isfinite(band_hz(trials))}
    assert len(shares) > 25 and min(shares.values()) > 2.0 * LEFT
