"""Lines of a serial port with a name before each number, as firmware prints them; and lines that only look so."""

import numpy as np
import pytest

from fes_pin.data.errors import InputError
from fes_pin.data.new_recording import propose
from fes_pin.data.new_study import new_study
from fes_pin.data.recorded.labelled import names_before_numbers, parts_of, without_names
from fes_pin.data.recorded.sniff import sniffed
from fes_pin.data.schema import known_rigs
from fes_pin.data.study import read_study
from fes_pin.data.templates import pendulum
from fes_pin.data.wanted import Wanted

JOINT = known_rigs()["joint"]
SEEDS = range(3)
FORMS = {
    "plotter": lambda t, q, u: f"t:{t:.0f},angle:{q:.3f},torque:{u:.3f}",
    "blanks": lambda t, q, u: f"t: {t:.0f} angle: {q:.3f} torque: {u:.3f}",
    "tabs": lambda t, q, u: f"t={t:.0f}\tangle={q:.3f}\ttorque={u:.3f}",
    "units": lambda t, q, u: f"t: {t:.0f} ms, angle: {q:.3f} deg, torque: {u:.3f} Nm",
    "units and blanks": lambda t, q, u: f"t: {t:.0f} ms angle: {q:.3f} deg torque: {u:.3f} Nm",
    "stamp": lambda t, q, u: f"{t:.0f},angle: {q:.3f},torque: {u:.3f}",
    "commas": lambda t, q, u: f"t: {t:.0f}; angle: {q:.3f}; torque: {u:.3f}".replace(".", ","),
    "words": lambda t, q, u: f"loop t : {t:.0f}, knee angle : {q:.3f}, motor torque : {u:.3f}",
    "end": lambda t, q, u: f"t:{t:.0f},angle:{q:.3f},torque:{u:.3f},",
}
BOOT = "ets Jul 29 2019 12:21:46\nrst:0x1 (POWERON_RESET),boot:0x13\ncalibrating ...\n\n"


def drawn(seed, rows=80):
    rng = np.random.default_rng(seed)
    return 10.0 * np.arange(rows), *rng.normal(scale=20.0, size=(2, rows))


def written(path, form, numbers, top="", end=""):
    path.write_text(top + "\n".join(map(FORMS[form], *numbers)) + f"\n{end}", encoding="utf-8")
    return path


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("top", ["", BOOT])
@pytest.mark.parametrize("form", FORMS)
def test_numbers_behind_their_names_are_columns(tmp_path, form, top, seed):
    numbers = drawn(seed)
    path = written(tmp_path / "log.txt", form, numbers, top, end=FORMS[form](1.0, 2.0, 3.0)[:9] * (seed == 1))
    one = propose(path, JOINT, True)
    for name, values in zip(one.recording.names, numbers, strict=True):
        np.testing.assert_allclose(one.recording.columns[name][:80], values, atol=5e-4)
    names = one.recording.names
    assert one.candidates["position"] == names[1:2] and one.candidates["effort"] == names[2:]
    assert any("names before their numbers" in words for words in one.said)
    if form.startswith("units"):
        assert [one.units[n] for n in one.recording.names] == ["ms", "deg", "Nm"]


@pytest.mark.parametrize("form", ["plotter", "units", "commas", "stamp"])
def test_a_study_of_labelled_lines_reads_them_again(tmp_path, form):
    numbers = drawn(7)
    path = written(tmp_path / "log.txt", form, numbers, BOOT)
    (tmp_path / "rod.urdf").write_text(pendulum(0.4, 1.0))
    names = propose(path, JOINT, True).recording.names
    columns = dict(
        zip(
            ("time_s", "position", "effort"),
            (f"{n}:{u}" for n, u in zip(names, ("ms", "deg", "Nm"), strict=True)),
            strict=True,
        )
    )
    wanted = Wanted((path,), JOINT, tmp_path, "own", urdf=tmp_path / "rod.urdf", columns=columns)
    made = new_study(wanted, lambda *_: {"inertia_scale": 1.0, "damping": 0.01})
    assert "labelled = true" in str(made.contents["study.toml"])
    (tmp_path / "study.toml").write_text(made.contents["study.toml"])
    (trial,) = read_study(tmp_path).trials
    np.testing.assert_allclose(np.degrees(trial["position"]), numbers[1], atol=1e-3)
    np.testing.assert_allclose(trial["effort"], numbers[2], atol=1e-3)


OTHERS = {
    "clock": "12:30:0{k},1.5,2.5",
    "dates": "2024-05-01 12:30:0{k},1.5,2.5",
    "numbers": "{k},1.5,2.5",
    "names that change": "a{k}: 1.5, b: 2.5",
    "words": "state: walking, angle: 1.5",
    "ratio": "1:2,1.5",
}


