"""EMG as the recruitment of an ankle: isometric and isokinetic on a dynamometer, and in free motion with a load."""

import numpy as np
import pytest
from imposed_rigs.ankle import KNOWN
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import fes_pin as fp
from fes_pin.data.channels import CHANNELS
from fes_pin.models.nominal import nominal_model

CONSTANTS = {n: v for n, v in KNOWN.items() if n not in CHANNELS["pulse_width_us"].ends}
DT, SECONDS, DELAY = 0.005, 6.0, 0.06
OF_PULSES = ("antagonist_spillover", "recruitment_hysteresis", "threshold_drift", "threshold_shift")


def activity(rng, rests):
    """A smooth voluntary activity, 0 to 1, as a function of time; it may hold when a trial begins."""
    edges = np.arange(-2.0, SECONDS + 1.0, rng.uniform(0.4, 0.9))
    levels = rng.uniform(0.0, 0.9, len(edges)) * (rng.random(len(edges)) < 0.7)
    levels[edges < 0.4] *= not rests
    fine = np.arange(-1.5, SECONDS + 0.5, DT)
    window = np.hanning(round(0.25 / DT))
    smooth = np.convolve(levels[np.searchsorted(edges, fine, "right") - 1], window / window.sum(), "same")
    return lambda t: np.interp(t, fine, smooth)


def moved(how, k, time):
    """Angles at which a dynamometer holds the ankle, or to and fro at one speed."""
    if how == "isometric":
        return np.full(len(time), 1.2 + 0.2 * k)
    to_and_fro = np.interp(time * (0.3 + 0.25 * k) / 0.7 % 2.0, [0.0, 1.0, 2.0], [-1.0, 1.0, -1.0])
    window = np.hanning(round(0.2 / DT))
    return 1.7 + 0.35 * np.convolve(np.pad(to_and_fro, 100, mode="edge"), window / window.sum(), "same")[100:-100]


def made(seed, how, cause="", rests=True, trials=5):
    """A study by another integrator, and its truth; one cause may be hidden."""
    rng, time = np.random.default_rng(seed), DT * np.arange(round(SECONDS / DT))
    true = {n: rng.uniform(*ends) for n, ends in {"gain": (0.5, 0.9), "time_constant_s": (0.03, 0.08)}.items()}
    true |= {"inertia_kgm2": rng.uniform(1e-3, 3e-3), "damping_nms": rng.uniform(0.03, 0.1)}
    arm, lever = CONSTANTS["moment_arm_m"], CONSTANTS["com_distance_m"]
    late, out = DELAY * (cause == "electromechanical_delay"), []
    for k in range(trials):
        load = {"load_kg": 0.8 + 0.3 * k} if how == "free" else {}
        u = activity(rng, rests)

        def torque(q, v, act, load=load):
            bent = CONSTANTS["f0_n"] * np.maximum(
                np.exp(CONSTANTS["f1_per_rad"] * (q - CONSTANTS["theta_r_rad"])) - 1, 0
            )
            cable = arm * true["gain"] * CONSTANTS["force_scale_n"] * act - lever * bent
            moment = (cable + lever * 9.81 * load.get("load_kg", 0.0)) * np.sin(q) - true["damping_nms"] * v
            moment += CONSTANTS["foot_mass_kg"] * 9.81 * lever * np.cos(q)
            return moment - (cause == "parallel_stiffness") * 0.8 * (q - 1.6)

        def rates(t, y, u=u, torque=torque):
            moves = [y[2], torque(y[1], y[2], y[0]) / true["inertia_kgm2"]] if len(y) > 1 else []
            return [(u(t - late) - y[0]) / true["time_constant_s"], *moves]

        begin = [float(u(-late))]
        begin += [brentq(torque, 0.2, 3.0, args=(0.0, begin[0])), 0.0] if how == "free" else []
        states = solve_ivp(rates, (0.0, time[-1]), begin, "LSODA", time, max_step=0.01, rtol=1e-8, atol=1e-10).y
        if how == "free":
            columns = {"angle_rad": states[1] + 5e-4 * rng.standard_normal(len(time))}
        else:
            q = moved(how, k, time)
            v, bend = np.gradient(q, DT), np.gradient(np.gradient(q, DT), DT)
            read = torque(q, v, states[0]) - true["inertia_kgm2"] * bend
            columns = {"angle_rad": q + 2e-5 * rng.standard_normal(len(q))}
            columns["torque_nm"] = read + 0.003 * np.std(read) * rng.standard_normal(len(q))
        kind = "motion" if how == "free" else "imposed"
        out.append(fp.Trial(f"{how}{k}", kind, {"emg_envelope": np.maximum(u(time), 0.0), **columns}, time, load))
    start = {n: float(v * rng.uniform(0.75, 1.3)) for n, v in true.items()}
    return fp.Study("emg", "ankle", CONSTANTS, start, out), true


