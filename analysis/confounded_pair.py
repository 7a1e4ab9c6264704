"""A delay or a second lag? A heavier load or a shifted sensor? Data that cannot tell, and the trial that can.

.venv/bin/python analysis/confounded_pair.py        -> out/confounded_pair.png
"""

# %% The true rigs: eq. (1) solved by scipy's LSODA, no code of the engine; each hides one cause of a pair
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from fes_pin.data.study import Study
from fes_pin.data.trial import Trial
from fes_pin.diagnosis.diagnosis import diagnose_joint
from fes_pin.models.effects import effect_named
from fes_pin.models.nominal import nominal_model
from fes_pin.models.simulate import simulate
from fes_pin.paper.equation_1 import static_torque_nm
from fes_pin.search.fit import fit
from fes_pin.view.style import label

OUT = Path("out")
OUT.mkdir(exist_ok=True)
STUDIES, MOST_TRIALS, STEP_S, SECONDS = 10, 3, 0.005, 5.0
DELAY, LAG, LOAD, OFFSET = "electromechanical_delay", "second_order_activation", "load_error", "sensor_offset"
HIDDEN = {DELAY: 0.005, LAG: 0.005, LOAD: 0.0015, OFFSET: 0.0005}  # s, s, share of the load, rad
PAIRS = ((DELAY, LAG), (LOAD, OFFSET))
NOISE = {"angle_rad": 0.002, "force_n": 0.2}
RIG = {"foot_mass_kg": 0.118, "com_distance_m": 0.078, "moment_arm_m": 0.034, "force_scale_n": 58.0}
RIG |= {"threshold_us": 180.0, "saturation_us": 1000.0, "f0_n": 3.9, "f1_per_rad": 2.25, "theta_r_rad": 1.22}
START = {"gain": 0.65, "time_constant_s": 0.05, "inertia_kgm2": 1e-3, "damping_nms": 0.07}


class TrueAnkle:
    """An ankle that hides one cause."""

    def __init__(self, cause: str, seed: int) -> None:
        self.rng, self.cause = np.random.default_rng(seed), cause
        self.hidden = {n: size * (n == cause) for n, size in HIDDEN.items()}
        self.true = {n: v * math.exp(self.rng.uniform(-0.15, 0.15)) for n, v in START.items()}

    def activation(self, width: np.ndarray) -> Callable[[float], float]:
        """Exact answer of both lags, after the delay, to pulse widths held from sample to sample."""
        r = np.clip((width - RIG["threshold_us"]) / (RIG["saturation_us"] - RIG["threshold_us"]), 0.0, 1.0).tolist()
        first, second = self.true["time_constant_s"], max(self.hidden[LAG], 1e-6)
        slow, fast, share = math.exp(-STEP_S / first), math.exp(-STEP_S / second), first / (first - second)
        one, two = [0.0], [0.0]
        for level, a, b in zip(r, one, two, strict=False):  # both grow as they are read
            toward = share * (a - level)
            one.append(level + (a - level) * slow)
            two.append(level + toward * slow + (b - level - toward) * fast)

        def at(t: float) -> float:
            t = max(t - self.hidden[DELAY], 0.0)
            k = min(int(t / STEP_S + 1e-9), len(r) - 1)
            toward, since = share * (one[k] - r[k]), t - k * STEP_S
            return r[k] + toward * math.exp(-since / first) + (two[k] - r[k] - toward) * math.exp(-since / second)

        return at

    def torque(self, force: float, angle: float, rate: float, load_kg: float) -> float:
        return static_torque_nm(RIG, angle, force, load_kg) - self.true["damping_nms"] * rate

    def run(self, trial: Trial) -> Trial:
        """The trial with what is measured of it."""
        act = self.activation(trial["pulse_width_us"])
        strength = self.true["gain"] * RIG["force_scale_n"]
        if trial.kind == "isometric":
            column, true = "force_n", strength * np.array([act(t) for t in trial.time])
        else:
            column, load = "angle_rad", trial.conditions["load_kg"] * (1.0 + self.hidden[LOAD])

            def slope(t: float, x: np.ndarray) -> list[float]:
                return [x[1], self.torque(strength * act(t), x[0], x[1], load) / self.true["inertia_kgm2"]]

            rest = brentq(lambda q: self.torque(0.0, q, 0.0, load), 1.0, 2.8)
            how = {"rtol": 1e-8, "atol": 1e-10, "max_step": STEP_S, "t_eval": trial.time}
            true = solve_ivp(slope, (0.0, trial.time[-1]), [rest, 0.0], "LSODA", **how).y[0] + self.hidden[OFFSET]
        return trial.with_columns(**{column: true + NOISE[column] * self.rng.standard_normal(len(trial))})

    def study(self) -> Study:
        """Four gentle motions under two loads and one held trial."""
        time = STEP_S * np.arange(round(SECONDS / STEP_S))
        rise = np.clip(np.minimum(time - 0.4, SECONDS - 0.4 - time), 0.0, 1.0)
        trials = []
        for k in range(5):
            level = self.rng.uniform(0.5, 0.8) * rise * (0.55 - 0.45 * np.cos(2 * np.pi * (0.5 + 0.4 * k) * time))
            width = np.where(level > 0.0, np.round(180.0 + 820.0 * level), 0.0)
            kind, conditions = (
                ("motion", {"load_kg": (1.0, 1.5)[k % 2]}) if k < 4 else ("isometric", {"angle_rad": 1.9})
            )
            trials.append(self.run(Trial(f"{k}", kind, {"pulse_width_us": width}, time, conditions)))
        return Study("gentle", "ankle", RIG, START, tuple(trials))


