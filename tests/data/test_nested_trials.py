"""Trials in struct arrays, cells and structs of one file of MATLAB; arrays that are left out; rates that say a unit."""

import json

import numpy as np
import pytest

pytest.importorskip("pymatreader")
from test_sheets import recording, study_of, xlsx

from fes_pin.data.errors import InputError

SEEDS = range(3)


def struct(seed, count, start=0.0, **more):
    """A trial at 100 Hz as a struct: times in s, degrees, N m."""
    random, time = np.random.default_rng(seed), start + np.arange(count) * 0.01
    angle = random.uniform(20.0, 35.0) * np.cos(6.0 * time + random.uniform(0.0, 1.0))
    return {"t_s": time, "angle_deg": angle, "torque_Nm": random.uniform(0.5, 1.0) * np.sin(3.0 * time), **more}


def cell(values):
    out = np.empty((1, len(values)), dtype=object)
    for place, value in enumerate(values):
        out[0, place] = value
    return out


def struct_array(structs):
    out = np.zeros((1, len(structs)), dtype=[(name, object) for name in structs[0]])
    for place, one in enumerate(structs):
        for name, value in one.items():
            out[0, place][name] = value
    return out


def named(words):
    return lambda structs: {"data": dict(zip(words, structs, strict=False))}


FORMS = {
    "struct array": (lambda s: {"log": struct_array(s), "subject": {"age": 30.0}}, "log.{}"),
    "cell of structs": (lambda s: {"c": cell(s)}, "c.{}"),
    "cells": (lambda s: {name: cell([one[name] for one in s]) for name in s[0]}, "{}"),
    "numbers": (lambda s: {f"walk{k}": one for k, one in enumerate(s, 1)}, "walk{}"),
    "trials": (lambda s: {"data": {f"Trial_{k}": one for k, one in enumerate(s, 1)}}, "data.Trial_{}"),
    "nested": (lambda s: {"all": {"set": struct_array([{"kin": one} for one in s])}}, "all.set.kin.{}"),
}


def saved(folder, content, name="a.mat"):
    from scipy.io import savemat

    savemat(folder / name, content)
    return folder / name


def saved_73(folder, content):
    """As MATLAB writes version 7.3: HDF5 behind 512 bytes, elements of struct arrays and cells as references."""
    h5py = pytest.importorskip("h5py")

    def put(group, name, value):
        if isinstance(value, dict) or value.dtype.names:
            made, kind = group.create_group(name), b"struct"
            fields = value if isinstance(value, dict) else {n: value[n] for n in value.dtype.names}
            for field, one in fields.items():
                put(made, field, one)
        elif value.dtype == object:
            refs = [put(file["#refs#"], f"{len(file['#refs#'])}", one).ref for one in value.flat]
            made, kind = group.create_dataset(name, data=np.array([refs], dtype=h5py.ref_dtype)), b"cell"
        else:
            made, kind = group.create_dataset(name, data=value[None, :]), b"double"
        if kind != b"cell" or "struct" not in str(group.attrs.get("MATLAB_class")):
            made.attrs["MATLAB_class"] = np.bytes_(kind)
        return made

    with h5py.File(folder / "a.mat", "w", userblock_size=512) as file:
        file.create_group("#refs#")
        for name, value in content.items():
            put(file, name, value)
    with (folder / "a.mat").open("r+b") as written:
        written.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM")
    return folder / "a.mat"


