"""Draws of driven rigs: which rig, what hides in it, how it is moved, and what is believed of it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from driven_rigs.plant import DT, Plant, run
from fes_pin.data.smooth import low_pass
from fes_pin.data.study import Study, write_study
from fes_pin.data.trial import Trial

CAUSES = (
    "coulomb_friction",
    "quadratic_damping",
    "effort_offset",
    "parallel_stiffness",
    "joint_stop",
    "passive_relaxation",
    "periodic_torque",
    "sensor_lag",
    "cogging",
    "backlash",
)
PAIRS = (
    ("coulomb_friction", "quadratic_damping"),
    ("coulomb_friction", "effort_offset"),
    ("coulomb_friction", "sensor_lag"),
    ("coulomb_friction", "periodic_torque"),
    ("coulomb_friction", "parallel_stiffness"),
)
OUTSIDE = ("damping_drift",)
"""Not in the library."""
BRISTLES = (3e-5, 1e-3)
"""Way over which bristles bend, as a share of how far the rig moves: 4 to 120 um of a slide. Metal on metal breaks away
within micrometres (Armstrong-Helouvry, Dupont and Canudas de Wit, Automatica 30, 1994), a gear or a belt later."""
READ_EFFORT = 0.01
"""Deviation of the noise that an effort is recorded with, as a share of it."""


@dataclass(frozen=True)
class Base:
    """A kind of rig: numbers as of a laboratory's own, and how far it moves."""

    name: str
    inertia: float
    damping: float
    weight: float
    reach: float
    bandwidth: float


BASES = (
    Base("slide", 60.0, 150.0, 0.0, 0.12, 12.0),
    Base("arm", 0.08, 0.05, 1.2, 0.9, 15.0),
    Base("knee", 0.4, 0.9, 11.0, 0.4, 9.0),
    Base("upright", 0.04, 0.02, -0.9, 0.3, 14.0),
)


@dataclass(frozen=True)
class Drawn:
    """A study and what is true of it; causes of little effect (`beside`) may be named as well.

    `nearest` are the causes of the library that are nearest to what is hidden, where the library has no form of that.
    """

    study: Path
    base: str
    causes: tuple[str, ...]
    truth: dict[str, float]
    beside: tuple[str, ...] = ()
    nearest: tuple[str, ...] | None = None


@dataclass(frozen=True)
class Recording:
    """How a laboratory records a rig.

    Attributes
    ----------
    measured
        The effort is read, with noise, instead of what the controller commands.
    cutoff_hz
        Where effort and reading were low-passed, without delay, before they were stored; None where they were not.
    every
        Samples of the controller from one row of the log to the next.
    """

    measured: bool = False
    cutoff_hz: float | None = None
    every: int = 1

    def stored(
        self, effort: np.ndarray, position: np.ndarray, usual: float, rng: np.random.Generator
    ) -> tuple[np.ndarray, np.ndarray]:
        """Efforts and positions as the log has them, shape (rows, trials)."""
        if self.measured:
            effort = effort + READ_EFFORT * usual * rng.standard_normal(effort.shape)
        if self.cutoff_hz is not None:
            effort, position = low_pass(effort, DT, self.cutoff_hz), low_pass(position, DT, self.cutoff_hz)
        return effort[:: self.every], position[:: self.every]


def draw(
    causes: tuple[str, ...],
    size: float,
    seed: int,
    folder: Path,
    recorded: bool = False,
    cutoff_hz: float | None = None,
    every: int = 1,
) -> Drawn:
    """Make a study with these causes hidden.

    Parameters
    ----------
    size
        Of each cause, as a share of the effort that moves the rig without it.
    seed
        Of everything that is random.
    folder
        Where the study is written.
    recorded
        As rigs are in a laboratory: friction is that of bristles, and the effort is measured, with noise.
    cutoff_hz
        Where effort and reading were low-passed, without delay, before they were stored; by default they were not.
    every
        Samples of the controller from one row of the log to the next.
    """
    rng = np.random.default_rng(seed)
    base = BASES[int(rng.integers(len(BASES)))]
    omega = base.bandwidth * rng.uniform(0.8, 1.2)
    plant = Plant(
        inertia=base.inertia,
        damping=base.damping,
        weight=base.weight,
        stiffness=base.inertia * omega**2 + abs(base.weight),
        rate_gain=1.2 * base.inertia * omega,
    )
    trials, seconds = int(rng.integers(3, 5)), float(rng.uniform(6.0, 12.0))
    references = references_of(base, trials, round(seconds / DT), rng)
    effort, position = run(plant, references, rng)
    usual = float(np.sqrt(np.mean(effort**2)))
    speed = float(np.sqrt(np.mean((np.diff(position, axis=0) / DT) ** 2)))
    hidden = sizes(causes, size * usual, position, speed, rng)
    own = np.random.default_rng([seed, 1])
    if recorded and "coulomb_friction" in hidden:
        hidden["bristles"] = base.reach * float(np.exp(own.uniform(*np.log(BRISTLES))))
    plant = replace(
        plant,
        hidden=hidden,
        noise=base.reach * float(rng.choice([3e-4, 1e-3])),
        count=base.reach * float(rng.choice([0.0, 6e-4])),
        torque=usual * float(rng.uniform(0.005, 0.03)),
        torque_s=float(rng.choice([0.02, 0.2])),
    )
    effort, position = run(plant, references, rng)
    effort, position = Recording(recorded, cutoff_hz, every).stored(effort, position, usual, own)
    believed = (float(rng.uniform(0.7, 1.3)), base.damping * float(rng.uniform(0.4, 1.6)))
    truth = {"inertia_scale": 1.0, "damping": base.damping, **hidden}
    study = written(base, effort, position, every * DT, believed, folder)
    return Drawn(study, base.name, causes, truth)


