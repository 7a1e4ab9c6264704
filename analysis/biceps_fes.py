"""How well can the force of an unseen train of pulses be predicted?

A human biceps under surface stimulation, twenty trains of thirty pulses at 31 Hz, one every two seconds (public data).
Models of the literature are ranked on whole trains left out. What they all miss is then taken apart: how much of it any
model could have, how much is a train's own, whether something before a train predicts that, and how much of it the
first 0.3 s of the train tell.
Run the cells, or `python analysis/biceps_fes.py`; the picture goes to out/biceps_fes.png.
"""

# %% The trials, and the models of the literature on whole trains left out
import sys
from itertools import islice
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import fes_pin as fp
from fes_pin.comparison.held_out import own_part, pairs_of
from fes_pin.comparison.literature import published_model
from fes_pin.data.datasets import fetch
from fes_pin.data.errors import InputError
from fes_pin.identify.fit import fit_problem
from fes_pin.identify.problem import Problem
from fes_pin.infer.noise import Noise

OUT = Path("out")
try:
    STUDY = fp.read_study(fetch("biceps_fes"))
except InputError as error:
    print(f"biceps_fes: {error}", file=sys.stderr)
    raise SystemExit(2) from None
GIVEN_S = 0.3
ranked = fp.compare(STUDY, given_s=GIVEN_S)
print(ranked)

# %% Leave each train out: the best model, a template without any model, and what only the train itself tells
TRAINS, WHITE = STUDY.trials, {"force_n": Noise(1.0, (), 1.0)}
SHORTEST = min(len(t) for t in TRAINS)
FORCE = np.array([t["force_n"][:SHORTEST] for t in TRAINS])
START = np.array([t.conditions["start_s"] for t in TRAINS])
PULSES = np.array([t["stim"].sum() for t in TRAINS])
name = ranked.models[0].name
model = published_model(name).model(fp.nominal_model(STUDY), TRAINS) if name != "nominal" else fp.nominal_model(STUDY)


def left_out(k):
    return [t for i, t in enumerate(TRAINS) if i != k]


FITS = [fit_problem(Problem(model, left_out(k), WHITE), model.parameters()) for k in range(len(TRAINS))]
WHOLE = [t["force_n"] for t in TRAINS]
PREDICTED = [fp.simulate(f.model, t)["force_n"] for f, t in zip(FITS, TRAINS, strict=True)]
TEMPLATE = [np.delete(FORCE, k, axis=0).mean(axis=0) for k in range(len(TRAINS))]


def pooled(errors):
    """Root mean square over trains, each of the same weight."""
    return float(np.sqrt(np.mean([np.mean(np.square(e)) for e in errors])))


def times(strengths):
    return pooled([y - s * f for y, s, f in zip(WHOLE, strengths, PREDICTED, strict=True)])


own = np.array([y @ f / (f @ f) for y, f in zip(WHOLE, PREDICTED, strict=True)])
free, known = times(np.ones(len(own))), times(own)
template = pooled(FORCE - np.array(TEMPLATE))
print(
    f"whole trains, never fitted: {name} {free:.2f} N; over {SHORTEST} ms the mean of all other trains {template:.2f} N"
)
print(f"{name}, times each train's own strength, which only the train itself tells: {known:.2f} N")

# %% Does anything before a train predict its strength? Each predictor by least squares on the other trains
BEFORE = {
    "time in the session": START,
    "time and its square": np.column_stack([START, START**2]),
    "the train before": np.concatenate([own[:1], own[:-1]]),
    "the three before": np.array([own[max(0, k - 3) : k].mean() if k else own[0] for k in range(len(own))]),
    "the pause before": np.diff(START, prepend=START[0] - np.median(np.diff(START))),
    "number of pulses": PULSES,
}


def by_the_others(predictor, strengths):
    """Strength of each train as a line through the other trains tells it."""
    design = np.column_stack([np.ones(len(strengths)), predictor])
    lines = [
        np.linalg.lstsq(np.delete(design, k, 0), np.delete(strengths, k), rcond=None)[0] for k in range(len(strengths))
    ]
    return np.sum(design * np.array(lines), axis=1)


predicted_by = {label: times(by_the_others(predictor, own)) for label, predictor in BEFORE.items()}
for label, missed in predicted_by.items():
    print(f"  strength by {label}: {missed:.2f} N")
