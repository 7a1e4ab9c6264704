"""Whatever stands in a study's files, reading gives a study or one line of error."""

import pytest
from data import studies
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fes_pin.data.errors import InputError
from fes_pin.data.motion import read_coordinates, read_ground_reaction
from fes_pin.data.study import read_study

FILES = [
    (studies.ankle, "study.toml"),
    (studies.ankle, "trials/00.csv"),
    (studies.joint, "study.toml"),
    (studies.joint, "rig.urdf"),
    (studies.joint, "a.csv"),
    (studies.muscle, "study.toml"),
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


@settings(max_examples=300, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(
    which=st.sampled_from(FILES),
    edits=st.lists(
        st.tuples(st.floats(0, 1), st.integers(0, 12), st.sampled_from(PIECES) | st.binary(max_size=5)), max_size=4
    ),
)
def test_spoilt_studies(tmp_path_factory, which, edits):
    make, file = which
    folder = make(tmp_path_factory.mktemp("fuzz"))
    (folder / file).write_bytes(spoilt((folder / file).read_bytes(), edits))
    one_line_or_none(lambda: read_study(folder))


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
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
