"""Which cause is hidden, where, and how large."""

import numpy as np
from walks.synthetic import Wrong

KINDS = ("segment_mass", "segment_com", "external_force", "plate_gain", "plate_offset", "clock_offset", "base_tilt",
         "marker_noise", "segment_inertia")  # fmt: skip
FORWARD, LEFT, UP = (1, 0, 0), (0, 1, 0), (0, 0, 1)


def drawn(kind: str, seed: int) -> Wrong:  # noqa: PLR0911
    """A hidden cause of a kind ("none" for nothing) with soft tissue, marker noise and 2 to 6 strides."""
    random = np.random.default_rng(1000 + seed)
    common = {"strides": int(random.integers(2, 7)), "tissue": float(random.uniform(0.2, 0.8))}
    sign = float(random.choice([-1, 1]))
    axis = (FORWARD, UP, LEFT)[random.integers(0, 3)]
    side = str(random.choice(["left", "right", "both"]))
    if kind == "segment_mass":
        site = str(random.choice(["trunk", "pelvis", "left_thigh,right_thigh", "right_thigh"]))
        share = {"trunk": 0.1, "pelvis": 0.3}.get(site, 0.25)
        return Wrong(kind, site, sign * share * random.uniform(0.7, 1.5), **common)
    if kind == "segment_com":
        axis = (FORWARD, LEFT)[random.integers(0, 2)]
        return Wrong(kind, "trunk", sign * random.uniform(0.03, 0.06), extra={"axis": axis}, **common)
    if kind == "external_force":
        site = str(random.choice(["trunk", "pelvis"]))
        return Wrong(kind, site, sign * random.uniform(20, 60), extra={"axis": axis, "at": (0, 0, 0.2)}, **common)
    if kind == "plate_gain":
        return Wrong(kind, side, sign * random.uniform(0.03, 0.1), **common)
    if kind == "plate_offset":
        return Wrong(kind, side, sign * random.uniform(15, 40), extra={"axis": axis}, **common)
    if kind == "clock_offset":
        return Wrong(kind, "", sign * random.uniform(0.015, 0.05), **common)
    if kind == "base_tilt":
        axis = (FORWARD, LEFT)[random.integers(0, 2)]
        return Wrong(kind, "", sign * random.uniform(0.02, 0.06), extra={"axis": axis}, **common)
    if kind == "marker_noise":
        return Wrong(kind, "", random.uniform(0.004, 0.01), **common)
    if kind == "segment_inertia":
        return Wrong(kind, "trunk", sign * random.uniform(0.4, 0.8), **common)
    return Wrong("none", **common)