# %% Diagnose; while the set is open, run the trial that is proposed, add it, diagnose again
def lead(diagnosis, true, other):
    """Twice the log-likelihood by which the true cause is ahead of the other one."""
    for name, sign, rival in ((true, 1.0, other), (other, -1.0, true)):
        for ranked in diagnosis.ranking.get(name, ()):
            if ranked.names == (rival,):
                return sign * ranked.shortfall
    return math.nan


def state(diagnosis, true):
    """Open, or resolved to the true cause, or wrong."""
    sets = [{c.name, *c.equivalents} for c in diagnosis.causes]
    if sets == [{true}]:
        return "resolved"
    return "open" if any(true in one for one in sets) else "wrong"


stories = {}
for pair in PAIRS:
    print(f"\n{pair[0]} or {pair[1]}\n  {'true cause':26s}{'first':>9s}  trials: its lead in twice the log-likelihood")
    for seed in range(STUDIES):
        true, other = pair if seed % 2 == 0 else pair[::-1]
        ankle = TrueAnkle(true, seed)
        study = ankle.study()
        found = [diagnose_joint(study)]
        first, expected, came, words = state(found[0], true), [], [], []
        while len(came) < MOST_TRIALS and (plan := found[-1].next_experiment) and plan.trial is not None:
            trial = ankle.run(replace(plan.trial, name=f"next{len(came)}"))
            study = replace(study, trials=(*study.trials, trial))
            found.append(diagnose_joint(study))
            rival = next(n for n in plan.separates[::-1] if n != true)
            before, after = (lead(d, true, rival) for d in found[-2:])
            expected.append(plan.expected[plan.separates.index(true)] if true in plan.separates else math.nan)
            came.append(after - before)
            numbers = f"{before:.1f} -> {after:.1f} ({came[-1]:.0f}, expected {expected[-1]:.0f})"
            words.append(numbers if math.isfinite(came[-1] + expected[-1]) else f"for {' | '.join(plan.separates)}")
        last = state(found[-1], true)
        if last != "resolved":
            words.append(" ".join(" | ".join((c.name, *c.equivalents)) for c in found[-1].causes) or "nothing is named")
        stories[pair, seed] = (true, first, last, expected, came, found)
        print(f"  {true:26s}{first:>9s}  {'; '.join(words)}{'; ' if words else ''}{last}")

# %% The picture: the first study's proposed trial, what both rivals had said of it, and all leads before and after
true, _, _, expected, came, found = stories[PAIRS[0], 0]
before, trial = found[0].study, found[1].study.trials[-1]
column = "force_n" if trial.kind == "isometric" else "angle_rad"
said = {}
for name in PAIRS[0]:
    rival = fit(nominal_model(before) + effect_named(name)(), before.trials, found[0].extended.noise)
    said[name] = simulate(rival.model, trial)[column]
