"""The generator of large causes: the physics by balances of its own, seeds, recordings; and the fit of ten lines."""

from collections import Counter
from dataclasses import replace
from itertools import islice

import numpy as np
import pytest
from harness import large
from harness.generator import Item, Truth
from harness.row import Row
from harness.run import ended_after, unseen_percent
from harness.table import against, families, totals
from harness.ten_lines import solved
from large_rigs import ankle, joint, muscle, recorded
from scipy.interpolate import make_interp_spline

import fes_pin as fp
from fes_pin.models.catalogue import shipped
from fes_pin.models.simulate import simulated_trial

GRAVITY = 9.81
QUIET = recorded.Recording(0.0, 0.0, 0.0, 12, False)


def items(count=160, seed=0):
    return list(islice(large.Large().plan(seed), count))


def motion(take):
    """Times, positions, speeds and accelerations."""
    time = np.arange(len(take.values)) * take.dt
    spline = make_interp_spline(time, take.values, 5)
    return time, take.values, spline(time, 1), spline(time, 2)


def integral(y, time):
    return float(np.trapezoid(y, time))


def plain(family, hidden, seed, faster=1):
    """A joint without friction: drawn, and as `joint` makes it before it is moved."""
    made = []
    real = joint.Joint

    def kept(*args):
        made.append(real(*args))
        return made[-1]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(joint, "Joint", kept)
        drawn = joint.draw(family, hidden, 1, faster, np.random.default_rng(seed))
    return drawn, made[0]


@pytest.mark.parametrize(
    ("family", "hidden"),
    [
        ("free", ("base_tilt",)),
        ("free", ("quadratic_damping",)),
        ("driven", ("effort_offset",)),
        ("driven", ("parallel_stiffness",)),
        ("free", ("coulomb_friction",)),
        ("free", ("joint_stop",)),
    ],
)
def test_the_energy_of_a_swing_is_what_went_in_less_what_was_lost(family, hidden):
    drawn, rig = plain(family, hidden, 11, 4)
    take, h = drawn.takes[0], rig.hidden
    time, q, v, _ = motion(take)
    tilted = q + rig.turned + h.get("base_tilt.tilt_rad", 0.0)
    energy = 0.5 * rig.inertia * v**2 - rig.weight * np.cos(tilted)
    energy -= h.get("effort_offset.offset", 0.0) * q
    if k := h.get("parallel_stiffness.stiffness_nm_per_rad"):
        energy += 0.5 * k * (q - h["parallel_stiffness.rest_angle_rad"]) ** 2
    if k := h.get("joint_stop.stiffness"):
        side = h["joint_stop.side"]
        energy += 0.5 * k * np.maximum(side * (q - h["joint_stop.angle_rad"]), 0.0) ** 2
    lost = rig.damping * v**2 + h.get("quadratic_damping.coefficient", 0.0) * np.abs(v) ** 3
    if size := h.get("coulomb_friction.torque_nm"):
        more = 1.0 + rig.form["more"] * np.exp(-((v / rig.form["fall"]) ** 2))
        lost += size * more * v * np.tanh(v / rig.form["sharp"])
    given = take.inputs.get("effort", np.zeros(len(time))) * v
    part = slice(8, round(2.0 / take.dt))
    change, exchanged = energy[part][-1] - energy[part][0], integral((given - lost)[part], time[part])
    scale = integral(np.abs(given - lost)[part], time[part])
    assert change == pytest.approx(exchanged, abs=0.005 * scale)
    assert scale > 0.05 * np.ptp(energy)


@pytest.mark.parametrize("family", ["turning", "coasting"])
@pytest.mark.parametrize("hidden", [(), ("coulomb_friction",), ("cogging",)])
def test_a_joint_turns_round_as_its_torques_turn_it(family, hidden):
    drawn, rig = plain(family, hidden, 4, 2)
    for take in drawn.takes:
        assert 3.0 < np.ptp(take.values) / (2.0 * np.pi) < 60.0
        time, q, v, _ = motion(take)
        torque = take.inputs.get("effort", 0.0) - rig.damping * v
        torque = torque + np.array([rig.besides(a, b) for a, b in zip(q, v, strict=True)])
        part = slice(8, round(3.0 / take.dt))
        usual = rig.inertia * np.ptp(v)
        assert rig.inertia * (v[part][-1] - v[part][0]) == pytest.approx(
            integral(torque[part], time[part]), abs=0.01 * usual
        )
    assert rig.weight == 0.0 and drawn.size == pytest.approx(2.0 * np.pi)


def test_no_swing_turns_over_and_dry_friction_lets_it_move():
    for item in items(32):
        family, _ = item.key.split("-")[0].split("_")
        if family in ("free", "driven"):
            drawn, rig = plain(family, item.hidden, [item.seed, 84])
            for take in drawn.takes:
                assert np.abs(take.values + rig.turned).max() < joint.OVER and np.ptp(take.values) > joint.LEAST


