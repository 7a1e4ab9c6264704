"""Benchmarks of the allocation: `run()` gives rows (name, measured, target, unit); run as a script it prints them.

Targets are lower limits for rates and ratios, upper limits for times and residuals. 30 muscles x 19 joints, 1e5
samples of a smooth torque; everything on one core (set OMP_NUM_THREADS=1 before numpy is imported, as this script
does when run alone).
"""

from __future__ import annotations

import itertools
import os
import sys
import time
import warnings
from pathlib import Path

if __name__ == "__main__":
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from fes_pin.allocation.allocate import allocate
from fes_pin.allocation.allocator import Allocator
from fes_pin.allocation.horizon import Horizon, StrengthFatigue
from fes_pin.allocation.walk import allocate_walk
from fes_pin.body.joints import JOINT_NAMES
from fes_pin.body.measured_walk import read_walk
from fes_pin.data.errors import InputError
from fes_pin.muscles.nerves import Nerves

sys.path.insert(0, str(Path(__file__).parents[2] / "analysis"))
from yardsticks.rules_of_thumb import clipped, direction_error, rescaled

SAMPLES = 100_000
MUSCLES = (
    "glut_med2",
    "glut_max2",
    "iliacus",
    "psoas",
    "semimem",
    "bifemlh",
    "bifemsh",
    "rect_fem",
    "vas_lat",
    "add_long",
)
MUSCLES += ("med_gas", "soleus", "tib_post", "tib_ant", "per_long")
"""Fifteen muscles a leg: 30 channels."""


def thirty_muscles() -> np.ndarray:
    """Torque at full recruitment, (19, 30) N m, at the neutral posture."""
    return Nerves([f"{side}_{name}" for side in ("left", "right") for name in MUSCLES]).torque_matrix()


def matrices() -> dict[str, np.ndarray]:
    """What the programs are timed with: the table's muscles, and a matrix that turns every joint independently."""
    random = np.random.default_rng(1).normal(size=(19, 30)) * 50
    return {"muscles of the table": thirty_muscles(), "random matrix": random}


def smooth_torque(samples: int, seconds: float, seed: int = 0) -> np.ndarray:
    """Three harmonics of a stride of 1.1 s on every joint, about 40 N m each, (samples, 19)."""
    rng = np.random.default_rng(seed)
    t = np.linspace(0.0, seconds, samples)[:, None]
    parts = [rng.normal(size=19) * 40.0 * np.sin(2 * np.pi * k * t / 1.1 + rng.uniform(0, 6, 19)) for k in (1, 2, 3)]
    return np.sum(parts, axis=0)


