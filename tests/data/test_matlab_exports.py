"""MATLAB files of Spike2, LabChart, AcqKnowledge and `importdata`: names, units and rates stand apart from numbers."""

import json

import numpy as np
import pytest

pytest.importorskip("pymatreader")
from test_nested_trials import saved, struct_array
from test_sheets import study_of

from fes_pin.data.errors import InputError

SEEDS = range(3)


def drawn(seed, count=300):
    """Angle in degrees and torque in N m of a trial, and its rate in Hz."""
    random = np.random.default_rng(seed)
    rate = float(random.choice([100.0, 200.0, 500.0]))
    time = np.arange(count) / rate
    return random.uniform(20.0, 35.0) * np.cos(6.0 * time), random.uniform(0.5, 1.0) * np.sin(3.0 * time), rate


def channel(values, unit, rate, **more):
    return {"title": "x", "interval": 1.0 / rate, "units": unit, "start": 0.0, "values": values[:, None], **more}


def spike(angle, torque, rate):
    marks = {"resolution": 1e-6, "times": np.arange(1.0, 5.0), "codes": np.ones((4, 4), dtype=np.uint8)}
    return {"Angle": channel(angle, "deg", rate), "Torque": channel(torque, "Nm", rate), "Keyboard": marks}


def labchart(*blocks):
    """One vector of all channels of all blocks; a channel of None was off."""
    data, starts, ends, count = [], [], [], 1
    for angle, torque, _ in blocks:
        for values in (angle, torque, None):
            starts.append(-1.0 if values is None else float(count))
            count += 0 if values is None else len(values)
            ends.append(-1.0 if values is None else count - 1.0)
            data += [] if values is None else [values]
    shape = {"shape": (len(blocks), 3)}
    rates = np.repeat([[rate for *_, rate in blocks]], 3, axis=0)
    return {
        "data": np.concatenate(data)[None],
        "titles": np.array(["Angle ", "Torque", "EMG   "]),
        "unittext": np.array(["N.m", "deg"]),
        "unittextmap": np.array([[2.0], [1.0], [-1.0]]).repeat(len(blocks), axis=1),
        "samplerate": rates,
        "tickrate": rates[:1],
        "datastart": np.reshape(starts, **shape).T,
        "dataend": np.reshape(ends, **shape).T,
    }


def acqknowledge(angle, torque, rate):
    texts = {"labels": np.array(["Knee angle", "Torque    "]), "units": np.array(["deg", "Nm "])}
    return {"data": np.stack([angle, torque], 1), **texts, "isi": 1e3 / rate, "isi_units": "ms", "start_sample": 0.0}


def imported(angle, torque, rate):
    heads = np.array([["time_s", "angle_deg", "torque_Nm"]], dtype=object)
    return {"A": {"data": np.stack([np.arange(len(angle)) / rate, angle, torque], 1), "colheaders": heads}}


MADE = {"Spike2": spike, "LabChart": lambda *one: labchart(one), "AcqKnowledge": acqknowledge, "importdata": imported}


def check(study, trials):
    for trial, (angle, torque, rate) in zip(study.trials, trials, strict=True):
        assert trial.dt == pytest.approx(1.0 / rate)
        np.testing.assert_allclose(np.degrees(trial["position"]), angle, rtol=0.0, atol=1e-9)
        np.testing.assert_allclose(trial["effort"], torque, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("program", MADE)
def test_names_units_and_rates_are_those_that_the_file_states(tmp_path, program, seed):
    one = drawn(seed)
    study, made = study_of(tmp_path / "s", saved(tmp_path, MADE[program](*one)))
    check(study, [one])
    assert "sheet" not in made.contents["study.toml"]


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("counts", [(300, 200), (150, 150, 150)])
def test_blocks_of_labchart_are_trials(tmp_path, seed, counts):
    trials = [(*drawn(10 * seed + k, count)[:2], 200.0) for k, count in enumerate(counts)]
    study, _ = study_of(tmp_path / "s", saved(tmp_path, labchart(*trials)))
    check(study, trials)
    assert [t.name for t in study.trials] == [f"a-recording{k + 1}" for k in range(len(counts))]


@pytest.mark.parametrize("seed", SEEDS)
def test_channels_that_end_a_sample_apart_or_have_other_rates_are_one_trial(tmp_path, seed):
    angle, torque, rate = drawn(seed)
    content = {"EMG": channel(np.ones(4 * len(angle)), "mV", 4.0 * rate), **spike(angle, torque[:-1], rate)}
    study, _ = study_of(tmp_path / "s", saved(tmp_path, content))
    check(study, [(angle[:-1], torque[:-1], rate)])
    assert any("Angle.values have one sample more than others" in words for words in study.trials[0].remarks)
    knees = {"Left": channel(angle, "deg", rate), "Right": channel(angle[::2], "deg", rate / 2.0)}
    study, made = study_of(tmp_path / "t", saved(tmp_path, knees))
    assert len(study.trials) == 1 and "150 samples: Right.values" in " ".join(made.said)


def test_elements_of_a_struct_array_have_names_of_their_own(tmp_path):
    trials = [drawn(k, 200 + 50 * k) for k in range(3)]
    content = {"log": struct_array([imported(*one)["A"] for one in trials])}
    check(study_of(tmp_path / "s", saved(tmp_path, content))[0], trials)


def test_a_table_of_pandas_in_json_has_its_names(tmp_path):
    one = drawn(3)
    table = imported(*one)["A"]
    path = tmp_path / "a.json"
    path.write_text(json.dumps({"columns": table["colheaders"][0].tolist(), "data": table["data"].tolist()}))
    check(study_of(tmp_path / "s", path)[0], [one])


@pytest.mark.parametrize("labels", [["one", "two"], ["one", "two", "three", "four"], [1.0, 2.0, 3.0]])
def test_labels_of_something_else_name_no_columns(tmp_path, labels):
    content = imported(*drawn(1))["A"] | {"colheaders": np.array(labels, dtype=object)}
    with pytest.raises(InputError) as caught:
        study_of(tmp_path / "s", saved(tmp_path, content))
    assert "data.2, data.3" in str(caught.value)


@pytest.mark.parametrize(
    "other",
    [
        {"datastart": np.ones((5, 2))},
        {"datastart": np.zeros((3, 0))},
        *(
            {key: np.full((3, 1), value)}
            for key in ("datastart", "dataend", "unittextmap")
            for value in (np.nan, np.inf)
        ),
        {"dataend": np.full((3, 1), 1e9)},
        {"titles": 3.0},
    ],
)
def test_what_only_looks_like_labchart_stays_as_it_is(tmp_path, other):
    with pytest.raises(InputError) as caught:
        study_of(tmp_path / "s", saved(tmp_path, labchart(drawn(1)) | other))
    assert "\n" not in str(caught.value)
