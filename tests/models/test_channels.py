"""The stimulus as an amplitude, a charge or a rate: what recruits, in the unit of its threshold."""

import pickle
import re
from contextlib import nullcontext
from dataclasses import replace

import numpy as np
import pytest
from models.cases import RIGS, trial

import fes_pin as fp
from fes_pin.control.control import PositionController
from fes_pin.data.by_itself import PULSES
from fes_pin.data.channels import CHANNELS, STIMULI
from fes_pin.data.pulses import PulseLimits, pulse_list
from fes_pin.data.recorded.events import looking_period
from fes_pin.models.compile.layout import make_layout
from fes_pin.models.model import Model
from fes_pin.models.nominal import nominal_model
from fes_pin.models.stage import by_name

ANKLE = {"foot_mass_kg": 0.118, "com_distance_m": 0.078, "moment_arm_m": 0.034, "force_scale_n": 58.0}
PASSIVE = {"f0_n": 3.9, "f1_per_rad": 2.25, "theta_r_rad": 1.22}
START = {"gain": 0.65, "time_constant_s": 0.05, "inertia_kgm2": 1e-3, "damping_nms": 0.06}
LIMITS = {"amplitude_ma": (5.0, 40.0), "charge_uc": (0.5, 8.0), "pulse_width_us": (100.0, 500.0)}


def held(recruitment: np.ndarray, dt: float, tau: float) -> np.ndarray:
    """A first-order lag by the exact answer to each held sample, as no engine of the library integrates it."""
    out, now = np.zeros(len(recruitment)), 0.0
    for k, r in enumerate(recruitment):
        out[k] = now
        now += (r - now) * -np.expm1(-dt / tau)
    return out


