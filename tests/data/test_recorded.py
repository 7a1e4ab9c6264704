# ruff: noqa: E501  (tables, one case a line)
"""Recordings as instruments write them: what `[columns]` says is read, nothing else; errors name their place."""

import csv
import io

import numpy as np
import pytest

from fes_pin.data.errors import InputError
from fes_pin.data.recorded.form import TextForm
from fes_pin.data.recorded.formats import UNREADABLE, read_recording
from fes_pin.data.recorded.sniff import sniffed
from fes_pin.data.recorded.text import read_text_recording
from fes_pin.data.schema import known_rigs
from fes_pin.data.study import read_columns, read_study
from fes_pin.data.templates import pendulum
from fes_pin.data.trial_files import read_trial
from fes_pin.data.units import UNITS, factor_of, split_header

TIME = np.arange(60) * 0.01
ANGLE = 40.0 * np.sin(3.0 * TIME)
TORQUE = 0.5 * np.cos(2.0 * TIME)


def text(delimiter=",", decimal=".", before=(), units=None, quoted=False, end="\n", digits=6):
    """Times in ms, an angle in degrees, a torque, and a column of words."""
    out = io.StringIO()
    how = csv.QUOTE_ALL if quoted else csv.QUOTE_MINIMAL
    rows = csv.writer(out, delimiter=delimiter, quoting=how, lineterminator=end)
    rows.writerow(["t_ms", "Angle", "Torque", "state"])
    if units:
        rows.writerow(units)
    for k in range(len(TIME)):
        numbers = (f"{x:.{digits}f}".replace(".", decimal) for x in (1e3 * TIME[k], ANGLE[k], TORQUE[k]))
        rows.writerow([*numbers, "on"])
    return "".join(f"{line}{end}" for line in before) + out.getvalue()


FORMS = {  # how the file is written, what is said of it
    "plain": ({}, TextForm()),
    "german": ({"delimiter": ";", "decimal": ","}, TextForm(";", ",")),
    "tabs": ({"delimiter": "\t"}, TextForm("\t")),
    "tabs_and_commas": ({"delimiter": "\t", "decimal": ","}, TextForm("\t", ",")),
    "units_row": ({"units": ["[ms]", "[deg]", "[Nm]", ""]}, TextForm(first_row=3)),
    "bare_units_row": ({"units": ["ms", "deg", "Nm", "-"]}, TextForm(first_row=3)),
    "preamble": ({"before": ["Lab 3", "subject 7, left", ""], "delimiter": ";"}, TextForm(";", ".", 4, 5)),
    "comments": ({"before": ["# exported", "# twice"]}, TextForm(",", ".", 3, 4, "#")),
    "quoted": ({"quoted": True, "decimal": ","}, TextForm(",", ",")),
    "windows": ({"end": "\r\n", "delimiter": ";"}, TextForm(";")),
}


@pytest.mark.parametrize("case", FORMS)
def test_a_form_is_recognized_and_read(tmp_path, case):
    how, form = FORMS[case]
    path = tmp_path / "a.csv"
    path.write_bytes(text(**how).encode())
    found, header = sniffed(path)
    assert found == form
    assert header.units == ({0: "ms", 1: "deg", 2: "Nm"} if "units" in how else {})
    read = read_text_recording(path, found, ("t_ms", "Angle", "Torque"))
    assert read.names == ("t_ms", "Angle", "Torque", "state")
    assert np.allclose(read.columns["Angle"], ANGLE, atol=1e-6)
    assert read.half_digit_of("Angle") == pytest.approx(0.5e-6)
    assert len(read.rows) == len(TIME) and read.rows[0] == form.first_row


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "cp1252"])
def test_other_encodings(tmp_path, encoding):
    path = tmp_path / "a.csv"
    path.write_bytes(text().replace("Angle", "Winkel_°").encode(encoding))
    form, _ = sniffed(path)
    assert read_text_recording(path, form, ("t_ms",)).names[1] == "Winkel_°"


