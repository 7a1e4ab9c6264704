"""How well can pulse widths make a wanted ankle torque, when the muscle lags and the nerve has play?

The paper's rig: one nerve, threshold 180 us, saturation 1 ms, 45 Hz, a lag of 0.05 s, a muscle of about 60 N at 34 mm.
Four ways to choose the pulse widths for the same torque are simulated with the play of the nerve.
Run the cells, or `python analysis/allocate_ankle.py`; the picture goes to out/allocate_ankle.png.
"""

# %% The rig and the torque that is wanted
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import fes_pin as fp

RATE_HZ, LAG_S, TORQUE_NM, PLAY_US, STEPS = 45.0, 0.05, 0.034 * 60.0, 25.0, 10
curve = fp.LinearRecruitment(180.0, 1000.0)
time = np.arange(int(3 * RATE_HZ)) / RATE_HZ
ahead = np.arange(len(time) + STEPS + 1) / RATE_HZ
wanted = TORQUE_NM * (0.35 + 0.25 * np.sin(2 * np.pi * 1.2 * ahead) + 0.12 * np.sign(np.sin(2 * np.pi * 0.5 * ahead)))
keep = np.exp(-1.0 / RATE_HZ / LAG_S)

# %% Four ways to choose recruitment, pulse by pulse; what pulse k makes is seen at pulse k + 1
program = fp.Allocator([[TORQUE_NM]], recruitment=curve, effort=1e-8)
static = program.sequence(wanted[1 : len(time) + 1, None]).recruitment[:, 0]
inverse = fp.invert_lag(static[:, None], 1.0 / RATE_HZ, LAG_S, start=[0.0])[:, 0]


def receding(**options):
    horizon = fp.Horizon(
        fp.Allocator([[TORQUE_NM]], recruitment=curve, effort=1e-8, **options), 1 / RATE_HZ, LAG_S, steps=STEPS
    )
    plans = [horizon.advance(wanted[k + 1 : k + 1 + STEPS, None]) for k in range(len(time))]
    return np.array([p.recruitment[0, 0] for p in plans]), plans


free, _ = receding()
limited, plans = receding(rate=0.12)
ways = {
    "torque of now": (static, False),
    "inverse of the lag": (inverse, False),
    "horizon": (free, False),
    "horizon, knows the play": (free, True),
    "horizon, at most 0.12 a pulse, knows the play": (limited, True),
}


# %% Simulated with a nerve that has play
def simulate(recruitment, knows_play):
    play, act, torque, widths = fp.Hysteresis(curve, PLAY_US), 0.0, [], []
    for r in recruitment:
        width = play.pulse_width_us(r) if knows_play else float(curve.pulse_width_us(r))
        act = keep * act + (1 - keep) * play.recruitment(width)
        torque.append(TORQUE_NM * act)
        widths.append(width)
    return np.array(torque), np.array(widths)


goal, results = wanted[1 : len(time) + 1], {}
for name, (recruitment, knows_play) in ways.items():
    torque, widths = simulate(recruitment, knows_play)
    assert ((widths == 0) | ((widths >= 180) & (widths <= 1000))).all()
    results[name] = torque, widths, 100 * np.sqrt(np.mean((torque - goal) ** 2)) / TORQUE_NM
    print(f"{name:48s} rms torque error {results[name][2]:5.2f} % of the muscle's torque")

# %% The picture
figure, axes = plt.subplots(2, 1, figsize=(10, 6.4), sharex=True, constrained_layout=True)
colours = ("tab:gray", "tab:green", "tab:blue", "tab:orange", "tab:red")
axes[0].plot(time + 1 / RATE_HZ, goal, color="black", lw=2.5, label="wanted")
for (name, (torque, widths, error)), colour in zip(results.items(), colours, strict=True):
    axes[0].plot(time + 1 / RATE_HZ, torque, color=colour, lw=1.3, label=f"{name}: {error:.1f} %")
    axes[1].step(time, widths, color=colour, lw=1.2, where="post")
axes[0].set(ylabel="ankle torque (N m)", title="The paper's ankle, a nerve with 25 us of play")
axes[0].set_ylim(-0.1, 2.35)
axes[0].legend(fontsize=8, ncols=2, loc="upper left")
axes[1].axhspan(0, 180, color="0.9", lw=0)
axes[1].text(0.02, 90, "below threshold: never used, except 0", fontsize=8, va="center")
axes[1].set(ylabel="pulse width (us)", xlabel="time (s)", ylim=(0, 1030), xlim=(0, time[-1]))
out = Path("out")
out.mkdir(exist_ok=True)
figure.savefig(out / "allocate_ankle.png", dpi=110)

# %% The number
first, best = results["torque of now"][2], results["horizon, knows the play"][2]
print(f"Looking {STEPS} pulses ahead and undoing the play: rms torque error {first:.1f} % -> {best:.1f} %.")
