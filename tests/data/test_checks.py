# ruff: noqa: E501  (tables, one case a line)
"""A trial and a study that are built in Python are checked as those that are read: one line says what was found."""

import copy
import pickle
import time
from dataclasses import replace

import numpy as np
import pandas
import pytest
from data import studies

from fes_pin.data.errors import InputError
from fes_pin.data.schema import schema_of
from fes_pin.data.study import Study, read_study, write_study
from fes_pin.data.trial import Trial, check_trial, derived_trial
from fes_pin.models.nominal import nominal_model
from fes_pin.models.simulate import simulate

TIME = np.arange(100) * 0.005
ANKLE = {"pulse_width_us": np.full(100, 300.0), "angle_rad": np.linspace(1.8, 1.9, 100)}
JOINT = {"effort": np.ones(100), "position": np.linspace(0.0, 1.0, 100)}


def trial(columns=None, kind="motion", times=TIME, conditions=None, **labels):
    columns = ANKLE if columns is None else columns
    conditions = {"load_kg": 1.0} if conditions is None and columns is ANKLE else conditions
    return Trial("a", kind, columns, times, conditions or {}, **labels)


def without(values, rows):
    return np.delete(np.asarray(values), rows)


FRAME = pandas.DataFrame(ANKLE, index=TIME)
LOST = FRAME.drop(FRAME.index[[20, 50]])
SWAPPED = TIME[[*range(30), 31, 30, *range(32, 100)]]
BAD_TRIALS = {
    "a frame that lost rows": (lambda: trial(LOST, times=LOST.index), "fixed step of 0.005 s within 1 %, found 0.01 s"),
    "times in disorder": (lambda: trial(times=SWAPPED), "expected time to increase"),
    "times of a clock": (lambda: trial(times=pandas.date_range("2026-01-01", periods=100, freq="5ms")), "found datetime64"),
    "uneven times": (lambda: trial(times=TIME**1.01), "fixed step"),
    "a time that is not finite": (lambda: trial(times=np.where(TIME[3] == TIME, np.nan, TIME)), "time_s: expected finite"),
    "one NaN": (lambda: trial({**ANKLE, "angle_rad": np.where(TIME[7] == TIME, np.nan, 1.8)}), "angle_rad: expected finite numbers, found nan (trial a, sample 7)"),
    "one NaN put in later": (lambda: trial().with_columns(angle_rad=np.full(100, np.nan)), "found nan"),
    "a masked sample": (lambda: trial({**ANKLE, "angle_rad": np.ma.masked_equal(ANKLE["angle_rad"], 1.8)}), "found nan"),
    "text": (lambda: trial({**ANKLE, "angle_rad": ["1.8"] * 100}), "expected numbers"),
    "texts of pandas": (lambda: trial({**ANKLE, "angle_rad": pandas.Series(["1.8"] * 100)}), "expected numbers"),
    "missing values of pandas": (lambda: trial({**ANKLE, "angle_rad": pandas.array([None] * 100, dtype="Int64")}), "found nan"),
    "complex numbers": (lambda: trial({**ANKLE, "angle_rad": np.ones(100) * 1j}), "expected numbers, found complex128"),
    "two dimensions": (lambda: trial({**ANKLE, "angle_rad": np.ones((100, 2))}), "expected shape"),
    "another length": (lambda: trial({**ANKLE, "angle_rad": np.ones(99)}), "shape (100,) as of the time, found (99,)"),
    "one sample": (lambda: trial({"position": [0.0]}, times=[0.0]), "at least 3 samples, found 1"),
    "the first two": (lambda: trial().first(2), "at least 3 samples, found 2"),
    "no samples": (lambda: trial({"position": []}, times=[]), "at least 3 samples, found 0"),
    "the time as a column": (lambda: trial(FRAME.rename_axis("time_s").reset_index(), times=TIME), "the time by itself"),
    "a column without a name": (lambda: trial({0: np.ones(100)}), "names of columns as text"),
    "another role": (lambda: trial(role="heldout"), "role: expected one of fit, held_out; found 'heldout'"),
    "no name": (lambda: Trial("", "motion", ANKLE, TIME), "name: expected a name"),
    "a number as kind": (lambda: trial(kind=1), "kind: expected a kind"),
    "a number as group": (lambda: trial(group=1), "group: expected a label"),
    "one text as remarks": (lambda: trial(remarks="filled in"), "expected texts"),
    "a text as condition": (lambda: trial(conditions={"load_kg": "1"}), "load_kg: expected a number, found the text '1'"),
    "a condition that is NaN": (lambda: trial(conditions={"load_kg": float("nan")}), "expected a finite number"),
    "an array as columns": (lambda: trial(np.ones((100, 2))), "columns: expected a mapping of names to values, found a ndarray"),
    "no conditions": (lambda: Trial("a", "motion", ANKLE, TIME, None), "conditions: expected a mapping"),
    "no columns": (lambda: Trial("a", "motion", None, TIME), "columns: expected a mapping"),
    "a low pass at 0 Hz": (lambda: trial(low_pass_hz=0.0), "low_pass_hz: expected a number above 0 in Hz"),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD_TRIALS, ids=str)
