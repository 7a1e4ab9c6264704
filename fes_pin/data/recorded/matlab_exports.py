"""Files that keep names, units and rates apart from their numbers: of LabChart, AcqKnowledge, `importdata`, pandas."""

from collections.abc import Mapping
from contextlib import suppress
from typing import Any

import numpy as np

from fes_pin.data.recorded.text import without_twins
from fes_pin.data.units import UNITS, known_unit

LABELS = ("labels", "colheaders", "titles", "names", "channels", "channel_names", "headers", "columns", "variables")
"""Keys of what a matrix in the same structure has as the names of its columns."""
OF_LABCHART = frozenset({"data", "datastart", "dataend", "titles", "samplerate"})
"""Keys of an export of LabChart: one vector, and where in it each channel of each block lies, from 1."""


def with_names(content: Any) -> Any:
    """What a file nests, with the names that stand next to its matrices: `data.Torque [Nm]` instead of `data.2`.

    A LabChart file has a structure for each block, and in it one for each channel, as a file of Spike2 has.
    """
    if isinstance(content, list):
        return content if all(isinstance(one, int | float) for one in content) else [with_names(one) for one in content]
    if not isinstance(content, Mapping):
        return content
    if content.keys() >= OF_LABCHART:
        with suppress(ValueError, TypeError, IndexError):  # where it is something else, it stays as it is
            return _of_labchart(content)
    labels = next((found for key in LABELS if len(found := _words(content.get(key))) > 1), [])
    units = _words(content.get("units"))
    if len(units) == len(labels):
        labels = [f"{label} [{unit}]" if unit else label for label, unit in zip(labels, units, strict=True)]
    out = {key: _columns(value, labels) or with_names(value) for key, value in content.items()}
    if (step := known_unit(str(content.get("isi_units")), ("time",))) and isinstance(content.get("isi"), int | float):
        out["interval"] = float(content["isi"]) * UNITS["time"][step[1]]  # of AcqKnowledge
    return out


def _words(value: Any) -> list[str]:
    """Texts of a list or an array of texts; none of anything else."""
    found = [value] if isinstance(value, str) else value.ravel().tolist() if isinstance(value, np.ndarray) else value
    is_text = isinstance(found, list) and all(isinstance(one, str) for one in found)
    return [one.strip() for one in found] if is_text else []


def _columns(value: Any, labels: list[str]) -> dict[str, np.ndarray]:
    """The columns of a matrix of as many as there are labels, by these; none of anything else."""
    try:
        matrix: np.ndarray = np.asarray(value) if labels else np.zeros(0)
    except ValueError:
        return {}
    if matrix.dtype.kind not in "biuf" or matrix.ndim != 2 or len(labels) not in matrix.shape:
        return {}
    return dict(zip(without_twins(labels), matrix.T if matrix.shape[1] == len(labels) else matrix, strict=True))


def _of_labchart(content: Mapping[str, Any]) -> dict[str, Any]:
    """Recordings of LabChart, the blocks between its stops; one alone is the file itself."""
    titles, texts, data = _words(content["titles"]), _words(content.get("unittext")), np.ravel(content["data"])
    keys = ("datastart", "dataend", "samplerate", "unittextmap")
    tables = [np.reshape(content.get(key, np.zeros(np.shape(content[keys[0]]))), (len(titles), -1)) for key in keys]
    starts, ends, rates, which = np.stack(tables).astype(float)
    if not np.abs([starts, ends, which]).max() <= data.size:
        raise ValueError("expected places in the data")
    blocks: dict[str, Any] = {f"recording{block + 1}": {} for block in range(starts.shape[1])}
    for place, title in enumerate(without_twins(titles)):
        for block, found in enumerate(blocks.values()):
            start, unit = int(starts[place, block]), int(which[place, block])
            if start > 0:  # else the channel was off
                channel = {
                    "values": data[start - 1 : int(ends[place, block])],
                    "samplerate": float(rates[place, block]),
                }
                found[title] = channel | ({"units": texts[unit - 1]} if 0 < unit <= len(texts) else {})
    return blocks if len(blocks) > 1 else blocks["recording1"]
