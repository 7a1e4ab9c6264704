"""A walk that is nearly one: sinusoids at the joints, feet that carry the weight in turn."""

from __future__ import annotations

import numpy as np

from fes_pin.data.motion import GROUND_REACTION, REQUIRED
from fuzz_inputs.recordings import FORCES, storage
from fuzz_inputs.stated import STATED, some

Rng = np.random.Generator
STRIDE_S, SPEED, LEG_M, WEIGHT_N = 1.1, 1.2, 0.9, 700.0
HEAD = '[study]\nname = "walk"\nrig = "body"\n\n[rig]\nmass_kg = 71.4\nheight_m = 1.8\n\n'
SHIFTS = ("pelvis_tx", "pelvis_ty", "pelvis_tz")
KEYS = {
    "belt_speed_mps": ("1.2", "0.0", "nan", '"fast"', "-3"),
    "from": ("0.2", "-1", "5.0", '"a"'),
    "to": ("0.9", "0.1", "0", "nan"),
    "role": ('"held_out"', '"fit"', '"x"'),
    "name": ('"a"', '""', "1"),
    "group": ('"before"', "1"),
    "at": ("[0.5]", "[]"),
    "split": ('"rests"', '"restarts"'),
    "sources": ('{ a = "coords.csv" }',),
    "rate": ("60", "0"),
    "low_pass_hz": ("6", "-1"),
}
"""Keys of a walking trial, of which some are those of rigs."""


def walking(rng: Rng) -> tuple[str, str]:
    """Coordinates as `.mot` or CSV and ground reaction as `.mot` or CSV, by chance."""
    seconds = float(rng.choice((0.2, 1.3, 1.3, 2.4)))
    time, finer = np.arange(0, seconds, 1 / 60), np.arange(0, seconds, 1 / 240)
    moves = np.column_stack([v if n in SHIFTS else np.radians(v) for n, v in _coordinates(time).items()])
    pushes = np.column_stack(_pushes(finer))
    degrees = bool(rng.integers(2))
    angles = np.array([name not in SHIFTS for name in REQUIRED])
    as_mot = np.where(angles, np.degrees(moves), moves) if degrees else moves
    kinds = rng.integers(2, size=2)
    coordinates = (
        storage(["time", *REQUIRED], np.column_stack([time, as_mot]), f"inDegrees={'yes' if degrees else 'no'}")
        if kinds[0]
        else _csv(["time", *(f"q_{n}" for n in REQUIRED)], np.column_stack([time, moves]))
    )
    names, of_file = (FORCES, storage) if kinds[1] else (GROUND_REACTION, lambda n, v, _: _csv(n, v))
    return coordinates, of_file(["time", *names], np.column_stack([finer, pushes]), "datacolumns 19")


def study_text(rng: Rng, files: tuple[str, str]) -> str:
    """A study.toml of a walk that states some conventions."""
    stated = ["[conventions]", *some(STATED, rng, 4), ""] if rng.uniform() < 0.7 else []
    trial = ["[[trial]]", f'coordinates = "{files[0]}"', f'ground_reaction = "{files[1]}"', *some(KEYS, rng, 2)]
    return HEAD + "\n".join([*stated, *trial, ""])


def _csv(names: list[str], values: np.ndarray) -> str:
    return "\n".join([",".join(names), *(",".join(f"{v:.9g}" for v in row) for row in values), ""])


def _coordinates(time: np.ndarray) -> dict[str, np.ndarray]:
    """Degrees, and m of the pelvis."""
    out = {name: np.zeros(len(time)) for name in REQUIRED}
    out["pelvis_tx"], out["pelvis_ty"] = SPEED * time, np.full(len(time), LEG_M + 0.05)
    for side, phase in (("r", 0.0), ("l", np.pi)):
        turn = 2 * np.pi * time / STRIDE_S + phase
        out[f"hip_flexion_{side}"] = 5.0 + 22.0 * np.cos(turn)
        out[f"knee_angle_{side}"] = -25.0 + 22.0 * np.cos(turn - 1.2)
        out[f"ankle_angle_{side}"] = 8.0 * np.sin(turn)
    return out


def _pushes(time: np.ndarray) -> list[np.ndarray]:
    """N, m and N m by the columns of `GROUND_REACTION`."""
    out = {name: np.zeros(len(time)) for name in GROUND_REACTION}
    for side, phase, across in (("r", 0.0, 0.1), ("l", 0.5, -0.1)):
        gait = (time / STRIDE_S + phase) % 1.0
        load = WEIGHT_N * np.clip(np.sin(np.pi * gait / 0.6) * 1.6, 0.0, 1.05) * (gait < 0.6)
        out[f"{side}_Fy"], out[f"{side}_Fx"] = load, -0.15 * load * np.cos(np.pi * gait / 0.6)
        landed = SPEED * (time - gait * STRIDE_S) + 0.3
        out[f"{side}_copx"], out[f"{side}_copz"] = (
            np.where(load > 0, landed + 0.2 * gait, 0.0),
            np.where(load > 0, across, 0),
        )
    return list(out.values())
