"""How fast the body is: A, B, C along a gait, and the analysis of one posture. Run alone or by scripts/benchmark."""

from __future__ import annotations

import time

import numpy as np

from fes_pin.body.build import Body
from fes_pin.body.catchable import attainable
from fes_pin.body.controllability import modal_controllability
from fes_pin.body.gait import posture_angles, posture_names
from fes_pin.body.inputs import Inputs
from fes_pin.body.joints import JOINT_NAMES
from fes_pin.body.linearize import linearize, linearize_batch
from fes_pin.body.observability import observability
from fes_pin.muscles.nerves import Nerves

POSTURES, CHUNK = 100_000, 4096


def gait(body: Body, count: int = POSTURES) -> np.ndarray:
    """Postures along the named ones of the measured walk, (count, 19) in the order of the body's joints."""
    names = ["initial_contact", "loading", "mid_stance", "mid_swing", "terminal_stance", "pre_swing"]
    assert set(names) < set(posture_names())
    corners = np.array([[posture_angles(n, body.stance)[j] for j in body.joint_names] for n in names])
    along = np.linspace(0.0, len(names) - 1.0, count)
    return np.stack([np.interp(along, np.arange(len(names)), column) for column in corners.T], axis=1)


def _best(call, times: int) -> tuple[float, float]:
    """Seconds of the fastest of some calls: by the wall's clock, and of this core's time."""
    taken = []
    for _ in range(times):
        core, start = time.thread_time(), time.perf_counter()
        call()
        taken.append((time.perf_counter() - start, time.thread_time() - core))
    return min(wall for wall, _ in taken), min(core for _, core in taken)


def run() -> list[tuple[str, float, float, str]]:
    """Rows of (name, measured, target, unit)."""
    body = Body.from_subject(mass_kg=72.6, height_m=1.80)
    postures = gait(body)

    buffers = np.empty((CHUNK, 19, 19)), np.empty((CHUNK, 19, 19)), np.empty((CHUNK, 19))

    def chunks() -> None:
        for start in range(0, len(postures), CHUNK):
            some = postures[start : start + CHUNK]
            linearize_batch(body, some, out=tuple(buffer[: len(some)] for buffer in buffers))

    nerves = Nerves()

    def one_posture() -> None:
        linear = linearize(body, "mid_stance")
        result = modal_controllability(linear, nerves)
        _ = result.fall_energy
        observability(linear, JOINT_NAMES)

    linear = linearize(body, "mid_stance")
    inputs = Inputs.of(nerves, linear)

    def holding() -> None:
        attainable(linear.brace(["right_mtp_extension"]), inputs, gravity=False)

    rows = []
    for name, call, times, factor, target, unit in (
        ("body: A, B, C at 1e5 postures of the gait, in chunks (24 MB)", chunks, 3, 1.0, 1.5, "s"),
        ("body: the same, kept in memory (590 MB)", lambda: linearize_batch(body, postures), 3, 1.0, 1.5, "s"),
        ("body: modes, controllability, observability of one posture", one_posture, 20, 1e3, 20.0, "ms"),
        ("body: what 26 nerves can hold there (linear programs)", holding, 3, 1e3, 100.0, "ms"),
    ):
        for clock, seconds in zip(("wall", "core"), _best(call, times), strict=True):
            rows.append((f"{name}, {clock}", factor * seconds, target, unit))
    return rows


if __name__ == "__main__":
    for name, measured, target, unit in run():
        print(f"{name:66s} {measured:8.3g} {unit:3s} (at most {target:g})")