def test_a_trial_that_cannot_be_is_refused_when_it_is_built(case):
    build, words = BAD_TRIALS[case]
    with pytest.raises(InputError) as caught:
        build()
    assert words in str(caught.value)


OF_A_RIG = {
    "seconds": ("ankle", {**ANKLE, "pulse_width_us": np.full(100, 3e-4)}, "motion", {"load_kg": 1.0}, "is it in s?"),
    "nanoseconds": ("ankle", {**ANKLE, "pulse_width_us": np.full(100, 3e5)}, "motion", {"load_kg": 1.0}, "is it in ns?"),
    "milliseconds": ("ankle", {**ANKLE, "pulse_width_us": np.full(100, 0.3)}, "motion", {"load_kg": 1.0}, "is it in ms?"),
    "negative widths": ("ankle", {**ANKLE, "pulse_width_us": np.full(100, -1.0)}, "motion", {"load_kg": 1.0}, "at least 0 us, found -1"),
    "no widths": ("ankle", {"angle_rad": ANKLE["angle_rad"]}, "motion", {"load_kg": 1.0}, "pulse_width_us: missing"),
    "degrees": ("ankle", {**ANKLE, "angle_rad": np.full(100, 105.0)}, "motion", {"load_kg": 1.0}, "is it in degrees?"),
    "a condition in degrees": ("ankle", {"pulse_width_us": ANKLE["pulse_width_us"], "force_n": TIME}, "isometric", {"angle_rad": 105.0}, "is it in degrees?"),
    "no load": ("ankle", ANKLE, "motion", {}, "load_kg: missing"),
    "an unknown condition": ("ankle", ANKLE, "motion", {"load_kg": 1.0, "load": 2.0}, "expected load_kg"),
    "an unknown kind": ("ankle", ANKLE, "isotonic", {"load_kg": 1.0}, "expected one of motion, isometric"),
    "effort with a unit": ("joint", {"effort_nm": TIME, "position": TIME}, "motion", {}, "effort_nm: wrong unit or none; expected effort"),
    "no position": ("joint", {"effort": TIME}, "motion", {}, "position: missing"),
    "another column": ("joint", {**JOINT, "emg": TIME}, "motion", {}, "emg: unknown"),
    "millimetres": ("muscle", {"stim": np.ones(100), "length_m": np.full(100, 35.0), "force_n": TIME}, "imposed", {}, "is it in mm?"),
    "a stimulus of 2": ("muscle", {"stim": np.full(100, 2.0), "force_n": TIME}, "isometric", {}, "expected 0 or 1, found 2"),
}  # fmt: skip


@pytest.mark.parametrize("case", OF_A_RIG, ids=str)
def test_a_trial_that_is_not_one_of_its_rig_is_refused(case):
    rig, columns, kind, conditions, words = OF_A_RIG[case]
    built = Trial("a", kind, columns, TIME, conditions)
    with pytest.raises(InputError) as caught:
        check_trial(built, schema_of(rig))
    assert words in str(caught.value) and "trial a" in str(caught.value)


def test_outputs_may_be_missing_where_they_are_to_be_predicted():
    built = Trial("a", "motion", {"pulse_width_us": ANKLE["pulse_width_us"]}, TIME, {"load_kg": 1.0})
    check_trial(built, schema_of("ankle"), inputs_only=True)
    with pytest.raises(InputError, match="angle_rad: missing"):
        check_trial(built, schema_of("ankle"))


def change(key, **values):
    return lambda s: replace(s, **{key: {**getattr(s, key), **values}})


