"""Trials that stand side by side in the columns of one file: told from instruments that recorded at once."""

from pathlib import Path

import numpy as np
import pytest

from fes_pin.data.as_read import HeldFile
from fes_pin.data.errors import InputError
from fes_pin.data.new_study import new_study
from fes_pin.data.schema import known_rigs
from fes_pin.data.study import read_study
from fes_pin.data.templates import pendulum
from fes_pin.data.wanted import Wanted

SEEDS = range(3)
UNITS = {"time_s": "time_s=time:s", "position": "position={}:deg", "effort": "effort={}:N m"}
REPEATED = "Time [s],Angle [deg],Torque [Nm]"


def swing(seed, count=200):
    """Times, angles in degrees and torques of a trial."""
    time, random = np.arange(count) * 0.01, np.random.default_rng(seed)
    angle = random.uniform(20.0, 35.0) * np.cos(6.0 * time + random.uniform(0.0, 1.0))
    return np.round([time, angle, random.uniform(0.5, 1.0) * np.sin(3.0 * time)], 6)


def text(columns, *header):
    """Lines of a file; a column that is shorter than others ends in empty cells."""
    count = max(map(len, columns))
    cells = [[repr(float(v)) for v in one] + [""] * (count - len(one)) for one in columns]
    return "\n".join([*header, *map(",".join, zip(*cells, strict=True))]) + "\n"


def wanted(folder, content, *columns, rig="joint", **more):
    files = content if isinstance(content, dict) else {"a.csv": content}
    for name, one in files.items():
        if isinstance(one, str):
            (folder / name).write_text(one)
        else:
            pytest.importorskip("python_calamine")
            from test_sheets import xlsx

            xlsx(folder / name, one)
    believed = HeldFile.holding("p.urdf", pendulum(0.3, 1.0).encode()) if rig == "joint" else None
    said = dict(words.split("=", 1) for words in columns)
    paths = tuple(folder / name for name in files)
    return Wanted(paths, known_rigs()[rig], folder / "s", "a", believed, columns=said, **more)


def made(folder, content, *columns, **more):
    start = {"inertia_scale": 1.0, "damping": 0.01}
    if more.get("rig") == "muscle":
        start = {"gain": 30.0, "time_constant_s": 0.05}
    out = new_study(wanted(folder, content, *columns, **more), lambda rig, columns: start)
    for place, one in out.contents.items():
        path = folder / "s" / place
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(one if isinstance(one, bytes) else one.encode())
    return read_study(folder / "s"), out


def refused(folder, content, *columns, **more):
    with pytest.raises(InputError) as caught:
        made(folder, content, *columns, **more)
    return str(caught.value)


def check(study, trials):
    """Compare a study with the trials that were written: (time, angle, torque) of each, by name."""
    assert [t.name for t in study] == [*trials]
    for name, (time, angle, torque) in trials.items():
        assert np.array_equal(study[name].time, time)
        assert np.allclose(study[name]["position"], np.radians(angle), rtol=0.0, atol=1e-12)
        if torque is not None:
            assert np.array_equal(study[name]["effort"], torque)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("counts", [(200, 200), (200, 150), (150, 200), (90, 200, 140)])
