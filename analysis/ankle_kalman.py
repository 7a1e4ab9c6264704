"""How soon does a Kalman filter know a muscle's gain and time constant? The paper's figures 3 and 4, with bands.

.venv/bin/python analysis/ankle_kalman.py        -> out/ankle_kalman.png
"""

# %% One isometric trial of the twin of 3-23: steps of all sizes, pulses at 45 Hz, 0.2 N of noise
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from paper_ankle.consistency import chi2_band, nees
from paper_ankle.constants import FORCE_NOISE_N, HELD_AT_RAD, isometric_stimulus, paper_study, paper_twin
from paper_ankle.regression import RegressionFilter
from paper_ankle.twin import record, staircase

import fes_pin as fp
from fes_pin.infer.noise import Noise
from fes_pin.models.nominal import nominal_model
from fes_pin.models.simulate import simulate
from fes_pin.paper.kalman import StraightRecruitment, history_of
from fes_pin.search.fit import fit

OUT = Path("out")
OUT.mkdir(exist_ok=True)
twin = paper_twin("3-23")


def isometric(stimulus, seed, noise=FORCE_NOISE_N):
    return record(twin, stimulus, "held", held_at_rad=HELD_AT_RAD, noise_std=noise, seed=seed)


trial = isometric(isometric_stimulus(8.0), 1)
history = fp.track_gain(trial, twin.constants(), FORCE_NOISE_N)
noisy = isometric(isometric_stimulus(8.0), 1, 1.0)
plain = history_of(RegressionFilter(noisy.dt, StraightRecruitment.of(twin.constants()), 1.0), noisy)
ours = fp.track_gain(noisy, twin.constants(), 1.0)

# %% Is its band honest? NEES over 60 trials, NIS within each
runs, squares, innovations = 60, [], []
for seed in range(2000, 2000 + runs):
    one = isometric(isometric_stimulus(5.25), seed)
    tracker = fp.GainFilter(one.dt, StraightRecruitment.of(twin.constants()), FORCE_NOISE_N)
    for k, (force, width) in enumerate(zip(one["force_n"], one["pulse_width_us"], strict=True)):
        tracker.step(force, width)
        if k >= 225:
            innovations.append(tracker.nis)
        if k == 1125:
            squares.append(nees(tracker, twin.gain, twin.time_constant_s))

# %% The same by a batch fit, and a step with its simulation
batch = fit(nominal_model(paper_study("3-23")), [trial], {"force_n": Noise(FORCE_NOISE_N)})
step = isometric(staircase([(0.1, 0.0), (0.4, 1000.0), (0.3, 0.0)]), 77)
known = batch.model.with_parameters({"gain": history.gain[-1], "time_constant_s": history.time_constant_s[-1]})
simulated = simulate(known, step)

# %% The picture
figure, (top, middle, bottom) = plt.subplots(3, 1, figsize=(8, 9), constrained_layout=True)
for axis, value, std, truth, label in (
    (top, history.gain, history.gain_std, 0.65, "gain $K$"),
    (middle, 1e3 * history.time_constant_s, 1e3 * history.time_constant_std_s, 50.0, r"time constant $\tau$ (ms)"),
):
    axis.fill_between(history.time, value - 1.96 * std, value + 1.96 * std, color="tab:blue", alpha=0.25)
    axis.plot(history.time, value, color="tab:blue", lw=2, label="estimate and its 95 % band")
    axis.axhline(truth, color="k", ls="--", lw=1, label="truth (the paper's value)")
    axis.set_ylabel(label, fontsize=13)
    axis.set_ylim(0.8 * truth, 1.2 * truth)
    axis.set(xscale="log", xlim=(0.05, 8.0))
    axis.set_xlabel("time (s)", fontsize=12)
    axis.legend(fontsize=11, loc="lower right")
top.set_title("Figure 3: history of both estimates", fontsize=13)
bottom.plot(step.time, simulated["force_n"], color="tab:orange", lw=3, label="simulated")
bottom.plot(step.time, step["force_n"], color="k", lw=0.8, label="measured (twin)")
bottom.set_title("Figure 4: a step that took no part", fontsize=13)
bottom.set_xlabel("time (s)", fontsize=12)
bottom.set_ylabel("force (N)", fontsize=13)
bottom.legend(fontsize=11)
figure.savefig(OUT / "ankle_kalman.png", dpi=110)

# %% The numbers
gain, tau = history.at(5.0)
low, high = chi2_band(2, runs)
low1, high1 = chi2_band(1, len(innovations))
print(f"after 5 s: K = {gain:.4f} ({100 * (gain / 0.65 - 1):+.2f} %), ", end="")
print(f"tau = {1e3 * tau:.2f} ms ({100 * (tau / 0.05 - 1):+.2f} %)")
print(f"NEES at 5 s {np.mean(squares):.3f}, 95 % band [{low:.3f}, {high:.3f}] ({runs} trials)")
print(f"NIS {np.mean(innovations):.4f}, 95 % band [{low1:.4f}, {high1:.4f}]")
for label, k, k_std, t in (
    ("batch fit", batch.values["gain"], batch.std("gain"), batch.values["time_constant_s"]),
    ("Kalman", history.gain[-1], history.gain_std[-1], history.time_constant_s[-1]),
):
    print(f"{label:10s} K = {k:.4f} (standard deviation {k_std:.4f}), tau = {1e3 * t:.2f} ms")
print(f"noise of 1 N: plain regression finds tau = {1e3 * plain.at(8)[1]:.1f} ms, ours {1e3 * ours.at(8)[1]:.1f} ms")
error = step.residual(simulated, "force_n")
print(f"figure 4: residual {np.std(error):.3f} N RMS, noise {FORCE_NOISE_N} N")