def test_a_train_settles_to_its_strength_and_a_twitch_has_its_impulse():
    one = muscle.Muscle(5.0, 0.04, 0.01, 0.007)
    on = one.run(np.arange(600) * 0.001, np.ones(600), 0.001)
    assert on[-1] == pytest.approx(5.0, rel=1e-4) and np.all(on[:7] == 0.0) and on[9] > 0.0
    twitch = one.run(np.arange(800) * 0.001, np.eye(800)[0] * 50.0, 0.001)
    assert np.sum(twitch) * 0.001 == pytest.approx(5.0 * 0.05, rel=1e-3)


def test_an_ankle_obeys_equation_1():
    drawn = ankle.draw("ankle", ("threshold_shift",), 1, 2, np.random.default_rng(3))
    k, take, truth = drawn.known, drawn.takes[0], drawn.truth
    time, q, v, a = motion(take)
    width = take.inputs["pulse_width_us"] - truth["threshold_shift.shift_us"]
    drive = np.clip((width - k["threshold_us"]) / (k["saturation_us"] - k["threshold_us"]), 0.0, 1.0)
    pull = np.zeros(len(time))
    keep = np.exp(-take.dt / truth["time_constant_s"])
    for i in range(1, len(time)):
        pull[i] = keep * pull[i - 1] + (1.0 - keep) * drive[i - 1]
    pull *= truth["gain"] * k["force_scale_n"]
    passive = k["f0_n"] * np.maximum(np.exp(k["f1_per_rad"] * (q - k["theta_r_rad"])) - 1.0, 0.0)
    load = take.conditions["load_kg"] * GRAVITY
    torque = (k["moment_arm_m"] * pull - k["com_distance_m"] * (passive - load)) * np.sin(q)
    torque += k["foot_mass_kg"] * GRAVITY * k["com_distance_m"] * np.cos(q) - truth["damping_nms"] * v
    missed = truth["inertia_kgm2"] * a - torque
    inner = slice(8, -8)
    assert np.sqrt(np.mean(missed[inner] ** 2)) < 0.02 * np.ptp(torque)
    assert abs(v[2]) < 1e-6 and np.ptp(q) > 0.1


@pytest.mark.parametrize(
    ("family", "hidden"),
    [
        ("free", ("base_tilt",)),
        ("turning", ("effort_offset",)),
        ("muscle", ("sensor_offset", "second_order_activation", "electromechanical_delay")),
        ("ankle", ("threshold_shift",)),
    ],
)
def test_what_is_true_is_in_the_terms_of_an_answer(family, hidden, tmp_path):
    """The package's model with the true values is what scipy integrates: names, units and signs are the answer's."""
    drawn = {"muscle": muscle, "ankle": ankle}.get(family, joint).draw(family, hidden, 1, 1, np.random.default_rng(3))
    study = recorded.recorded(drawn, QUIET, np.random.default_rng(0), tmp_path)
    model = fp.nominal_model(study)
    for effect in (one for one in shipped().effects if one.name in hidden):
        own = {n.split(".")[1]: v for n, v in drawn.truth.items() if n.startswith(effect.name)}
        model = model + effect(**own)
    model = model.with_parameters({n: v for n, v in drawn.truth.items() if n in model.parameters()})
    take = drawn.unseen
    columns = {**take.inputs, take.output: take.values}
    trial = fp.Trial("unseen", take.kind, columns, np.arange(len(take.values)) * take.dt, take.conditions)
    assert np.ptp(trial.residual(simulated_trial(model, trial), take.output)) < 1e-5 * np.ptp(take.values)


def test_strength_alone_changes_between_groups():
    drawn = muscle.draw("twitches", ("gain",), 3, 1, np.random.default_rng(2))
    peaks = {t.group: t.values.max() for t in drawn.takes}
    assert peaks["after"] / peaks["before"] == pytest.approx(1.3) or peaks["after"] / peaks["before"] == pytest.approx(
        1.67
    )
    null = muscle.draw("twitches", (), 3, 1, np.random.default_rng(2))
    assert len({t.values.max() for t in null.takes}) == 1


def test_a_resting_force_is_a_share_of_the_twitch():
    for seed in range(12):
        drawn = muscle.draw("muscle", ("sensor_offset",), 2, 1, np.random.default_rng(seed))
        ranges = [np.ptp(t.values) for t in drawn.takes]
        assert 0.1 * min(ranges) <= drawn.truth["sensor_offset.offset"] <= max(ranges)


def test_a_seed_makes_the_same_study_again_and_every_kind_is_there(tmp_path):
    plan = items()
    families_of = Counter((i.key.split("_")[0], bool(i.hidden)) for i in plan)
    assert len(families_of) == 2 * len(set(large.FAMILIES)) and min(families_of.values()) >= 4
    assert {i.part.rsplit(", ", 1)[-1] for i in plan} >= {"one trial", "three trials"}
    hidden = {frozenset(i.hidden) for i in plan if i.hidden}
    assert hidden >= {frozenset(c) for causes in large.CAUSES.values() for c in causes}
    assert items(8, 5) == items(13)[5:]
    for item in (plan[0], plan[10]):
        made = []
        for k in range(2):
            (tmp_path / f"{item.key}{k}").mkdir()
            made.append(large.Large().make(item, tmp_path / f"{item.key}{k}"))
        (one, truth), (other, again) = made
        assert truth == again and all(
            np.array_equal(a[n], b[n]) for a, b in zip(one, other, strict=True) for n in a.columns
        )