def durations(call, arguments, tries: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Seconds per call, one per argument, by the wall's clock and of this core's time: the fastest of some tries.

    They differ where other processes want the core, too.
    """
    result = np.full((2, len(arguments), tries), np.inf)
    for k, argument in enumerate(arguments):
        for j in range(tries):
            core, start = time.thread_time(), time.perf_counter()
            call(argument)
            result[:, k, j] = time.perf_counter() - start, time.thread_time() - core
    return tuple(result.min(2))


def timed(
    name: str, taken: tuple[np.ndarray, np.ndarray], factor: float, target: float | None, unit: str, tail=None
) -> list:
    """Rows of median and 99th percentile (whose target is `tail`), by the wall's clock and of the core's time."""
    rows = []
    for clock, seconds in zip(("wall", "core"), taken, strict=True):
        rows.append((f"{name}: median, {clock}", factor * float(np.median(seconds)), target, unit))
        rows.append((f"{name}: 99th percentile, {clock}", factor * float(np.percentile(seconds, 99)), tail, unit))
    return rows


def batch() -> list[tuple]:
    """The whole batch: linear terms, solutions, pulse widths and recomputed residuals, all counted."""
    torque = smooth_torque(SAMPLES, 100.0)
    rows = []
    for name, matrix in matrices().items():
        program = Allocator(matrix)
        program.sequence(torque[:1000])
        done: list = []
        wall, core = durations(lambda t, p=program, d=done: d.append(p.sequence(t).residual.max()), [torque], tries=3)
        residual = float(max(done))
        rows.append((f"batch, {name}, wall", SAMPLES / float(wall[0]), 8e4, "solves/s"))
        rows.append((f"batch, {name}, core", SAMPLES / float(core[0]), 8e4, "solves/s"))
        rows.append((f"batch, {name}: greatest KKT residual", residual, 1e-9, "of strongest channel^2"))
        rows.append((f"batch, {name}: the same", residual * program.problem.scale, None, "(N m)^2"))
    return rows


def against_osqp() -> list[tuple]:
    """The same samples through qpsolvers and OSQP at its default tolerance."""
    torque = smooth_torque(SAMPLES, 100.0)
    program = Allocator(thirty_muscles())
    start = time.perf_counter()
    program.sequence(torque)
    ours = SAMPLES / (time.perf_counter() - start)
    program([0.0] * 19, solver="osqp")
    some = torque[:: SAMPLES // 300]
    residual = 0.0
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        taken = durations(lambda one: program(one, solver="osqp"), some)[0]
        for one in some[:100]:
            residual = max(residual, program(one, solver="osqp").certificate.residual)
    theirs = 1.0 / float(taken.mean())
    return [
        ("qpsolvers + OSQP, default tolerance", theirs, None, "solves/s"),
        ("qpsolvers + OSQP: greatest KKT residual", residual, None, "of strongest channel^2"),
        ("batch over qpsolvers + OSQP", ours / theirs, 50.0, "times"),
    ]


def single_call() -> list[tuple]:
    """One call from Python, pulse widths and certificate included."""
    torque = list(smooth_torque(5000, 5.0))
    matrix = thirty_muscles()
    program = Allocator(matrix)
    rows = []
    for name, call in (
        ("Allocator(...)(torque)", program),
        ("allocate(torque, matrix)", lambda t: allocate(t, matrix)),
    ):
        durations(call, torque[:500])
        rows += timed(f"one call, {name}", durations(call, torque), 1e6, 60.0, "us", 200.0)
    return rows


def horizon() -> list[tuple]:
    """Ten steps of 30 channels at 30 Hz with lag, rate limit and price of change, along a smooth torque.

    With fatigue the program is made again at every pulse.
    """
    torque = smooth_torque(420, 14.0)
    rows = []
    for (name, matrix), fatigue in itertools.product(matrices().items(), (None, StrengthFatigue())):
        plans: list = []
        ahead = Horizon(Allocator(matrix, change=1e-3, rate=0.2), fatigue=fatigue)
        rank = np.linalg.matrix_rank(matrix)
        taken = durations(lambda k, a=ahead, p=plans: p.append(a.advance(torque[k : k + 10])), range(400))
        residual, gap = max(max(p.primal, p.dual) for p in plans), max(p.gap for p in plans)
        label = f"10-step horizon{', fatigue' if fatigue else ''}, {name} (rank {rank})"
        rows += timed(label, tuple(t[20:] for t in taken), 1e3, None, "ms", 15.0)
        rows += [
            (f"{label}: greatest residual", residual, 1e-9, "of strongest channel^2"),
            (f"{label}: greatest proven gap", gap, 1e-9, "of strongest channel^2"),
        ]
    return rows


def walking() -> list[tuple]:
    """Torque-direction error on the measured walk beside two rules of thumb (sagittal joints), if the data is there."""
    try:
        walk = read_walk()
    except InputError:
        return []
    sagittal = [
        j for j, name in enumerate(JOINT_NAMES) if name.endswith(("hip_flexion", "knee_flexion", "ankle_dorsiflexion"))
    ]
    nerves = [f"{s}_{n}" for s in ("left", "right") for n in ("femoral", "hamstrings", "tibial", "deep_peroneal")]
    weights = np.isin(np.arange(len(JOINT_NAMES)), sagittal).astype(float)
    result = allocate_walk(walk.torque, Nerves(nerves), walk.q, weights=weights)
    wanted, matrices = walk.torque[:, sagittal], result.matrices[:, sagittal]
    made = {"this": result.achieved[:, sagittal]}
    for name, rule in (("clip", clipped), ("rescale", rescaled)):
        made[name] = np.array([m @ rule(m, t) for m, t in zip(matrices, wanted, strict=True)])
    rows = []
    for name, torque in made.items():
        angle = float(np.degrees(np.median(direction_error(wanted, torque))))
        error = float(np.sqrt(((torque - wanted) ** 2).sum(1).mean()))
        rows.append((f"walking, four nerves a leg, {name}: median direction error", angle, None, "degrees"))
        rows.append((f"walking, four nerves a leg, {name}: rms torque error", error, None, "N m"))
    return rows


def off_or_enough() -> list[tuple]:
    """Twelve channels that are off or at 0.3 and more, proven optimal."""
    names = [n for n in Nerves().names if n.startswith("left_")][:12]
    rng = np.random.default_rng(2)
    gaps, rows = [], []
    for name, matrix in (("nerves", Nerves(names).torque_matrix()), ("random", rng.normal(size=(19, 12)) * 50)):
        program = Allocator(matrix, least=0.3)
        torques = [
            matrix @ (rng.uniform(0, 0.6, 12) * rng.choice([0, 1], 12)) + 5 * rng.normal(size=19) for _ in range(300)
        ]
        program(torques[0])
        taken = durations(lambda t, program=program: gaps.append(program(t).gap), torques, tries=3)[0] * 1e3
        rows.append((f"12 channels off or enough, {name}: median", float(np.median(taken)), 1.0, "ms"))
        rows.append(
            (f"12 channels off or enough, {name}: slowest of 300 (best of 3 tries)", float(taken.max()), None, "ms")
        )
    return [*rows, ("12 channels off or enough: greatest gap", max(gaps), 0.0, "of strongest channel^2")]


def run() -> list[tuple]:
    """Rows (name, measured, target or None, unit)."""
    assert len(JOINT_NAMES) == 19
    return [*batch(), *against_osqp(), *single_call(), *horizon(), *off_or_enough(), *walking()]


if __name__ == "__main__":
    for name, measured, target, unit in run():
        goal = "" if target is None else f"target {target:g}"
        print(f"{name:58s} {measured:12.4g} {unit:24s} {goal}")
