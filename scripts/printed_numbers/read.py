"""Numbers that an answer prints, compared with those that it saves.

A printed number equals a saved one if it is the saved one, rounded to the digits that are printed.
"""

import html
import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from fes_pin.infer.text import plain_name

NUMBER = r"-?\d+(?:\.\d+)?(?:e[-+]?\d+)?"
BETWEEN = r"\s*(?:\|\s*[^|\[\d]{0,24}\|)?\s*"
"""Between an estimate and its interval: nothing, or the cell of a unit."""
INTERVALS = re.compile(
    rf"(?P<name>[\w.]*)[ |]*(?P<value>{NUMBER}) ?%?{BETWEEN}\[(?P<low>{NUMBER}), (?P<high>{NUMBER})\]"
)
MEASURES = r"predictions one sample ahead|predictions [\d.]+ s ahead|free simulations|the ground reaction"
ERRORS = re.compile(
    rf"(?P<measure>{MEASURES})[^\d%]{{0,60}}?(?P<nominal>{NUMBER}) %[^\d%]{{1,4}}(?P<extended>{NUMBER}) %"
)
SHARES = re.compile(rf"(?P<below>below )?(?P<value>{NUMBER}) %")
P_VALUES = re.compile(rf"\bp (?P<below><)?=? ?(?P<value>{NUMBER})")
METHOD = re.compile(r"\b95 %|: 0 % is a perfect model, 100 %")
"""Shares that are no result."""
ENDS = ("value", "low", "high"), ("added", "low", "high"), ("percent", "low", "high")


@dataclass(frozen=True)
class Printed:
    """A number that is printed: where, in which words, and whether the saved answer has it."""

    where: str
    words: str
    is_saved: bool


def page_text(page: str) -> str:
    """Return the text of a page, with a bar between the texts of two elements; without figures and their captions."""
    drawn = r"<(script|style|svg|math|figcaption)\b.*?</\1>"
    seen = re.sub(drawn, "", page, flags=re.DOTALL)
    return re.sub(r"[| ]*\|[| ]*", " | ", re.sub(r"\s+", " ", html.unescape(re.sub(r"<[^>]+>", "|", seen))))


def terminal_text(printed: str) -> str:
    """Return what a terminal shows without the breaks of its lines and the rules of its tables."""
    return re.sub(
        r"\s+", " ", re.sub("[\N{BOX DRAWINGS LIGHT HORIZONTAL}\N{BOX DRAWINGS HEAVY HORIZONTAL}]+", "", printed)
    )


def agrees(printed: str, saved: float) -> bool:
    """Return whether a number is another one, rounded to the digits that are printed."""
    mantissa, _, power = printed.partition("e")
    unit = 10.0 ** (int(power or 0) - len(mantissa.partition(".")[2]))
    if not math.isfinite(saved):
        return False
    whole = "." not in mantissa and not power
    digits = len(mantissa.strip("-").rstrip("0")) if whole else 0
    if whole and float(mantissa):  # 2360 may be rounded to tens
        unit = 10.0 ** (len(mantissa.strip("-")) - max(digits, 1))
        unit = unit if abs(float(mantissa)) > unit else 1.0
    return abs(float(printed) - saved) <= 0.5 * unit * (1.0 + 1e-6) + 1e-5 * abs(saved)


def walked(record: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """Yield every table and number of a JSON file, with its path; numbers within its strings too."""
    if isinstance(record, dict):
        yield path, record
        for key, value in record.items():
            yield from walked(value, f"{path}/{key}")
    elif isinstance(record, list):
        for value in record:
            yield from walked(value, path)
    elif isinstance(record, str):
        yield from ((f"{path}/words", float(n)) for n in re.findall(NUMBER, record))
    elif isinstance(record, int | float) and not isinstance(record, bool):
        yield path, float(record)


class Saved:
    """The numbers of a JSON file.

    Parameters
    ----------
    record
        The file.
    """

    def __init__(self, record: Any) -> None:
        pairs = list(walked({n: v for n, v in record.items() if n not in ("text", "table", "provenance")}))
        numbers = [(path, one) for path, one in pairs if isinstance(one, float)]
        self.errors = [(e["measure"], e["nominal"], e["extended"]) for e in record.get("errors", [])]
        self.shares = [one for path, one in numbers if re.search("percent|error|words", path)]
        self.shares += [100.0 * one for path, one in numbers if re.search("at_most|/repeats/", path)]
        self.shares += [100.0 * (1.0 - after / before) for _, before, after in self.errors if before]
        self.p_values = [one for path, one in numbers if path.endswith("p_value")]
        self.triples = list(_triples(pairs))

    def has_interval(self, name: str, value: str, low: str, high: str) -> bool:
        """Return whether an estimate with its interval stands in the file, under its name if that is a parameter's."""
        named = [one for n, one in self.triples if name.rpartition(".")[2] in _printed_names(n)]
        return any(
            all(agrees(p, s) for p, s in zip((value, low, high), one, strict=True))
            for one in named or [one for _, one in self.triples]
        )

    def has_errors(self, measure: str, nominal: str, extended: str) -> bool:
        """Return whether the errors E of both models stand in the file, under their measure."""
        return any(m.endswith(measure) and agrees(nominal, n) and agrees(extended, e) for m, n, e in self.errors)


def _printed_names(name: str) -> set[str]:
    """Return a parameter's name as it is saved, and the last word of its names in words, on every rig."""
    return {name, *(plain_name(name, unit).rpartition(" ")[2] for unit in ("", "N"))}


def _triples(pairs: list[tuple[str, Any]]) -> Iterator[tuple[str, tuple[float, float, float]]]:
    """Yield estimates with their intervals, by name."""
    for path, one in pairs:
        if not isinstance(one, dict):
            continue
        name = path.rpartition("/")[2]
        for keys in ENDS:
            if all(isinstance(one.get(k), int | float) for k in keys):
                yield name, (one[keys[0]], one[keys[1]], one[keys[2]])
        if one.get("ci95"):
            yield name, (one["held_out"] if one.get("held_out") is not None else one["fit"], *one["ci95"])


def printed_in(text: str, where: str, saved: Saved) -> Iterator[Printed]:
    """Yield the estimates, errors, shares and p-values of a text, each with whether the saved answer has it."""
    for one in INTERVALS.finditer(text):
        yield Printed(where, one[0], saved.has_interval(**one.groupdict()))
    for one in ERRORS.finditer(text):
        yield Printed(where, one[0], saved.has_errors(**one.groupdict()))
    left = METHOD.sub(" ", INTERVALS.sub(" ", text))
    for pattern, known in ((SHARES, saved.shares), (P_VALUES, saved.p_values)):
        for one in pattern.finditer(left):
            around = left[max(one.start() - 40, 0) : one.end()]
            same = agrees if one["below"] is None else lambda printed, number: number <= float(printed)
            yield Printed(where, around, any(same(one["value"], k) for k in known))
