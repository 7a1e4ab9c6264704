"""Whether an effort drives a joint or is what a motion takes, where the kind of a trial is left out or wrong."""

import sys
from dataclasses import replace

import numpy as np
import pytest
from bench import DAMPING, INERTIA, WEIGHT, study, trial
from driven_rigs.draw import draw
from driven_rigs.laboratory import draw_laboratory
from driven_rigs.swing_up import draw_swing_up

import fes_pin as fp
from fes_pin.cli import main
from fes_pin.data.direction import MANY, MORE, direction_of
from fes_pin.prepare.measured import measured_study

GENERATORS = {
    "read": lambda seed, folder: draw(("coulomb_friction",), 0.2, seed, folder, recorded=True),
    "commanded": lambda seed, folder: draw(("joint_stop",), 0.2, seed, folder),
    "laboratory": lambda seed, folder: draw_laboratory(("quadratic_damping",), seed, folder),
    "swing_up": lambda seed, folder: draw_swing_up((), seed, folder),
}
DRAWS, SEEDS = range(2), range(6)


def imposed(seed, friction=0.2, noise=0.3, kind="", seconds=8.0, fastest=1.5):
    """A motion of any load cell's stand: the effort that it takes, and its noise, which moves nothing."""
    rng = np.random.default_rng(seed)
    time = np.arange(round(seconds / 0.005)) * 0.005
    sines = [(rng.uniform(0.1, 0.4), 2 * np.pi * rng.uniform(0.1, fastest), rng.uniform(0, 6)) for _ in range(4)]
    q, v, a = (
        sum(size * w**k * np.sin(w * time + phase + k * np.pi / 2) for size, w, phase in sines) for k in range(3)
    )
    effort = INERTIA * a + DAMPING * v + WEIGHT * np.sin(q) + friction * np.tanh(v / 0.02)
    effort += noise * rng.standard_normal(len(time))
    read = q + 5e-5 * rng.standard_normal(len(time))
    return fp.Trial(f"{seed}", kind, {"effort": effort, "position": read}, time)


def unstated(trials):
    return [replace(t, kind="") for t in trials]


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("noise", [0.005, 0.05, 0.5])
def test_an_effort_whose_noise_moves_nothing_is_read(noise, seed, tmp_path):
    made = study(tmp_path, [imposed(seed, noise=noise), imposed(seed + 100, noise=noise)])
    assert {t.kind for t in made.trials} == {"imposed"}
    said = [r for t in made.trials for r in t.remarks]
    assert len(said) == 2 and all('kind is left out and "imposed" is taken' in one for one in said)
    assert any('"imposed" is taken' in one for one in measured_study(made).odd())


@pytest.mark.parametrize("count", [0.0, 0.001])
@pytest.mark.parametrize("seed", DRAWS)
def test_a_controllers_effort_drives(seed, count, tmp_path):
    made = study(tmp_path, unstated([trial(seed, count, friction=0.1), trial(seed + 50, count, friction=0.1)]))
    assert {t.kind for t in made.trials} == {"motion"}
    assert all('"motion" is taken' in t.remarks[0] for t in made.trials)


@pytest.mark.parametrize("seed", DRAWS)
@pytest.mark.parametrize("generator", GENERATORS)
def test_no_driven_rig_is_doubted(generator, seed, tmp_path):
    made = fp.read_study(GENERATORS[generator](7000 + seed, tmp_path).study)
    assert direction_of(made.trials).kind == "motion"
    assert not [one for one in measured_study(made).warnings if "kind" in one]


@pytest.mark.parametrize("seed", DRAWS)
@pytest.mark.parametrize("hum_hz", [61.0, 88.0])
def test_hum_that_all_channels_pick_up_is_no_answer_of_a_controller(hum_hz, seed):
    clean = imposed(seed, noise=0.05)
    hum = np.sin(2.0 * np.pi * hum_hz * clean.time + seed)
    both = clean.with_columns(effort=clean["effort"] + 0.1 * hum, position=clean["position"] + 1e-4 * hum)
    assert direction_of([both]).answering < 0.05 and direction_of([both]).kind == "imposed"