@pytest.mark.parametrize("word", ["Trial", "Run", "Messung"])
def test_names_that_are_repeated_below_words_for_a_trial(tmp_path, seed, counts, word):
    trials = [swing(10 * seed + k, count) for k, count in enumerate(counts)]
    heads = ",".join(f"{word} {k + 1},," for k in range(len(counts)))
    study, out = made(tmp_path, text([c for one in trials for c in one], heads, ",".join([REPEATED] * len(counts))))
    check(study, {f"a-{k + 1}": one for k, one in enumerate(trials)})
    (said,) = [words for words in out.said if "side by side" in words]
    assert f"{len(counts)} trials side by side, Time [s], Angle [deg], Torque [Nm] and Time [s]#2" in said
    left = {f"a-{k + 1}": max(counts) - n for k, n in enumerate(counts)}
    for trial in study:
        rows = f"{left[trial.name]} rows of the file below its last sample are left out"
        assert (rows in trial.remarks) == (left[trial.name] > 0)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize(
    "form",
    ["trial{}_{}", "{1}_trial{0}", "{1} (run {0})", "Trial {}: {}", "{1}Trial{0}", "{1}_rep_{0:02}", "TEST {} {}"],
)
def test_numbers_behind_words_for_a_trial_with_one_time(tmp_path, seed, form):
    trials = [swing(10 * seed + k, count) for k, count in enumerate((200, 200, 120))]
    names = [form.format(k, what) for k in (1, 2, 3) for what in ("angle", "torque")]
    columns = [trials[0][0], *(c for one in trials for c in one[1:])]
    said = [UNITS["time_s"], UNITS["position"].format(names[0]), UNITS["effort"].format(names[1])]
    study, _ = made(tmp_path, text(columns, ",".join(["time", *names])), *said)
    check(study, {f"a-{k}": one for k, one in enumerate(trials, 1)})


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("names", ["t,angle,torque|t#,angle#,torque#", "t_#,angle_#,torque_#", "time#,pos#,tau#"])
@pytest.mark.parametrize("has_times", [True, False])
def test_sets_that_end_apart_are_trials(tmp_path, seed, names, has_times):
    trials = [swing(10 * seed + k, count) for k, count in enumerate((200, 120, 160))]
    first, _, others = names.partition("|")
    own = [(first if k == 1 else others or first).replace("#", str(k)).split(",") for k in (1, 2, 3)]
    every = [[*zip(some, one, strict=True)] for some, one in zip(own, trials, strict=True)]
    flat = [c for one in every for c in one] if has_times else [every[0][0], *(c for one in every for c in one[1:])]
    if not has_times:
        flat[0] = ("time", flat[0][1])
    said = [f"time_s={flat[0][0]}:s", UNITS["position"].format(own[0][1]), UNITS["effort"].format(own[0][2])]
    study, out = made(tmp_path, text([c for _, c in flat], ",".join(n for n, _ in flat)), *said)
    check(study, {f"a-{k}": one for k, one in enumerate(trials, 1)})
    assert any("they do not end at once" in words for words in out.said)


@pytest.mark.parametrize("seed", SEEDS)
def test_one_column_a_trial_next_to_the_time(tmp_path, seed):
    trials = [swing(10 * seed + k) for k in range(3)]
    content = text([trials[0][0], *(one[1] for one in trials)], "Time [s],Trial 1,Trial 2,Trial 3")
    assert "--column position=Trial 1:UNIT" in refused(tmp_path, content)
    study, _ = made(tmp_path, content, "position=Trial 1:deg")
    check(study, {f"a-{k}": (*one[:2], None) for k, one in enumerate(trials, 1)})


@pytest.mark.parametrize("names", ["angle_1,torque_1,angle_2,torque_2", "position.1,effort.1,position.2,effort.2"])
def test_two_joints_of_a_robot_are_asked_for_and_may_be_said_to_be_trials(tmp_path, names):
    trials = [swing(1), swing(2)]
    content = text([trials[0][0], *trials[0][1:], *trials[1][1:]], f"time,{names}")
    said = refused(tmp_path, content)
    one, effort, other, _ = names.split(",")
    assert "may be 2 trials side by side or 2 instruments at once: --split columns" in said
    assert f"--column position=NAME:UNIT ({one} or {other})" in said
    units = [UNITS["time_s"], UNITS["position"].format(one), UNITS["effort"].format(effort)]
    study, _ = made(tmp_path, content, *units, split="columns")
    check(study, {f"a-{k}": one for k, one in enumerate(trials, 1)})
    for split in (None, "none"):
        study, out = made(tmp_path, content, *units, split=split)
        check(study, {"a": trials[0]})
        assert not any("side by side" in words for words in out.said)


NO_TRIALS = {
    "two sensors of one joint": "time,angle_1,angle_2,torque",
    "two sensors, also with times": "time_1,angle_1,time_2,angle_2,torque",
    "eight muscles": "time,angle,torque," + ",".join(f"emg_{k}" for k in range(1, 9)),
    "two plates": "time,angle,torque,Fz1,Mx1,Fz2,Mx2",
    "sides": "time,angle_left,torque_left,angle_right,torque_right",
    "a set that lacks a column": "time,angle_1,torque_1,angle_2",
    "a test that has a name": "time,test_angle_1,test_angle_2,test_torque",
    "another unit": "time,angle_1 [deg],torque_1 [Nm],angle_2 [rad],torque_2 [Nm]",
}