def check(study, structs, names):
    assert [t.name for t in study.trials] == [f"a-{name}" for name in names]
    for trial, one in zip(study.trials, structs, strict=True):
        np.testing.assert_allclose(trial.time, one["t_s"], rtol=0.0, atol=1e-12)
        np.testing.assert_allclose(np.degrees(trial["position"]), one["angle_deg"], rtol=0.0, atol=1e-9)
        np.testing.assert_allclose(trial["effort"], one["torque_Nm"], rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("form", FORMS)
def test_structures_that_end_apart_are_trials(tmp_path, form, seed):
    counts = np.random.default_rng(seed).permutation([120, 160, 200, 240])[: 2 + seed]
    structs, (make, name) = [struct(10 * seed + k, n) for k, n in enumerate(counts)], FORMS[form]
    study, made = study_of(tmp_path / "s", saved(tmp_path, make(structs)))
    check(study, structs, [name.format(k + 1) for k in range(len(counts))])
    (said,) = [words for words in made.said if "--split none" in words]
    assert ("their names say so" if form == "trials" else "they do not end at once") in said
    assert made.contents["study.toml"].count("[columns") == 1


@pytest.mark.parametrize("form", ["cell of structs", "trials", "struct array"])
def test_trials_of_an_hdf5_file_are_in_the_order_of_their_numbers(tmp_path, form):
    structs, (make, name) = [struct(k, 120 + 10 * k) for k in range(12)], FORMS[form]
    content = {n: v for n, v in make(structs).items() if n != "subject"}
    check(study_of(tmp_path / "s", saved_73(tmp_path, content))[0], structs, [name.format(k) for k in range(1, 13)])


@pytest.mark.parametrize("seed", SEEDS)
def test_structures_of_one_length_are_trials_where_their_names_say_so(tmp_path, seed):
    structs = [struct(10 * seed + k, 150) for k in range(3)]
    study, _ = study_of(tmp_path / "s", saved(tmp_path, {"trials": struct_array(structs)}))
    check(study, structs, [f"trials.{k}" for k in (1, 2, 3)])
    later = [struct(k, 150, start=10.0 * k) for k in range(3)]  # one after the other
    check(study_of(tmp_path / "t", saved(tmp_path, named("abc")(later)))[0], later, [f"data.{n}" for n in "abc"])


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("names", [("left", "right"), ("knee", "hip", "ankle")])
def test_instruments_at_once_are_asked_for_and_may_be_said_to_be_trials(tmp_path, names, seed):
    structs = [struct(10 * seed + k, 150) for k in range(len(names))]
    path = saved(tmp_path, named(names)(structs))
    with pytest.raises(InputError, match="may be trials or instruments at once: --split columns") as caught:
        study_of(tmp_path / "s", path)
    assert all(f"data.{name}" in str(caught.value) for name in names)
    check(study_of(tmp_path / "t", path, split="columns")[0], structs, [f"data.{n}" for n in names])


def test_what_two_loggers_recorded_of_one_trial_is_no_two_trials(tmp_path):
    one = struct(1, 200)
    half = {"t_s": one["t_s"][::2], "angle_deg": one["angle_deg"][::2]}
    path = saved(tmp_path, {"data": {"fine": {n: one[n] for n in half}, "coarse": half}})
    said = {"time_s": "data.fine.t_s", "position": "data.fine.angle_deg"}
    study, made = study_of(tmp_path / "s", path, columns=said)
    assert [t.name for t in study.trials] == ["a"] and "sheet" not in made.contents["study.toml"]


def test_a_vector_may_be_named_by_its_place_and_a_file_be_left_whole(tmp_path):
    structs = [struct(k, 100 + 40 * k) for k in range(3)]
    path = saved(tmp_path, {"log": struct_array(structs)})
    columns = {"time_s": "log.t_s.2", "position": "log.angle_deg.2", "effort": "log.torque_Nm.2"}
    for k, more in enumerate(({"columns": columns}, {"columns": columns, "split": "none"})):
        study, _ = study_of(tmp_path / str(k), path, **more)
        np.testing.assert_allclose(study.trials[0]["effort"], structs[1]["torque_Nm"], atol=1e-12)
        assert len(study.trials) == 1
    study, _ = study_of(tmp_path / "s", path, form={"sheet": "log.3"})
    check(study, structs[2:], ["log.3"])
    with pytest.raises(InputError, match=r"expected one of its structures, log, log.1, log.2, log.3; found 'log.7'"):
        study_of(tmp_path / "t", path, form={"sheet": "log.7"})


def test_a_structure_with_other_columns_is_left_out_and_said(tmp_path):
    structs = [struct(k, 100 + 40 * k) for k in range(3)]
    del structs[1]["torque_Nm"]
    study, made = study_of(tmp_path / "s", saved(tmp_path, named(("one", "two", "three"))(structs)))
    assert [t.name for t in study.trials] == ["a-data.one", "a-data.three"]
    assert any("data.two have other columns and are left out" in words for words in made.said)


def test_lists_of_json_are_trials_as_well(tmp_path):
    structs = [struct(k, 100 + 40 * k) for k in range(3)]
    path = tmp_path / "a.json"
    path.write_text(json.dumps([{n: v.tolist() for n, v in one.items()} for one in structs]))
    check(study_of(tmp_path / "s", path)[0], structs, ["1", "2", "3"])


@pytest.mark.parametrize("shape", [(150, 3, 4), (4, 150, 3), (2, 3, 150), (3, 3, 3, 2)])
def test_arrays_of_more_dimensions_are_said(tmp_path, shape):
    words = f"emg ({' x '.join(map(str, shape))}) is left out"
    study, _ = study_of(tmp_path / "s", saved(tmp_path, {**struct(3, 150), "emg": np.ones(shape)}))
    assert any(words in remark for remark in study.trials[0].remarks)
    with pytest.raises(InputError) as caught:
        study_of(tmp_path / "t", saved(tmp_path, {"emg": np.ones(shape)}))
    assert words in str(caught.value)
    with pytest.raises(InputError) as caught:
        study_of(tmp_path / "v", saved(tmp_path, {"t_s": struct(3, 150)["t_s"], "emg": np.ones(shape)}))
    assert words in str(caught.value) and "--column position" in str(caught.value)
    flat = {**struct(3, 150), "emg": np.ones((150, 1, 3))}  # a matrix
    study, _ = study_of(tmp_path / "u", saved(tmp_path, flat))
    assert not any("emg" in remark for remark in study.trials[0].remarks)


QTM = "NO_OF_FRAMES\t{n}\nFREQUENCY\t{rate:g}\nNO_OF_ANALOG\t0\nANALOG_FREQUENCY\t0\nDATA_INCLUDED\t6D\n"


@pytest.mark.parametrize("rate", [50.0, 120.0, 200.0])
@pytest.mark.parametrize("unit", ["s", "ms", "min"])
def test_a_rate_above_the_numbers_says_the_unit_of_times(tmp_path, rate, unit):
    time = np.arange(200) / rate / {"s": 1.0, "ms": 1e-3, "min": 60.0}[unit]
    rows = "".join(f"{k}\t{t:.6f}\t{30.0 * np.cos(0.1 * k):.4f}\n" for k, t in enumerate(time, 1))
    path = tmp_path / "a.tsv"
    path.write_text(QTM.format(n=200, rate=rate) + "Frame\tTime\tknee Angle [deg]\n" + rows)
    if unit == "min":  # nothing that its rate shows
        with pytest.raises(InputError, match="time_s=Time:UNIT"):
            study_of(tmp_path / "s", path)
        return
    study, made = study_of(tmp_path / "s", path)
    assert study.trials[0].dt == pytest.approx(1.0 / rate, rel=1e-3)
    assert f"Time is in {unit}: its steps are those of {rate:g} Hz, which the file states" in made.said


def test_a_rate_of_a_struct_says_the_unit_of_its_times(tmp_path):
    structs = [{"time" if n == "t_s" else n: v for n, v in struct(k, 100 + 40 * k, fs=100.0).items()} for k in (0, 1)]
    study, _ = study_of(tmp_path / "s", saved(tmp_path, {"log": struct_array(structs)}))
    assert [round(t.dt, 9) for t in study.trials] == [0.01, 0.01]
    structs[1]["fs"] = 250.0  # which its times contradict
    with pytest.raises(InputError, match="time_s=time:UNIT"):
        study_of(tmp_path / "t", saved(tmp_path, {"log": struct_array(structs)}))


def test_what_is_said_of_sheets_names_their_file_once(tmp_path):
    pytest.importorskip("python_calamine")
    path = xlsx(tmp_path / "a.xlsx", {"one": recording(4), "notes": [["nobody"]], "two": recording(5)})
    said = study_of(tmp_path / "s", path)[1].said
    assert [words.count("a.xlsx") for words in said if "sheets" in words] == [1]


def test_a_rate_of_times_is_no_vector_of_the_whole_file(tmp_path):
    structs = [struct(k, 100 + 40 * k) for k in range(3)]
    study, _ = study_of(
        tmp_path / "s", saved(tmp_path, {"log": struct_array(structs)}), columns={"time_s": "rate=99.5"}
    )
    assert [round(1.0 / t.dt, 6) for t in study.trials] == [99.5] * 3


@pytest.mark.parametrize(
    "content", [{"": [0.1] * 60, "a": [0.2] * 61}, [[0.1] * 60, {"": [0.3] * 59}], {"t": [[]] * 3}]
)
def test_vectors_without_names_are_refused_in_one_line(tmp_path, content):
    path = tmp_path / "a.json"
    path.write_text(json.dumps(content))
    with pytest.raises(InputError) as caught:
        study_of(tmp_path / "s", path)
    assert "\n" not in str(caught.value)
