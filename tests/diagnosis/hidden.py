"""Studies whose data hide causes, by the independent simulator, and their diagnoses; each made once."""

import functools
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
from oracle import TYPICAL, make_study, simulate
from oracle.studies import stimulus

from fes_pin.data.study import Study
from fes_pin.data.trial import Trial
from fes_pin.diagnosis.diagnosis import diagnose_joint

SHORT = {"n_motion": 4, "n_isometric": 2, "duration_s": 5.0}


def study_of(rig, names=(), noise="white", seed=0, **how):
    """A short study that hides causes of typical size."""
    more = {"n_isometric": 5} if rig == "muscle" else {}
    causes = names if callable(names) else {n: dict(TYPICAL[n]) for n in names}
    return make_study(np.random.default_rng(seed), rig, causes, noise, **(SHORT | more | how))


@functools.cache
def diagnosed(rig, names=(), noise="white", seed=0, driven=True):
    """The diagnosis of such a study."""
    return diagnose_joint(study_of(rig, names, noise, seed, driven=driven))


def slide(seed, causes, driven=True, trials=5, seconds=4.0):
    """A carriage on an inclined rail: one prismatic joint, its velocity measured too."""
    rng = np.random.default_rng(seed)
    mass, pitch = rng.uniform(0.8, 1.5), rng.uniform(0.03, 0.1)
    constants = {"inertia": mass, "gravity_cos": mass * 9.81 * np.sin(pitch), "gravity_sin": 0.0, "revolute": 0.0}
    made = []
    for number in range(trials):
        time = np.arange(round(seconds * 200)) / 200
        begin = {"position0": rng.uniform(-0.2, 0.2), "velocity0": rng.uniform(0.4, 1.5)}
        columns = {"effort": 3.0 * stimulus(rng, time, number)} if driven else {}
        bare = Trial(f"{number:02d}", "motion", columns, time, begin)
        for name, true in simulate(constants, {"inertia_scale": 1.1, "damping": 0.8}, causes, bare).items():
            columns[name] = true + {"position": 1e-3, "velocity": 1e-2}[name] * rng.standard_normal(len(time))
        made.append(Trial(bare.name, "motion", columns, time))
    folder = Path(tempfile.mkdtemp(prefix="slide"))
    (folder / "rig.urdf").write_text(
        f"""<?xml version="1.0"?>
<robot name="slide">
  <link name="rail"/>
  <link name="carriage"><inertial><mass value="{mass!r}"/>
    <inertia ixx="1e-3" ixy="0" ixz="0" iyy="1e-3" iyz="0" izz="1e-3"/></inertial></link>
  <joint name="slide" type="prismatic">
    <origin rpy="0 {-pitch!r} 0"/><parent link="rail"/><child link="carriage"/><axis xyz="1 0 0"/>
    <limit lower="-100" upper="100" effort="100" velocity="100"/>
  </joint>
</robot>
"""
    )
    start = {"inertia_scale": 1.0, "damping": 0.5}
    return Study("slide", "joint", {}, start, tuple(made), files={"urdf": folder / "rig.urdf"})


def named(diagnosis):
    """Each named cause with what cannot be told from it."""
    return [{c.name, *c.equivalents} for c in diagnosis.causes]


def shortened(study, kinds):
    """The trials of some kinds only."""
    return replace(study, trials=tuple(t for t in study.trials if t.kind in kinds))
