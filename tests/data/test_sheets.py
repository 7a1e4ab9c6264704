"""Recordings in spreadsheets: each sheet is read as a text file is, by what its cells store."""

import zipfile
from xml.sax.saxutils import escape

import numpy as np
import pytest

from fes_pin.data.as_read import HeldFile
from fes_pin.data.errors import InputError
from fes_pin.data.new_study import new_study
from fes_pin.data.recorded.sheets import sheets_of
from fes_pin.data.schema import known_rigs
from fes_pin.data.study import read_study
from fes_pin.data.templates import pendulum
from fes_pin.data.wanted import Wanted

pytest.importorskip("python_calamine")
ROOT = "http://schemas.openxmlformats.org"


def cell(value):
    if isinstance(value, str):
        return f'<c t="inlineStr"><is><t>{escape(value)}</t></is></c>'
    return f"<c><v>{float(value)!r}</v></c>"


def xlsx(path, sheets):
    """The least that a program reads as a workbook: rows by the name of their sheet."""
    main = f'xmlns="{ROOT}/spreadsheetml/2006/main" xmlns:r="{ROOT}/officeDocument/2006/relationships"'
    names = "".join(f'<sheet name="{n}" sheetId="{k}" r:id="rId{k}"/>' for k, n in enumerate(sheets, 1))
    kind = f"{ROOT}/officeDocument/2006/relationships"
    links = "".join(
        f'<Relationship Id="rId{k}" Type="{kind}/worksheet" Target="worksheets/sheet{k}.xml"/>'
        for k in range(1, len(sheets) + 1)
    )
    package = f'xmlns="{ROOT}/package/2006/relationships"'
    with zipfile.ZipFile(path, "w") as file:
        types = '<Default Extension="xml" ContentType="application/xml"/>'
        file.writestr("[Content_Types].xml", f'<Types xmlns="{ROOT}/package/2006/content-types">{types}</Types>')
        whole = f'<Relationship Id="rId1" Type="{kind}/officeDocument" Target="xl/workbook.xml"/>'
        file.writestr("_rels/.rels", f"<Relationships {package}>{whole}</Relationships>")
        file.writestr("xl/workbook.xml", f"<workbook {main}><sheets>{names}</sheets></workbook>")
        file.writestr("xl/_rels/workbook.xml.rels", f"<Relationships {package}>{links}</Relationships>")
        for k, rows in enumerate(sheets.values(), 1):
            text = "".join(f"<row>{''.join(cell(v) for v in row)}</row>" for row in rows)
            file.writestr(f"xl/worksheets/sheet{k}.xml", f"<worksheet {main}><sheetData>{text}</sheetData></worksheet>")
    return path


def swing(seed, count=200):
    time = np.arange(count) * 0.01
    return time, np.random.default_rng(seed).uniform(0.2, 0.6) * np.cos(6.0 * time)


def recording(seed, *above, units=True):
    """A sheet with titles, names, perhaps a row of units, and a swing in degrees."""
    time, position = swing(seed)
    names = [["Time", "Angle, left"], ["ms", "deg"]] if units else [["Time [ms]", "Angle [deg]"]]
    return [*([one] for one in above), *names, *zip(1e3 * time, np.degrees(position), strict=True)]


def study_of(folder, path, **more):
    believed = HeldFile.holding("p.urdf", pendulum(0.3, 1.0).encode())
    wanted = Wanted((path,), known_rigs()["joint"], folder, "a", believed, **more)
    made = new_study(wanted, lambda rig, columns: {"inertia_scale": 1.0, "damping": 0.01})
    folder.mkdir(exist_ok=True)
    for place, content in made.contents.items():
        (folder / place).parent.mkdir(parents=True, exist_ok=True)
        (folder / place).write_bytes(content if isinstance(content, bytes) else content.encode())
    return read_study(folder), made


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("above", [(), ("Lab 3", "subject 7, left")])
@pytest.mark.parametrize("units", [True, False])
def test_a_sheet_is_read_as_text_is(tmp_path, seed, above, units):
    path = xlsx(tmp_path / "a.xlsx", {"Sheet1": recording(seed, *above, units=units)})
    study, made = study_of(tmp_path / "s", path)
    assert "sheet" not in made.contents["study.toml"]
    assert np.allclose(study.trials[0]["position"], swing(seed)[1], rtol=0.0, atol=1e-12)
    assert study.trials[0].dt == pytest.approx(0.01, rel=1e-9)


