"""Forms that laboratories write: lists as headers, too few names, transposed tables, units rows, rates, clocks."""

from datetime import UTC, datetime, timedelta

import numpy as np
import pytest

from fes_pin.data.errors import InputError, listed
from fes_pin.data.new_recording import propose
from fes_pin.data.new_study import new_study
from fes_pin.data.recorded.formats import read_recording
from fes_pin.data.recorded.sniff import sniffed
from fes_pin.data.schema import known_rigs
from fes_pin.data.study import read_study
from fes_pin.data.templates import pendulum
from fes_pin.data.wanted import Wanted

JOINT = known_rigs()["joint"]
NAMES = ("Time", "Angle", "Torque", "EMG1", "trigger", "Temp C", "knee.q", "F_z")
DELIMITERS = {"comma": ",", "semicolon": ";", "tab": "\t", "space": " "}
SEEDS = range(4)


def drawn(seed, columns=3, rows=40):
    """Names and numbers of a recording, time first."""
    rng = np.random.default_rng(seed)
    names = ["Time", *(str(n) for n in rng.choice(NAMES[1:], columns - 1, replace=False))]
    return names, np.column_stack([0.01 * np.arange(rows), rng.normal(size=(rows, columns - 1))])


def body_of(values, delimiter=","):
    return "".join(delimiter.join(f"{x:.5f}" for x in row) + "\n" for row in values)


def written(path, *lines, values, delimiter=","):
    path.write_text("".join(f"{line}\n" for line in lines) + body_of(values, delimiter))
    return path


def study_of(folder, *files, rig="joint", made=None, **more):
    """The study that is proposed of files, as it is read again, and what was said."""
    (folder / "rod.urdf").write_text(pendulum(0.4, 1.0))
    urdf = folder / "rod.urdf" if rig == "joint" else None
    made = new_study(Wanted(files, known_rigs()[rig], folder, "own", urdf=urdf, **more), lambda *_: START[rig])
    (folder / "study.toml").write_text(made.contents["study.toml"])
    return read_study(folder), made.said


START = {
    "joint": {"inertia_scale": 1.0, "damping": 0.01},
    "muscle": {"gain": 1.0, "time_constant_s": 0.05},
}

LISTS = {
    "python": repr,
    "comment": lambda names: f"# {names!r}",
    "numpy": lambda names: "[" + " ".join(map(repr, names)) + "]",
    "bare": lambda names: f"[{', '.join(names)}]",
    "tuple": lambda names: str(tuple(names)),
    "assigned": lambda names: f"columns = {names!r}",
    "json": lambda names: "[" + ", ".join(f'"{n}"' for n in names) + "]",
}


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("delimiter", DELIMITERS.values(), ids=list(DELIMITERS))
@pytest.mark.parametrize("how", LISTS)
def test_a_header_that_a_script_wrote_as_a_list_has_its_names(tmp_path, how, delimiter, seed):
    names, values = drawn(seed, 2 + seed)
    path = written(tmp_path / "a.txt", LISTS[how](names), values=values, delimiter=delimiter)
    form, header = sniffed(path)
    read = read_recording(path, form)
    assert read.names == tuple(names) and header.said == ()
    assert np.allclose(np.column_stack(list(read.columns.values())), values, atol=1e-5)


@pytest.mark.parametrize(
    "header", ["time [s],torque cmd [Nm],q [rad]", "t (s),Angle,F (N)", "[s],[deg],[Nm]", "a=(s),b,c(1)"]
)
def test_brackets_behind_names_are_no_list(tmp_path, header):
    path = written(tmp_path / "a.csv", header, values=drawn(1)[1])
    assert read_recording(path, sniffed(path)[0]).names == tuple(header.split(",")) and sniffed(path)[0].names == ()


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("between", [", ", "; ", "\t"])
def test_names_with_another_delimiter_than_the_numbers(tmp_path, between, seed):
    names, values = drawn(seed, 3)
    path = written(tmp_path / "a.txt", between.join(names), values=values, delimiter=" ")
    assert read_recording(path, sniffed(path)[0]).names == tuple(names)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize(("count", "columns"), [(2, 4), (2, 3), (4, 3), (3, 1), (5, 2)])