@pytest.mark.parametrize("ends_apart", [False, True])
@pytest.mark.parametrize("names", NO_TRIALS.values(), ids=NO_TRIALS.keys())
def test_instruments_are_no_trials(tmp_path, names, ends_apart):
    count, random = names.count(","), np.random.default_rng(3)
    time = swing(0)[0]
    columns = [time if "time" in name else random.normal(size=200) for name in names.split(",")]
    if ends_apart:
        columns[count - 1 :] = [c[:150] for c in columns[count - 1 :]]
    rig = wanted(tmp_path, text(columns, names))
    try:
        out = new_study(rig, lambda rig, columns: {"inertia_scale": 1.0, "damping": 0.01})
    except InputError as error:
        assert "trials side by side" not in str(error)
    else:
        assert "sources" not in out.contents["study.toml"]


def test_a_stimulus_may_be_that_of_all_trials_where_words_say_what_they_are(tmp_path):
    time, random = np.arange(200) * 0.01, np.random.default_rng(5)
    stim, forces = (np.arange(200) % 20 == 0).astype(float), random.uniform(1.0, 30.0, (2, 200))
    shared = text([time, stim, *forces], "time_s,stim,force_n_1,force_n_2")
    assert "trials side by side" not in refused(tmp_path, shared, rig="muscle")
    named = text([time, stim, *forces], "time_s,stim,trial1_force_n,trial2_force_n")
    study, _ = made(tmp_path, named, rig="muscle")
    assert [np.array_equal(t["force_n"], one) for t, one in zip(study, forces, strict=True)] == [True, True]
    assert all(np.array_equal(t["stim"], stim) for t in study)


def test_copies_are_no_trials(tmp_path):
    time, angle, torque = swing(1)
    content = text([time, angle, torque] * 2, "Trial 1,,,Trial 2,,", ",".join([REPEATED] * 2))
    study, out = made(tmp_path, content)
    check(study, {"a": (time, angle, torque)})
    assert not any("side by side" in words for words in out.said)


def test_a_column_of_another_trial_that_is_named_leaves_the_file_whole(tmp_path):
    trials = [swing(1), swing(2)]
    content = text([c for one in trials for c in one], "Trial 1,,,Trial 2,,", ",".join([REPEATED] * 2))
    study, _ = made(tmp_path, content, "position=Angle [deg]#2", "effort=Torque [Nm]#2", "time_s=Time [s]")
    check(study, {"a": trials[1]})


def test_numbers_may_go_on_in_another_file(tmp_path):
    trials = [swing(k) for k in range(4)]
    files = {
        f"{name}.csv": text(
            [trials[first][0], *trials[first][1:], *trials[first + 1][1:]],
            f"time,{','.join(f'trial{first + k}_{what}' for k in (1, 2) for what in ('angle', 'torque'))}",
        )
        for name, first in (("a", 0), ("b", 2))
    }
    said = [UNITS["time_s"], "position=trial1_angle:deg", "effort=trial1_torque:N m"]
    study, out = made(tmp_path, files, *said)
    check(study, dict(zip(("a-1", "a-2", "b-1", "b-2"), trials, strict=True)))
    assert 'trial3 = "b.csv"' in out.contents["study.toml"] or 'trial3 = "trials/b.csv"' in out.contents["study.toml"]


def test_a_file_of_one_trial_may_be_among_others(tmp_path):
    time, *both = swing(1)
    names = "time,{0}_angle,{0}_torque,{1}_angle,{1}_torque"
    (_, angle, torque), (_, other, effort) = swing(2), swing(3)
    files = {
        "a.csv": text([time, *both, angle, torque], names.format("trial1", "trial2")),
        "b.csv": text([time, other, effort], "time,trial1_angle,trial1_torque"),
    }
    study, _ = made(tmp_path, files, UNITS["time_s"], "position=trial1_angle:deg", "effort=trial1_torque:N m")
    check(study, {"a-1": (time, *both), "a-2": (time, angle, torque), "b": (time, other, effort)})


def test_a_file_that_is_said_to_hold_trials_must(tmp_path):
    content = text([swing(1)[0], *swing(1)[1:]], "time,angle,torque")
    said = refused(tmp_path, content, split="columns")
    assert "--split columns: expected names that are the same but for a number" in said
    assert "time, angle, torque" in said


def test_two_trials_must_not_read_one_column(tmp_path):
    trials = [swing(1), swing(2)]
    made(tmp_path, text([c for one in trials for c in one], "Trial 1,,,Trial 2,,", ",".join([REPEATED] * 2)))
    file = tmp_path / "s/study.toml"
    before, _, after = file.read_text().rpartition("[sources.trial2]")
    own, other = '"Angle [deg]#2"', '"Angle [deg]"'
    after = after.replace(other, "?").replace(own, other).replace("?", own)
    file.write_text(f"{before}[sources.trial2]{after}")
    with pytest.raises(InputError, match=r"the same file as trial\[0\]\.sources\.trial1; expected from and to"):
        read_study(tmp_path / "s")


