"""Exports of dynamometers, loggers and drives: names with blanks, remarks, headers again, speeds in Hz, commands."""

import json

import numpy as np
import pytest

from fes_pin.data.errors import InputError
from fes_pin.data.new_recording import propose
from fes_pin.data.new_study import new_study
from fes_pin.data.recorded.formats import read_recording
from fes_pin.data.recorded.sniff import sniffed
from fes_pin.data.schema import known_rigs
from fes_pin.data.study import read_study
from fes_pin.data.templates import pendulum
from fes_pin.data.units import UNITS, known_unit, split_header, turns_a_second
from fes_pin.data.wanted import Wanted

JOINT = known_rigs()["joint"]
SEEDS = range(4)


def drawn(seed, columns=2, rows=30):
    """Times, s, and columns of numbers."""
    rng = np.random.default_rng(seed)
    return 0.01 * np.arange(rows), 50.0 * rng.normal(size=(rows, columns))


def lines_of(time, values, between="\t"):
    return [between.join([f"{t:.7f}", *(f"{x:.4f}" for x in row)]) for t, row in zip(time, values, strict=True)]


def written(path, *lines):
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def read(path):
    form, header = sniffed(path)
    return read_recording(path, form), header


def study_of(folder, *files, rig="joint", **more):
    """The study that is proposed of files, as it is read again, and what was said."""
    (folder / "rod.urdf").write_text(pendulum(0.4, 1.0))
    urdf = folder / "rod.urdf" if rig == "joint" else None
    made = new_study(
        Wanted(files, known_rigs()[rig], folder, "own", urdf=urdf, **more),
        lambda *_: {"inertia_scale": 1.0, "damping": 0.01} if rig == "joint" else {"gain": 1.0},
    )
    (folder / "study.toml").write_text(made.contents["study.toml"])
    return read_study(folder), made.said


SPELT = {
    "deg/s": ("Deg/Sec", "DEG/SEC", "°/s", "° s-1", "deg·s⁻¹", "degrees per second", "deg/second"),
    "deg": ("Grad", "grados", "°", "degrees"),
    "rad/s": ("rad s^-1", "radians/s", "rad·s-1"),
    "rpm": ("r/min", "rev/min", "U/min"),
    "lbf ft": ("FT-LBS", "ft·lb", "Foot-Pounds", "ft.lbs", "lb-ft"),
    "N m": ("N-M", "Newton-meters", "N·m"),
    "m/s": ("m s-1", "m/sec"),
    "ms": ("mSec", "milliSec"),
}


@pytest.mark.parametrize("unit", SPELT)
def test_units_as_instruments_spell_them(unit):
    assert {known_unit(each, tuple(UNITS))[1] for each in SPELT[unit]} == {unit}


@pytest.mark.parametrize("text", ["s-1", "N/s", "per second", "foot", "steps/min"])
def test_what_is_no_unit_of_these_stays_unknown(text):
    assert known_unit(text, tuple(UNITS)) is None


@pytest.mark.parametrize(
    ("header", "parts"),
    [("gyro rad/sec", ("gyro", "rad/sec")), ("X [s]#2", ("X", "s")), ("time_sec", ("time", "sec")), ("a#2", ("a", ""))],
)
def test_units_behind_a_blank_and_before_the_number_of_a_twin(header, parts):
    assert split_header(header) == parts


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("units", ["mSec     N-M         Degrees     Degrees       DEG/SEC", ""])
def test_names_that_hold_a_blank_stand_above_columns_of_white_space(tmp_path, units, seed):
    time, values = drawn(seed, 4)
    rows = ["".join(f"{x:12.3f}" for x in (1000.0 * t, *row)) for t, row in zip(time, values, strict=True)]
    names = "TIME     TORQUE      POSITION    POS (ANAT)    VELOCITY"
    path = written(tmp_path / "a.txt", "Data Set (UNFILTERED)", "", names, *[units] * bool(units), "", *rows)
    table, header = read(path)
    assert table.names == ("TIME", "TORQUE", "POSITION", "POS (ANAT)", "VELOCITY") and len(table) == len(time)
    assert [header.units.get(k) for k in range(5)] == (units.split() or [None] * 5)
    assert np.allclose(table.columns["POS (ANAT)"], values[:, 2], atol=1e-3)


