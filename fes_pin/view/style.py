"""Style of figures: colours by stage and by role, units of columns.

The colours are Okabe and Ito's, which colour-blind readers can distinguish (Color Universal Design, 2008). Each has a
name, under which a page may give it another shade on a dark ground.
"""

import numpy as np

STAGES = {"nerve": "#0072b2", "muscle": "#d55e00", "joint": "#00855f", "rig": "#8f6800", "sensor": "#a8477f"}
"""Colour of each stage of the signal path; three are darkened, to be read as text on white."""
COLOURS = {
    **{f"stage-{name}": colour for name, colour in STAGES.items()},
    **{"measured": "#17191c", "nominal": "#8b8f96", "extended": "#56b4e9", "ink": "#3d4248", "faint": "#c9cdd2"},
    **{"band": "#eceef1", "stimulus": "#6f7680"},
}
"""Every colour that a figure uses, by name."""
WIDTHS = {"extended": 4.0, "nominal": 1.8, "measured": 0.9}
"""Widths of curves: simulations behind, the measurement in front."""

LABELS = {
    "angle_rad": ("angle", "rad"),
    "force_n": ("force", "N"),
    "torque_nm": ("torque", "N m"),
    "length_m": ("length", "m"),
    "pulse_width_us": ("pulse width", "µs"),
    "stim": ("pulses", ""),
    "activation": ("activation", ""),
    "time_s": ("time", "s"),
}


def quantity(column: str, position_unit: str = "rad") -> tuple[str, str]:
    """Return the name and the unit of a column, as printed.

    Parameters
    ----------
    column
        Of a trial, or a name of `view.missing`.
    position_unit
        "rad" for a revolute joint, "m" for a prismatic one.
    """
    place, effort = ("angle", "N m") if position_unit == "rad" else ("position", "N")
    own = {n: (place, position_unit) for n in ("position", "angle")}
    own |= {n: ("rate", f"{position_unit}/s") for n in ("velocity", "rate")} | {"effort": ("effort", effort)}
    return (own | LABELS).get(column, (column.replace("_", " "), ""))


def label(column: str, position_unit: str = "rad") -> str:
    """Return the axis label of a column, with its unit."""
    name, unit = quantity(column, position_unit)
    return f"{name} ({unit})" if unit else name


def milli(values: np.ndarray, unit: str) -> tuple[float, str]:
    """Factor and unit in which small values have short numbers: thousandths where they are below a twentieth."""
    largest = float(np.quantile(np.abs(values), 0.995)) if len(values) else 0.0
    return (1e3, f"m{unit}") if 0.0 < largest < 0.05 and unit else (1.0, unit)