def test_names_that_are_not_one_a_column_are_said_and_asked_for(tmp_path, count, columns, seed):
    names = drawn(seed, max(count, 2))[0][:count]
    path = written(tmp_path / "a.csv", ",".join(names), values=drawn(seed, max(columns, 2))[1][:, -columns:])
    over = f"line 1 has {count} names over {columns} column{'s' * (columns > 1)}"
    with pytest.raises(InputError, match=rf"a\.csv: {over}, .*: --names .*; the files do not say everything") as caught:
        study_of(tmp_path, path)
    assert len(str(caught.value)) < 600
    own = tuple(f"n{k}" for k in range(columns))
    form, header = sniffed(path, {"names": own})
    assert form.first_row == 2 and read_recording(path, form).names == own and header.said == ()


def test_names_that_a_person_states_are_written_into_the_study(tmp_path):
    _, values = drawn(1, 4)
    path = written(tmp_path / "a.csv", '"Time","data"', values=values)
    form = {"names": ("time_s", "position", "other", "effort")}
    study, said = study_of(tmp_path, path, form=form, columns={"effort": "effort"})
    text = (tmp_path / "study.toml").read_text()
    assert 'names = ["time_s", "position", "other", "effort"]' in text and said == ()
    assert np.allclose(study.trials[0]["position"], values[:, 1], atol=1e-5)
    (tmp_path / "study.toml").write_text(text.replace('"other", ', "", 1))
    with pytest.raises(InputError, match="expected names of 4 columns, found 3"):
        read_study(tmp_path)


@pytest.mark.parametrize("lines", [[], ["Lab 3"], ["# subject 7, left, twice"], ["Lab", "", "Time,q,tau"], ["Time,q,"]])
def test_titles_and_good_headers_are_no_names_too_few(tmp_path, lines):
    path = written(tmp_path / "a.csv", *lines, values=drawn(0)[1])
    assert sniffed(path)[1].said == ()


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("delimiter", DELIMITERS.values(), ids=list(DELIMITERS))
@pytest.mark.parametrize("how", ["names_above", "names_before"])
def test_a_transposed_table_is_read_and_said(tmp_path, how, delimiter, seed):
    names, values = drawn(seed, 2 + seed, rows=30 + 100 * seed)
    names = [name.replace(" ", "_") for name in names]
    lines = [delimiter.join(f"{x:.5f}" for x in row) for row in values.T]
    if how == "names_above":
        lines = [delimiter.join(names), *lines]
    else:
        lines = [f"{name}{delimiter}{line}" for name, line in zip(names, lines, strict=True)]
    path = tmp_path / "a.csv"
    path.write_text("\n".join(lines) + "\n")
    form, header = sniffed(path)
    assert form.transposed and "taken as transposed" in header.said[0] and f"{len(names)} names" in header.said[0]
    read = read_recording(path, form)
    assert read.names == tuple(names)
    assert np.allclose(np.column_stack(list(read.columns.values())), values, atol=1e-5)
    assert read.half_digit_of(names[0]) == pytest.approx(0.5e-5)


def test_a_transposed_table_becomes_a_study_and_its_faults_are_one_line(tmp_path):
    time, angle = 0.01 * np.arange(50), np.cos(np.arange(50) / 9)
    path = tmp_path / "a.csv"
    lines = ["time_s," + ",".join(f"{t:.3f}" for t in time), "position," + ",".join(f"{q:.6f}" for q in angle)]
    path.write_text("\n".join(lines))
    study, said = study_of(tmp_path, path)
    assert np.allclose(study.trials[0]["position"], angle, atol=1e-6)
    assert said == ("a.csv: 2 names before as many rows of 50 numbers: the table is taken as transposed",)
    path.write_text("\n".join([lines[0], lines[1] + ",0.5"]))
    with pytest.raises(InputError, match="row 2: expected lines of 51 values, found 52"):
        read_study(tmp_path)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_wide_table_without_names_is_doubted_and_read_where_a_person_says_so(tmp_path, seed):
    _, values = drawn(seed, 2 + seed, rows=60)
    path = written(tmp_path / "a.csv", values=values.T)
    assert sniffed(path)[1].said[0].startswith(f"{2 + seed} rows of 60 columns without names: is the table transposed?")
    form, header = sniffed(path, {"transposed": True})
    read = read_recording(path, form)
    assert read.names == tuple(f"column{k}" for k in range(1, 3 + seed)) and header.said == ()
    assert np.allclose(np.column_stack(list(read.columns.values())), values, atol=1e-5)
    own = tuple("abcdef"[: 2 + seed])
    study, _ = study_of(
        tmp_path, path, form={"transposed": True, "names": own}, columns={"time_s": "a:s", "position": "b:rad"}
    )
    assert np.allclose(study.trials[0]["position"], values[:, 1], atol=1e-5)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_table_of_many_named_columns_and_few_rows_is_not_transposed(tmp_path, seed):
    names = [f"c{k}" for k in range(50)]
    values = np.random.default_rng(seed).normal(size=(3 + seed, 50))
    for lines in ([",".join(names)], ["title, of four, words, here"[: 9 + 5 * seed], ",".join(names)]):
        form, header = sniffed(written(tmp_path / "a.csv", *lines, values=values))
        assert not form.transposed and header.said == () and form.header_row == len(lines)


