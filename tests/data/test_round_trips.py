"""Whatever study or trial can be built is read as it was written; 1000 examples under the mark `long`."""

import string
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from data import studies
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import fes_pin as fp
from fes_pin.data.channels import CHANNELS, EMG, EMG_KEYS, ENVELOPE, RATE, WIDTH
from fes_pin.data.motion import GROUND_REACTION, OPTIONAL, REQUIRED
from fes_pin.data.outputs import RECORD
from fes_pin.data.schema import known_rigs

EXAMPLES = pytest.mark.parametrize("examples", [20, pytest.param(1000, marks=pytest.mark.long)])
numbers = st.floats(-1e6, 1e6)
positive = st.floats(1e-6, 1e6)
lines = st.text(string.printable + "äß°µ√ 日本😀\xa0", min_size=1, max_size=30).filter(
    lambda s: s.strip() and s.isprintable()
)
URDF = Path(tempfile.mkdtemp(prefix="round")) / "rig.urdf"
URDF.write_text(studies.URDF)
LIMITS = {"amplitude_ma": (0.0, 100.0), "charge_uc": (0.0, 50.0), "emg_envelope": (0.0, 1.0)}
LIMITS |= {"pulse_width_us": (3.0, 1e3), "angle_rad": (-6.0, 6.0), "length_m": (1e-3, 1.0), "position0": (-9.0, 9.0)}


def series(draw, name, count):
    if name == "stim":
        return np.array(draw(st.lists(st.sampled_from([0.0, 1.0]), min_size=count, max_size=count)))
    low, high = (-0.25, 0.25) if name.startswith("q_") else LIMITS.get(name, (-1e6, 1e6))
    return np.array(draw(st.lists(st.floats(low, high), min_size=count, max_size=count)))


@st.composite
def times(draw):
    """Steps of any size, from anywhere; as a clock with few decimals writes them, or to the last digit."""
    count, rate = draw(st.integers(3, 12)), draw(st.sampled_from([1000.0, 200.0, 100.0, 10.0]) | st.floats(1.0, 5e3))
    begin = draw(st.sampled_from([0.0, 12.345]) | st.floats(-1e3, 1e3))
    time = begin + np.arange(count) / rate
    return np.round(time, 3) if rate in (1000.0, 200.0, 100.0, 10.0) and draw(st.booleans()) else time


@st.composite
def trials(draw, schema, name, stimulus):
    kind = draw(st.sampled_from(sorted(schema.outputs)))
    time = draw(times())
    if len(schema.recordings) > 1:
        also = draw(st.lists(st.sampled_from(OPTIONAL), unique=True, max_size=3))
        names = [*(f"q_{n}" for n in (*REQUIRED, *also)), *GROUND_REACTION]
    else:
        stimuli = [n for n in schema.stimuli(kind) if n == stimulus]
        names = [*stimuli, *schema.motion(kind)[:1], schema.outputs[kind]]
        others = [n for n in schema.columns_of(kind) if n not in (*names, "time_s", *schema.inputs)]
        names += draw(st.lists(st.sampled_from(others), unique=True)) if others else []
    low = {n: LIMITS.get(n, (0.0, 1e6)) for n in schema.conditions if schema.only.get(n, kind) == kind}
    needed = schema.needed.get(kind, {})
    conditions = {n: draw(st.floats(*ends)) for n, ends in low.items() if n in needed or draw(st.booleans())}
    columns = {n: series(draw, n, len(time)) for n in dict.fromkeys(names)}
    labels = {"role": draw(st.sampled_from([None, "fit", "held_out"])), "group": draw(st.none() | lines)}
    labels |= {"remarks": tuple(draw(st.lists(lines, max_size=2))), "low_pass_hz": draw(st.none() | positive)}
    return fp.Trial(name, kind, columns, time, conditions, **labels)


@st.composite
def whole_studies(draw):
    rig = draw(st.sampled_from(["ankle", "muscle", "joint", "body"]))
    schema = known_rigs()[rig]
    names = draw(st.lists(lines, min_size=1, max_size=3, unique=True))
    stimulus = draw(st.sampled_from([n for n in schema.inputs if n not in (EMG, RATE)]))  # which others replace
    measured = tuple(draw(trials(schema, name, stimulus)) for name in names)
    ends = {n for c in CHANNELS.values() for n in c.ends}
    constants = {n: draw(positive) for n in (*schema.constants, *schema.passive) if n not in (*ends, *EMG_KEYS)}
    if ends & set(schema.constants) and stimulus != ENVELOPE:
        low, high = CHANNELS.get(stimulus, WIDTH).ends
        constants[low] = draw(positive)
        constants[high] = constants[low] + draw(positive)
    return fp.Study(
        name=draw(lines),
        rig=rig,
        constants=constants,
        start={n: draw(positive) for n in schema.start},
        trials=measured,
        files={"urdf": URDF} if rig == "joint" else {},
        horizon_s=draw(st.none() | positive),
    )


