"""Functions that write replace what they wrote themselves; a copy of an answer is known by its content."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import pytest
from data import studies
from view.reported import ankle_study, diagnosed

import fes_pin as fp
from fes_pin.body.build import Body
from fes_pin.data.errors import InputError
from fes_pin.data.outputs import RECORD, WRITTEN, Outputs
from fes_pin.models.nominal import nominal_model

DEMO = Path(__file__).parents[2] / "analysis/studies/ankle_demo"


@pytest.fixture(scope="module")
def found():
    return diagnosed(ankle_study(), (), ())


WRITERS = {  # each with an ending that it writes, and all of them
    "write_trial": (lambda one, path, **more: fp.write_trial(one.study.trials[0], path, **more), ".csv"),
    "save_model": (lambda one, path, **more: fp.save_model(nominal_model(one.study), path, **more), ".toml"),
    "report": (fp.report, ".html or .htm"),
    "save_result": (fp.save_result, ".json"),
    "Body.write": (lambda _, path, **more: Body.from_subject(70.0, 1.75).write(path, **more), ".urdf or .xml"),
}


@pytest.mark.parametrize("name", WRITERS)
def test_a_function_replaces_what_it_wrote_and_nothing_else(found, tmp_path, monkeypatch, name):
    monkeypatch.setattr("fes_pin.view.report.report_html", lambda _: "a page that takes no time to draw")
    write, endings = WRITERS[name]
    path = tmp_path / f"one{endings.split()[0]}"
    write(found, path)
    write(found, path)
    written = path.read_bytes()
    path.write_bytes(written + b"\n# mine\n")
    with pytest.raises(InputError, match=rf"was changed since fp\.{name} wrote it; .* overwrite=True"):
        write(found, path)
    assert path.read_bytes() == written + b"\n# mine\n"
    other = tmp_path / f"notes{endings.split()[0]}"
    other.write_text("notes")
    with pytest.raises(InputError, match=rf"no note is here that fp\.{name} wrote it; .* overwrite=True"):
        write(found, other)
    assert other.read_text() == "notes"
    for one in (path, other):
        write(found, one, overwrite=True)
        write(found, one)
        assert one.read_bytes()[:30] == written[:30]
    for ending in (".xlsx", ".txt", ".PDF"):
        with pytest.raises(InputError, match=f"ends in {endings}, found {ending}"):
            write(found, tmp_path / f"two{ending}", overwrite=True)
        assert not (tmp_path / f"two{ending}").exists()


def test_what_was_read_is_not_replaced_with_overwrite_either(tmp_path):
    study = fp.read_study(studies.ankle(tmp_path))
    (first,) = (p for p in sorted((tmp_path / "trials").iterdir())[:1])
    with pytest.raises(InputError, match="was read"):
        fp.write_trial(study.trials[0], first, overwrite=True)
    with pytest.raises(InputError, match="was read"):
        fp.write_study(study, tmp_path, overwrite=True)


def test_a_study_replaces_the_one_that_was_written(tmp_path):
    study = fp.read_study(DEMO)
    fp.write_study(study, tmp_path / "a")
    fp.write_study(study, tmp_path / "a")
    fp.write_study(replace(study, name="other"), tmp_path / "a")
    toml = tmp_path / "a/study.toml"
    toml.write_text(toml.read_text() + "# mine\n")
    with pytest.raises(InputError, match=r"study\.toml: is there already, and it was changed since fp\.write_study"):
        fp.write_study(study, tmp_path / "a")
    fp.write_study(study, tmp_path / "a", overwrite=True)
    assert fp.read_study(tmp_path / "a") == study


ANSWER = {"diagnosis.json": json.dumps({"a": 1, "b": [1, 2]}, indent=1) + "\n", "model.toml": "m", "report.html": "r"}
COPIES = {
    "whole": shutil.copytree,
    "without the hidden file": lambda a, b: shutil.copytree(a, b, ignore=lambda *_: [RECORD]),
    "moved": shutil.move,
}


@pytest.mark.parametrize("copy", COPIES)
def test_a_copied_answer_is_known_by_its_content(tmp_path, copy):
    """Each command may write over its own answer, wherever it was copied to; what is a person's stays."""
    Outputs("diagnose").write(tmp_path / "a", ANSWER)
    COPIES[copy](tmp_path / "a", tmp_path / "b")
    (tmp_path / "b/notes.txt").write_text("mine")
    new = {**ANSWER, "model.toml": "new"}
    with pytest.raises(InputError, match="fes-pin diagnose wrote it"):
        Outputs("contrast").check(tmp_path / "b", ["report.html"])
    Outputs("diagnose").write(tmp_path / "b", new)
    Outputs("diagnose").write(tmp_path / "b", ANSWER)
    assert (tmp_path / "b/notes.txt").read_text() == "mine" and (tmp_path / "b/model.toml").read_text() == "m"
    with pytest.raises(InputError, match="no note is here that fes-pin diagnose wrote it"):
        Outputs("diagnose").check(tmp_path / "b", ["notes.txt"])


@pytest.mark.parametrize("hidden", [True, False])
@pytest.mark.parametrize("name", ANSWER)
def test_what_was_changed_in_a_copy_needs_force(tmp_path, name, hidden):
    Outputs("diagnose").write(tmp_path, ANSWER)
    if not hidden:
        (tmp_path / RECORD).unlink()
    path = tmp_path / name
    path.write_text(path.read_text().replace("1", "7").replace("m", "n", 1).replace("r", "s", 1))
    is_known = hidden or name != "report.html"  # which is what knows the others
    with pytest.raises(InputError, match=rf"{name if is_known else ''}: is there already, and") as said:
        Outputs("diagnose").write(tmp_path, {**ANSWER, "model.toml": "2", "report.html": "2"})
    assert ("was changed since" if is_known else "no note is here") in str(said.value)
    Outputs("diagnose", force=True).write(tmp_path, ANSWER)
    Outputs("diagnose").write(tmp_path, ANSWER)


def test_an_answer_of_an_older_version_and_an_empty_folder(tmp_path):
    (tmp_path / "empty").mkdir()
    Outputs("diagnose").write(tmp_path / "empty", ANSWER)
    for name, content in ANSWER.items():
        (tmp_path / name).write_text(content)
    with pytest.raises(InputError, match="no note is here"):
        Outputs("diagnose").check(tmp_path, ANSWER.keys())
    Outputs("diagnose").check(tmp_path / "empty", ANSWER.keys())


def test_an_answer_in_json_has_no_notes(found, tmp_path):
    """Two runs of one study write the same record."""
    Outputs("diagnose").write(tmp_path, ANSWER)
    assert json.loads((tmp_path / "diagnosis.json").read_text()) == {"a": 1, "b": [1, 2]}
    assert WRITTEN in (tmp_path / "report.html").read_text()
    fp.save_result(found, tmp_path / "one.json")
    assert fp.load_result(tmp_path / "one.json") == fp.load_result(tmp_path / "one.json")