@pytest.mark.parametrize("order", [("notes", "one", "two", "summary"), ("summary", "two", "notes", "one")])
def test_sheets_that_are_alike_are_trials(tmp_path, order):
    summary = [["trial", "peak"], *[[float(k), 0.1 * k] for k in range(1, 9)]]
    sheets = {"notes": [["measured by"], ["nobody"]], "one": recording(4), "two": recording(5), "summary": summary}
    path = xlsx(tmp_path / "swings.xlsx", {name: sheets[name] for name in order})
    study, made = study_of(tmp_path / "s", path)
    assert {t.name for t in study} == {"swings-one", "swings-two"}
    for name, seed in (("swings-one", 4), ("swings-two", 5)):
        assert np.allclose(study[name]["position"], swing(seed)[1], rtol=0.0, atol=1e-12)
    assert any("of its 4 sheets are trials, not " in words for words in made.said)


def test_two_views_of_one_sheet_must_not_overlap_and_those_of_two_may(tmp_path):
    path = xlsx(tmp_path / "a.xlsx", {"one": recording(4), "two": recording(5)})
    study_of(tmp_path / "s", path)
    file = tmp_path / "s/study.toml"
    file.write_text(file.read_text().replace('sheet = "two"', 'sheet = "one"'))
    with pytest.raises(InputError, match="the same file as"):
        read_study(tmp_path / "s")


def test_what_is_wrong_is_one_line(tmp_path):
    path = xlsx(tmp_path / "a.xlsx", {"one": recording(4), "two": recording(5)})
    assert sheets_of(path) == ("one", "two")
    study_of(tmp_path / "s", path)
    file = tmp_path / "s/study.toml"
    right = file.read_text()
    file.write_text(right.replace('sheet = "two"', 'sheet = "three"'))
    with pytest.raises(InputError, match="expected one of its sheets, one, two; found 'three'"):
        read_study(tmp_path / "s")
    file.write_text(right.replace('sheet = "two"', "sheet = 2"))
    with pytest.raises(InputError, match="expected the name of a sheet"):
        read_study(tmp_path / "s")
    broken = tmp_path / "b.xlsx"
    broken.write_bytes(b"PK\x03\x04 and no more")
    with pytest.raises(InputError, match="cannot be read as a spreadsheet"):
        study_of(tmp_path / "t", broken)
    empty = xlsx(tmp_path / "c.xlsx", {"one": [["title"]], "two": [["picture"]]})
    with pytest.raises(InputError, match="expected rows of numbers in one of its sheets, one, two"):
        study_of(tmp_path / "t", empty)


def test_a_wrong_cell_is_named_by_its_row_and_column(tmp_path):
    rows = recording(4)
    rows[50] = (rows[50][0], "twelve")
    path = xlsx(tmp_path / "a.xlsx", {"one": rows, "two": recording(5)})
    with pytest.raises(InputError) as caught:
        study_of(tmp_path / "s", path, columns={"position": "Angle, left"})
    assert caught.value.row == 51 and caught.value.column == "Angle, left"


@pytest.mark.parametrize("sheet", ["one", "two"])
def test_one_sheet_may_be_meant(tmp_path, sheet):
    rows = {name: recording(seed)[2:] for name, seed in (("one", 4), ("two", 5))}  # without names
    path = xlsx(tmp_path / "a.xlsx", rows)
    said = {"columns": {"time_s": "column1:ms", "position": "column2:deg"}}
    with pytest.raises(InputError, match="one, two hold columns without names: expected --sheet NAME"):
        study_of(tmp_path / "s", path, **said)
    study, _ = study_of(tmp_path / "s", path, form={"sheet": sheet}, **said)
    (trial,) = study.trials
    assert trial.name == f"a-{sheet}"
    assert np.allclose(trial["position"], swing(4 if sheet == "one" else 5)[1], rtol=0.0, atol=1e-12)
    named = {"names": ("t_ms", "angle_deg")}
    both, _ = study_of(tmp_path / "t", path, form=named, columns={"time_s": "t_ms:ms", "position": "angle_deg:deg"})
    assert {t.name for t in both} == {"a-one", "a-two"}


def test_a_text_file_has_no_sheets(tmp_path):
    folder = tmp_path / "s"
    path = xlsx(tmp_path / "a.xlsx", {"one": recording(4), "two": recording(5)})
    study_of(folder, path)
    (folder / "trials/a.csv").write_text("time_s,position\n" + "".join(f"{k / 100},{k / 100}\n" for k in range(9)))
    text = (folder / "study.toml").read_text().replace("a.xlsx", "a.csv")
    (folder / "study.toml").write_text(text)
    with pytest.raises(InputError, match="expected a spreadsheet, which has sheets"):
        read_study(folder)