UNITS_ROWS = {  # names, units
    "volts": (["Time", "EMG1", "Angle", "Torque"], ["s", "V", "deg", "N"]),
    "counts": (["Time", "Load", "Angle", "Torque"], ["ms", "LSB", "deg", "xyz"]),
    "nearly_all_unknown": (["Time", "Valve", "Pump", "Fan"], ["s", "foo", "baz", "qux"]),
    "blank": (["Frame", "EMG1", "Angle", "Torque"], ["", "mV", "deg", "Nm"]),
    "twice_the_same": (["Time", "EMG1", "EMG2", "Torque"], ["s", "V", "V", "arb"]),
    "bracketed": (["Time", "Valve", "Angle", "Pump"], ["[s]", "[foo]", "[baz]", "[qux]"]),
}


@pytest.mark.parametrize("case", UNITS_ROWS)
@pytest.mark.parametrize("order", ["below", "above"])
@pytest.mark.parametrize("before", [(), ("Devices", "1500", ",,Amplifier - Voltage,,"), ("# made",)])
def test_rows_of_units_stand_below_or_above_the_names(tmp_path, before, order, case):
    names, units = UNITS_ROWS[case]
    rows = [",".join(names), ",".join(units)][:: 1 if order == "below" else -1]
    path = written(tmp_path / "a.csv", *before, *rows, values=drawn(2, 4)[1])
    form, header = sniffed(path)
    assert read_recording(path, form).names == tuple(names)
    assert [header.units.get(k, "") for k in range(4)] == [u.strip("[]") for u in units]


NO_UNITS = {  # the row above, the row of the names
    "groups": (["left", "left", "right", "right"], ["angle", "torque", "speed", "emg"]),
    "short_names": (["Clock", "Bend", "Moment", "Side"], ["t", "phi", "m", "x"]),
    "words": (["Device", "Device", "Sensor", "Sensor"], ["Time", "Angle", "Torque", "Speed"]),
    "numbers": (["1", "2", "3", "4"], ["Time", "Angle", "Torque", "Speed"]),
}


@pytest.mark.parametrize("case", NO_UNITS)
def test_two_rows_of_names_are_no_row_of_units(tmp_path, case):
    above, names = NO_UNITS[case]
    path = written(tmp_path / "a.csv", ",".join(above), ",".join(names), values=drawn(3, 4)[1])
    form, header = sniffed(path)
    assert read_recording(path, form).names == tuple(names) and header.units == {}


def test_a_unit_below_the_time_and_names_below_the_channels(tmp_path):
    lines = ("Axis1", "Sampling time interval(ms),10", "Time,Analog 1,Analog 2", "ms,Servo motor speed,Torque")
    form, header = sniffed(written(tmp_path / "a.csv", *lines, values=drawn(0)[1]))
    assert form.names == ("Time", "Servo motor speed", "Torque") and header.units == {0: "ms"}
    assert header.rate_hz == pytest.approx(100.0)