@pytest.mark.parametrize("seed", SEEDS)
def test_single_blanks_between_names_part_them(tmp_path, seed):
    time, values = drawn(seed, 2)
    path = written(tmp_path / "a.txt", "t  angle torque", *lines_of(time, values, " "))
    assert read(path)[0].names == ("t", "angle", "torque")


def labchart(time, values, *, remarks=(), first=True):
    """A block as LabChart exports it."""
    rows = lines_of(time, values)
    for k in remarks:
        rows[k] += "\t#* stimulus on "
    return [
        f"Interval=\t{time[1] - time[0]:.3g} s",
        f"ExcelDateTime=\t4.2507{int(first)}e+004\t05/17/16 14:30:00.000000",
        "ChannelTitle=\tTorque\tKnee angle",
        "Range=\t10.000 V\t5.000 V",
        "UnitName=\tNm\tdeg",
        "TopValue=\t10\t*",
        "BottomValue=\t-10\t-5",
        *rows,
    ]


@pytest.mark.parametrize("seed", SEEDS)
def test_blocks_of_labchart_are_recordings_without_their_headers_and_remarks(tmp_path, seed):
    rng = np.random.default_rng(seed)
    blocks = [drawn(10 * seed + k, rows=int(rng.integers(30, 900))) for k in range(3)]
    marks = [sorted(rng.choice(len(t), 3, replace=False)) for t, _ in blocks]
    parts = [labchart(*b, remarks=m, first=k == 0) for k, (b, m) in enumerate(zip(blocks, marks, strict=True))]
    path = written(tmp_path / "a.txt", *(line for part in parts for line in part))
    table, header = read(path)
    assert table.names == ("Time", "Torque", "Knee angle") and header.units == {0: "s", 1: "Nm", 2: "deg"}
    every = np.concatenate([np.column_stack(b) for b in blocks])
    assert np.allclose(np.column_stack([*table.columns.values()]), every, atol=1e-3)
    assert table.said == (
        "its header comes again in 14 lines, which are passed over",
        "9 rows end in a remark, '#* stimulus on': it is passed over",
    )


@pytest.mark.parametrize("seed", SEEDS)
def test_rows_of_words_are_no_header_that_comes_again(tmp_path, seed):
    time, values = drawn(seed, rows=60)
    rows = [f"{'left' if k % 7 else 'right'},{row}" for k, row in enumerate(lines_of(time, values, ","))]
    path = written(tmp_path / "a.csv", "side,t,angle,torque", *rows)
    table = propose(path, JOINT, True).recording
    assert len(table) == 60 and table.said == () and table.names == ("side", "t", "angle", "torque")
    plain = written(tmp_path / "b.csv", "t,angle,torque", *lines_of(time, values, ","), "0.9,#N/A,2.0")
    table = read(plain)[0]
    assert len(table) == 61 and table.said == () and np.isnan(table.columns["angle"][-1])


def acqknowledge(time, values, *, clock, counts):
    labels = ["Knee angle", "deg", "Torque - DA100C", "Nm"]
    rows = lines_of(time / 60.0 if clock == "min" else time, values)
    rows = rows if clock else [row.partition("\t")[2] for row in rows]
    names = [*[clock] * bool(clock), "CH1", "CH2"]
    count = "\t".join([*[""] * bool(clock), str(len(rows)), str(len(rows) - counts)])
    return ["knee.acq", "10 msec/sample", "2 channels", *labels, "\t".join(names), count, *rows]


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("clock", ["", "min", "sec"])
def test_channels_that_acqknowledge_describes(tmp_path, clock, seed):
    time, values = drawn(seed, rows=int(np.random.default_rng(seed).integers(20, 700)))
    path = written(tmp_path / "a.txt", *acqknowledge(time, values, clock=clock, counts=seed % 2))
    table, header = read(path)
    found = propose(path, JOINT, True)
    assert header.rate_hz == pytest.approx(100.0) and len(table) == len(time)
    assert found.candidates["position"] == ("Knee angle",) and found.candidates["effort"] == ("Torque - DA100C",)
    assert np.allclose(table.columns["Knee angle"], values[:, 0], atol=1e-3)
    study, _ = study_of(tmp_path, path)
    assert np.allclose(study.trials[0]["position"], np.radians(values[:, 0]), atol=1e-4)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_first_sample_of_whole_numbers_is_a_sample(tmp_path, seed):
    count = int(np.random.default_rng(seed).integers(20, 90))
    rows = [f"{k},{count - k},{count}" for k in range(count)]
    table, _ = read(written(tmp_path / "a.csv", "n,a,b", *rows))
    assert len(table) == count and table.columns["a"][0] == count


