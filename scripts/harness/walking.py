"""Walks: `walking_matrix`."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import count
from pathlib import Path

from walking_matrix.plan import KINDS, drawn
from walks.synthetic import Wrong, gait_of, make

import fes_pin as fp
from fes_pin.body.measured_walk import data_folder
from harness.generator import Item, Truth

AXIS = {(1, 0, 0): "forward", (0, 1, 0): "left", (0, 0, 1): "up"}
CLEAR = 40.0
"""The least d at which a hidden cause that is missed counts."""


class Walks:
    """Every cause in turn, nothing in every fourth.

    Parameters
    ----------
    strength
        Count by d, which takes as long as to make the walk.
    """

    ask = staticmethod(fp.diagnose)

    def __init__(self, strength: bool = True) -> None:
        self.strength = strength

    def plan(self, seed: int) -> Iterator[Item]:
        for k in count():
            kind = "none" if k % 4 == 3 else KINDS[(k - k // 4) % len(KINDS)]
            yield Item(f"{kind}-{seed + k}", seed + k, () if kind == "none" else (kind,))

    def make(self, item: Item, folder: Path) -> tuple[fp.Study, Truth]:
        wrong = drawn(*item.hidden or ("none",), item.seed)
        gait = gait_of(data_folder())
        make(gait, folder, wrong, item.seed)
        study = fp.read_study(folder)
        if not (item.hidden and self.strength):
            return study, Truth()
        from walking_matrix.strength import strength  # noqa: PLC0415

        d = strength(gait, wrong, item.seed, study)
        part = f"d of {CLEAR:g} and more" if d >= CLEAR else f"d below {CLEAR:g}"
        return study, Truth({f"{wrong.cause} at {hidden_site(wrong)}": wrong.size}, part=part)


def hidden_site(wrong: Wrong) -> str:
    """The site of the form that is hidden."""
    axis = AXIS.get(tuple(wrong.extra.get("axis", ())), "")
    site = {"left_thigh,right_thigh": "both thighs", "both": "both plates", "": "both plates"}.get(
        wrong.site, wrong.site
    )
    if wrong.cause.startswith("plate") and site in ("left", "right"):
        site = f"{site} plate"
    if wrong.cause == "plate_offset":
        return f"{site}, {axis} force, while loaded"
    if wrong.cause in ("segment_com", "external_force"):
        return f"{site}, {axis}"
    return {"base_tilt": axis, "marker_noise": "white"}.get(wrong.cause, site.replace("_", " "))
