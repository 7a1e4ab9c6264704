"""Rigs that a controller drives with a change in one group, from the generator of driven rigs."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from driven_rigs.draw import BASES, Recording, references_of, sizes, urdf
from driven_rigs.plant import DT, Plant, run

from fes_pin.data.study import Study
from fes_pin.data.trial import Trial

CAUSES = ("coulomb_friction", "quadratic_damping", "effort_offset", "parallel_stiffness", "joint_stop", "sensor_lag")
NOMINAL = ("inertia_scale", "damping")


COMMANDED = Recording()


def driven_pair(
    changes: tuple[str, ...], size: float, seed: int, folder: Path, recording: Recording = COMMANDED
) -> Study:
    """A study of two groups of two trials; the second has the changes.

    Parameters
    ----------
    size
        Torque of a cause as a share of the effort that moves the rig.
    """
    rng, own = np.random.default_rng([seed, 78]), np.random.default_rng([seed, 79])
    base = BASES[int(rng.integers(len(BASES)))]
    omega = base.bandwidth * rng.uniform(0.8, 1.2)
    gain = base.inertia * omega**2 + abs(base.weight)
    bare = Plant(base.inertia, base.damping, base.weight, gain, 1.2 * base.inertia * omega)
    references = references_of(base, 4, round(float(rng.uniform(5.0, 8.0)) / DT), rng)
    effort, position = run(bare, references, rng)
    usual = float(np.sqrt(np.mean(effort**2)))
    speed = float(np.sqrt(np.mean((np.diff(position, axis=0) / DT) ** 2)))
    plant = replace(
        bare,
        noise=base.reach * float(rng.choice([3e-4, 1e-3])),
        count=base.reach * float(rng.choice([0.0, 6e-4])),
        torque=usual * float(rng.uniform(0.005, 0.03)),
        torque_s=float(rng.choice([0.02, 0.2])),
    )
    hidden = sizes(tuple(c for c in changes if c in CAUSES), size * usual, position, speed, rng)
    inertia = base.inertia * (float(rng.uniform(1.2, 2.0)) if "inertia_scale" in changes else 1.0)
    damping = base.damping + (size * usual / speed if "damping" in changes else 0.0)
    other = replace(plant, hidden=hidden, inertia=inertia, damping=damping)
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / f"{base.name}.urdf"
    file.write_text(urdf(base), encoding="utf-8")
    trials = []
    for label, one, columns in (("before", plant, slice(0, 2)), ("after", other, slice(2, 4))):
        effort, position = run(one, references[:, columns], rng)
        effort, position = recording.stored(effort, position, usual, own)
        trials += [
            Trial(
                f"{label}{k}",
                "motion",
                {"effort": np.round(effort[:, k], 6), "position": position[:, k]},
                np.arange(len(effort)) * DT * recording.every,
                group=label,
            )
            for k in range(effort.shape[1])
        ]
    start = {"inertia_scale": float(rng.uniform(0.7, 1.3)), "damping": base.damping * float(rng.uniform(0.4, 1.6))}
    known = {} if base.weight else {"gravity_scale": 0.0}
    start |= {"gravity_scale": 1.0} if base.weight else {}
    return Study(f"{base.name}-{seed}", "joint", known, start, tuple(trials), folder, {"urdf": file})
