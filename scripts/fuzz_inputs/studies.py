"""Small studies that are right: what is made odd or spoilt afterwards."""

from __future__ import annotations

import functools
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from fes_pin.data.study import Study
from fes_pin.data.trial import Trial
from fes_pin.models.nominal import nominal_model
from fes_pin.models.simulate import Simulator

RIGS = ("ankle", "joint", "slide", "muscle", "pulsed")
NOISE = {"angle_rad": 2e-3, "position": 2e-3, "velocity": 2e-2, "force_n": 0.2}
THRESHOLD_US, SATURATION_US = 180.0, 1000.0
ANKLE = {
    **{"foot_mass_kg": 0.115, "com_distance_m": 0.08, "moment_arm_m": 0.035, "force_scale_n": 58.0},
    **{"threshold_us": THRESHOLD_US, "saturation_us": SATURATION_US},
    **{"f0_n": 4.0, "f1_per_rad": 2.2, "theta_r_rad": 1.2},
}
ANKLE_START = {"gain": 0.65, "time_constant_s": 0.05, "inertia_kgm2": 1.1e-3, "damping_nms": 0.075}
URDF = """<?xml version="1.0"?>
<robot name="rig">
  <link name="base"/>
  <link name="arm"><inertial>
    <origin xyz="0 0 -0.18"/><mass value="0.6"/>
    <inertia ixx="2e-3" ixy="0" ixz="0" iyy="2e-3" iyz="0" izz="1e-4"/>
  </inertial></link>
  <joint name="pivot" type="{type}">
    <origin rpy="0 {pitch} 0"/><parent link="base"/><child link="arm"/><axis xyz="{axis}"/>{limit}
  </joint>
</robot>
"""
SLIDING = '<limit lower="-9" upper="9" effort="9" velocity="9"/>'
URDF_OF = {
    "joint": URDF.format(type="continuous", pitch=0.0, axis="1 0 0", limit=""),
    "slide": URDF.format(type="prismatic", pitch=-0.05, axis="1 0 0", limit=SLIDING),
}
KEPT = 12
"""Studies of each rig that cases share which spoil files: what is in them differs enough."""


def kept_study(rng: np.random.Generator, rig: str) -> Study:
    """One of `KEPT` studies, which are made once."""
    return _kept(int(rng.integers(KEPT)), rig)


@functools.cache
def _kept(number: int, rig: str) -> Study:
    return small_study(np.random.default_rng(number), rig)


def small_study(rng: np.random.Generator, rig: str) -> Study:
    """A study of two to four trials of one or two seconds at 100 Hz, simulated, with white noise."""
    count, seconds = int(rng.integers(2, 5)), float(rng.choice((1.0, 2.0)))
    time = np.arange(round(100 * seconds)) / 100
    trials = [_bare(rng, rig, f"{k:02d}", time, k) for k in range(count)]
    read = {"motion": "angle_rad" if rig == "ankle" else "position", "isometric": "force_n"}
    study = _study(rig, [t.with_columns(**{read[t.kind]: np.zeros(len(t))}) for t in trials])  # nothing is read yet
    model = nominal_model(study)
    true = {n: v * float(np.exp(rng.uniform(-0.2, 0.2))) for n, v in model.parameters().items()}
    start = [
        {"initial_position": t.conditions["position0"], "initial_velocity": 0.0} if study.rig == "joint" else {}
        for t in trials
    ]
    run = Simulator(model, trials).run(true, start)
    measured = []
    for trial, simulated in zip(trials, run, strict=True):
        names = model.rig.outputs(trial.kind)
        if rig == "joint":
            names = names[:1]
        noisy = {n: simulated.readings[:, k] + NOISE[n] * rng.standard_normal(len(time)) for k, n in enumerate(names)}
        conditions = {n: v for n, v in trial.conditions.items() if n != "position0"}
        measured.append(replace(trial, columns={**trial.columns, **noisy}, conditions=conditions))
    return replace(study, trials=tuple(measured))


def _study(rig: str, trials: list[Trial]) -> Study:
    if rig == "ankle":
        return Study("small", "ankle", ANKLE, ANKLE_START, tuple(trials))
    if rig in ("muscle", "pulsed"):
        known = {"threshold_us": THRESHOLD_US, "saturation_us": SATURATION_US} if rig == "muscle" else {}
        return Study("small", "muscle", known, {"gain": 36.0, "time_constant_s": 0.05}, tuple(trials))
    path = Path(tempfile.mkdtemp(prefix="fuzz")) / "rig.urdf"
    path.write_text(URDF_OF[rig], encoding="utf-8")
    start = {"inertia_scale": 1.0, "damping": 0.5 if rig == "slide" else 0.03}
    return Study("small", "joint", {}, start, tuple(trials), files={"urdf": path})


def _bare(rng: np.random.Generator, rig: str, name: str, time: np.ndarray, number: int) -> Trial:
    """Inputs and conditions: levels that hold for 0.2 s, from 0.1 s on."""
    level = np.repeat(rng.uniform(0.0, 1.0, len(time) // 20 + 1), 20)[: len(time)] * (time >= 0.1)
    width = np.where(level > 0.2, THRESHOLD_US + level * (SATURATION_US - THRESHOLD_US), 0.0)
    if rig == "ankle" and number % 3 < 2:
        return Trial(name, "motion", {"pulse_width_us": width}, time, {"load_kg": 1.0 + 0.5 * (number % 2)})
    if rig == "ankle":
        return Trial(name, "isometric", {"pulse_width_us": width}, time, {"angle_rad": 1.8})
    if rig == "muscle":
        return Trial(name, "isometric", {"pulse_width_us": width}, time)
    if rig == "pulsed":
        pulses = ((np.arange(len(time)) % 4 == 0) & (level > 0.2)).astype(float)
        return Trial(name, "isometric", {"stim": pulses}, time)
    begin = {"position0": float(rng.uniform(-0.8, 0.8))}
    columns = {"effort": 0.6 * (2.0 * level - 1.0)} if rig == "slide" or number else {"effort": np.zeros(len(time))}
    return Trial(name, "motion", columns, time, begin)