def tried(examples, strategy, check):
    """The check on so many examples."""
    checks = [HealthCheck.too_slow, HealthCheck.data_too_large, HealthCheck.filter_too_much]
    settings(max_examples=examples, deadline=None, suppress_health_check=checks, derandomize=True)(
        given(strategy)(check)
    )()


@EXAMPLES
def test_a_study_is_read_as_it_was_written(tmp_path, examples):
    place = iter(range(10**6))

    def check(study):
        folder = tmp_path / str(next(place))
        fp.write_study(study, folder)
        again = fp.read_study(folder)
        assert again == study and hash(again) == hash(study)
        assert set(again.inputs()) == {
            p.relative_to(folder).as_posix() for p in folder.rglob("*.*") if p.name != RECORD
        }

    tried(examples, whole_studies(), check)


@EXAMPLES
def test_a_trial_is_read_as_it_was_written(tmp_path, examples):
    def check(study):
        if study.rig == "body":
            return
        for trial in study:
            fp.write_trial(trial, tmp_path / "a.csv")
            own = ("name", "kind", "conditions", "role", "group", "remarks", "low_pass_hz")
            labels = {n: getattr(trial, n) for n in own}
            assert fp.read_trial(tmp_path / "a.csv", rig=study.rig, **labels) == trial

    tried(examples, whole_studies(), check)


def test_what_could_not_be_read_is_not_written(tmp_path):
    """Samples that were not measured, and a part whose times only the whole shows to be equally spaced."""
    from fes_pin.data.trial import derived_trial

    study = fp.read_study(studies.joint(tmp_path / "a"))
    first, second = study
    hidden = derived_trial(first, columns={**first.columns, "position": np.full(3, np.nan)})
    with pytest.raises(fp.InputError, match="position: expected finite numbers, found nan"):
        fp.write_study(replace(study, trials=(hidden, second)), tmp_path / "b")
    with pytest.raises(fp.InputError, match="position: expected finite numbers, found nan"):
        fp.write_trial(hidden, tmp_path / "b.csv")
    rounded = fp.Trial("r", "motion", {"position": np.zeros(300)}, np.round(np.arange(300) / 60.0, 3))
    with pytest.raises(fp.InputError, match="fixed step"):
        fp.write_trial(rounded.first(4), tmp_path / "b.csv")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a"]


def test_a_filter_and_remarks_of_a_trial_are_kept(tmp_path):
    """They were lost: 0.013 rad at 3 Hz."""
    study = fp.read_study(studies.ankle(tmp_path / "a"))
    first = replace(study.trials[0], low_pass_hz=3.0, remarks=("2 missing samples are filled in",), name="left: 1/2")
    fp.write_study(replace(study, trials=(first, study.trials[1]), horizon_s=0.3), tmp_path / "b")
    again = fp.read_study(tmp_path / "b")
    assert again["left: 1/2"].low_pass_hz == 3.0 and again["left: 1/2"].remarks == first.remarks
    assert again.horizon_s == 0.3 and again["left: 1/2"] == first
    assert sorted(p.name for p in (tmp_path / "b" / "trials").iterdir()) == ["10.csv", "trial~1.csv"]


BAD = {
    'name = ""': "trial[0].name: expected a name",
    "name = 1": "trial[0].name: expected a name",
    'name = "10"': "two trials are named '10'",
    "remarks = 'x'": "trial[0].remarks: expected texts",
    "remarks = [1]": "trial[0].remarks: expected a remark",
    "low_pass_hz = 0.0": "trial[0].low_pass_hz: expected a number above 0 in Hz",
    "low_pass_hz = nan": "trial[0].low_pass_hz: expected a finite number",
}


@pytest.mark.parametrize("line", BAD)
def test_what_a_trial_is_called_and_how_it_was_filtered_is_checked(tmp_path, line):
    folder = studies.ankle(tmp_path)
    text = (folder / "study.toml").read_text()
    (folder / "study.toml").write_text(text.replace("load_kg = 1.0", f"load_kg = 1.0\n{line}"))
    with pytest.raises(fp.InputError) as caught:
        fp.read_study(folder)
    assert BAD[line] in str(caught.value)
    assert "row 28" in str(caught.value) or line == 'name = "10"'


def test_a_low_pass_is_checked_of_a_trial_that_is_read_by_itself(tmp_path):
    (first,) = sorted((studies.ankle(tmp_path) / "trials").iterdir())[:1]
    conditions = {"load_kg": 1.0}
    assert fp.read_trial(first, rig="ankle", conditions=conditions, low_pass_hz=6.0).low_pass_hz == 6.0
    with pytest.raises(fp.InputError, match=r"low_pass_hz: expected a number above 0 in Hz, found 0\.0"):
        fp.read_trial(first, rig="ankle", conditions=conditions, low_pass_hz=0.0)