RATES = {
    "interval": ("Interval,0.01", 100.0),
    "interval_in_ms": ("Sampling time interval(ms),0.667", 1000 / 0.667),
    "labchart": ("Interval=\t0.0005 s", 2000.0),
    "rate": ("Sampling rate: 1000", 1000.0),
    "rate_in_khz": ("Sample rate [kHz],2", 2000.0),
    "rate_with_its_unit": ("# sampling frequency = 200 Hz", 200.0),
    "frame_rate": ("Frame Rate;120", 120.0),
    "pairs": ("start_deg, sample_rate, duration_s, x\n45, 250, 3, 4", 250.0),
    "fs": ("fs,500", 500.0),
}


@pytest.mark.parametrize("case", RATES)
def test_a_sample_rate_above_the_numbers_is_proposed(tmp_path, case):
    line, rate = RATES[case]
    path = written(tmp_path / "a.csv", line, "angle_rad,torque_Nm", values=drawn(0, 3)[1][:, 1:])
    study, said = study_of(tmp_path, path)
    assert study.trials[0].dt == pytest.approx(1 / rate) and f"{rate:g} Hz is what the header says" in said[0]


@pytest.mark.parametrize(
    "line",
    ["Stimulation frequency,30", "Heart rate,60", "Pulse interval,0.03", "Cut-off frequency,20", "rate,fast", "dt,-1"],
)
def test_other_rates_are_no_sample_rates(tmp_path, line):
    path = written(tmp_path / "a.csv", line, "angle_rad,torque_Nm", values=drawn(0, 3)[1][:, 1:])
    assert propose(path, JOINT, True).rate_hz is None
    with pytest.raises(InputError, match="--column time_s=NAME:UNIT"):
        study_of(tmp_path, path)


def test_a_rate_gives_way_to_a_column_of_times(tmp_path):
    path = written(tmp_path / "a.csv", "Interval,0.5", "Time_s,angle_rad,torque_Nm", values=drawn(0, 3)[1])
    assert study_of(tmp_path, path)[0].trials[0].dt == pytest.approx(0.01)


def test_frames_have_the_rate_that_stands_alone_above_them(tmp_path):
    _, values = drawn(1, 4)
    lines = ("Devices", "1500", ",,Dyn - Angle,", "Frame,Sub Frame,Angle,Torque", ",,deg,N.mm")
    study, said = study_of(tmp_path, written(tmp_path / "a.csv", *lines, values=values))
    assert study.trials[0].dt == pytest.approx(1 / 1500) and "1500 Hz" in said[0]
    assert np.allclose(study.trials[0]["effort"], 1e-3 * values[:, 3], atol=1e-7)
    assert sniffed(written(tmp_path / "b.csv", "Devices", "1500", "n,m,Angle,Torque", values=values))[1].rate_hz is None


def test_names_in_lines_with_a_key(tmp_path):
    lines = ("Timestamp,2020-03-16 17:04:51", "Interval,0.01", 'Channel name,"Force"', 'Unit,"V"')
    form, header = sniffed(written(tmp_path / "a.csv", *lines, values=drawn(0, 2)[1]))
    assert form.names == ("Time", "Force") and header.units == {0: "s", 1: "V"}
    other = sniffed(written(tmp_path / "b.csv", "Interval,0.3", *lines[2:], values=drawn(0, 2)[1]))
    assert other[0].names == ("", "Force")  # what the first column holds is not known
    lab = ("Interval=\t0.01 s", "ChannelTitle=\tForce\tEMG", "Range=\t10 V\t5 V")
    form, header = sniffed(written(tmp_path / "c.txt", *lab, values=drawn(0, 3)[1], delimiter="\t"))
    assert form.names == ("Time", "Force", "EMG")
    plain = written(tmp_path / "d.csv", "Channel,Force", values=drawn(0, 2)[1])
    assert sniffed(plain)[0].names == () and read_recording(plain, sniffed(plain)[0]).names == ("Channel", "Force")


