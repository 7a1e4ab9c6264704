"""Headers of programs that describe each channel apart from the columns: AcqKnowledge, OpenSignals, LabVIEW."""

import json
import re
from collections.abc import Sequence
from typing import Any, NamedTuple

from fes_pin.data.recorded.form import TextForm, cells_of
from fes_pin.data.units import UNITS, known_unit

_CHANNELS = re.compile(r"^(\d+) channels?$")
_EACH = re.compile(r"^(\d+(?:\.\d*)?(?:[eE][+-]?\d+)?)\s*(\w+)/sample\b")
_LABVIEW_END = "***End_of_Header***"
FASTEST_HZ = 1e9
"""No logger samples faster (a round figure): what a header states beyond is no rate."""


class ChannelHeader(NamedTuple):
    """Names of columns, by place the units that are stated, the sample rate in Hz, and the line of the names or 0."""

    names: tuple[str, ...]
    units: dict[int, str]
    rate_hz: float | None
    row: int


def channels_of(lines: Sequence[str], form: TextForm, columns: int) -> ChannelHeader | None:
    """What lines above the numbers describe of this many columns; None where they are of another program."""
    known = (read(lines, form, columns) for read in (_acqknowledge, _opensignals, _labview))
    return next((found for found in known if found), None)


def _acqknowledge(lines: Sequence[str], form: TextForm, columns: int) -> ChannelHeader | None:
    """`0.5 msec/sample`, `2 channels`, then a label and a unit for each; a line `min  CH1  CH2` stands below."""
    texts = [line.strip() for line in lines]
    start = next((k for k, text in enumerate(texts) if _CHANNELS.match(text)), None)
    if start is None:
        return None
    count = int(texts[start].split()[0])
    pairs = texts[start + 1 : start + 1 + 2 * count]
    below = [k for k in range(start + 1 + 2 * count, len(texts)) if texts[k]]
    row = below[0] if below else start
    cells = cells_of(lines[row], form)
    ahead = columns - count
    if len(pairs) < 2 * count or not below or ahead not in (0, 1) or len(cells) != columns:
        return None
    units = {k: unit for k, unit in enumerate([*cells[:ahead], *pairs[1::2]]) if unit}
    return ChannelHeader((*["Time"] * ahead, *pairs[::2]), units, _rate_hz(texts[:start]), row + 1)


def _labview(lines: Sequence[str], form: TextForm, columns: int) -> ChannelHeader | None:
    """Keys with a cell for each column down to `***End_of_Header***`, then the names, and `Comment` of the remarks."""
    ends = [k for k, line in enumerate(lines) if line.startswith(_LABVIEW_END)]
    names = cells_of(lines[ends[-1] + 1], form) if ends and ends[-1] + 1 < len(lines) else []
    if names[-1:] == ["Comment"] and len(names) == columns + 1:
        names = names[:-1]
    if len(names) != columns:
        return None
    keyed = {cells[0]: cells[1:] for line in lines[: ends[-1]] if (cells := cells_of(line, form))}
    units = {k: unit for k, unit in enumerate(keyed.get("Y_Unit_Label", []), 1) if unit and k < columns}
    if set(keyed.get("X_Dimension", [])) - {""} == {"Time"}:
        units |= {k: "s" for k, name in enumerate(names) if name == "X_Value"}
    steps = {step.replace(",", ".") for step in keyed.get("Delta_X", []) if step}
    rate = _rate_hz([f"{steps.pop()} sec/sample"]) if len(steps) == 1 else None
    return ChannelHeader(tuple(names), units, rate, ends[-1] + 2)


def _rate_hz(texts: Sequence[str]) -> float | None:
    """The rate that a line like `0.5 msec/sample` states, Hz."""
    each = next((found for text in texts if (found := _EACH.match(text))), None)
    step = known_unit(each[2], ("time",)) if each else None
    seconds = float(each[1]) * UNITS["time"][step[1]] if each and step else 0.0
    return 1.0 / seconds if seconds > 0.0 else None


def _opensignals(lines: Sequence[str], form: TextForm, columns: int) -> ChannelHeader | None:
    """A comment holds JSON: each device has the names of its columns, what its channels sense, and the sample rate."""
    for row, line in enumerate(lines, 1):
        text = line.strip().removeprefix(form.comment or "#").strip()
        devices = _table(text) if text.startswith("{") else {}
        known = [one for one in devices.values() if isinstance(one, dict) and isinstance(one.get("column"), list)]
        names = [name for one in known for name in _sensed(one)]
        rates = [one.get("sampling rate") for one in known]
        if known and len(names) == columns:
            rate = rates[0] if rates.count(rates[0]) == len(rates) else None
            stated = float(rate) if isinstance(rate, int | float) and 0.0 < rate < FASTEST_HZ else None
            return ChannelHeader(tuple(names), {}, stated, row)
    return None


def _table(text: str) -> dict[str, Any]:
    try:
        found = json.loads(text)
    except (ValueError, RecursionError):
        return {}
    return found if isinstance(found, dict) else {}


def _sensed(device: dict[str, Any]) -> list[str]:
    """Names of a device's columns; of its channels, which come last, with what they sense: `CH1 TORQUE`."""
    names, sensors = ([str(each) for each in device.get(key) or []] for key in ("column", "sensor"))
    ahead = max(len(names) - len(sensors), 0)
    return [*names[:ahead], *(" ".join(each) for each in zip(names[ahead:], sensors, strict=False))]
