"""Recordings as instruments and OpenSim write them, which `fes-pin new-study` makes a study of."""

from __future__ import annotations

import numpy as np

from fes_pin.data.motion import GROUND_REACTION, REQUIRED

FORCES = [
    f"{before}ground_{what}_{kind}{axis}"
    for before in ("", "1_")
    for what, kind in (("force", "v"), ("force", "p"), ("torque", ""))
    for axis in "xyz"
]
"""OpenSim's names of what `GROUND_REACTION` is called here, in its order."""


def instrument(rng: np.random.Generator, bare: bool = False) -> str:
    """Angle and torque of a joint: units in a row of their own, semicolons and decimal commas or neither, ms or s.

    `bare` is always in ms, with commas, and the names in the first row.
    """
    comma, milliseconds = (False, True) if bare else rng.uniform(size=2) < 0.5
    separator = "," if bare else ";" if comma else str(rng.choice([",", "\t"]))
    odd = 0.02 * rng.standard_normal((60, 2))
    times = np.arange(60) * (10.0 if milliseconds else 0.01)
    rows = [["t", "Angle", "Torque"], ["ms" if milliseconds else "s", "deg", "Nm"]]
    rows += [
        [f"{t:g}", f"{20 * np.sin(k / 5) + odd[k, 0]:.3f}", f"{np.cos(k / 5) + odd[k, 1]:.3f}"]
        for k, t in enumerate(times)
    ]
    lines = [separator.join(v.replace(".", ",") if comma else v for v in row) for row in rows]
    return "\n".join(["made by hand"] * int(not bare and rng.integers(2)) + lines) + "\n"


def coordinates(rng: np.random.Generator) -> str:
    """Joint coordinates of a walk as OpenSim's `.mot`."""
    count = int(rng.integers(7, 40))
    angles = rng.normal(scale=20.0, size=(count, len(REQUIRED)))
    return storage(["time", *REQUIRED], np.column_stack([np.arange(count) / 60, angles]), "inDegrees=yes")


def ground_reaction(rng: np.random.Generator) -> str:
    """Forces, centres of pressure and moments below both feet as OpenSim's `.mot`."""
    count = int(rng.integers(70, 400))
    values = rng.normal(scale=100.0, size=(count, len(GROUND_REACTION)))
    return storage(["time", *FORCES], np.column_stack([np.arange(count) / 600, values]), "datacolumns 19")


def storage(labels: list[str], values: np.ndarray, header: str) -> str:
    """Numbers as a file of OpenSim."""
    rows = ["\t".join(f"{value:.9g}" for value in row) for row in values]
    return "\n".join(["walk", "version=1", f"nRows={len(rows)}", header, "", "endheader", "\t".join(labels), *rows, ""])