@pytest.mark.parametrize(
    ("how", "rests", "seed"), [("isometric", True, 1), ("isokinetic", False, 2), ("free", False, 3)]
)
def test_with_nothing_hidden_the_model_fits_within_the_noise(how, rests, seed):
    study, true = made(seed, how, rests=rests)
    found = fp.fit(nominal_model(study), study)
    assert not found.lack_of_fit.unexplained
    for name in ("gain", "time_constant_s"):
        assert found.parameters[name] == pytest.approx(true[name], rel=0.01)


@pytest.mark.parametrize("how", ["isokinetic", "free"])
def test_the_delay_from_emg_to_torque_is_found(how):
    study, true = made(4, how, "electromechanical_delay", rests=False)
    found = fp.fit(nominal_model(study) + fp.effects.ElectromechanicalDelay(delay_s=0.03), study)
    assert found.parameters["electromechanical_delay.delay_s"] == pytest.approx(DELAY, abs=0.002)
    assert found.parameters["time_constant_s"] == pytest.approx(true["time_constant_s"], abs=0.003)


@pytest.mark.parametrize(
    ("how", "cause", "seed"),
    [pytest.param("free", "parallel_stiffness", 5, marks=pytest.mark.long), ("isokinetic", "", 6)],
)
def test_what_is_hidden_is_named_and_no_cause_of_pulses_is_tried(how, cause, seed):
    study, _ = made(seed, how, cause)
    found = fp.diagnose(study)
    assert [one.name for one in found.causes] == [cause] * bool(cause)
    assert found.verdict == ("causes_found" if cause else "adequate")
    assert {*OF_PULSES} <= {*found.absorbed}  # act in none of the trials


def test_a_muscle_that_nobody_stimulates_has_recruitment_and_no_pulses():
    study, _ = made(7, "isokinetic", trials=2)
    rig = nominal_model(study).rig
    signals = rig.changeable("imposed", rig.input_columns(study.trials[0]))
    assert "recruitment" in signals and not {"pulse_width", "net_force"} & set(signals)
    assert rig.steered(study) is None
    frames = {"a": {"time_s": DT * np.arange(50), "emg_envelope": np.full(50, 0.2), "force_n": np.sin(np.arange(50.0))}}
    start = {"gain": 30.0, "time_constant_s": 0.05}
    muscle = fp.Study.from_frames(frames, rig="muscle", name="m", start=start)
    rig = nominal_model(muscle).rig
    assert "summation" not in rig.changeable("isometric", ("emg_envelope",))
    held = fp.simulate(nominal_model(muscle), muscle.trials[0])["force_n"]
    np.testing.assert_allclose(held, 0.2 * 30.0, rtol=1e-9)  # a contraction that is held goes on as it began


def test_new_study_takes_an_emg_for_what_it_is(tmp_path):
    from fes_pin.data.new_study import new_study
    from fes_pin.data.schema import known_rigs
    from fes_pin.data.wanted import Wanted

    settings = {n: f"{v:g}" for n, v in CONSTANTS.items()}
    rows = [f"{k / 1000:.3f},{k % 7 - 3},{100 + k % 5},{k % 9},0" for k in range(60)]
    for k, (name, stimulator) in enumerate((("EMG2", "Stim"), ("TA_EMG [mV]", "Trigger"), ("EMG", "Stim [us]"))):
        path = tmp_path / f"{k}.csv"
        path.write_text("\n".join([f"Time [s],{name},Angle [deg],Torque [Nm],{stimulator}", *rows]) + "\n")
        wanted = Wanted((path,), known_rigs()["ankle"], tmp_path, "s", settings={**settings, "emg_cutoff_hz": "6"})
        taken = {own: theirs for own, theirs, _ in new_study(wanted, lambda *_: {}).taken}
        assert taken["emg"] == name and "pulse_width_us" not in taken
        with pytest.raises(fp.InputError, match="--set emg_cutoff_hz=NUMBER"):
            new_study(Wanted((path,), known_rigs()["ankle"], tmp_path, "s", settings=settings), lambda *_: {})
