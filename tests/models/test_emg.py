"""EMG as the activation of a voluntary muscle: its envelope, its scale, and the delay to the force."""

import numpy as np
import pytest

import fes_pin as fp
from fes_pin.models.nominal import nominal_model

START = {"gain": 30.0, "time_constant_s": 0.05}


def voluntary(rng, delay=0.05, trials=2, **constants):
    """Trials of raw EMG, noise whose deviation is the activation, and of the force that a lag makes of it, late."""
    dt, n, frames, true = 0.001, 8000, {}, []
    for k in range(trials):
        steps = np.repeat(rng.uniform(0.0, 1.0, n // 1000 + 1), 1000)[: n + 400]
        effort = np.convolve(np.r_[np.zeros(400), steps], np.hanning(400) / np.hanning(400).sum(), "same")[
            400 : 400 + n
        ]
        late = np.concatenate([np.zeros(round(delay / dt)), effort])[:n]
        force, now = np.zeros(n), 0.0
        for i in range(n):
            force[i] = now
            now += (late[i] - now) * -np.expm1(-dt / 0.08)
        raw = 1e-4 * effort * rng.standard_normal(n) + 3e-4 + 5e-5 * np.sin(2.0 * np.pi * 0.5 * dt * np.arange(n))
        frames[f"t{k}"] = {"time_s": dt * np.arange(n), "emg": raw, "force_n": 80.0 * force + rng.normal(0.0, 0.3, n)}
        true.append(effort)
    return fp.Study.from_frames(frames, rig="muscle", name="v", constants=constants, start=START), true


def test_the_envelope_is_the_activation_and_says_how_it_was_made():
    study, true = voluntary(np.random.default_rng(0), emg_cutoff_hz=4.0)
    for trial, effort in zip(study.trials, true, strict=True):
        assert set(trial.columns) == {"emg_envelope", "force_n"}
        assert "rectified, low-passed at 4 Hz without delay, and divided by its maximum" in trial.remarks[-1]
        assert trial["emg_envelope"].min() >= 0.0
        assert np.corrcoef(trial["emg_envelope"], effort)[0, 1] > 0.95  # an offset and what moves slowly are no effort
    assert max(t["emg_envelope"].max() for t in study.trials) == 1.0
    # the mean of |x| of noise is sqrt(2 / pi) of its deviation: that is the envelope at an activation of 1
    stated, true = voluntary(np.random.default_rng(0), emg_cutoff_hz=4.0, emg_mvc=1e-4 * np.sqrt(2.0 / np.pi))
    slope = [t["emg_envelope"] @ e / (e @ e) for t, e in zip(stated.trials, true, strict=True)]
    np.testing.assert_allclose(slope, 1.0, atol=0.05)


@pytest.mark.parametrize(("delay", "seed"), [(0.03, 1), (0.08, 2)])
def test_the_delay_from_emg_to_force_is_found(delay, seed):
    study, _ = voluntary(np.random.default_rng(seed), delay, emg_cutoff_hz=4.0, emg_mvc=1e-4 * np.sqrt(2.0 / np.pi))
    model = nominal_model(study).with_parameters({"gain": 60.0})
    with pytest.warns(fp.InputWarning, match="divided by that of an MVC"):
        found = fp.fit(model + fp.effects.ElectromechanicalDelay(delay_s=0.02), study, least_squares=True)
    total = found.parameters["electromechanical_delay.delay_s"] + found.parameters["time_constant_s"]
    assert total == pytest.approx(delay + 0.08, abs=0.02)  # a lag of slow effort is a delay of as much
    assert found.parameters["gain"] == pytest.approx(80.0, rel=0.1)


def test_what_an_envelope_needs_is_asked(tmp_path):
    with pytest.raises(fp.InputError, match=r"expected emg_cutoff_hz in \[rig\], the cut-off of its envelope"):
        voluntary(np.random.default_rng(0), trials=1)
    with pytest.raises(fp.InputError, match="below half the rate; found 600 Hz at 1000 Hz"):
        voluntary(np.random.default_rng(0), trials=1, emg_cutoff_hz=600.0)
    study, _ = voluntary(np.random.default_rng(0), trials=1, emg_cutoff_hz=4.0)
    raw = fp.Trial("raw", "isometric", {"emg": np.ones(100)}, 0.001 * np.arange(100))
    with pytest.raises(fp.InputError, match="expected emg_envelope: a study with emg_cutoff_hz makes it of emg"):
        fp.simulate(nominal_model(study), raw)
    fp.write_study(study, tmp_path / "again")
    again = fp.read_study(tmp_path / "again")  # an envelope is not made of an envelope
    np.testing.assert_array_equal(again.trials[0]["emg_envelope"], study.trials[0]["emg_envelope"])