START_OF_CLOCK = datetime(2026, 2, 2, 23, 59, 59, 500000, tzinfo=UTC)
CLOCKS = {
    "iso": (lambda t: (START_OF_CLOCK + timedelta(seconds=t)).isoformat(timespec="milliseconds"), "dates"),
    "iso_z": (lambda t: f"{START_OF_CLOCK + timedelta(seconds=t):%Y-%m-%dT%H:%M:%S.%f}Z", "dates"),
    "blank": (lambda t: f"{START_OF_CLOCK + timedelta(seconds=t):%Y-%m-%d %H:%M:%S.%f}", "dates"),
    "of_day": (lambda t: f"{START_OF_CLOCK + timedelta(seconds=t):%H:%M:%S.%f}", "times of day"),
    "german": (lambda t: f"{START_OF_CLOCK + timedelta(seconds=t):%d.%m.%Y %H:%M:%S.%f}", "times of day"),
    "minutes": (lambda t: f"{int((3500 + t) // 60):02d}:{(3500 + t) % 60:06.3f}", "times of day"),
}


@pytest.mark.parametrize("case", CLOCKS)
@pytest.mark.parametrize("delimiter", [",", ";", "\t"])
def test_dates_and_times_of_day_are_seconds_from_the_first_row(tmp_path, delimiter, case):
    form, what = CLOCKS[case]
    time = 0.01 * np.arange(90)
    rows = [delimiter.join([form(t), f"{np.cos(t):.5f}"]) for t in time]
    path = tmp_path / "a.csv"
    path.write_text("\n".join([delimiter.join(["time_s", "position"]), *rows]))
    study, _ = study_of(tmp_path, path)
    (trial,) = study.trials
    assert np.allclose(trial.time, time, atol=1e-6) and np.allclose(trial["position"], np.cos(time), atol=1e-5)
    assert any(f"time_s holds {what}: it is read as seconds from its first row" in one for one in trial.remarks)


@pytest.mark.parametrize(("unit", "factor"), [("s", 1.0), ("ms", 1e3), ("us", 1e6)])
@pytest.mark.parametrize("name", ["UnixTimestamp", "time"])
def test_seconds_since_1970_count_from_the_first_row(tmp_path, name, unit, factor):
    time = 0.25 * np.arange(60)
    rows = [f"{factor * (1770048000.5 + t):.3f},{np.cos(t):.5f}" for t in time]
    path = tmp_path / "a.csv"
    path.write_text("\n".join([f"{name},angle_rad", *rows]))
    study, _ = study_of(tmp_path, path)
    assert np.allclose(study.trials[0].time, time, atol=1e-6)
    assert f"{name} is taken as {unit} since 1970" in study.trials[0].remarks[0]
    assert "2026-02-02 16:00:00.500" in study.trials[0].remarks[0]


@pytest.mark.parametrize("rows", [1, 2])
def test_a_sample_that_is_no_number_is_no_header(tmp_path, rows):
    bad = ["0.5,error"] * rows
    path = written(tmp_path / "a.csv", "time_s,position", *bad, values=drawn(0, 2)[1])
    with pytest.raises(InputError, match="--column position="):
        study_of(tmp_path, path)
    assert sniffed(path)[0].first_row == 2
    keyed = written(tmp_path / "b.csv", "time_s,position", "Interval,0.01", values=drawn(0, 2)[1])
    assert sniffed(keyed)[0].first_row == 3 and read_recording(keyed, sniffed(keyed)[0]).names == ("time_s", "position")


@pytest.mark.parametrize("seed", SEEDS)
def test_large_numbers_are_no_dates(tmp_path, seed):
    rng = np.random.default_rng(seed)
    counts = {"noise": 1.7e9 + rng.normal(size=40), "same": np.full(40, 1.7e9), "small": 1e5 + np.arange(40.0)}
    values = np.column_stack([0.01 * np.arange(40), *counts.values()])
    recording = read_recording(written(tmp_path / "a.csv", ",".join(["t", *counts]), values=values))
    assert recording.said == () and np.allclose(recording.columns["noise"], counts["noise"], atol=1e-4)


def test_at_most_ten_columns_are_listed(tmp_path):
    assert listed(list("abc")) == "a, b, c" and listed([str(k) for k in range(400)]).endswith("9 ... and 390 more")
    path = written(tmp_path / "a.csv", values=np.random.default_rng(0).normal(size=(500, 400)))
    with pytest.raises(InputError, match=r"column10 \.\.\. and 390 more") as caught:
        study_of(tmp_path, path)
    assert len(str(caught.value)) < 600