@pytest.mark.parametrize("seed", SEEDS)
def test_channels_that_opensignals_describes(tmp_path, seed):
    rate = int(np.random.default_rng(seed).choice([100, 700, 1000]))
    about = {"sensor": ["TORQUE", "EMG"], "column": ["nSeq", "DI", "CH1", "CH2"], "sampling rate": rate}
    rows = [f"{k % 16}\t0\t{x:.0f}\t{y:.0f}\t" for k, (x, y) in enumerate(1e3 * drawn(seed)[1])]
    top = ["# OpenSignals Text File Format", "# " + json.dumps({"00:07": about}), "# EndOfHeader"]
    path = written(tmp_path / "a.txt", *top, *rows)
    table, header = read(path)
    assert table.names == ("nSeq", "DI", "CH1 TORQUE", "CH2 EMG") and header.rate_hz == rate
    assert propose(path, JOINT, True).candidates["effort"] == ("CH1 TORQUE",)
    other = written(tmp_path / "b.txt", "# [1, 2]", '# {"a": 3}', "# {broken", *rows)
    assert read(other)[0].names == ("column1", "column2", "column3", "column4")


@pytest.mark.parametrize("rate", ["[100]", "1" + "0" * 400, "Infinity", "null", '"fast"', "-5", "{}"])
def test_a_rate_that_is_none_is_left_out(tmp_path, rate):
    rows = [f"{k % 16}\t0\t{x:.0f}\t{y:.0f}\t" for k, (x, y) in enumerate(1e3 * drawn(1)[1])]
    about = f'"sensor": ["TORQUE", "EMG"], "column": ["nSeq", "DI", "CH1", "CH2"], "sampling rate": {rate}'
    for devices in (f'{{"one": {{{about}}}}}', f'{{"one": {{{about}, "column": []}}, "two": {{{about}}}}}'):
        table, header = read(written(tmp_path / "a.txt", f"# {devices}", "# EndOfHeader", *rows))
        assert table.names == ("nSeq", "DI", "CH1 TORQUE", "CH2 EMG") and header.rate_hz is None
    time, values = drawn(1)
    broken = [line.replace("10 msec", "..5 msec") for line in acqknowledge(time, values, clock="min", counts=0)]
    assert read(written(tmp_path / "b.txt", *broken))[1].rate_hz is None


@pytest.mark.parametrize("name", ["Motor speed [Hz]", "velocity measured (Hz)", "omega_Hz"])
def test_a_speed_in_hz_is_turns_a_second_and_said(tmp_path, name):
    time, values = drawn(1, rows=200)
    path = written(tmp_path / "a.csv", f"time [s],{name},torque [Nm]", *lines_of(time, values, ","))
    for columns in ({}, {"velocity": name}):
        study, said = study_of(tmp_path, path, columns=columns)
        turned = 2.0 * np.pi * 0.005 * np.cumsum(values[1:, 0] + values[:-1, 0])
        assert np.allclose(study.trials[0]["position"][1:], turned, rtol=1e-3, atol=1e-2)
        assert said == (f"{name} is in Hz: it is taken as turns a second, rev/s",)
    with pytest.raises(InputError, match=r"found 'Hz'; turns a second are rev/s"):
        study_of(tmp_path, path, columns={"velocity": f"{name}:Hz"})


