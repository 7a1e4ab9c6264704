"""A slide like a measured one, under position control, four trials of 25 s at 1 kHz: what is found, and the time.

.venv/bin/python scripts/benchmarks/show.py slide

It is made without the engine: bristles whose friction rises and falls along the way by what no cause has, an encoder
that is read in coarse counts, an effort that is felt with an offset. The last trial is held out. Both estimators are
asked: the diagnosis, and least squares of low-passed inverse dynamics.
"""

from __future__ import annotations

import json
import math
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from driven_rigs.draw import Base, urdf
from driven_rigs.laboratory import MOTIONS
from harness.effort_alone import search_effort
from harness.never_worse import model_of

import fes_pin as fp

MASS, DAMPING, FRICTION, OFFSET = 95.0, 203.5, 20.4, 3.2
"""kg, N s/m, N, N: the slide feels the recorded effort and the offset."""
WAVE, WAVE_M = 1.0, 0.05
"""Friction that rises and falls along the way: N, 1 % of the effort's root mean square, and its length, m."""
DT, SECONDS, STEP = 1e-3, 25.0, 1e-4
REACH, COUNT, READ = 0.2, 2e-5, 5e-6
"""Half of the way, an encoder's count, and noise of its reading, m."""
CONTACT, RINGS = 1e-5, 1.5e4
"""Way over which bristles bend, m, and their damping, N s/m."""
RANDOM, RANDOM_S = 0.5, 0.05
"""Deviation, N, and time constant of a random force."""
MOVED = (1, 0, 3, 1)
"""Motions of the trials: moves of minimum jerk, moves at a limited speed, sines; the last is held out."""
TARGETS = {
    "inertia_scale": ("mass", 1.0, 1.0),
    "damping": ("damping", DAMPING, 5.0),
    "coulomb_friction.torque_nm": ("dry friction", FRICTION, 5.0),
    "effort_offset.offset": ("offset of the effort", OFFSET, 10.0),
}
"""By parameter: in words, its true value, and how far off it may be, percent."""

Rows = list[tuple[str, float, float | None, str]]


def run() -> Rows:
    """Rows of (name, measured, target, unit), of the diagnosis and of inverse dynamics; both compile before."""
    with tempfile.TemporaryDirectory(prefix="slide") as folder:
        study = slide(Path(folder))
        asked: Mapping[str, Callable[[fp.Study], Any]] = {"diagnosis": fp.diagnose, "effort": search_effort}
        return [row for name, ask in asked.items() for row in answered(name, ask, study)]


def answered(name: str, ask: Callable[[fp.Study], Any], study: fp.Study) -> Rows:
    """Return what an estimator makes of the slide; `off` of a parameter that is not named is 100 %."""
    began = time.perf_counter()
    found = ask(study)
    rows: Rows = [(f"{name}: time", time.perf_counter() - began, None, "s")]
    estimates = estimates_of(found)
    for path, (words, true, most) in TARGETS.items():
        value, half = estimates.get(path, (0.0, 0.0))
        rows.append((f"{name}: {words} off by", 100.0 * abs(value / true - 1.0), most, "%"))
        inside = abs(value - true) / half if half else math.inf
        rows.append((f"{name}: {words} off by, in half intervals", inside, 1.0, ""))
    named = [cause.name for cause in found.causes]
    false = sum(n not in ("coulomb_friction", "effort_offset") for n in named)
    held = study.trials[-1]
    missed = held["position"] - fp.predict(model_of(study, found), held)["position"]
    free = 100.0 * float(np.sum(missed**2) / np.sum((held["position"] - held["position"].mean()) ** 2))
    return [
        *rows,
        (f"{name}: false stops", float("joint_stop" in named), 0.0, ""),
        (f"{name}: causes that are not there", float(false), 0.0, ", ".join(named)),
        (f"{name}: E of a free simulation of the held-out trial", free, 2.0, "%"),
    ]


def estimates_of(found: Any) -> dict[str, tuple[float, float]]:
    """Return values and half of their 95 % intervals, by the names of a diagnosis."""
    record = json.loads(found.to_json())
    many = {"": record["extended"]["parameters"], **{f"{c['name']}.": c["parameters"] for c in record["causes"]}}
    each = {f"{cause}{n}": one for cause, own in many.items() for n, one in own.items()}
    return {n: (one["value"], 0.5 * (one["high"] - one["low"])) for n, one in each.items()}


def slide(folder: Path) -> fp.Study:
    """The study: the slide is believed to be without friction, lighter and less damped."""
    trials = tuple(trial(seed, motion) for seed, motion in enumerate(MOVED))
    trials = (*trials[:-1], replace(trials[-1], role="held_out"))
    rig = folder / "rig.urdf"
    rig.write_text(urdf(Base("slide", MASS, DAMPING, 0.0, REACH, 15.0)))
    start = {"inertia_scale": 0.8, "damping": 0.6 * DAMPING}
    return fp.Study("slide", "joint", {"gravity_scale": 0.0}, start, trials, folder, {"urdf": rig})


def trial(seed: int, motion: int) -> fp.Trial:
    """Return one trial, moved as one of the laboratory's motions is.

    LuGre's friction, z' = v - |v| z / way, by semi-implicit Euler steps. Source: Canudas de Wit, Olsson, Astrom and
    Lischinsky, A new model for control of systems with friction, IEEE Transactions on Automatic Control 40 (1995).
    """
    rng, n, steps = np.random.default_rng([seed, 95]), round(SECONDS / DT), round(DT / STEP)
    wanted = REACH * MOTIONS[motion](np.arange(n) * DT, rng)
    effort, position, noise = np.empty(n), np.empty(n), rng.standard_normal((n, 2))
    q = v = z = random = rate = last = 0.0
    keeps = math.exp(-DT / RANDOM_S)
    for k in range(n):
        position[k] = COUNT * round((q + READ * noise[k, 0]) / COUNT)
        rate += 0.1 * ((position[k] - last) / DT - rate)
        last = position[k]
        effort[k] = 2000.0 * (15.0 * (wanted[k] - position[k]) - rate)
        random = keeps * random + RANDOM * math.sqrt(1.0 - keeps**2) * noise[k, 1]
        size = FRICTION + WAVE * math.sin(2.0 * math.pi * q / WAVE_M)
        for _ in range(steps):
            z = (z + STEP * v) / (1.0 + STEP * abs(v) / CONTACT)
            bristles = size / CONTACT * z + RINGS * (v - abs(v) * z / CONTACT)
            v += STEP * (effort[k] + OFFSET + random - DAMPING * v - bristles) / MASS
            q += STEP * v
    return fp.Trial(f"{seed:02d}", "motion", {"effort": effort, "position": position}, np.arange(n) * DT)
