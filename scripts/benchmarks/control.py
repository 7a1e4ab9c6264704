"""Position control and the Kalman filter: time per step, and how closely a joint is held.

.venv/bin/python scripts/benchmarks/control.py
"""

import math
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from fes_pin.control.control import PositionController
from fes_pin.control.loop import sine, track
from fes_pin.models.effects.fatigue import Fatigue
from fes_pin.paper.kalman import GainFilter, StraightRecruitment

sys.path.insert(0, str(Path(__file__).parents[2] / "analysis"))
from paper_ankle.constants import FORCE_NOISE_N, HELD_AT_RAD, isometric_stimulus, paper_twin
from paper_ankle.ratios import ankle_of
from paper_ankle.twin import RunningTwin, record

FATIGUE = {"rate_per_s": 0.068, "recovery_s": 60.0}


def run() -> list[tuple[str, float, float, str]]:
    """Rows of (name, measured, target, unit); smaller is better throughout."""
    twin = replace(paper_twin("3-23"), load_kg=0.5)
    low = twin.rest_angle() + math.radians(1.0)
    fresh = track(PositionController(ankle_of(twin), 0.5), RunningTwin(twin), sine(low, 15.0, 0.5, 30.0))
    tiring = replace(twin, fatigue_per_s=FATIGUE["rate_per_s"], recovery_s=FATIGUE["recovery_s"])
    tired = RunningTwin(tiring)
    controller = PositionController(ankle_of(tiring) + Fatigue(**FATIGUE), 0.5)
    long = track(controller, tired, sine(low, 15.0, 0.5, 300.0))
    return [
        ("controller step, median", 1e6 * float(np.median(long.step_s)), 100.0, "us"),
        ("controller step, 99 %", 1e6 * float(np.percentile(long.step_s, 99)), 22222.0, "us"),
        ("Kalman filter of gain and time constant, step", _filter_step(), 100.0, "us"),
        ("sine of 15 degrees peak to peak, 0.5 Hz: RMS error", fresh.rms_error_deg(), 1.0, "deg"),
        ("the same, 5 minutes, fatigue: RMS error", long.rms_error_deg(), 1.5, "deg"),
        ("force left at its end", 100.0 * tired.capacity, 62.0, "%"),
    ]


def _filter_step() -> float:
    twin = paper_twin("3-23")
    trial = record(twin, isometric_stimulus(4.0), "held", held_at_rad=HELD_AT_RAD, noise_std=FORCE_NOISE_N)
    tracker = GainFilter(trial.dt, StraightRecruitment.of(twin.constants()), FORCE_NOISE_N)
    took = []
    for force, width in zip(trial["force_n"], trial["pulse_width_us"], strict=True):
        began = time.perf_counter()
        tracker.step(float(force), float(width))
        took.append(time.perf_counter() - began)
    return 1e6 * float(np.median(took))


if __name__ == "__main__":
    for name, measured, target, unit in run():
        print(f"{name:55s} {measured:9.3g} {unit:4s} (target {target:g})")
