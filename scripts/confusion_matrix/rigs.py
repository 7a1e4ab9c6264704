"""Random rigs around the paper's, their trials, and what a study believes of them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from confusion_matrix.stimuli import SHAPES, effort, pulse_widths

THRESHOLD_US, SATURATION_US = 180.0, 1000.0
GRAVITY = 9.81
LOADS_KG = (1.0, 1.5)


@dataclass(frozen=True)
class Plant:
    """A rig as it is, and as it is believed to be.

    Attributes
    ----------
    rig
        "ankle", "joint" or "muscle".
    known
        Constants of the study's `[rig]`; for a joint what its URDF holds.
    true
        What the nominal model fits, at its true values, by the names of the study format.
    start
        The same, as the study believes it.
    """

    rig: str
    known: Mapping[str, float]
    true: Mapping[str, float]
    start: Mapping[str, float]

    def numbers(self) -> dict[str, float]:
        """What the equations of motion read, by one name on all rigs."""
        k = dict(self.known)
        if self.rig == "joint":
            inertia = self.true["inertia_scale"] * k["inertia"]
            return {**k, "inertia": inertia, "damping": self.true["damping"]}
        if self.rig == "muscle":
            return {**k, "strength": self.true["gain"], "time_constant": self.true["time_constant_s"]}
        own = {"inertia": self.true["inertia_kgm2"], "damping": self.true["damping_nms"]}
        strength = self.true["gain"] * k["force_scale_n"]
        return {**k, **own, "strength": strength, "time_constant": self.true["time_constant_s"]}


@dataclass(frozen=True)
class Protocol:
    """One trial before it is run: its input (or None), kind and conditions."""

    kind: str
    input: np.ndarray | None
    conditions: Mapping[str, float]


def _near(rng: np.random.Generator, value: float, share: float) -> float:
    return value * float(rng.uniform(1.0 - share, 1.0 + share))


def draw_plant(rng: np.random.Generator, rig: str, wrong: float) -> Plant:
    """A random rig; its start values are wrong by up to the share `wrong`, each in its own direction."""
    known, true = {"ankle": _ankle, "joint": _joint, "muscle": _muscle}[rig](rng)
    start = {n: float(f"{v * (1.0 + rng.uniform(-wrong, wrong)):.4g}") for n, v in true.items()}
    return Plant(rig, known, true, start)


def _ankle(rng: np.random.Generator) -> tuple[dict[str, float], dict[str, float]]:
    known = {
        "foot_mass_kg": _near(rng, 0.115, 0.15),
        "com_distance_m": _near(rng, 0.08, 0.1),
        "moment_arm_m": _near(rng, 0.035, 0.2),
        "force_scale_n": _near(rng, 58.0, 0.12),
        "threshold_us": THRESHOLD_US + float(rng.integers(-3, 4)) * 10.0,
        "saturation_us": SATURATION_US + float(rng.integers(-5, 6)) * 20.0,
        "f0_n": _near(rng, 4.0, 0.2),
        "f1_per_rad": _near(rng, 2.2, 0.15),
        "theta_r_rad": _near(rng, 1.2, 0.08),
    }
    true = {
        "gain": _near(rng, 0.65, 0.2),
        "time_constant_s": _near(rng, 0.05, 0.25),
        "inertia_kgm2": _near(rng, 1.1e-3, 0.2),
        "damping_nms": _near(rng, 0.075, 0.3),
    }
    return known, true


def _joint(rng: np.random.Generator) -> tuple[dict[str, float], dict[str, float]]:
    mass, length, turned = _near(rng, 0.6, 0.25), _near(rng, 0.18, 0.2), float(rng.uniform(-0.4, 0.4))
    own, weight = 0.1 * mass * length**2, mass * GRAVITY * length
    known = {
        "mass": mass,
        "length": length,
        "turned": turned,
        "own": own,
        "inertia": own + mass * length**2,
        "gravity_cos": weight * math.sin(turned),
        "gravity_sin": weight * math.cos(turned),
    }
    return known, {"inertia_scale": _near(rng, 1.0, 0.15), "damping": _near(rng, 0.03, 0.3)}


def _muscle(rng: np.random.Generator) -> tuple[dict[str, float], dict[str, float]]:
    known = {"threshold_us": THRESHOLD_US, "saturation_us": SATURATION_US}
    return known, {"gain": _near(rng, 36.0, 0.2), "time_constant_s": _near(rng, 0.05, 0.25)}


def urdf_text(known: Mapping[str, float]) -> str:
    """A pendulum about x whose rest is turned by `turned`: gravity m g l sin(q + turned)."""
    own = f"{known['own']:.12g}"
    return f"""<?xml version="1.0"?>
<robot name="pendulum">
  <link name="base"/>
  <link name="arm"><inertial>
    <origin xyz="0 0 {-known["length"]:.12g}"/><mass value="{known["mass"]:.12g}"/>
    <inertia ixx="{own}" ixy="0" ixz="0" iyy="{own}" iyz="0" izz="{own}"/>
  </inertial></link>
  <joint name="pivot" type="continuous">
    <origin rpy="{known["turned"]:.12g} 0 0"/><parent link="base"/><child link="arm"/><axis xyz="1 0 0"/>
  </joint>
</robot>
"""


def draw_trials(rng: np.random.Generator, plant: Plant, motion: int, isometric: int) -> list[Protocol]:
    """Random trials: stimuli of every shape in turn, two loads, one angle for all isometric trials."""
    shapes = [SHAPES[(k + int(rng.integers(0, 2)) * 3) % len(SHAPES)] for k in range(motion + isometric)]
    if plant.rig == "joint":
        driven = rng.random() < 0.7
        return [_joint_trial(rng, plant, shape, driven) for shape in shapes]
    held_at = round(float(rng.uniform(1.75, 1.95)), 2)
    known, out = plant.known, []
    for k, shape in enumerate(shapes):
        width = pulse_widths(rng, shape, known["threshold_us"], known["saturation_us"])
        if k < motion:
            out.append(Protocol("motion", width, {"load_kg": LOADS_KG[k % 2]}))
        else:
            out.append(Protocol("isometric", width, {"angle_rad": held_at} if plant.rig == "ankle" else {}))
    return out


def _joint_trial(rng: np.random.Generator, plant: Plant, shape: str, driven: bool) -> Protocol:
    start = {"position0": float(rng.choice((-1.0, 1.0)) * rng.uniform(0.4, 1.0)), "velocity0": 0.0}
    weight = plant.known["mass"] * GRAVITY * plant.known["length"]
    return Protocol("motion", effort(rng, shape, 0.35 * weight) if driven else None, start)
