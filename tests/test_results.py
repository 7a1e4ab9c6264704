"""Every result: read-only, equal to its copies, shown as a table, saved as JSON and loaded, sent through pools."""

import copy
import html
import json
import multiprocessing
import pickle
import sys
from collections.abc import Mapping
from dataclasses import fields, is_dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from cohort.fakes import quick, studies
from comparison import twins
from view.reported import ankle_diagnosis, ankle_study, measured

import fes_pin as fp
from fes_pin.cohort.run import run_cohort
from fes_pin.data.results import SavedResult

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "scripts"))
KINDS = ("Diagnosis", "Contrast", "Comparison", "Cohort", pytest.param("WalkDiagnosis", marks=pytest.mark.shared))


def walking_study(walk, folder):
    from walks.synthetic import Wrong, gait_of, make

    make(gait_of(walk), folder, Wrong("segment_mass", "trunk", 0.15, strides=2, tissue=0.4), 2)
    return fp.read_study(folder)


@pytest.fixture(scope="module")
def made(tmp_path_factory, request):
    """A result of each kind, made once."""
    known = {}

    def of(kind):
        if kind not in known:
            known[kind] = MAKERS[kind](tmp_path_factory.mktemp("made"), request)
        return known[kind]

    return of


def _contrast(folder, request):
    from contrast_pairs.free import free_pair

    return fp.contrast(free_pair("muscle", ("gain",), 80.0, 9, folder))


def _cohort(folder, request):
    return run_cohort([studies(folder / "in", ["bad", "f1", "f22"])], folder / "out", run=quick)


def _walk(folder, request):
    return fp.diagnose(walking_study(request.getfixturevalue("walk"), folder), limit=0.0)


MAKERS = {
    "Diagnosis": lambda folder, request: ankle_diagnosis(),
    "Contrast": _contrast,
    "Comparison": lambda folder, request: fp.compare(twins.study("lag", 4, count=5), ["nominal", "hill"]),
    "Cohort": _cohort,
    "WalkDiagnosis": _walk,
}


def held(value):
    """Everything that a result holds: but for studies, models and fits, which are objects of their own."""
    yield value
    if isinstance(value, Mapping):
        for one in value.values():
            yield from held(one)
    elif isinstance(value, list | tuple):
        for one in value:
            yield from held(one)
    elif is_dataclass(value) and not isinstance(value, fp.Study | fp.Trial | fp.Model | fp.Fit | type):
        for one in fields(value):
            yield from held(getattr(value, one.name))


@pytest.mark.parametrize("kind", KINDS)
def test_what_a_result_holds_cannot_be_changed(made, kind):
    found = made(kind)
    ours = [one for f in fields(found) if f.name not in ("search", "best") for one in held(getattr(found, f.name))]
    assert not [one for one in ours if isinstance(one, dict | list)]
    assert not [one for one in ours if isinstance(one, np.ndarray) and one.flags.writeable]


def test_the_rivals_of_a_diagnosis_cannot_be_changed(made):
    with pytest.raises(TypeError):
        made("Diagnosis").ranking["coulomb_friction"] = ()
    with pytest.raises(TypeError):
        made("Diagnosis").causes[0].parameters["torque_nm"] = None
    with pytest.raises(ValueError, match="read-only"):
        made("Comparison").models[0].squares["free"][0] = 0.0


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy, lambda one: pickle.loads(pickle.dumps(one))])
@pytest.mark.parametrize("kind", KINDS)
def test_a_copy_says_the_same(made, kind, copied):
    found = made(kind)
    other = copied(found)
    assert type(other) is type(found) and other is not found
    assert other == found and hash(other) == hash(found)
    assert str(other) == str(found) and repr(other) == repr(found)
    assert json.loads(other.to_json()) == json.loads(found.to_json())


@pytest.mark.parametrize("kind", ["Diagnosis", "Contrast"])
def test_no_search_pays_for_the_equality_of_fits(kind, tmp_path, request, monkeypatch):
    """Which asks for their tables, and of a fit at a bound for its profile."""

    def asked(*fits):
        raise AssertionError("a fit was hashed, or compared with another")

    monkeypatch.setattr(fp.Fit, "__eq__", asked)
    monkeypatch.setattr(fp.Fit, "__hash__", asked)
    study = measured(ankle_study(), ("coulomb_friction",))
    found = fp.diagnose(study) if kind == "Diagnosis" else _contrast(tmp_path, request)
    assert found.verdict != "stopped"