@pytest.mark.parametrize("heads", [True, False])
def test_sheets_whose_trials_stand_side_by_side(tmp_path, heads):
    sheets, trials = {}, {}
    for place, sheet in enumerate(("before", "after")):
        pair = [swing(10 * place + k, count) for k, count in enumerate((200, 200 if heads else 120))]
        trials |= {f"a-{sheet}-{k}": one for k, one in enumerate(pair, 1)}
        columns = [c for one in pair for c in one]
        rows = [[float(c[row]) if row < len(c) else "" for c in columns] for row in range(200)]
        above = [["first trial", "", "", "Trial 2"]] if heads else [["subject 7"]]
        sheets[sheet] = [*above, REPEATED.split(",") * 2, *rows]
    study, _ = made(tmp_path, {"a.xlsx": sheets})
    check(study, trials)


def test_a_study_by_hand_as_the_format_has_it(tmp_path):
    page = (Path(__file__).parents[2] / "docs/study_format.md").read_text()
    block = page[page.index("[sources.trial1]") :].partition("```")[0]
    (tmp_path / "p.urdf").write_text(pendulum(0.3, 1.0))
    head = '[study]\nname = "a"\nrig = "joint"\n[rig]\nurdf = "p.urdf"\n[start]\ninertia_scale = 1.0\ndamping = 0.01\n'
    (tmp_path / "study.toml").write_text(head + block)
    (time, one, _), (_, other, _) = swing(1), swing(2, 120)
    (tmp_path / "session.csv").write_text(text([time, one, other], "time,angle_1,angle_2"))
    check(read_study(tmp_path), {"session-1": (time, one, None), "session-2": (time[:120], other, None)})


def sheets_of_quantities(trials, names=("Angle", "Torque"), head="Trial {}"):
    """Sheets of a quantity each: the times of the longest trial, then a column a trial."""
    longest = max((one[0] for one in trials), key=len)
    heads = ["Time [s]", *(head.format(k) for k in range(1, len(trials) + 1))]
    sheets = {}
    for place, name in enumerate(names, 1):
        columns = [longest, *(one[place] for one in trials)]
        rows = [[float(c[row]) if row < len(c) else "" for c in columns] for row in range(len(longest))]
        sheets[name] = [heads, *rows]
    return sheets


NOTES = {"notes": [["measured by"], ["nobody"]]}
SUMMARY = {"Peak torque": [["trial", "peak"], *[[float(k), 0.1 * k] for k in range(1, 9)]]}


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("counts", [(200,), (200, 200), (150, 200, 90)])
@pytest.mark.parametrize("more", [{}, NOTES, {**NOTES, **SUMMARY}], ids=["alone", "notes", "summary"])
def test_one_quantity_a_sheet(tmp_path, seed, counts, more):
    trials = [swing(10 * seed + k, count) for k, count in enumerate(counts)]
    sheets = {**sheets_of_quantities(trials), **more}
    study, out = made(tmp_path, {"a.xlsx": sheets}, "position=angle.Trial 1:deg", "effort=torque.Trial 1:N m")
    check(study, {f"a-{k}" if len(trials) > 1 else "a": one for k, one in enumerate(trials, 1)})
    assert any("Angle, Torque of its sheets hold one quantity each" in words for words in out.said)
    text = (tmp_path / "s/study.toml").read_text()
    for wrong, why in (("3", "expected the name of a sheet"), ('"Speed"', "expected one of its sheets, Angle, Torque")):
        (tmp_path / "s/study.toml").write_text(text.replace('sheet = "Torque"', f"sheet = {wrong}", 1))
        with pytest.raises(InputError, match=why):
            read_study(tmp_path / "s")


def test_sheets_may_state_the_unit(tmp_path):
    trials = [swing(1), swing(2)]
    sheets = sheets_of_quantities(trials, ("Knee angle (deg)", "Torque (Nm)"), "run {}")
    study, _ = made(tmp_path, {"a.xlsx": sheets, "b.xlsx": sheets_of_quantities(trials[::-1], [*sheets], "run {}")})
    check(study, dict(zip(("a-1", "a-2", "b-1", "b-2"), [*trials, *trials[::-1]], strict=True)))