@pytest.mark.parametrize("case", OTHERS)
def test_other_lines_have_no_names_before_their_numbers(tmp_path, case):
    lines = "\n".join(OTHERS[case].format(k=k) for k in range(9)).splitlines()
    assert names_before_numbers(lines) == ()
    path = tmp_path / "a.csv"
    path.write_text("t,x,y\n" + "\n".join(lines) + "\n")
    try:
        assert not sniffed(path)[0].labelled
    except InputError as error:
        assert "\n" not in str(error)


def test_lines_without_names_stay_as_they_are():
    assert without_names(["rst:0x1 (POWERON),boot:0x13", "3, 4", "a: 1, b: 2", ""]) == [
        *("rst:0x1 (POWERON),boot:0x13", "3, 4", "1,2", ""),
    ]
    assert parts_of("q: nan, u: -1e-3 N").numbers == ("nan", "-1e-3") and parts_of("a:,b:2") is None


RECORDS = {
    "a line each": "t: {0:.0f}\nangle: {1:.3f}\ntorque: {2:.3f}",
    "units": "t: {0:.0f} ms\nangle: {1:.3f} deg\ntorque: {2:.3f} Nm",
    "rules": "t: {0:.0f}\nangle: {1:.3f}\ntorque: {2:.3f}\n--------",
    "empty lines": "\nt = {0:.0f}\nangle = {1:.3f}\ntorque = {2:.3f}",
    "two lines": "t: {0:.0f}, angle: {1:.3f}\ntorque: {2:.3f}",
    "stamp": "{0:.0f}, angle: {1:.3f}\ntorque: {2:.3f}",
    "commas": "t: {0:.0f}\nangle: {1:.3f}\ntorque: {2:.3f}",
}


def of_records(form, numbers):
    lines = [RECORDS[form].format(*one) for one in zip(*numbers, strict=True)]
    return [one.replace(".", ",") for one in lines] if form == "commas" else lines


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("top", ["", BOOT])
@pytest.mark.parametrize("form", RECORDS)
def test_a_record_may_have_several_lines(tmp_path, form, top, seed):
    numbers = drawn(seed, 60 + 150 * seed)
    records = of_records(form, numbers)
    path = tmp_path / "log.txt"
    path.write_text(top + "\n".join([*records, records[0].partition("\n")[0] * (seed == 1)]) + "\n")
    one = propose(path, JOINT, True)
    for name, values in zip(one.recording.names, numbers, strict=True):
        np.testing.assert_allclose(one.recording.columns[name], values, atol=5e-4)
    assert one.candidates["position"] == one.recording.names[1:2]
    assert one.candidates["effort"] == one.recording.names[2:]
    if form == "units":
        assert [one.units[n] for n in one.recording.names] == ["ms", "deg", "Nm"]


@pytest.mark.parametrize("seed", SEEDS)
def test_a_record_that_lost_a_line_is_left_out_and_said(tmp_path, seed):
    numbers = drawn(seed)
    lines = [line for one in of_records("a line each", numbers) for line in one.splitlines()]
    place = int(np.random.default_rng(seed).integers(30, 180))
    row, lost = place // 3, lines.pop(place)
    path = tmp_path / "log.txt"
    path.write_text("\n".join(lines) + "\n")
    one = propose(path, JOINT, True)
    assert len(one.recording) == 79, lost
    for name, values in zip(one.recording.names, numbers, strict=True):
        np.testing.assert_allclose(one.recording.columns[name], np.delete(values, row), atol=5e-4)
    assert any("passed over" in words for words in one.recording.said)


@pytest.mark.parametrize("seed", SEEDS)
def test_names_in_no_order_are_refused_in_one_line_that_says_what_to_do(tmp_path, seed):
    random = np.random.default_rng(seed)
    lines = [f"{random.choice(['A', 'T', 'v'])}: {random.normal():.3f}" for _ in range(90)]
    path = tmp_path / "log.txt"
    path.write_text("\n".join(lines) + "\n")
    with pytest.raises(InputError, match=r"come again in no order, .*: write the lines of each record in one order"):
        propose(path, JOINT, True)


def test_a_long_header_of_keys_is_no_record(tmp_path):
    keys = [f"{word}: {k}.5" for k, word in enumerate(["mass", "length", "height", "rate", "gain", "offset", "age"])]
    path = tmp_path / "a.csv"
    path.write_text("\n".join([*keys, "time,angle", *(f"{0.01 * k:.2f},{k}.0" for k in range(5))]) + "\n")
    one = propose(path, JOINT, True)
    assert one.recording.names == ("time", "angle") and len(one.recording) == 5


def test_a_broken_line_is_said_with_its_row(tmp_path):
    numbers = drawn(3)
    path = written(tmp_path / "log.txt", "plotter", numbers)
    lines = path.read_text().splitlines()
    lines[40] = "t:400,ang"
    path.write_text("\n".join(lines) + "\n")
    one = propose(path, JOINT, True)
    assert len(one.recording) == 79 and any(
        "passed over" in words and "t:400,ang" in words for words in one.recording.said
    )