@pytest.mark.parametrize("name", ["Pulse rate [Hz]", "Stim frequency (Hz)", "rate_Hz", "f [Hz]", "Motor speed [kHz]"])
def test_other_columns_in_hz_are_no_speed(name):
    assert not turns_a_second("velocity", name, "", True)
    assert not turns_a_second("velocity", "speed [Hz]", "", False) and not turns_a_second("effort", "speed [Hz]")


@pytest.mark.parametrize("word", ["setpoint", "cmd", "target", "desired", "reference"])
@pytest.mark.parametrize("quantity", ["position", "velocity"])
def test_what_is_wanted_is_no_reading_where_there_is_one(tmp_path, quantity, word):
    unit = {"position": "deg", "velocity": "deg/s"}[quantity]
    time, values = drawn(3, 3)
    names = [f"{quantity} {word} [{unit}]", f"{quantity} actual [{unit}]", "torque [Nm]"]
    path = written(tmp_path / "a.csv", ",".join(["t [s]", *names]), *lines_of(time, values, ","))
    assert propose(path, JOINT, True).candidates[quantity] == (names[1],)
    alone = written(tmp_path / "b.csv", ",".join(["t [s]", names[0]]), *lines_of(time, values[:, :1], ","))
    assert propose(alone, JOINT, True).candidates[quantity] == (names[0],)
    efforts = written(tmp_path / "c.csv", f"t,torque {word} [Nm],torque [Nm]", *lines_of(time, values[:, :2], ","))
    assert len(propose(efforts, JOINT, True).candidates["effort"]) == 2  # either may drive: asked


@pytest.mark.parametrize("seed", SEEDS)
def test_equal_times_before_each_channel_are_one(tmp_path, seed):
    time, values = drawn(seed)
    rows = [f"{t:.3f},{a:.4f},{t:.3f},{b:.4f}" for t, (a, b) in zip(time, values, strict=True)]
    top = "X [s],Torque: Analog A [Nm],X [s],Angle: Analog B [deg]"
    path = written(tmp_path / "a.csv", top, *rows)
    found = propose(path, JOINT, True).candidates
    assert found["time_s"] == ("X [s]",) and found["position"] == ("Angle: Analog B [deg]",)
    later = [f"{t:.3f},{a:.4f},{t + 0.002:.3f},{b:.4f}" for t, (a, b) in zip(time, values, strict=True)]
    assert len(propose(written(tmp_path / "b.csv", top, *later), JOINT, True).candidates["time_s"]) == 2


def test_what_is_asked_for_is_what_is_left(tmp_path):
    time, values = drawn(2)
    one = written(tmp_path / "a.csv", *lines_of(time, values[:, :1], ","))
    with pytest.raises(InputError, match=r"--column position=column2:UNIT \("):
        study_of(tmp_path, one)
    two = written(tmp_path / "b.csv", "foo,bar", *lines_of(values[:, 0], values[:, 1:], ","))
    with pytest.raises(InputError, match=r"time_s=NAME:UNIT \(one of foo, bar; or rate=HZ of a file without times\)"):
        study_of(tmp_path, two)


@pytest.mark.parametrize(
    "name", ["AccX (g)", "gyr_x", "Force_x", "F_x", "Motor temperature", "Motor Efficiency (%)", "torque y"]
)
def test_an_axis_of_another_quantity_is_no_position_and_what_no_rig_reads_no_effort(tmp_path, name):
    time, values = drawn(4)
    path = written(tmp_path / "a.csv", f"t [s],{name},foo", *lines_of(time, values, ","))
    found = propose(path, JOINT, True).candidates
    is_effort = "orce" in name or "F_" in name or "torque" in name
    assert found["position"] == () and found["effort"] == ((name,) if is_effort and "F_x" not in name else ())