colours = {DELAY: "tab:orange", LAG: "tab:blue", LOAD: "tab:orange", OFFSET: "tab:blue"}
words = {DELAY: "delay", LAG: "second lag", LOAD: "load error", OFFSET: "sensor offset"}
middle = np.abs(trial.time - SECONDS / 2) < SECONDS / 4
most = trial.time[np.argmax(np.abs(said[DELAY] - said[LAG]) * middle)]
figure, ((stimulus, leads), (near, evidence)) = plt.subplots(2, 2, figsize=(12, 7.5), constrained_layout=True)
stimulus.plot(trial.time, trial["pulse_width_us"], "k", lw=0.9)
stimulus.axvspan(most - 0.04, most + 0.04, color="0.75")
conditions = ", ".join(f"{n} = {v:g}" for n, v in trial.conditions.items())
stimulus.set(xlabel="time (s)", ylabel="pulse width (µs)", title=f"proposed: {trial.kind}, {conditions}")
for name, y in said.items():
    near.plot(trial.time, y, color=colours[name], lw=2.5, label=f"predicted with a {words[name]}")
near.plot(trial.time, trial[column], "k.", ms=5, label=f"measured; true: {words[true]}")
window = np.abs(trial.time - most) < 0.04
near.set(
    xlim=(most - 0.04, most + 0.04), xlabel="time (s)", ylabel=label(column), title="at one of its edges (grey above)"
)
near.set_ylim(trial[column][window].min() - 1.0, trial[column][window].max() + 1.0)
near.legend(fontsize=10)
false = LAG if true == DELAY else DELAY
missed = {n: (trial[column] - y) ** 2 / NOISE[column] ** 2 for n, y in said.items()}
evidence.plot(trial.time, np.cumsum(missed[false] - missed[true]), "k", label="rivals as fitted to the study")
evidence.axhline(expected[0], color="tab:green", ls="--", label="expected, the wrong one fitted again")
evidence.axhline(came[0], color="tab:red", ls=":", label="came, both fitted again")
evidence.set(
    xlabel="time (s)", ylabel="twice the log-likelihood", title=f"evidence for the {words[true]} as the trial runs"
)
evidence.legend(fontsize=10)
for place, pair in enumerate(PAIRS):
    for seed in range(STUDIES):
        hid, _, _, _, runs, all_of = stories[pair, seed]
        if runs:
            heights = [lead(d, hid, pair[1 - pair.index(hid)]) for d in all_of]
            at = 5 * place + np.arange(len(heights))
            leads.plot(at, heights, "o-", color=colours[hid], ms=5, lw=1.2)
leads.axhspan(-2.71, 2.71, color="0.9")
leads.set_yscale("symlog", linthresh=5.0)
leads.set(xlim=(-0.5, 8.5), ylim=(-10.0, 1e4))
leads.set_xticks([0, 1, 5, 6, 7, 8], ["study", "+ trial", "study", "+ 1", "+ 2", "+ 3"])
leads.set(
    ylabel="lead of the true cause\n(twice the log-likelihood)", title="ten studies of each pair; grey: still open"
)
leads.text(-0.3, 7e3, "true: delay (orange),\nsecond lag (blue)", va="top")
leads.text(8.3, 7e3, "true: load error (orange),\nsensor offset (blue)", va="top", ha="right")
figure.savefig(OUT / "confounded_pair.png", dpi=100)

# %% The answer
for pair in PAIRS:
    of = [stories[pair, seed] for seed in range(STUDIES)]
    open_ = [one for one in of if one[1] == "open"]
    ends = [one[2] for one in open_]
    share = [c / p for one in open_ for c, p in zip(one[4], one[3], strict=True) if math.isfinite(c + p)]
    once = sum(one[2] == "resolved" and len(one[4]) == 1 for one in open_)
    ahead = sum(lead(one[5][0], one[0], pair[1 - pair.index(one[0])]) > 0.0 for one in open_)
    print(
        f"{pair[0]} or {pair[1]}: {len(open_)} of {STUDIES} studies could not tell (the true one ahead in {ahead}); "
        f"the proposed trial resolved {once} to the true cause, up to {MOST_TRIALS} of them {ends.count('resolved')}, "
        f"open {ends.count('open')}, wrong {ends.count('wrong')}; what came over what was expected: median "
        f"{np.median(share):.2f}, {min(share):.2f} to {max(share):.2f}"
    )
