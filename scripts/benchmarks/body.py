"""How fast the body is: A, B, C along a gait, and the analysis of one posture. Run alone or by scripts/benchmark."""

from __future__ import annotations

import time

import numpy as np

from fes_pin.body.attainable import attainable
from fes_pin.body.build import Body
from fes_pin.body.controllability import controllability
from fes_pin.body.gait import posture_angles, posture_names
from fes_pin.body.inputs import Inputs
from fes_pin.body.joints import JOINT_NAMES
from fes_pin.body.linearize import linearize, linearize_batch, linearize_chunks
from fes_pin.body.observability import observability
from fes_pin.stimulate.nerves import Nerves

POSTURES = 100_000


def gait(body: Body, count: int = POSTURES) -> np.ndarray:
    """Postures along the named ones of the measured walk, (count, 19) in the order of the body's joints."""
    names = ["initial_contact", "loading", "mid_stance", "mid_swing", "terminal_stance", "pre_swing"]
    assert set(names) < set(posture_names())
    corners = np.array([[posture_angles(n, body.stance)[j] for j in body.joint_names] for n in names])
    along = np.linspace(0.0, len(names) - 1.0, count)
    return np.stack([np.interp(along, np.arange(len(names)), column) for column in corners.T], axis=1)


def _best(call, times: int) -> float:
    taken = []
    for _ in range(times):
        start = time.perf_counter()
        call()
        taken.append(time.perf_counter() - start)
    return min(taken)


def run() -> list[tuple[str, float, float, str]]:
    """Rows of (name, measured, target, unit)."""
    body = Body.from_subject(mass_kg=72.6, height_m=1.80)
    postures = gait(body)

    def chunks() -> None:
        for _ in linearize_chunks(body, postures):
            pass

    nerves = Nerves()

    def one_posture() -> None:
        linear = linearize(body, "mid_stance")
        result = controllability(linear, nerves)
        _ = result.fall_energy
        observability(linear, JOINT_NAMES)

    linear = linearize(body, "mid_stance")
    inputs = Inputs.of(nerves, linear)

    def holding() -> None:
        attainable(linear.brace(["right_mtp_extension"]), inputs, gravity=False)

    return [
        ("body: A, B, C at 1e5 postures of the gait, in chunks (24 MB)", _best(chunks, 3), 1.5, "s"),
        ("body: the same, kept in memory (590 MB)", _best(lambda: linearize_batch(body, postures), 3), 1.5, "s"),
        ("body: modes, controllability, observability of one posture", 1e3 * _best(one_posture, 20), 20.0, "ms"),
        ("body: what 26 nerves can hold there (linear programs)", 1e3 * _best(holding, 3), 100.0, "ms"),
    ]


if __name__ == "__main__":
    for name, measured, target, unit in run():
        print(f"{name:66s} {measured:8.3g} {unit:3s} (at most {target:g})")