@pytest.mark.parametrize("names", [("left", "right"), ("Angle 1", "Angle 2"), ("trial 1", "trial 2")])
def test_sheets_of_the_same_quantity_stay_trials(tmp_path, names):
    trials = [swing(1), swing(2)]
    rows = {n: [["Time [s]", "Angle [deg]"], *zip(*one[:2], strict=True)] for n, one in zip(names, trials, strict=True)}
    study, _ = made(tmp_path, {"a.xlsx": rows})
    check(study, {f"a-{n}": (*one[:2], None) for n, one in zip(names, trials, strict=True)})


@pytest.mark.parametrize("order", [("Angle", "Torque"), ("Torque", "Angle")])
def test_quantities_of_other_times_are_no_trial(tmp_path, order):
    both = {"Angle": swing(1)[:2], "Torque": swing(2, 90)[::2]}
    sheets = {n: [["Time [s]", "value"], *zip(*both[n], strict=True)] for n in order}
    study, out = made(tmp_path, {"a.xlsx": sheets}, "position=value:deg")
    check(study, {"a-Angle": (*both["Angle"], None)})
    assert any("Angle of its 2 sheets is a trial, not Torque" in words for words in out.said)


def test_several_files_a_trial_whose_trials_stand_side_by_side(tmp_path):
    trials = [swing(1), swing(2)]
    files = {
        f"s1_{name}.csv": text([trials[0][0], *(one[k] for one in trials)], "Time [s],Trial 1,Trial 2")
        for k, name in ((1, "angle"), (2, "torque"))
    }
    study, _ = made(tmp_path, files, "position=angle.Trial 1:deg", "effort=torque.Trial 1:N m")
    check(study, {"s1_angle-1": trials[0], "s1_angle-2": trials[1]})


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("count", [1, 3])
def test_sheets_whose_columns_say_the_quantity(tmp_path, seed, count):
    trials = [swing(10 * seed + k) for k in range(count)]
    sheets = sheets_of_quantities(trials, ("Sheet1", "Sheet2"))
    for sheet, name in (("Sheet1", "Angle {} [deg]"), ("Sheet2", "Torque {} [Nm]")):
        sheets[sheet][0] = ["Time [s]", *(name.format(f"trial {k}") for k in range(1, count + 1))]
    study, _ = made(tmp_path, {"a.xlsx": sheets})
    check(study, {f"a-{k}" if count > 1 else "a": one for k, one in enumerate(trials, 1)})


def test_all_trials_may_be_of_one_sheet(tmp_path):
    trials = {name: swing(seed) for seed, name in enumerate(("one", "two", "three"))}
    sheets = {n: [["t", "Angle [deg]"], *zip(*one[:2], strict=True)] for n, one in trials.items()}
    wanted(tmp_path, {"a.xlsx": sheets})
    (tmp_path / "p.urdf").write_text(pendulum(0.3, 1.0))
    head = '[study]\nname = "a"\nrig = "joint"\n[rig]\nurdf = "p.urdf"\n[start]\ninertia_scale = 1.0\ndamping = 0.01\n'
    own = '[columns]\ntime_s = "t"\nposition = { name = "Angle [deg]", unit = "deg" }\n[columns.file]\nsheet = "two"\n'
    each = '[[trial]]\nfile = "a.xlsx"\n[[trial]]\nfile = "a.xlsx"\nsheet = "three"\n'
    (tmp_path / "study.toml").write_text(head + own + each)
    check(read_study(tmp_path), {"a": (*trials["two"][:2], None), "a-three": (*trials["three"][:2], None)})
    (tmp_path / "study.toml").write_text(head + own + each.replace("three", "two"))
    with pytest.raises(InputError, match="the same file as"):
        read_study(tmp_path)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("counts", [(200, 200, 200), (200, 90, 140)])
@pytest.mark.parametrize("form", ["Trial {}: {}", "{1} run {0:02}", "{1} {0}"])
def test_times_that_are_repeated_next_to_numbers(tmp_path, seed, counts, form):
    trials = [swing(10 * seed + k, count) for k, count in enumerate(counts)]
    names = [n for k in (1, 2, 3) for n in ("Time [s]", form.format(k, "Angle"), form.format(k, "Torque"))]
    content = text([c for one in trials for c in one], ",".join(names))
    said = [UNITS["position"].format(names[1]), UNITS["effort"].format(names[2])]
    if form == "{1} {0}" and len({*counts}) == 1:
        assert "may be 3 trials side by side or 3 instruments" in refused(tmp_path, content)
        said = [*said, "time_s=Time [s]"]
    study, _ = made(tmp_path, content, *said, split="columns" if form == "{1} {0}" else None)
    check(study, {f"a-{k}": one for k, one in enumerate(trials, 1)})


