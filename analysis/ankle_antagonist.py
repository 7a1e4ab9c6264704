"""What does the passive antagonist do, and how much of its uncertainty ends up in k1, k2 and k3?

.venv/bin/python analysis/ankle_antagonist.py        -> out/ankle_antagonist.png
"""

# %% Hang loads, read angles, no stimulation: eight loads, three readings each, 2 mrad of noise
from dataclasses import replace
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from paper_ankle.carried import carried_covariance, with_antagonist
from paper_ankle.constants import ANGLE_NOISE_RAD, paper_trial, paper_twin
from paper_ankle.error_region import profile_intervals
from paper_ankle.ratios import RATIOS, RatioProblem, ankle_of, least_error

import fes_pin as fp
from fes_pin.paper.equation_1 import GRAVITY

OUT = Path("out")
OUT.mkdir(exist_ok=True)
twin = paper_twin("3-23")
loads = np.repeat([0.2, 0.5, 0.8, 1.0, 1.2, 1.5, 2.0, 2.5], 3)
true = np.array([replace(twin, load_kg=m).rest_angle() for m in loads])
angles = true + ANGLE_NOISE_RAD * np.random.default_rng(3).standard_normal(len(loads))
curve = fp.fit_antagonist(loads, angles, ANGLE_NOISE_RAD, twin.foot_mass_kg)
print(curve)

# %% Carry it on to the ratios
problem = RatioProblem(with_antagonist(ankle_of(twin), curve.constants), [paper_trial("3-23")])
optimum = least_error(problem)
noise = profile_intervals(problem, optimum, ANGLE_NOISE_RAD)
carried = np.sqrt(np.diag(carried_covariance(problem, optimum, curve)))
for k, name in enumerate(RATIOS):
    own = np.log(noise.maximum(name) / noise.minimum(name)) / 2 / 1.96
    value = optimum.ratios[name]
    print(f"{name} = {value:.2f}, standard deviation {100 * own:.1f} % from noise, {100 * carried[k]:.1f} % from F_ANT")

# %% The picture
grid = np.linspace(1.2, 2.3, 200)
figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4.5), constrained_layout=True)
left.fill_between(
    np.degrees(grid),
    curve.force(grid) - 20 * curve.force_std(grid),
    curve.force(grid) + 20 * curve.force_std(grid),
    color="tab:blue",
    alpha=0.25,
    label="95 % band, ten times as wide",
)
left.plot(np.degrees(grid), curve.force(grid), color="tab:blue", lw=2, label="fitted")
held = loads * GRAVITY + twin.foot_mass_kg * GRAVITY / np.tan(angles)
left.plot(np.degrees(angles), held, "ko", ms=4, label="loads and rest angles")
left.set_xlabel("angle (deg)", fontsize=13)
left.set_ylabel(r"$F_{ANT}$ (N)", fontsize=13)
left.legend(fontsize=11)
right.plot(loads, 1e3 * curve.residual, "ko", ms=4)
right.axhspan(-1e3 * 1.96 * ANGLE_NOISE_RAD, 1e3 * 1.96 * ANGLE_NOISE_RAD, color="0.9", label="95 % of the noise")
right.set_xlabel("load (kg)", fontsize=13)
right.set_ylabel("angle: measured - fitted (mrad)", fontsize=13)
right.legend(fontsize=11)
figure.savefig(OUT / "ankle_antagonist.png", dpi=110)
truth = np.array([twin.antagonist(q) for q in grid])
print(
    f"greatest error of F_ANT over 70 to 130 degrees: {np.abs(curve.force(grid) - truth).max():.3f} N, "
    f"greatest standard deviation {curve.force_std(grid).max():.3f} N"
)
