"""Style of figures: colours by stage and by role, units of columns.

The colours are Okabe and Ito's, which colour-blind readers can distinguish (Color Universal Design, 2008). Each has a
name, under which a page may give it another shade on a dark ground.
"""

import numpy as np

from fes_pin.data.schema import without_unit
from fes_pin.data.units import own_unit

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

WORDS = {"position": "angle", "velocity": "rate", "stim": "pulses"}
"""Columns of a revolute joint, and of pulses, whose names are others on a page."""


def quantity(column: str, position_unit: str = "rad") -> tuple[str, str]:
    """Return the name and the unit of a column, as printed.

    Parameters
    ----------
    column
        Of a trial, or a name of `view.missing`.
    position_unit
        "rad" for a revolute joint, "m" for a prismatic one.
    """
    revolute = position_unit == "rad"
    column = {"angle": "position", "rate": "velocity"}.get(column, column)
    name = "position" if column == "position" and not revolute else WORDS.get(column, without_unit(column))
    return name.replace("_", " "), own_unit(column, revolute).replace("us", "µs")


def label(column: str, position_unit: str = "rad") -> str:
    """Return the axis label of a column, with its unit."""
    name, unit = quantity(column, position_unit)
    return f"{name} ({unit})" if unit else name


LARGE, SMALL = 2000.0, 0.05
"""Values from which on, and below which, an axis counts in thousands or thousandths."""


def short_unit(values: np.ndarray, unit: str) -> tuple[float, str]:
    """Factor and unit in which large and small values have short numbers: thousands or thousandths."""
    largest = float(np.quantile(np.abs(values), 0.995)) if len(values) and unit else 0.0
    if largest >= LARGE:
        return 1e-3, f"k{unit}"
    return (1e3, f"m{unit}") if 0.0 < largest < SMALL else (1.0, unit)