def test_twice_the_rate_is_the_same_rig(tmp_path):
    for k, item in enumerate(items(8)):
        made = []
        for faster in (1, 2):
            (tmp_path / f"{k}-{faster}").mkdir()
            made.append(large.Large().make(item, tmp_path / f"{k}-{faster}", faster))
        (one, truth), (fast, again) = made
        assert truth.parameters == pytest.approx(again.parameters) and one.start == fast.start
        for a, b in zip(one, fast, strict=True):
            assert b.dt == pytest.approx(0.5 * a.dt) and len(b) == 2 * len(a)
            read = next(n for n in ("position", "angle_rad", "force_n") if n in a)
            assert np.std(b[read][::2] - a[read]) < 0.05 * max(np.ptp(a[read]), 1e-9)


def test_a_recording_is_rounded_in_its_own_unit_and_has_the_noise_that_was_drawn():
    take = recorded.Take(0.01, "position", np.zeros(5000))
    rng = np.random.default_rng(1)
    degrees = replace(QUIET, noise=0.01, decimals=4, other_unit=True).read(take, 2.0, rng).values * 180.0 / np.pi
    assert np.allclose(degrees, np.round(degrees, 4), atol=1e-12)
    assert np.std(degrees) * np.pi / 180.0 == pytest.approx(0.02, rel=0.1)
    slow = replace(QUIET, noise=0.01, correlation_s=0.05).read(take, 2.0, rng).values
    assert np.corrcoef(slow[1:], slow[:-1])[0, 1] == pytest.approx(np.exp(-0.01 / 0.05), abs=0.05)
    counts = replace(QUIET, noise=0.01, count=0.01).read(take, 2.0, rng).values / 0.02
    assert np.allclose(counts, np.round(counts), atol=1e-6)


def test_ten_lines_find_what_is_hidden(tmp_path, monkeypatch):
    monkeypatch.setattr(joint, "_form", lambda speed, rng: {"sharp": 1e-3 * speed, "more": 0.0, "fall": 1.0})
    for family, hidden, name in (
        ("muscle", ("sensor_offset",), "rest"),
        ("coasting", ("coulomb_friction",), "friction"),
    ):
        rig = muscle if family == "muscle" else joint
        drawn = rig.draw(family, hidden, 1, 1, np.random.default_rng(8))
        (tmp_path / family).mkdir()
        study = recorded.recorded(drawn, QUIET, np.random.default_rng(0), tmp_path / family)
        found, (_, size) = solved(study), next((n, v) for n, v in drawn.truth.items() if n.startswith(hidden[0]))
        assert found.values[name] == pytest.approx(size, rel=0.02)
        truth = Truth(drawn.truth, unseen=large.unseen(drawn, QUIET, np.random.default_rng(0)))
        assert unseen_percent(found, truth) < 0.1
    with pytest.raises(ValueError, match="without groups"):
        solved(replace(study, trials=tuple(replace(t, group="a") for t in study.trials)))


def row(key, hidden, sets=(), **more):
    return Row(key, hidden, more.pop("part", "x"), False, "c", sets=sets, **more)


ROWS = [
    row("a", ("fatigue",), (("fatigue", "cogging"),), unseen=0.5),
    row("b", ("fatigue",), (("fatigue",), ("cogging",)), part="y", unseen=0.2),
    row("c", ("fatigue",), error="E"),
    row("d", (), (("cogging",),), unseen=1e-9),
    row("e", (), verdict="stopped"),
    row("f", (), error="E"),
]


def test_totals_count_what_has_no_answer():
    assert totals(ROWS) == [
        "first set right: 2 of 3: 67 %",
        "exactly right: 1 of 3: 33 %",
        "nulls named: 1 of 2: 50 %",
        "ended in an error: 2 of 6: 33 %",
        "stopped: 1 of 6: 17 %",
    ]
    assert "| y | 1 | 1 of 1: 100 % | 0 of 1: 0 % |  | 0 of 1: 0 % | 0 of 1: 0 % |" in families(ROWS)


def test_errors_beside_those_of_ten_lines():
    theirs = [replace(r, unseen=e) for r, e in zip(ROWS, (0.4, 0.2, 0.1, 1e-7, None, None), strict=True)]
    first, second, *odd = against(ROWS, theirs)
    assert "of 4 studies" in first and second.endswith("without our answer: 1 of these") and "2 of 4" in second
    assert [line.split(":")[0].strip() for line in odd] == ["a", "c"]
    assert against(ROWS, []) == ["no trial that nobody was shown"]


def test_an_answer_that_does_not_come_is_an_error(monkeypatch):
    monkeypatch.setattr("harness.run.GRACE", 0.005)
    with pytest.raises(TimeoutError, match=r"no answer after 0\.05"), ended_after(0.0):
        while True:
            pass
    with ended_after(None):
        assert Item("a", 1).hidden == ()
    assert fp.Trial
