"""Recordings that are no plain table: serial logs, trials side by side, nested `.json` and `.mat`."""

from __future__ import annotations

import io
import json
import re
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import scipy.io

from fuzz_inputs.texts import NAMES, one_of

Rng = np.random.Generator
ODD_VALUES: tuple[Any, ...] = (
    *(None, True, "x", "", 3, -1.5, 1e308, [], {}, [1, "a"], [[1, 2], [3]], [None, 1.0, 2.0, 3.0], "Grad °"),
    *(float("nan"), float("inf"), 10**400, [[[1.0, 2.0]]], {"": [1, 2, 3]}, ["1", "2", "3", "4"]),
)
KEYS = (
    "t_s",
    "time_s",
    "angle",
    "Angle",
    "torque",
    "fs",
    "SampleRate",
    "trials",
    "run1",
    "data",
    "x",
    "names",
    "a.b",
    "values",
)


def serial(rng: Rng) -> tuple[bytes, list[str]]:
    """Lines of a serial port that name their numbers, some broken, and the names."""
    names = [one_of(rng, ("t_ms", "t_ms", "t")), "angle", "Torque"][: int(rng.integers(2, 4))]
    if rng.uniform() < 0.3:
        names = [one_of(rng, ("t", "ms", "angle", "Torque", "q", "t_ms")) for _ in range(int(rng.integers(2, 4)))]
    equals, between = one_of(rng, (": ", "=", ":", " = ", " ")), one_of(rng, (", ", " ", "\t", "; ", "\n"))
    units = [one_of(rng, ("",) * 9 + (" deg", "Nm", " ms", " %", " furlong")) for _ in names]
    odd = float(rng.choice((0.0, 0.02, 0.1)))
    lines = ["Booting...", "ready"][: int(rng.integers(3))]
    for k in range(int(rng.choice((60, 60, 30, 30, 3, 1, 0)))):
        values = [10 * k if n in ("t", "ms", "t_ms") else 20.0 * np.sin(k / 5 + j) for j, n in enumerate(names)]
        lines.append(between.join(f"{n}{equals}{v:.4g}{u}" for n, v, u in zip(names, values, units, strict=True)))
        if rng.uniform() < odd:
            lines.append(one_of(rng, ("overrun", "angle: ", "", lines[-1][:5], "t: nan", "E (123) i2c: timeout")))
    return "\n".join(lines).encode(), names


def side_by_side(rng: Rng) -> tuple[bytes, list[str]]:
    """Two to four trials in the columns of one table, which may end apart, and the names of the columns."""
    form = one_of(rng, ("{n}", "{n}_{k}", "trial{k}_{n}", "{n} {k}", "trial{k}_{n}", "{k}", "T{k}.{n}"))
    each = [one_of(rng, ("time_s", "time_s", "t")), "angle", "torque"][int(rng.integers(2)) : int(rng.integers(2, 4))]
    count = int(rng.integers(2, 5))
    names = [form.format(n=n, k=k) for k in range(1, count + 1) for n in each]
    if shared := rng.uniform() < 0.5:
        names = ["time_s", *names]
    longest = int(rng.choice((40, 40, 40, 8, 2)))
    ends = [int(rng.integers(longest // 2, longest + 1)) if rng.uniform() < 0.6 else longest for _ in range(count)]
    between = one_of(rng, (",", ",", ",", ";"))
    rows = [names] if rng.uniform() < 0.8 else [[f"Trial {k // len(each)}" for k in range(len(names))], names]
    for k in range(longest):
        cells = [
            f"{0.01 * k if n in ('t', 'time_s') else np.sin(k / 5):.4g}" if k < end else ""
            for end in ends
            for n in each
        ]
        rows.append([f"{0.01 * k:.4g}", *cells] if shared else cells)
    return "\n".join(between.join(row) for row in rows).encode(), names


def nested(rng: Rng, suffix: str) -> tuple[bytes, list[str]]:
    """A file that nests vectors of one length and of others, records, words and nothing; names of some vectors."""
    made = _node(rng, 0)
    if suffix == ".json":
        content = json.dumps([made] if rng.uniform() < 0.2 else made, default=lambda v: v.tolist()).encode()
    else:
        out = io.BytesIO()
        scipy.io.savemat(out, _matlab(made if isinstance(made, dict) and made else {"v": made}), long_field_names=True)
        content = out.getvalue()
    return content, [*_leaves(made)]


def _leaves(node: Any, name: str = "") -> Iterator[str]:
    if isinstance(node, dict):
        for key, value in node.items():
            yield from _leaves(value, f"{name}.{key}" if name else key)
    elif isinstance(node, np.ndarray):
        yield name


def _node(rng: Rng, depth: int) -> Any:
    """Trials of vectors; what is no trial, and odd values, at any depth."""
    if depth > 2:
        return ODD_VALUES[int(rng.integers(len(ODD_VALUES)))]
    make: tuple[Callable[[], Any], ...] = (
        lambda: ODD_VALUES[int(rng.integers(len(ODD_VALUES)))],
        lambda: {one_of(rng, (*KEYS, *NAMES[:8])): _vector(rng, 40) for _ in range(int(rng.integers(1, 5)))},
        lambda: [{"t_s": 0.01 * k, "angle": np.sin(k / 5), "on": k > 3} for k in range(int(rng.integers(30)))],
        lambda: [_trial(rng) for _ in range(int(rng.integers(1, 4)))],
        lambda: {"trials": [_trial(rng) for _ in range(int(rng.integers(1, 4)))]},
        lambda: {"data": _trial(rng)},
        lambda: _trial(rng),
        lambda: {one_of(rng, KEYS): _node(rng, depth + 1) for _ in range(int(rng.integers(1, 4)))},
        lambda: {**_trial(rng), one_of(rng, KEYS): _node(rng, depth + 1)},
    )
    return make[int(rng.integers(len(make)))]()


def _trial(rng: Rng) -> dict[str, Any]:
    """A trial of three vectors, of which each may be another one."""
    count = int(rng.choice((30, 40)))
    right = {n: np.sin(np.arange(count) / 5) for n in ("angle", "torque")} | {"t_s": 0.01 * np.arange(count)}
    trial: dict[str, Any] = {
        n: right[n] if rng.uniform() < 0.85 else _vector(rng, count) for n in ("t_s", "angle", "torque")
    }
    return trial | ({"fs": 100.0} if rng.uniform() < 0.3 else {})


def _vector(rng: Rng, count: int) -> Any:
    count = int(rng.choice((3, 0, 1))) if rng.uniform() < 0.1 else count
    values = float(rng.choice((1.0, 1.0, 20.0, 1.0, 20.0, 1e30))) * np.sin(np.arange(count) / 5)
    kinds: tuple[Any, ...] = (values, values, values, 0.01 * np.arange(count), np.where(values > 0.9, np.nan, values))
    kinds += (values.reshape(1, -1), values.reshape(-1, 1), np.stack([values, values]), values.astype(np.float32))
    return kinds[int(rng.integers(len(kinds)))]


def _matlab(node: Any) -> Any:
    """What MATLAB can hold of a node: names that it allows, cells for lists."""
    if isinstance(node, dict):
        return {
            re.sub(r"^(?![A-Za-z])", "v", re.sub(r"\W", "_", n))[:60]: _matlab(v) for n, v in node.items()
        } or np.zeros(0)
    if isinstance(node, list):
        cells = np.empty(len(node), dtype=object)
        for k, one in enumerate(node):
            cells[k] = _matlab(one)
        return cells
    if node is None or (isinstance(node, int) and abs(node) > 1 << 60):
        return np.zeros((0, 0))
    return node