def test_a_stated_kind_that_data_contradict_is_said(tmp_path):
    wrong = study(tmp_path, [imposed(k, kind="motion", noise=0.6) for k in (3, 4)])
    assert {t.kind for t in wrong.trials} == {"motion"} and not wrong.trials[0].remarks
    measured = measured_study(wrong)
    assert {t.kind for t in measured.study.trials} == {"imposed"}
    assert 'kind = "motion" is contradicted and "imposed" is taken' in measured.warnings[0]


def test_a_stated_kind_that_is_uncertain_is_kept(tmp_path):
    loud = study(tmp_path, [imposed(k, kind="motion", noise=0.09) for k in (1, 2)])
    measured = measured_study(loud)
    assert MORE < direction_of(loud.trials).ratio < MANY
    assert {t.kind for t in measured.study.trials} == {"motion"} and "is doubtful" in measured.warnings[0]


def test_a_stated_kind_that_a_controllers_command_contradicts_is_said(tmp_path):
    wrong = study(tmp_path, [replace(trial(3, 0.001), kind="imposed"), replace(trial(4, 0.001), kind="imposed")])
    assert {t.kind for t in wrong.trials} == {"imposed"}
    assert measured_study(wrong).warnings[0].startswith('kind = "imposed" is doubtful: the effort answers the noise')


def test_efforts_without_noise_show_nothing(tmp_path):
    made = study(tmp_path, [imposed(5, noise=0.0)])
    assert made.trials[0].kind == "motion" and "do not show whether the effort drives" in made.trials[0].remarks[0]


def test_a_study_file_and_frames_may_leave_the_kind_out(tmp_path):
    made = study(tmp_path, [imposed(6, kind="imposed"), imposed(7, kind="imposed")])
    fp.write_study(made, tmp_path / "written")
    file = tmp_path / "written/study.toml"
    file.write_text(file.read_text().replace(', kind = "imposed"', ""))
    read = fp.read_study(tmp_path / "written")
    frames = {t.name: {"time_s": t.time, **t.columns} for t in made.trials}
    known = {"constants": {}, "start": made.start, "files": made.files, "name": "arm"}
    for one in (read, fp.Study.from_frames(frames, rig="joint", **known)):
        assert {t.kind for t in one.trials} == {"imposed"} and "left out" in one.trials[0].remarks[0]


def test_free_motion_has_the_default_kind_and_no_remark(tmp_path):
    free = imposed(8).without("effort")
    made = study(tmp_path, [free])
    assert made.trials[0].kind == "motion" and not made.trials[0].remarks


@pytest.mark.parametrize("columns", [("t_s", "angle_rad", "torque_Nm"), ("time", "position", "effort")])
def test_a_new_study_states_the_kind_that_its_recordings_show(columns, tmp_path, monkeypatch, capsys):
    for one in (imposed(9), imposed(10)):
        table = np.column_stack([one.time, one["position"], one["effort"]])
        np.savetxt(tmp_path / f"{one.name}.csv", table, "%.6f", ",", header=",".join(columns), comments="")
    files = [str(tmp_path / f"{k}.csv") for k in (9, 10)]
    named = ["--column", f"position={columns[1]}:rad", "--column", f"effort={columns[2]}:Nm"]
    units = ["--column", f"time_s={columns[0]}:s"]
    monkeypatch.setattr(sys, "argv", ["fes-pin", "new-study", *files, "--rod", "0.3", "1", *named, *units])
    with pytest.raises(SystemExit) as ended:
        main.main()
    assert not ended.value.code and 'kind is left out and "imposed" is taken' in capsys.readouterr().out
    assert (tmp_path / "study.toml").read_text().count('kind = "imposed"') == 2
    assert not fp.read_study(tmp_path).trials[0].remarks