def references_of(base: Base, trials: int, n: int, rng: np.random.Generator) -> np.ndarray:
    """Sums of three sines, or smoothed steps, from where the rig rests; shape (n, trials)."""
    t = np.arange(n) * DT
    out = np.empty((n, trials))
    for k in range(trials):
        if rng.random() < 0.6:
            slow = rng.uniform(0.1, 0.9, size=3)
            sizes = rng.uniform(0.2, 1.0, size=3)
            waves = sum(a * np.sin(2.0 * np.pi * f * t) for a, f in zip(sizes, slow, strict=True))
            out[:, k] = base.reach * waves / max(float(np.abs(waves).max()), 1e-9)
        else:
            held = np.repeat(rng.uniform(-1.0, 1.0, size=-(-n // 600)), 600)[:n]
            held[: min(100, n)] = 0.0
            kernel = np.hanning(300)
            out[:, k] = base.reach * np.convolve(held, kernel / kernel.sum(), mode="same")
    return out - out[0]


def sizes(
    causes: tuple[str, ...], torque: float, position: np.ndarray, speed: float, rng: np.random.Generator
) -> dict[str, float]:
    """Numbers of what is hidden, so that each acts with about this torque."""
    reach = float(np.ptp(position)) / 2.0
    out: dict[str, float] = {}
    for cause in causes:
        if cause == "coulomb_friction":
            out |= {cause: torque, "friction_speed": speed * float(rng.uniform(0.02, 0.1))}
            out["stiction"], out["sticks"] = float(rng.choice([0.0, 0.3])), float(rng.random() < 0.5)
        elif cause == "quadratic_damping":
            out[cause] = torque / speed**2
        elif cause == "parallel_stiffness":
            out |= {cause: torque / reach, "rest": float(rng.uniform(-0.5, 0.5)) * reach}
        elif cause == "joint_stop":
            out |= {cause: 8.0 * torque / reach, "at": float(np.quantile(position, 0.85))}
        elif cause == "passive_relaxation":
            out |= {cause: 1.5 * torque / reach, "relaxation_s": float(rng.uniform(0.15, 0.5))}
        elif cause == "periodic_torque":
            out |= {cause: torque, "frequency": float(rng.uniform(0.25, 0.6)), "phase": float(rng.uniform(0.0, 6.28))}
        elif cause == "sensor_lag":
            out[cause] = float(rng.uniform(0.006, 0.02))
        elif cause == "cogging":
            out |= {cause: torque, "waves": 2.0 * np.pi / (2.0 * reach) * float(rng.uniform(4.0, 9.0))}
        elif cause == "backlash":
            out[cause] = 0.02 * reach
        elif cause == "damping_drift":
            out[cause] = torque / speed / 4.0
        else:
            out[cause] = torque * float(rng.choice([-1.0, 1.0]))
    return out


URDF = """<?xml version="1.0"?>
<robot name="{name}">
  <link name="base"/>
  <link name="moving">
    <inertial><origin xyz="{lever}"/><mass value="{mass}"/>
      <inertia ixx="{about}" iyy="{about}" izz="{about}" ixy="0" ixz="0" iyz="0"/></inertial>
  </link>
  <joint name="joint" type="{kind}"><parent link="base"/><child link="moving"/><axis xyz="{axis}"/>
    <limit lower="-10" upper="10" effort="1e6" velocity="1e3"/></joint>
</robot>
"""


def urdf(base: Base) -> str:
    """The rig with its true inertia and weight; a revolute joint hangs, or stands where its weight is negative."""
    if not base.weight:
        return URDF.format(name=base.name, lever="0 0 0", mass=base.inertia, about=1e-3, kind="prismatic", axis="1 0 0")
    lever = 0.3
    mass = abs(base.weight) / (9.81 * lever)
    about = base.inertia - mass * lever**2
    if about <= 0.0:
        lever = 0.8 * base.inertia * 9.81 / abs(base.weight)
        mass = abs(base.weight) / (9.81 * lever)
        about = base.inertia - mass * lever**2
    place = f"0 0 {-lever if base.weight > 0 else lever}"
    return URDF.format(name=base.name, lever=place, mass=mass, about=about, kind="revolute", axis="0 1 0")


def written(
    base: Base, effort: np.ndarray, position: np.ndarray, dt: float, believed: tuple[float, float], folder: Path
) -> Path:
    """Write a study of a rig: its URDF, its trials, the inertia's scale and the damping that are believed."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "rig.urdf").write_text(urdf(base))
    time = np.arange(len(effort)) * dt
    trials = tuple(
        Trial(f"{k:02d}", "motion", {"effort": np.round(effort[:, k], 6), "position": position[:, k]}, time)
        for k in range(effort.shape[1])
    )
    start = {"inertia_scale": round(believed[0], 4), "damping": round(believed[1], 6)}
    known = {} if base.weight else {"gravity_scale": 0.0}
    start |= {"gravity_scale": 1.0} if base.weight else {}
    study = Study(folder.name, "joint", known, start, trials, folder, {"urdf": folder / "rig.urdf"})
    write_study(study, folder / "study")
    return folder / "study"