@pytest.mark.parametrize("name", ["x", "cart x", "x_pos", "encoder_x", "q", "laser.x", "pitch"])
def test_an_axis_alone_or_of_a_thing_is_a_position(tmp_path, name):
    time, values = drawn(4)
    path = written(tmp_path / "a.csv", f"t,{name},foo", *lines_of(time, values, ","))
    assert propose(path, JOINT, True).candidates["position"] == (name,)


def test_columns_in_the_unit_stand_among_several_of_a_word(tmp_path):
    time, values = drawn(4, 3)
    path = written(tmp_path / "a.csv", "t,position x,position y,rotation_degree", *lines_of(time, values, ","))
    assert propose(path, JOINT, True).candidates["position"] == ("position x", "position y", "rotation_degree")
    one = written(tmp_path / "b.csv", "t,position x,foo,rotation_degree", *lines_of(time, values, ","))
    assert propose(one, JOINT, True).candidates["position"] == ("position x",)


def test_a_torque_is_a_force_over_its_lever(tmp_path):
    time, values = drawn(2, rows=60)
    path = written(tmp_path / "a.csv", "time [s],elbow_trq [Nm],stim_pw [us]", *lines_of(time, abs(values), ","))
    with pytest.raises(InputError, match=r"force_n=NAME,scale=NUMBER \(elbow_trq"):
        study_of(tmp_path, path, rig="muscle")


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("ends", ["", ","])
@pytest.mark.parametrize("between", [",", ";", "\t"])
def test_rows_above_one_whose_last_cell_is_empty_are_read(tmp_path, between, ends, seed):
    """They were taken for a title, as that row has a cell less: all above it was lost in silence."""
    rng = np.random.default_rng(seed)
    time, values = drawn(seed, rows=int(rng.integers(20, 380)))
    gone = rng.choice(len(time), 3, replace=False)
    values[gone, 1] = np.nan
    rows = [row.replace("nan", "") + ends.replace(",", between) for row in lines_of(time, values, between)]
    for top in (["t [s]", "angle [deg]", "torque [Nm]"], None):
        path = written(tmp_path / "a.csv", *([between.join(top)] if top else []), *rows)
        table, header = read(path)
        assert len(table) == len(time) and header.row == bool(top)
        assert np.allclose([*table.columns.values()][2], values[:, 1], atol=1e-3, equal_nan=True)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_line_of_fewer_numbers_above_the_rows_is_still_no_row(tmp_path, seed):
    time, values = drawn(seed)
    path = written(tmp_path / "a.csv", "7,3", "t,angle,torque", *lines_of(time, values, ","))
    assert len(read(path)[0]) == len(time)
    bare = written(tmp_path / "b.csv", "7,3", *lines_of(time, values, ","))
    assert sniffed(bare)[0].first_row == 2


FOOTERS = {
    "words": ("End of data",),
    "summary": ("", "Peak torque,12.5", "Mean,3.2"),
    "comment": ("", "# saved 12:00"),
    "stamp": ("Saved: 12.5.2020",),
}


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("kind", FOOTERS)
def test_lines_below_the_numbers_are_passed_over_and_said(tmp_path, kind, seed):
    """They made the first column one of words: there was no time, or there were no rows at all."""
    rng = np.random.default_rng(seed)
    time, values = drawn(seed, int(rng.integers(1, 4)), rows=int(rng.integers(8, 900)))
    names = ["t [s]", "angle [deg]", "torque [Nm]", "foo"][: 1 + values.shape[1]]
    path = written(tmp_path / "a.csv", ",".join(names), *lines_of(time, values, ","), *FOOTERS[kind])
    table = propose(path, JOINT, True).recording
    assert table.names == tuple(names) and len(table) == len(time)
    assert np.allclose(table.columns["angle [deg]"], values[:, 0], atol=1e-3)
    assert table.said == () if kind == "comment" else "below the numbers" in table.said[0]
    study, _ = study_of(tmp_path, path)
    assert len(study.trials[0]) == len(time)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("last", ["1.0,oops,2.0", ",1.0,2.0", "nan,1.0,2.0"])
