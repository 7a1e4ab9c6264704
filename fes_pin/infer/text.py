"""Numbers in words: p-values, percentages and estimates as they are printed everywhere."""

import math
import re

LEAST_P, LEAST_PERCENT = 1e-12, 1e-3
"""Least p-value and percentage that are printed; smaller ones are printed as below these."""
WHOLE = 100.0
"""A whole in percent: from it on no decimals are printed."""
LARGE, DIGITS = 1e5, 6
"""Larger values, and values with more decimals, are printed with a power of ten."""

UNIT_IN_NAME = re.compile(r"(?<=.)(_(kgm2|nms|nm|us|ma|uc|s2?|hz|n|kg|rad|m))?(_per_(rad[23]?|s))?$")
"""Unit in a parameter's name; for a slide it is another than the parameter has."""
ON_A_SLIDE = {"torque": "force", "angle": "position"}
"""Words for quantities of a joint that turns, and for those of a slide."""


def plain_name(name: str, unit: str) -> str:
    """Return the name of a parameter in words, without a unit, which is printed next to its value.

    A torque in newtons is a force, and an angle in metres a position.
    """
    words = UNIT_IN_NAME.sub("", name).split("_")
    return " ".join(ON_A_SLIDE.get(w, w) if unit in ("N", "m") else w for w in words)


def probability(value: float) -> str:
    """Return a p-value as printed; it is never zero."""
    if math.isnan(value):
        return "not tested"
    return f"p < {LEAST_P:g}" if value < LEAST_P else f"p = {value:.2g}"


def percent(value: float | None) -> str:
    """Return a percentage as printed; "-" for None."""
    if value is None or not math.isfinite(value):
        return "-"
    if 0.0 <= value < LEAST_PERCENT:
        return f"below {LEAST_PERCENT:g} %"
    digits = 2 if value < 1.0 else 3
    return f"{value:.0f} %" if value >= WHOLE else f"{value:.{digits}g} %"


def rounded(value: float, std: float) -> str:
    """Return a value with its significant digits: two of them are uncertain by its standard deviation."""
    if not math.isfinite(std) or std <= 0.0:
        return f"{value:.4g}"
    digits = 1 - math.floor(math.log10(std))
    if abs(value) < LARGE and digits <= DIGITS:
        return f"{value:.{max(digits, 0)}f}"
    lead = math.floor(math.log10(abs(value))) if value else 0
    return f"{value:.{min(max(lead + digits, 0), 8)}e}" if value else "0"


def estimated(value: float, std: float, interval: tuple[float, float], held: str = "held") -> tuple[str, str]:
    """Return a value and its 95 % interval, both rounded to significant digits.

    In the place of the interval stands that the value is held, or that it is not identified.
    """
    if std <= 0.0 or not math.isfinite(std):
        return f"{value:.4g}", held if std <= 0.0 else "not identified"
    low, high = (rounded(end, std) for end in interval)
    return rounded(value, std), f"[{low}, {high}]"


def quantity(value: float, std: float, interval: tuple[float, float], unit: str) -> str:
    """Return a value with its 95 % interval and its unit."""
    size, reach = estimated(value, std, interval)
    words = f"{size} {reach} {unit}" if reach.startswith("[") else f"{size} {unit} ({reach})"
    return " ".join(words.split())


def listed(names: list[str], last: str = "and") -> str:
    """Return words in a row: a, b and c; "-" for none."""
    return f" {last} ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names) or "-"
