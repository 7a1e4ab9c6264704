"""What changes on a slope: how the body falls, or what it takes to hold it?

The ground enters as the paper has it, by alpha, the forward component of its unit normal (positive: downhill ahead).
Run the cells, or `python analysis/body_on_a_slope.py`; the picture goes to out/body_on_a_slope.png.
"""

# %% Mid-stance on slopes up to 20 %, square to the ground, or kept upright by the stance ankle
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import fes_pin as fp

body = fp.Body.from_subject(mass_kg=72.6, height_m=1.80, sex="male", stance="right")
level = fp.posture_angles("mid_stance", "right")
ANKLE, HIP, KNEE = "right_ankle_dorsiflexion", "right_hip_flexion", "right_knee_flexion"
grades = np.linspace(-0.2, 0.2, 41)
rows = {"square to the ground": [], "kept upright by the ankle": []}
for grade in grades:  # grade: rise over run, uphill positive
    angle = np.arctan(grade)
    slope = (-np.sin(angle), 0.0)
    upright = level | {ANKLE: level[ANKLE] + angle}
    for label, posture in zip(rows, (level, upright), strict=True):
        linear = fp.linearize(body, posture, slope)
        torque = linear.holding_torque
        slow = [mode.rate for mode in linear.modes().falling]
        rows[label].append([torque[ANKLE], torque[KNEE], torque[HIP], slow[0], slow[-1], linear.modes()[0].rate])
rows = {label: np.array(values) for label, values in rows.items()}

# %% The answer
flat = len(grades) // 2
for label, values in rows.items():
    per_percent = np.gradient(values[:, 0], 100 * grades)[flat]
    spread = 50.0 * np.ptp(values[:, 4]) / values[flat, 4]
    print(f"{label:26s} ankle {per_percent:+6.2f} N m for each percent; slowest fall's rate within {spread:.1f} %")
square = np.gradient(rows["square to the ground"][:, 0], 100 * grades)[flat]
print(
    f"\nA slope changes what must be held (C), not how the body falls (A, B): {abs(square):.1f} N m at the ankle "
    "for each percent\nif the body leans with the ground, nothing if the ankle turns with it."
)

# %% Picture
figure, (left, right) = plt.subplots(1, 2, figsize=(10, 4.2))
for (label, values), style in zip(rows.items(), ("-", "--"), strict=True):
    for k, name in enumerate(("ankle dorsiflexion", "knee flexion", "hip flexion")):
        left.plot(100 * grades, values[:, k], style, color=f"C{k}", label=f"{name}, {label}")
    right.plot(100 * grades, values[:, 4], style, color="tab:red", label=label)
left.set(
    xlabel="grade, % (uphill +)", ylabel="torque that holds mid-stance, N m", title="What holds the stance leg (C)"
)
left.legend(fontsize=7)
right.set(xlabel="grade, %", ylabel="rate of the slowest fall, 1/s", title="How it falls (A⁻¹B)")
right.set_ylim(0, 4)
right.legend(fontsize=7)
figure.tight_layout()
Path("out").mkdir(exist_ok=True)
figure.savefig("out/body_on_a_slope.png", dpi=110)