def test_a_last_row_that_is_wrong_is_no_footer(tmp_path, last, seed):
    time, values = drawn(seed)
    path = written(tmp_path / "a.csv", "t,angle,torque", *lines_of(time, values, ","), last)
    assert len(propose(path, JOINT, True).recording) == len(time) + 1


WITHIN = {
    "word": lambda row: "Sensor reconnected",
    "comment": lambda row: "# marker 1",
    "short": lambda row: row.partition(",")[0],
    "long": lambda row: f"{row},1.0,2.0",
    "names": lambda row: ",".join("xyz"),
}


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("kind", WITHIN)
def test_a_line_of_another_kind_among_the_rows_loses_none_of_them_in_silence(tmp_path, kind, seed):
    """All rows above it were taken for a title."""
    rng = np.random.default_rng(seed)
    time, values = drawn(seed, rows=int(rng.integers(30, 700)))
    values[rng.choice(len(time), 2), 1] = np.nan
    rows = [row.replace("nan", "") for row in lines_of(time, values, ",")]
    place = int(rng.integers(4, len(rows) - 4))
    rows.insert(place, WITHIN[kind](rows[place]))
    path = written(tmp_path / "a.csv", "t [s],angle [deg],torque [Nm]", *rows)
    if kind == "long":
        with pytest.raises(
            InputError, match=rf"row {place + 2}, column .*: expected 3 values as in the header, found 5"
        ):
            propose(path, JOINT, True)
        return
    found = propose(path, JOINT, True)
    if kind == "names" and place < 390:
        assert "lines of numbers above line" in found.said[0] and len(found.recording) == len(time) - place
    else:
        assert len(found.recording) == len(time) + (kind in ("short", "names"))
        said = ("1 line between the numbers, passed over: 'Sensor reconnected'",)
        assert found.recording.said == (said if kind == "word" else ())


@pytest.mark.parametrize("seed", SEEDS)
def test_numbers_above_a_title_of_one_word_are_no_rows_where_it_is_a_key(tmp_path, seed):
    time, values = drawn(seed)
    above = lines_of(time[:5], values[:5], ",")
    path = written(tmp_path / "a.csv", *above, "Data:", *lines_of(time, values, ","))
    assert sniffed(path)[0].first_row == 7


def lvm(path, time, values, times, point):
    """As LabVIEW writes a measurement; `times`: none, one column of them, or one for each channel."""
    rows = {
        "No": lambda t, row: ["", *row],
        "One": lambda t, row: [t, *row],
        "Multi": lambda t, row: [t, row[0], t, row[1]],
    }
    keys = {"Y_Unit_Label": ("deg", "Nm"), "X_Dimension": ("Time", "Time"), "Delta_X": ("1.000000E-2", "1.000000E-2")}
    apart, end = ("\t\t" if times == "Multi" else "\t"), "***End_of_Header***"
    named = ["X_Value", "Angle", *(["X_Value"] if times == "Multi" else []), "Torque", "Comment"]
    about = ["LabVIEW Measurement\t", f"X_Columns\t{times}", "Date\t2026/01/02", end, "\t"]
    head = [f"{key}\t{apart.join(two)}\t" for key, two in keys.items()]
    body = [
        "\t".join(x if isinstance(x, str) else f"{x:.6f}" for x in rows[times](t, row))
        for t, row in zip(time, values, strict=True)
    ]
    text = [one.replace(".", point) for one in [*head, end, "\t".join(named), *body]]
    return written(path, *about, *text)


@pytest.mark.parametrize("times", ["No", "One", "Multi"])
@pytest.mark.parametrize("point", [".", ","])
def test_a_measurement_of_labview_has_its_names_units_and_rate(times, point, tmp_path):
    time, values = drawn(3)
    study, _ = study_of(tmp_path, lvm(tmp_path / "a.lvm", time, values, times, point))
    (trial,) = study.trials
    np.testing.assert_allclose(trial.time, time, atol=1e-9)
    np.testing.assert_allclose(np.degrees(trial["position"]), values[:, 0], atol=1e-6)
    np.testing.assert_allclose(trial["effort"], values[:, 1], atol=1e-6)