@pytest.mark.parametrize("kind", KINDS)
def test_a_result_that_says_something_else_is_another(made, kind):
    found = made(kind)
    other = replace(found, **({"studies": found.studies[:1]} if kind == "Cohort" else {"warnings": ("odd",)}))
    assert other != found and found != kind


def test_what_a_copy_holds_can_still_not_be_changed(made):
    for copied in (copy.deepcopy(made("Comparison")), pickle.loads(pickle.dumps(made("Comparison")))):
        with pytest.raises(ValueError, match="read-only"):
            copied.models[0].squares["free"][0] = 0.0
        assert not np.shares_memory(copied.models[0].squares["free"], made("Comparison").models[0].squares["free"])


@pytest.mark.parametrize("kind", KINDS)
def test_a_result_is_shown_as_one_line_and_as_a_table(made, kind):
    found = made(kind)
    assert "\n" not in repr(found) and len(repr(found)) < 300
    assert found._repr_html_().startswith("<div>") and "<script" not in found._repr_html_()
    pytest.importorskip("pandas")
    table = found.to_frame()
    assert len(table) == len(next(iter(found.columns().values())))
    assert len(table) > 0 or kind == "WalkDiagnosis"  # which was stopped before a cause was found


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_saved_is_loaded_as_it_was(made, kind, tmp_path):
    found = made(kind)
    fp.save_result(found, tmp_path / "result.json")
    loaded = fp.load_result(tmp_path / "result.json")
    assert isinstance(loaded, SavedResult) and loaded.kind == kind
    assert loaded == found and found == loaded and hash(loaded) == hash(found)
    assert str(loaded) == str(found)
    assert loaded.verdict == getattr(found, "verdict", None)
    causes = getattr(found, "causes", getattr(found, "changes", ()))
    assert [c.get("name", c.get("cause")) for c in loaded.causes] == [
        c["cause"] if isinstance(c, Mapping) else c.name for c in causes
    ]
    for name, values in found.columns().items():
        for value, saved in zip(values, loaded.columns()[name], strict=True):
            if isinstance(value, float):
                assert saved == pytest.approx(value, rel=1e-5) if np.isfinite(value) else saved is None
            else:
                assert saved == value
    fp.save_result(loaded, tmp_path / "again.json")
    assert (tmp_path / "again.json").read_bytes() == (tmp_path / "result.json").read_bytes()
    for copied in (copy.deepcopy(loaded), pickle.loads(pickle.dumps(loaded))):
        assert copied == found
    with pytest.raises(TypeError):
        loaded.found["verdict"] = "adequate"
    assert str(loaded).split("\n")[0] in html.unescape(loaded._repr_html_()) or kind == "Diagnosis"
    pytest.importorskip("pandas")
    assert loaded.to_frame().shape == found.to_frame().shape


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("{", "row 1: expected JSON"),
        ("[1]", "expected a result that fes-pin saved"),
        ('{"study": "a"}', "expected a result that fes-pin saved"),
        ('{"result": "Diagnosis", "text": [], "table": {"value": 3}}', "expected a result that fes-pin saved"),
        ("[" * 100_000, "expected JSON"),
    ],
)
def test_what_is_no_result_is_not_loaded(tmp_path, text, said):
    path = tmp_path / "odd.json"
    path.write_text(text)
    with pytest.raises(fp.InputError, match=said) as found:
        fp.load_result(path)
    assert str(found.value).startswith(str(path)) and "\n" not in str(found.value)
    with pytest.raises(fp.InputError, match=r"none\.json"):
        fp.load_result(tmp_path / "none.json")


def test_what_is_no_result_is_not_saved(made, tmp_path):
    for odd in (made("Diagnosis").study, made("Diagnosis").model, {}, None):
        with pytest.raises(fp.InputError, match=f"found {type(odd).__name__}"):
            fp.save_result(odd, tmp_path / "odd.json")
    assert not (tmp_path / "odd.json").exists()


def through_a_pool(work, study):
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        (found,) = pool.map(work, [study])
    return found


def test_a_diagnosis_comes_back_from_a_pool():
    study = measured(ankle_study(), ("coulomb_friction",))
    assert through_a_pool(partial(fp.diagnose, limit=0.0), study) == fp.diagnose(study, limit=0.0)


@pytest.mark.shared
def test_a_walk_comes_back_from_a_pool(walk, tmp_path):
    study = walking_study(walk, tmp_path)
    found = through_a_pool(partial(fp.diagnose, limit=0.0), study)
    assert found == fp.diagnose(study, limit=0.0)
    assert found.model.mass_kg == pytest.approx(fp.diagnose(study, limit=0.0).model.mass_kg)