following = np.corrcoef(own[1:], own[:-1])[0, 1]
rng = np.random.default_rng(0)
shuffled = [np.corrcoef(x[1:], x[:-1])[0, 1] for x in (rng.permutation(own) for _ in range(5000))]
chance = float(np.mean(np.abs(shuffled) >= abs(following)))
print(f"correlation of a train's strength with that of the train before: {following:.2f} (p = {chance:.2f})")
few = np.flatnonzero(PULSES.max() > PULSES)
print(f"trains of {PULSES.min():.0f} pulses, not {PULSES.max():.0f}: {few}, strengths {own[few].round(2)}")

# %% The first 0.3 s of a train given: what the model then predicts, alone and with what all trains have in common
rest, alone, shared, predicted_rest = [], [], [], {}
for k, (fitted, train) in enumerate(zip(FITS, TRAINS, strict=True)):
    step = round(4e-3 / train.dt)
    begun, end = round(GIVEN_S / (step * train.dt)), SHORTEST // step
    others = [(r[:end], j[:end]) for r, j in pairs_of(fitted, left_out(k))]
    r, j = (x[:end] for x in pairs_of(fitted, [train])[0])
    rest.append(r[begun:])
    alone.append(own_part(others, [begun] * len(others)).left((r, j), begun))
    common = np.mean([r for r, _ in others], axis=0)
    differs = own_part([(r - common, j) for r, j in others], [begun] * len(others))
    shared.append(differs.left((r - common, j), begun))
    predicted_rest[k] = (np.arange(begun, end) * step * train.dt, shared[-1])
free_rest, from_model, from_both = (pooled(x) for x in (rest, alone, shared))
print(f"what follows of a train after {GIVEN_S} s: free {free_rest:.2f} N, its beginning given {from_model:.2f} N,")
print(f"and with what all other trains show beyond the model {from_both:.2f} N")
print("So nothing before a train predicts more than 29 or 30 pulses do: the strength of a train remains its own.")

# %% Three trains from their first 0.3 s, their strengths over the session, and what each step is worth
figure, axes = plt.subplots(1, 3, figsize=(14, 4.2), width_ratios=(1.6, 1.2, 1.5))
for k, colour in ((2, "C0"), (9, "C1"), (16, "C2")):
    time = np.arange(SHORTEST) * TRAINS[k].dt
    axes[0].plot(time, FORCE[k], color=colour, lw=0.8, zorder=3)
    late, left = predicted_rest[k]
    step = round(4e-3 / TRAINS[k].dt)
    measured = FORCE[k][: SHORTEST // step * step].reshape(-1, step).mean(axis=1)[-len(left) :]
    axes[0].plot(late, measured - left, color=colour, lw=2.4, alpha=0.5, label=f"train {k}: {pooled([left]):.1f} N")
axes[0].axvline(GIVEN_S, color="0.7", lw=0.8)
axes[0].set(title="measured (thin), predicted from the first 0.3 s", xlabel="time, s", ylabel="force, N")
axes[0].legend(fontsize=8, loc="lower center")
axes[1].plot(START, own, "o-", color="0.4", ms=4, lw=0.6)
axes[1].plot(START[few], own[few], "s", color="C3", ms=6, label=f"{PULSES.min():.0f} pulses")
axes[1].legend(fontsize=8)
axes[1].set(title=f"from train to train r = {following:.2f}", xlabel="time in the session, s", ylabel="strength")
steps = {
    **{m.name: m.rmse["force_n"]["free"] for m in reversed(ranked.models)},
    "mean of other trains": template,
    f"{name}, train left out": free,
    **{f"+ {n}": predicted_by[n] for n in ("time in the session", "the train before", "number of pulses")},
    "+ its own strength": known,
    "after 0.3 s, free": free_rest,
    "first 0.3 s given": from_model,
    "+ common to all": from_both,
}
groups = {
    "0.7": ("models of the literature", len(ranked.models)),
    "C0": ("its own train left out", 6),
    "C3": ("after 0.3 s", 3),
}
rows = iter(steps.items())
for colour, (group, count) in groups.items():
    bars = axes[2].barh(*zip(*islice(rows, count), strict=True), color=colour, label=group)
    axes[2].bar_label(bars, fmt="%.2f", fontsize=7, padding=2)
axes[2].legend(fontsize=7, loc="lower right", title="error of", title_fontsize=7)
axes[2].invert_yaxis()
axes[2].set(xlabel="root mean squared error, N", title="error, whole trains and after 0.3 s", xlim=(0, 8.4))
axes[2].tick_params(axis="y", labelsize=7)
figure.tight_layout()
OUT.mkdir(exist_ok=True)
figure.savefig(OUT / "biceps_fes.png", dpi=110)
