"""Whatever stands in a study's files, reading gives a study or one line of error."""

import re

import pytest
from data import studies
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fes_pin.data.errors import InputError
from fes_pin.data.motion import read_coordinates, read_ground_reaction
from fes_pin.data.new_recording import propose
from fes_pin.data.schema import known_rigs
from fes_pin.data.study import read_study
from fes_pin.models.effects import effects_for
from fes_pin.models.nominal import nominal_model
from fes_pin.models.rigs.rigid import load_urdf
from fes_pin.models.store import load_model, model_toml

FILES = [
    (studies.ankle, "study.toml"),
    (studies.ankle, "trials/00.csv"),
    (studies.joint, "study.toml"),
    (studies.joint, "rig.urdf"),
    (studies.joint, "a.csv"),
    (studies.muscle, "study.toml"),
    (studies.own, "study.toml"),
    (studies.own, "a.csv"),
]
PIECES = [
    b"",
    b"\n",
    b"\x00",
    b"\xff",
    b",",
    b'"',
    b"'''",
    b"=",
    b"[",
    b"]",
    b"[[trial]]\n",
    b".",
    b"e9999",
    b"nan",
    b"-",
]
PIECES += [
    b"0",
    b"<",
    b"/>",
    b"<!DOCTYPE a>",
    b"&a;",
    b"\xe2\x80\xa8",
    b"\r",
    b"\t",
    b'"a\\nb" = 1\n',
    b"{}",
    b"1_0",
    b"\x0c",
]


EDITS = st.lists(
    st.tuples(st.floats(0, 1), st.integers(0, 12), st.sampled_from(PIECES) | st.binary(max_size=5)), max_size=4
)


@settings(max_examples=600, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(
    which=st.sampled_from(FILES),
    edits=EDITS,
)
def test_spoilt_studies(tmp_path_factory, which, edits):
    make, file = which
    folder = make(tmp_path_factory.mktemp("fuzz"))
    (folder / file).write_bytes(spoilt((folder / file).read_bytes(), edits))
    one_line_or_none(lambda: read_study(folder))


@settings(max_examples=400, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(edits=EDITS)
def test_any_recording_is_proposed_or_refused(tmp_path, edits):
    path = tmp_path / "a.csv"
    path.write_bytes(spoilt(studies.RECORDED.encode(), edits))
    one_line_or_none(lambda: propose(path, known_rigs()["joint"], True))


def test_the_recordings_that_are_spoilt_can_be_read(tmp_path):
    (trial, _) = read_study(studies.own(tmp_path)).trials
    assert trial.remarks and trial.dt == pytest.approx(1 / 80)


NUMBERS = ["1e-200", "1e200", "-1", "0", "1_0", "inf", "1e400", "9" * 400, "", "0x10", "1 2", "{}", '""', "true"]


@settings(max_examples=200, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(edits=EDITS, number=st.sampled_from(NUMBERS), at=st.integers(0, 30))
def test_spoilt_urdfs_are_refused_in_our_words_alone(tmp_path, capfd, edits, number, at):
    """The parser behind Pinocchio prints lines of its own on what it refuses: it must get nothing to refuse."""
    whole = studies.URDF.replace("</inertial>", '</inertial><visual><geometry><box size="1 1 1"/></geometry></visual>')
    path = tmp_path / "rig.urdf"
    for text in (spoilt(whole.encode(), edits), with_number(whole, r'(?<=")[-0-9. e]+(?=")', number, at).encode()):
        path.write_bytes(text)
        one_line_or_none(lambda: load_urdf(path))
    assert capfd.readouterr().err == ""


@pytest.fixture(scope="module")
def model_text(tmp_path_factory):
    model = nominal_model(read_study(studies.ankle(tmp_path_factory.mktemp("model"))))
    for effect in effects_for("ankle")[:4]:
        model = model + effect()
    return model_toml(model)


@settings(max_examples=200, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(edits=EDITS, number=st.sampled_from(NUMBERS), at=st.integers(0, 40))
def test_spoilt_models(model_text, tmp_path, edits, number, at):
    path = tmp_path / "model.toml"
    for text in (spoilt(model_text.encode(), edits), with_number(model_text, "(?<== ).+", number, at).encode()):
        path.write_bytes(text)
        one_line_or_none(lambda: load_model(path))


def with_number(text, pattern, number, at):
    """The text with one of its numbers replaced."""
    found = list(re.finditer(pattern, text))
    one = found[at % len(found)]
    return text[: one.start()] + number + text[one.end() :]


@settings(max_examples=120, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(content=st.text(max_size=200), suffix=st.sampled_from([".mot", ".sto", ".csv"]), head=st.booleans())
def test_any_text_as_motion(tmp_path, content, suffix, head):
    path = tmp_path / f"a{suffix}"
    path.write_bytes((("nRows=3\nendheader\ntime a\n" if head else "") + content).encode("utf-8", "surrogatepass"))
    one_line_or_none(lambda: read_coordinates(path))
    one_line_or_none(lambda: read_ground_reaction(path))


def spoilt(content, edits):
    for place, cut, piece in edits:
        at = int(place * len(content))
        content = content[:at] + piece + content[at + cut :]
    return content


def one_line_or_none(call):
    try:
        call()
    except InputError as error:
        assert len(str(error).splitlines()) == 1
    except Exception as error:
        pytest.fail(f"{type(error).__name__}: {error}")