def muscle(rng, column, low, high, shift=0.0, trials=3, rate=False):
    """A study of an isometric muscle whose threshold and saturation sit `shift` beside what is believed."""
    frames, dt, n = {}, 0.01, 800
    for k in range(trials):
        size = np.repeat(rng.uniform(0.7 * low, 1.2 * high, n // 40), 40) * np.repeat(rng.random(n // 40) < 0.8, 40)
        size = np.round(size, 4)
        recruited = np.clip((size - shift - low) / (high - low), 0.0, 1.0) * (size > 0.0)
        hz = np.repeat(rng.choice([20.0, 30.0, 40.0], n // 80), 80) if rate else np.full(n, 30.0)
        force = 40.0 * held(recruited * hz / 30.0, dt, 0.08) + rng.normal(0.0, 0.3, n)
        frames[f"t{k}"] = {"time_s": dt * np.arange(n), column: size, "force_n": force}
        frames[f"t{k}"] |= {"frequency_hz": hz} if rate else {}
    ends = dict(zip(CHANNELS[column].ends, (low, high), strict=True))
    return fp.Study.from_frames(
        frames, rig="muscle", name="m", constants=ends, start={"gain": 30.0, "time_constant_s": 0.05}
    )


def covers(found, name, true):
    """Whether twice the 95 % interval covers a value: 16 of 100 000 do not."""
    low, high = found.interval(name)
    return low - 0.5 * (high - low) <= true <= high + 0.5 * (high - low)


def with_widths(study, widths=200.0, **constants):
    """The same trials with a pulse width in addition to the amplitude."""
    frames = {t.name: {"time_s": t.time, **t.columns} for t in study.trials}
    for k, frame in enumerate(frames.values()):
        frame["pulse_width_us"] = np.broadcast_to(widths, (len(frame["time_s"]),)) * (1.0 + 0.0 * k)
    known = constants or study.constants
    return fp.Study.from_frames(frames, rig="muscle", name="m", constants=known, start=study.start)


@pytest.mark.parametrize("column", ["amplitude_ma", "charge_uc"])
@pytest.mark.parametrize("seed", range(3))
def test_a_threshold_is_found_in_the_unit_of_the_stimulus(column, seed):
    rng = np.random.default_rng(seed)
    low = rng.uniform(*LIMITS[column]) / 2.0
    high = low * rng.uniform(1.8, 3.0)
    shift = float(rng.choice([-1.0, 1.0]) * rng.uniform(0.1, 0.3) * (high - low))
    study = muscle(rng, column, low, high, shift)
    model = nominal_model(study)
    kind = model.rig.cause(fp.effects.ThresholdShift)
    found = fp.fit(model + kind.absent(), study)
    unit = CHANNELS[column].unit
    name = f"threshold_shift.shift_{unit.lower()}"
    assert found.model.parameter_info()[name].unit == unit
    assert covers(found, name, shift)
    assert np.ptp(found.interval(name)) < 0.05 * (high - low)
    assert covers(found, "gain", 40.0)
    assert covers(found, "time_constant_s", 0.08)


def test_a_diagnosis_names_an_amplitude_in_ma_and_saves_it(tmp_path):
    study = muscle(np.random.default_rng(5), "amplitude_ma", 8.0, 20.0, 1.5, trials=2)
    found = fp.diagnose(study)
    assert [c.name for c in found.causes] == ["threshold_shift"]
    (value,) = found.causes[0].parameters.values()
    assert value.ends[0] < 1.5 < value.ends[1]
    assert " mA" in str(found)
    assert not re.search(r" us\b", str(found))
    assert "pulse width" not in str(found)
    fp.save_model(found.model, tmp_path / "model.toml")
    assert "shift_ma = " in (tmp_path / "model.toml").read_text()
    again = fp.load_model(tmp_path / "model.toml")
    assert again == found.model
    with pytest.raises(fp.InputError, match="expected amplitude_ma, of which the model has the threshold"):
        fp.simulate(again, muscle(np.random.default_rng(0), "pulse_width_us", 100.0, 300.0, trials=1).trials[0])


@pytest.mark.parametrize(
    "name", ["threshold_shift", "threshold_drift", "recruitment_hysteresis", "antagonist_spillover"]
)
@pytest.mark.parametrize("column", ["amplitude_ma", "charge_uc"])
def test_a_cause_in_another_unit_simulates_what_the_same_cause_of_a_width_does(name, column):
    """Widths of a thousand, and the same numbers as amplitudes by their share of it: the readings are equal."""
    rng, per = np.random.default_rng(2), CHANNELS[column].per_us
    width = np.repeat(np.round(rng.uniform(0.0, 1000.0, 20)), 20)
    ends = {"pulse_width_us": (180.0, 1000.0), column: (180.0 * per, 1000.0 * per)}
    runs = []
    for stimulus, values in (("pulse_width_us", width), (column, width * per)):
        known = dict(zip(CHANNELS[stimulus].ends, ends[stimulus], strict=True))
        frame = {"time_s": 0.01 * np.arange(400), stimulus: values, "angle_rad": np.linspace(1.7, 1.8, 400)}
        about = {"a": {"kind": "motion", "load_kg": 1.0}}
        constants = {**ANKLE, **PASSIVE, **known}
        study = fp.Study.from_frames({"a": frame}, about, rig="ankle", name="a", constants=constants, start=START)
        model = nominal_model(study)
        kind = model.rig.cause(by_name(fp.effects.EFFECTS, name))
        runs.append(fp.simulate(model + kind(), study.trials[0])["angle_rad"])
        assert pickle.loads(pickle.dumps(kind())) == kind()
    assert np.ptp(runs[0]) > 0.01
    np.testing.assert_allclose(runs[0], runs[1], rtol=1e-9, atol=1e-9)


def test_a_cause_in_another_unit_than_the_rigs_is_refused():
    model = nominal_model(muscle(np.random.default_rng(0), "amplitude_ma", 8.0, 20.0, trials=1))
    with pytest.raises(fp.InputError, match="has sizes in us, and the stimulus has not"):
        model + fp.effects.ThresholdShift()
    widths = nominal_model(muscle(np.random.default_rng(0), "pulse_width_us", 80.0, 200.0, trials=1))
    with pytest.raises(fp.InputError, match="has sizes in mA, and the stimulus has not"):
        widths + model.rig.cause(fp.effects.ThresholdShift)()
    assert widths.rig.cause(fp.effects.ThresholdShift) is fp.effects.ThresholdShift


def test_of_width_and_amplitude_the_one_that_varies_recruits():
    alone = muscle(np.random.default_rng(1), "amplitude_ma", 8.0, 20.0, trials=2)
    both = with_widths(alone)
    assert [set(t.columns) for t in both.trials] == [{"amplitude_ma", "force_n"}] * 2
    assert all("pulse_width_us is 200 us in every pulse and left out" in t.remarks[-1] for t in both.trials)
    for one, other in zip(alone.trials, both.trials, strict=True):
        np.testing.assert_array_equal(one["amplitude_ma"], other["amplitude_ma"])
    gate = np.arange(800) % 200 < 100  # pulses that are switched by their width
    gated = with_widths(alone, np.where(gate, 200.0, 0.0))
    assert not gated.trials[0]["amplitude_ma"][~gate].any()
    with pytest.raises(fp.InputError, match="threshold_uc and saturation_uc of their charge"):
        with_widths(alone, np.where(gate, 200.0, 300.0))
    charge = with_widths(alone, np.where(gate, 200.0, 300.0), threshold_uc=1.6, saturation_uc=4.0)
    np.testing.assert_allclose(
        charge.trials[0]["charge_uc"], 1e-3 * np.where(gate, 200.0, 300.0) * alone.trials[0]["amplitude_ma"]
    )


def test_a_width_is_never_taken_where_the_threshold_is_in_ma():
    study = muscle(np.random.default_rng(1), "amplitude_ma", 8.0, 20.0, trials=1)
    frame = {"time_s": study.trials[0].time, "pulse_width_us": study.trials[0]["amplitude_ma"], "force_n": np.ones(800)}
    with pytest.raises(fp.InputError, match="threshold_us"):
        fp.Study.from_frames({"a": frame}, rig="muscle", name="a", constants=study.constants, start=study.start)
    with pytest.raises(fp.InputError, match="in one unit"):
        constants = {**study.constants, "threshold_us": 100.0, "saturation_us": 200.0}
        fp.Study(study.name, "muscle", constants, study.start, study.trials)
    with pytest.raises(fp.InputError, match="expected 0 to 500 mA, found 8000"):
        frame = {"time_s": frame["time_s"], "amplitude_ma": np.full(800, 8000.0), "force_n": np.ones(800)}
        fp.Study.from_frames({"a": frame}, rig="muscle", name="a", constants=study.constants, start=study.start)


def test_outputs_for_a_person_refuse_an_amplitude():
    trial = muscle(np.random.default_rng(1), "amplitude_ma", 8.0, 20.0, trials=1).trials[0]
    with pytest.raises(fp.InputError, match="expected a trial of pulse widths or of single pulses"):
        pulse_list(trial, PulseLimits(500.0, 50.0, 40.0, 20.0), rate_hz=30.0)
    frame = {"time_s": trial.time, "amplitude_ma": trial["amplitude_ma"], "angle_rad": np.linspace(1.7, 1.8, 800)}
    known = {**ANKLE, **PASSIVE, "threshold_ma": 8.0, "saturation_ma": 20.0}
    about = {"a": {"kind": "motion", "load_kg": 1.0}}
    ankle = fp.Study.from_frames({"a": frame}, about, rig="ankle", name="a", constants=known, start=START)
    with pytest.raises(fp.InputError, match="needs threshold_us and saturation_us"):
        PositionController(nominal_model(ankle), load_kg=1.0)
    rig = nominal_model(ankle).rig
    proposed = type(rig).driven(ankle, np.linspace(0.0, 1.0, 50))
    assert type(rig).steered(ankle) == "amplitude_ma"
    assert proposed[0] == 0.0
    assert 8.0 <= proposed[1:].min() < proposed.max() <= 20.0


def test_a_rate_that_varies_scales_the_force_of_a_muscle():
    study = muscle(np.random.default_rng(4), "pulse_width_us", 80.0, 200.0, rate=True)
    found = fp.fit(nominal_model(study), study)
    usual = 1.0 / found.model.rig.constants["pulse_period_s"]
    assert usual in (20.0, 30.0, 40.0)
    assert covers(found, "gain", 40.0 * usual / 30.0)


def test_a_rate_alone_drives_a_muscle_as_its_pulses_do():
    rate, n = np.repeat([0.0, 10.0, 25.0, 0.0], 500), 2000
    pulses = np.diff(np.floor(np.cumsum(rate) * 1e-3), prepend=0.0)
    start = {"gain": 20.0, "time_constant_s": 0.3}
    runs = []
    for column, values in (("frequency_hz", rate), ("stim", pulses)):
        frame = {"time_s": 1e-3 * np.arange(n), column: values, "force_n": np.linspace(0.0, 1.0, n)}
        study = fp.Study.from_frames({"a": frame}, rig="muscle", name="a", start=start)
        model = nominal_model(study)
        runs.append(fp.simulate(model, study.trials[0])["force_n"] / model.rig.constants["pulse_period_s"])
    assert abs(np.mean(runs[0][600:1500]) / np.mean(runs[1][600:1500]) - 1.0) < 0.05


@pytest.mark.parametrize("column", ["", "pulse_width_us", "amplitude_ma"])
def test_a_passive_ankle_needs_no_threshold(column):
    """A dynamometer moves a limb that is not stimulated: inertia and damping are fitted, and what stimulation needs
    is not asked for."""
    rng, frames = np.random.default_rng(6), {}
    for k in range(2):
        t = 0.005 * np.arange(1200)
        w = 2.0 * np.pi * (0.4 + 0.3 * k)
        q, v, a = 1.7 + 0.3 * np.sin(w * t), 0.3 * w * np.cos(w * t), -0.3 * w**2 * np.sin(w * t)
        antagonist = np.where(q > 1.22, 3.9 * np.expm1(2.25 * np.maximum(q - 1.22, 0.0)), 0.0)
        torque = -0.078 * antagonist * np.sin(q) - 0.118 * 9.81 * 0.078 * np.cos(q) - 0.08 * v - 0.0015 * a
        frames[f"t{k}"] = {"time_s": t, "angle_rad": q + rng.normal(0.0, 1e-4, 1200)}
        frames[f"t{k}"] |= {"torque_nm": torque + rng.normal(0.0, 2e-3, 1200)} | ({column: 0.0 * t} if column else {})
    about = {n: {"kind": "imposed"} for n in frames}
    study = fp.Study.from_frames(frames, about, rig="ankle", name="p", constants={**ANKLE, **PASSIVE}, start=START)
    model = nominal_model(study)
    assert model.rig.fitted_parameters() == ("inertia_kgm2", "damping_nms")
    said = pytest.warns(fp.InputWarning, match="the muscle is passive") if column else nullcontext()
    with said:
        found = fp.fit(model, study)
    assert found.parameters["damping_nms"] == pytest.approx(0.08, rel=0.1)


def test_stimulated_trials_need_their_threshold_and_passive_ones_beside_them_do_not():
    rng = np.random.default_rng(0)
    study = muscle(rng, "amplitude_ma", 8.0, 20.0, trials=1)
    with pytest.raises(fp.InputError, match="threshold_ma: missing; trials with amplitude_ma"):
        fp.Study("a", "muscle", {}, study.start, study.trials)
    lever = {"time_s": 0.01 * np.arange(100), "length_m": np.linspace(0.2, 0.21, 100), "force_n": rng.normal(size=100)}
    passive = fp.Trial("lever", "imposed", {n: v for n, v in lever.items() if n != "time_s"}, lever["time_s"])
    assert len(fp.Study("a", "muscle", study.constants, study.start, (*study.trials, passive)).trials) == 2
    with pytest.raises(fp.InputError, match="missing; this rig needs"):
        still = fp.Trial("still", "isometric", {"force_n": lever["force_n"]}, lever["time_s"])
        fp.Study("a", "muscle", study.constants, study.start, (*study.trials, still))


def test_all_stimuli_are_among_the_columns_that_stimulate():
    assert set(PULSES) == set(STIMULI)


def events(rng, quiet):
    """A logger that looks 16 times a second, and writes a row where something has changed."""
    t = 0.0625 * np.arange(600)
    level = np.repeat(np.round(rng.uniform(5.0, 15.0, 20)) * (rng.random(20) > quiet), 30)
    force = np.round(held(level, 0.0625, 0.2), 2)
    rows = np.r_[True, (np.diff(level) != 0.0) | (np.diff(force) != 0.0)]
    return t[rows], {"level": level[rows], "force": force[rows]}


@pytest.mark.parametrize("seed", range(20))
def test_a_log_of_events_is_told_from_one_that_is_sampled(seed):
    rng = np.random.default_rng(seed)
    assert looking_period(*events(rng, 0.4)) == pytest.approx(0.0625)
    t = 0.01 * np.arange(500)
    noise = {"a": rng.normal(size=500)}
    smooth = {"a": np.sin(rng.uniform(2.0, 8.0) * t) + 1e-3 * rng.normal(size=500), "b": np.zeros(500)}
    assert looking_period(t, noise) is None
    assert looking_period(t + rng.uniform(0.0, 0.004, 500), noise) is None  # jitter
    kept = np.ones(500, dtype=bool)
    for begin in rng.integers(10, 480, 4):
        kept[begin : begin + 12] = False  # holes
    assert looking_period(t[kept], {"a": noise["a"][kept]}) is None
    assert looking_period(t[kept], {n: v[kept] for n, v in smooth.items()}) is None
    for begin in range(20, 480, 30):
        kept[begin : begin + 12] = False
    assert looking_period(t[kept], {n: v[kept] for n, v in smooth.items()}) is None
    lost = rng.random(500) > 0.2
    assert looking_period(t[lost], {"a": noise["a"][lost]}) is None


@pytest.mark.parametrize("rig", ["ankle", "muscle"])
def test_a_program_without_a_curve_is_none_of_a_rig_that_has_one(rig):
    """A program is kept by its layout: one that recruits nothing was once served to a rig with a threshold."""
    with_curve = Model(RIGS[rig]).rig
    bare = replace(with_curve, constants={n: v for n, v in with_curve.constants.items() if n not in with_curve.ends()})
    for kind in with_curve.schema.outputs:
        columns = with_curve.input_columns(trial(rig, kind, np.random.default_rng(0), 20))
        one, other = (make_layout(Model(r), kind, columns, ()) for r in (with_curve, bare))
        assert one != other
        assert set(one.constants) - set(other.constants) == set(with_curve.ends())