BAD_STUDIES = {
    "two of one name": (lambda s: replace(s, trials=(s.trials[0], s.trials[0].first(4))), "two trials are named '00'"),
    "no trials": (lambda s: replace(s, trials=()), "at least one trial, found none"),
    "no trial among them": (lambda s: replace(s, trials=(s, )), "expected trials, found a Study"),
    "an empty start": (lambda s: replace(s, start={}), "start.gain: missing"),
    "an unknown start value": (change("start", gian=1.0), "start.gian: unknown; did you mean gain?"),
    "a negative start value": (change("start", gain=-1.0), "start.gain: expected a number above 0"),
    "an unknown constant": (change("constants", foot_mas_kg=1.0), "did you mean foot_mass_kg?"),
    "a constant as text": (change("constants", foot_mass_kg="1"), "constants.foot_mass_kg: expected a number"),
    "a curve that ends before it begins": (change("constants", saturation_us=100.0), "saturation above the threshold"),
    "a constant is missing": (lambda s: replace(s, constants={n: v for n, v in s.constants.items() if n != "f0_n"}), "constants.f0_n: missing"),
    "an unknown rig": (lambda s: replace(s, rig="knee"), "rig: expected one of"),
    "another rig": (lambda s: replace(s, rig="joint"), "unknown"),
    "no name": (lambda s: replace(s, name=" "), "name: expected a name"),
    "trials by name": (lambda s: replace(s, trials={"a": s.trials[0]}), "expected trials, found a str"),
    "a number of trials": (lambda s: replace(s, trials=3), "expected trials, found a int"),
    "no constants": (lambda s: replace(s, constants=None), "Study.constants: expected a mapping"),
    "files as a list": (lambda s: replace(s, files=["rig.urdf"]), "Study.files: expected a mapping"),
    "no horizon": (lambda s: replace(s, horizon_s=0.0), "above 0 in s"),
    "degrees": (lambda s: replace(s, trials=(s.trials[0].with_columns(angle_rad=np.full(5, 105.0)),)), "is it in degrees?"),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD_STUDIES, ids=str)
def test_a_study_that_cannot_be_is_refused_when_it_is_built(tmp_path, case):
    spoil, words = BAD_STUDIES[case]
    study = read_study(studies.ankle(tmp_path))
    assert replace(study) == study and replace(study, trials=study.trials[0]).trials == study.trials[:1]
    with pytest.raises(InputError) as caught:
        spoil(study)
    assert words in str(caught.value)


def test_a_joint_needs_its_urdf_and_one_input_in_all_trials(tmp_path):
    start = {"inertia_scale": 1.0, "damping": 1e-3}
    with pytest.raises(InputError, match=r"files\.urdf: missing; expected the path of a file$"):
        Study("s", "joint", {}, start, (Trial("a", "motion", JOINT, TIME),))
    study = read_study(studies.joint(tmp_path))
    mixed = replace(study, trials=(Trial("c", "motion", JOINT, TIME), *study.trials))  # nothing drives the others
    with pytest.raises(InputError, match="lacks the column effort and the first has it"):
        write_study(mixed, tmp_path / "mixed")
    with pytest.raises(InputError, match="also among the constants"):
        replace(study, constants={"damping": 1e-3})


def test_equal_trials_have_one_hash_and_copies_are_equal(tmp_path):
    study = read_study(studies.ankle(tmp_path))
    one = study.trials[0]
    for other in (pickle.loads(pickle.dumps(one)), copy.copy(one), copy.deepcopy(one), replace(one)):
        assert other == one and hash(other) == hash(one) and not other["angle_rad"].flags.writeable
    assert one != one.with_columns(angle_rad=one["angle_rad"] + 1e-9) and one != replace(one, role=None)
    assert one != "00"


def test_numbers_of_numpy_are_numbers():
    built = trial(conditions={"load_kg": np.float32(1.0)}, columns=ANKLE)
    assert type(built.conditions["load_kg"]) is float
    assert trial(FRAME, times=FRAME.index, conditions={"load_kg": 1}) == trial()
    assert trial({"stim": TIME > 0.1})["stim"].dtype == float


def test_times_with_few_decimals_may_begin_anywhere():
    """1/60 s as 0.017, 0.033, 0.050, and the same less its first time: rounding, not jitter."""
    for begin in (0.0, 12.345, 1e6):
        rounded = np.round(np.arange(300) / 60.0 + begin, 3)
        for times in (rounded, rounded - rounded[0]):
            assert trial({"position": np.zeros(300)}, times=times).dt == pytest.approx(1 / 60, rel=1e-3)


@pytest.mark.filterwarnings("ignore:fewer than 16 samples:fes_pin.InputWarning")
def test_what_the_library_makes_of_a_trial_may_be_unmeasured_or_run_away(tmp_path):
    study = read_study(studies.ankle(tmp_path))
    hidden = derived_trial(study.trials[0], columns={"angle_rad": np.full(5, np.nan)})
    assert np.isnan(pickle.loads(pickle.dumps(hidden))["angle_rad"]).all()
    assert isinstance(simulate(nominal_model(study), study.trials[0]), Trial)


def test_the_checks_take_less_than_a_millisecond():
    count = 5000
    columns = {"pulse_width_us": np.full(count, 300.0), "angle_rad": np.full(count, 1.8)}
    times, schema = np.arange(count) * 1e-3, schema_of("ankle")

    def once():
        begin = time.perf_counter()
        check_trial(Trial("a", "motion", columns, times, {"load_kg": 1.0}), schema)
        return time.perf_counter() - begin

    assert min(once() for _ in range(50)) < 1e-3