def test_without_a_header_columns_are_counted(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("\n".join(f"{t:.3f} {a:.5f}" for t, a in zip(TIME, ANGLE, strict=True)))
    form, _ = sniffed(path)
    assert form.header_row == 0
    assert np.allclose(read_text_recording(path, form).columns["column2"], ANGLE, atol=1e-5)


def study(folder, columns, files, rig="joint"):
    folder.mkdir(exist_ok=True)
    (folder / "pendulum.urdf").write_text(pendulum(0.3, 0.5))
    tables = "".join(f'[[trial]]\nfile = "{name}"\n' for name in files)
    for name, content in files.items():
        (folder / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    (folder / "study.toml").write_text(
        f'[study]\nname = "own"\nrig = "{rig}"\n[rig]\nurdf = "pendulum.urdf"\n'
        f"[start]\ninertia_scale = 1.0\ndamping = 0.01\n[columns]\n{columns}\n{tables}"
    )
    return folder


COLUMNS = """
time_s = { name = "t_ms", unit = "ms" }
position = { name = "Angle", unit = "deg" }
effort = { name = "Torque", unit = "N m" }
ignored = ["state"]
"""


def test_names_and_units_are_mapped(tmp_path):
    german = {"delimiter": ";", "decimal": ","}
    form = '[columns.file]\ndelimiter = ";"\ndecimal = ","'
    own = study(tmp_path / "own", COLUMNS + form, {"a.csv": text(**german)})
    (trial,) = read_study(own).trials
    assert trial.dt == pytest.approx(0.01)
    assert np.allclose(trial["position"], np.radians(ANGLE), atol=1e-7)
    assert np.allclose(trial["effort"], TORQUE, atol=1e-6)
    (own / "b.csv").write_text(text(**german))  # and another recording like them, for a prediction
    assert np.array_equal(read_trial(own / "b.csv", rig="joint", own=read_columns(own))["effort"], trial["effort"])


def test_zero_scale_and_the_trigger_of_a_stimulator(tmp_path):
    columns = COLUMNS.replace('unit = "deg"', 'unit = "deg", zero = 90.0, scale = -1.0')
    (trial,) = read_study(study(tmp_path / "own", columns, {"a.csv": text()})).trials
    assert np.allclose(trial["position"], -np.radians(ANGLE - 90.0), atol=1e-7)
    folder = tmp_path / "muscle"
    folder.mkdir()
    volts = np.where((np.arange(60) % 20) < 6, 5.0, 0.1)
    rows = "".join(f"{v},{f}\n" for v, f in zip(volts, TIME, strict=True))
    (folder / "a.csv").write_text(f"sync,Force\n{rows}")
    (folder / "study.toml").write_text(
        '[study]\nname = "m"\nrig = "muscle"\n[start]\ngain = 1.0\ntime_constant_s = 0.05\n[columns]\n'
        'time_s = { rate_hz = 100.0 }\nstim = { name = "sync", edge = 2.5 }\n'
        'force_n = { name = "Force", unit = "kgf" }\n[[trial]]\nfile = "a.csv"\n'
    )
    (trial,) = read_study(folder).trials
    assert np.flatnonzero(trial["stim"]).tolist() == [20, 40]  # when the one at the beginning began is not known
    assert np.allclose(trial["force_n"], 9.80665 * TIME)
    assert trial.dt == pytest.approx(0.01)


def jittered(missing=()):
    rng = np.random.default_rng(0)
    time = TIME + 0.0003 * rng.uniform(-1, 1, len(TIME))
    rows = [
        f"{1e3 * t:.4f},{'' if k in missing else f'{40.0 * np.sin(3.0 * t):.6f}'},{k // 10},x"
        for k, t in enumerate(time)
    ]
    return time, "\n".join(["t_ms,Angle,Torque,state", *rows]) + "\n"


def test_jitter_and_missing_samples_are_filled_in_where_the_study_says_so(tmp_path):
    time, content = jittered(missing=(7, 20, 21))
    with pytest.raises(
        InputError, match=r"row 9, column Angle \(position\): expected a number, found nothing; missing ="
    ):
        read_study(study(tmp_path / "own", COLUMNS, {"a.csv": content}))
    fill = '[columns.file]\nmissing = "interpolate"\n'
    with pytest.raises(InputError, match=r"row \d+, column t_ms \(time_s\): expected a fixed step.*; resample_hz in"):
        read_study(study(tmp_path / "own", COLUMNS + fill, {"a.csv": content}))
    (trial,) = read_study(study(tmp_path / "own", f"{COLUMNS}{fill}resample_hz = 100.0\n", {"a.csv": content})).trials
    assert np.allclose(np.diff(trial.time), 0.01)
    assert np.allclose(trial["position"], np.radians(40.0 * np.sin(3.0 * trial.time)), atol=2e-3)
    held = np.searchsorted(time, trial.time + 1e-9, side="right") - 1
    assert np.array_equal(trial["effort"], held // 10)  # an input keeps its value until the next sample
    assert trial.remarks[0] == "3 missing samples are filled in"
    assert trial.remarks[1].startswith("time steps of about 9.98 ms are interpolated to 100 Hz")


def test_gaps_are_not_filled_in(tmp_path):
    _, content = jittered(missing=(7, 8, 9, 10, 11, 12))
    fill = '[columns.file]\nmissing = "interpolate"\nresample_hz = 100.0'
    with pytest.raises(InputError, match=r"row 9, column Angle.*6 samples in a row are missing; expected at most 4"):
        read_study(study(tmp_path / "own", COLUMNS + fill, {"a.csv": content}))
    lines = text().split("\n")
    hole = "\n".join(lines[:20] + lines[40:])
    with pytest.raises(InputError, match=r"row 21, column t_ms \(time_s\): expected steps of at most 5 usual ones"):
        read_study(study(tmp_path / "own", COLUMNS + fill, {"a.csv": hole}))


def test_pulses_keep_their_number(tmp_path):
    folder = tmp_path / "muscle"
    folder.mkdir()
    time = np.arange(400) / 1024.0
    pulses = (np.arange(400) % 33 == 5).astype(int)
    (folder / "a.csv").write_text(
        "time_s,stim,force_n\n" + "".join(f"{t!r},{p},1\n" for t, p in zip(time.tolist(), pulses, strict=True))
    )
    made = '[study]\nname = "m"\nrig = "muscle"\n[start]\ngain = 1.0\ntime_constant_s = 0.05\n[columns]\n'
    (folder / "study.toml").write_text(f'{made}[columns.file]\nresample_hz = 500.0\n[[trial]]\nfile = "a.csv"\n')
    (trial,) = read_study(folder).trials
    assert trial["stim"].sum() == pulses.sum()
    assert np.abs(trial.time[trial["stim"] > 0] - time[pulses > 0]).max() <= 0.001


WRONG = {  # columns, file, what is said
    "unit": (COLUMNS.replace('"deg"', '"mm"'), text(), "columns.position.unit: expected a unit of angle: rad, mrad, deg"),
    "not_taken": (COLUMNS.replace("ignored", "#"), text(), "row 1, column state: expected it in .columns., or there among"),
    "not_there": (COLUMNS.replace('"Angle"', '"angle"'), text(), "row 1, column angle: missing; .columns. takes position"),
    "twice": (COLUMNS.replace('"Torque"', '"Angle"'), text(), "columns.position: 'Angle' is named twice"),
    "no_column": (COLUMNS.replace("position", "positoin"), text(), "columns.positoin: unknown; did you mean position"),
    "comma": (COLUMNS, text(decimal=",", quoted=True), "row 2, column t_ms: expected a number, found '0,000000'"),
    "points": (COLUMNS + '[columns.file]\ndelimiter = ";"\ndecimal = ","', text(";"), "expected a number with a decimal comma"),
    "delimiter": (COLUMNS + '[columns.file]\ndelimiter = "|"', text(), "columns.file.delimiter: expected one of"),
    "rate": (COLUMNS.replace('unit = "deg"', "rate_hz = 5"), text(), "of time_s only"),
    "edge": (COLUMNS.replace('unit = "deg"', "edge = 5"), text(), "columns.position.edge: expected for stim only"),
    "infinite": (COLUMNS, text().replace(f"{ANGLE[4]:.6f}", "inf"), "row 6, column Angle: expected a finite"),
    "ragged": (COLUMNS, text().replace(",on\n", ",on,1\n", 3), "expected 4 values as in the header, found 5"),
}  # fmt: skip


@pytest.mark.parametrize("case", WRONG)
def test_what_is_wrong_names_its_place(tmp_path, case):
    columns, content, words = WRONG[case]
    with pytest.raises(InputError, match=words) as caught:
        read_study(study(tmp_path / "own", columns, {"a.csv": content}))
    assert len(str(caught.value).splitlines()) == 1


def test_a_file_of_another_form_is_refused_with_the_hint(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text(text(";", ","))
    with pytest.raises(InputError, match="semicolons between values, decimal commas: `fes-pin new-study` writes"):
        read_trial(path, rig="joint")
    for suffix in UNREADABLE:
        other = path.rename(path.with_suffix(suffix))
        with pytest.raises(InputError, match="this is a"):
            read_trial(other, rig="joint")
        with pytest.raises(InputError, match="this is a"):
            read_recording(other)
        path = other


def test_units_are_exact():
    assert factor_of("°", "angle_rad") == np.pi / 180
    assert factor_of("lbf·in", "effort", True) == pytest.approx(0.1129848290276167, rel=1e-15)
    assert factor_of("Nm", "torque_nm") == factor_of("N·m", "effort", True) == 1.0
    assert factor_of("mN", "force_n") == 1e-3 and factor_of("kip", "force_n") == pytest.approx(4448.2216152605)
    assert factor_of("ms", "time_s") == 1e-3 and factor_of("ms", "pulse_width_us") == 1e3
    assert factor_of("rpm", "velocity", True) == pytest.approx(2 * np.pi / 60)
    for wrong, column in (("MN", "force_n"), ("deg", "force_n"), ("mm", "time_s"), ("furlong", "position")):
        with pytest.raises(ValueError, match="expected a unit of"):
            factor_of(wrong, column)
    for units in UNITS.values():
        assert 1.0 in units.values()  # the study format's own


@pytest.mark.parametrize(
    ("header", "parts"),
    [("Angle_deg", ("Angle", "deg")), ("Torque [N·m]", ("Torque", "N·m")), ("t/ms", ("t", "ms")),
     ("knee angle (°)", ("knee angle", "°")), ("omega_rad_s", ("omega", "rad/s")), ("speed", ("speed", "")),
     ("pulse_width_us", ("pulse_width", "us")), ("force_x", ("force_x", ""))],
)  # fmt: skip
def test_headers_are_split(header, parts):
    assert split_header(header) == parts


def test_every_column_of_every_rig_has_a_quantity():
    from fes_pin.data.units import quantities_of

    for schema in known_rigs().values():
        if len(schema.recordings) == 1:
            assert all(quantities_of(c) for c in schema.columns if not c.startswith("emg"))  # relative to its largest