@pytest.mark.parametrize("form", ["{}.{}", "{}{}", "{}_{}"])
@pytest.mark.parametrize("names", [("Time [s]", "Angle [deg]", "Torque [Nm]"), ("time_s", "position", "effort")])
def test_repeated_names_that_a_program_has_numbered(tmp_path, form, names):
    trials = [swing(k, count) for k, count in enumerate((200, 120, 160))]
    every = [n if k == 0 else form.format(n, k + ("." not in form)) for k in range(3) for n in names]
    said = ["position=position:deg"] if "position" in names else []
    study, _ = made(tmp_path, text([c for one in trials for c in one], ",".join(every)), *said)
    check(study, {f"a-{k}": one for k, one in enumerate(trials, 1)})


@pytest.mark.parametrize("later", [3.0, 60.0])
def test_a_clock_that_goes_on_parts_trials(tmp_path, later):
    one, (time, *both) = swing(1), swing(2)
    content = text([*one, np.round(time + later, 6), *both], "time_1,angle_1,torque_1,time_2,angle_2,torque_2")
    said = ("time_s=time_1:s", "position=angle_1:deg", "effort=torque_1:N m")
    study, out = made(tmp_path, content, *said)
    check(study, {"a-1": one, "a-2": (np.round(time + later, 6), *both)})
    assert any("they do not end at once" in words for words in out.said)


def test_clocks_that_overlap_are_of_instruments(tmp_path):
    one, (time, *both) = swing(1), swing(2)
    content = text([*one, np.round(time + 0.3, 6), *both], "time_1,angle_1,torque_1,time_2,angle_2,torque_2")
    assert "or 2 instruments at once" in refused(tmp_path, content)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("form", ["{} deg/s", "trial at {} deg/s", "{}°/s", "{} dps", "Knee 0{} deg/s", "{} rpm"])
def test_a_column_for_each_speed_of_a_dynamometer(tmp_path, seed, form):
    random = np.random.default_rng(seed)
    speeds = sorted(random.choice([5, 30, 60, 90, 120, 180, 240, 300], size=2 + seed, replace=False))
    trials = [swing(10 * seed + k) for k in range(len(speeds))]
    names = [form.format(speed) for speed in speeds]
    content = text([trials[0][0], *(one[1] for one in trials)], ",".join(["Time [s]", *names]))
    assert f"--column position={names[0]}:UNIT" in refused(tmp_path, content)
    study, _ = made(tmp_path, content, f"position={names[0]}:deg")
    check(study, {f"a-{k}": (*one[:2], None) for k, one in enumerate(trials, 1)})


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("form", ["{} {} deg/s", "{} ({} deg/s)", "{}_{}dps", "{} [{}°/s]", "{} {} deg/s [unit]"])
def test_quantities_at_each_speed_of_a_dynamometer(tmp_path, seed, form):
    speeds, trials = (60, 120, 180), [swing(10 * seed + k) for k in range(3)]
    names = [form.format(what, speed) for speed in speeds for what in ("angle", "torque")]
    names = [n.replace("unit", "deg" if n.startswith("angle") else "Nm") for n in names]
    columns = [trials[0][0], *(c for one in trials for c in one[1:])]
    said = [UNITS["time_s"], UNITS["position"].format(names[0]), UNITS["effort"].format(names[1])]
    study, out = made(tmp_path, text(columns, ",".join(["time", *names])), *(said[:1] if "unit" in form else said))
    check(study, {f"a-{k}": one for k, one in enumerate(trials, 1)})
    assert any("their names say so" in words for words in out.said)


@pytest.mark.parametrize(
    "names",
    ["gyro 1 deg/s,gyro 2 deg/s", "omega_1 [dps],omega_2 [dps]", "speed1 dps,speed2 dps", "imu 1 dps,imu 2 dps"],
)
def test_channels_of_a_gyroscope_are_no_trials(tmp_path, names):
    one, other = swing(1), swing(2)
    content = text([*one, other[2]], f"Time [s],Angle [deg],{names}")
    said = refused(tmp_path, content)
    assert "trials side by side" not in said and all(name in said for name in names.split(","))
