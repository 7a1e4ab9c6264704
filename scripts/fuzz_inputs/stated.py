"""What a study.toml states, right and wrong: values of other types, conventions of columns and of a walk."""

from __future__ import annotations

import json
import tomllib
from typing import Any

import numpy as np

from fuzz_inputs.texts import one_of

Rng = np.random.Generator
VALUES = (
    *('""', '"x"', '"nan"', "0", "1", "-1", "3.5", "nan", "inf", "-inf", "1e308", "true", "false", "[]", "{}", "[1]"),
    *("[[1]]", '["a", "b"]', "{ a = 1 }", '{ name = "q" }', "2020-01-01", "2020-01-01T00:00:00Z", "07:32:00", "[{}]"),
    *(
        "99999999999999999999",
        '"../../etc/passwd"',
        '"/dev/null"',
        '"."',
        '"\\u0000"',
        '"trials/*"',
        '"é"',
        "0x10",
        "1_0",
    ),
)
"""Any value as TOML writes it."""
UNITS = (
    "rad",
    "deg",
    "mrad",
    "rev",
    "m",
    "mm",
    "N m",
    "mN m",
    "N",
    "V",
    "counts",
    "",
    "furlong",
    "s",
    "ms",
    "rad/s",
    "A",
)
COLUMNS = ("time_s", "position", "velocity", "effort", "stim", "emg", "force_n", "pulse_width_us", "ignored")
ENTRY = {
    "name": ('"t"', '"Angle"', '"Torque"', '"column1"', '"no"', '""', "3"),
    "unit": tuple(json.dumps(unit) for unit in UNITS),
    "scale": ("1.0", "-1.0", "0", "1e-3", "nan", '"x"'),
    "zero": ("0.0", "20.0", "-1e9", "inf"),
    "edge": ("0.5", "-3", "nan"),
    "rate_hz": ("100.0", "0", "-5", "1e12", '"a"'),
}
FILE = {
    "delimiter": ('";"', '","', '"\\t"', '" "', '"|"', '""', '"ab"'),
    "decimal": ('","', '"."', '"x"'),
    "header_row": ("0", "1", "2", "3", "-1", "99", '"after comments"', '"x"'),
    "first_row": ("1", "3", "4", "0", "1000000"),
    "comment": ('"#"', '"%"', '""', '"t"'),
    "encoding": ('"utf-8"', '"utf-16"', '"cp1252"', '"rot13"', '"klingon"'),
    "names": ('["t", "Angle", "Torque"]', '["t"]', "[]", '["t", "t", "t"]', '[""]', "[1, 2]", '"t"'),
    "transposed": ("true", "false", "1"),
    "labelled": ("true", "false", '"a"'),
    "sheet": ('"Sheet1"', '""', "1"),
    "resample_hz": ("50.0", "1e9", "0", "-1", "33.3", "1e-6"),
    "rows": ('"events"', '"all"', "1"),
    "missing": ('"interpolate"', '"x"', "true"),
}
STATED = {
    **{f"knee_flexion_{side}": ('"positive"', '"negative"', '"up"') for side in ("left", "right")},
    **{f"dorsiflexion_{side}": ('"positive"', '"negative"', "1") for side in ("left", "right")},
    "angle_unit": ('"rad"', '"deg"', '"rev"'),
    **{f"{what}_unit": ('"m"', '"cm"', '"mm"', '"in"') for what in ("translation", "pressure")},
    "force_unit": ('"N"', '"kN"', '"lbf"'),
    "moment_unit": ('"N m"', '"N mm"', '"kN m"', "{}"),
    **{f"{what}_on": ('"foot"', '"ground"', '"plate"') for what in ("fx", "fy", "fz", "moments")},
    "moments_about": ('"pressure"', '"origin"', "true"),
    "axes": ('"level"', '"inclined"', "3"),
    **{
        f"{side}_plates": ('["r"]', '["l"]', '["1"]', "[1]", "[1, 2]", "[]", '"r"', '["r", "l"]')
        for side in ("left", "right")
    },
}
"""Keys of `[columns]`, `[columns.file]` and `[conventions]`, with values of which some cannot be."""


def some(keys: dict[str, tuple[str, ...]], rng: Rng, most: int) -> list[str]:
    """Up to `most` lines `key = value`."""
    names = rng.choice(list(keys), int(rng.integers(most + 1)), replace=False)
    return [f"{name} = {one_of(rng, keys[str(name)])}" for name in names]


def columns(rng: Rng) -> str:
    """Tables `[columns]` and `[columns.file]` for `t`, `Angle` and `Torque` in a text with a row of units."""
    right = {
        "time_s": '{ name = "t", unit = "ms" }',
        "position": '{ name = "Angle", unit = "deg" }',
        "effort": '{ name = "Torque", unit = "N m" }',
    }
    for _ in range(int(rng.choice((0, 0, 0, 1, 2)))):
        entry = f"{{ {', '.join(some(ENTRY, rng, 3))} }}"
        right[one_of(rng, COLUMNS)] = one_of(rng, (entry, entry, *VALUES))
    for _ in range(int(rng.uniform() < 0.15)):
        del right[one_of(rng, tuple(right))]
    form = {"header_row": "1", "first_row": "3"} | dict(
        line.split(" = ", 1) for line in some(FILE, rng, int(rng.uniform() < 0.5))
    )
    return (
        "\n".join(["[columns]", *(f"{k} = {v}" for k, v in right.items()), "", "[columns.file]"])
        + "\n"
        + "".join(f"{k} = {v}\n" for k, v in form.items())
    )


def mistyped(text: str, rng: Rng) -> str:
    """A study.toml of which one to three values are of another type, or keys are lost, renamed or new."""
    study = tomllib.loads(text)
    for _ in range(int(rng.integers(1, 4))):
        table: Any = study
        while isinstance(table, dict | list) and table and (table is study or rng.uniform() < 0.6):
            keys = list(table) if isinstance(table, dict) else list(range(len(table)))
            key = keys[int(rng.integers(len(keys)))]
            held, table = table, table[key]
        change = int(rng.integers(5))
        if change == 0:
            del held[key]
        elif change == 1 and isinstance(held, dict):
            held[one_of(rng, ("x", "", "name", "file", "é", "rate", "a.b"))] = held.pop(key)
        else:
            held[key] = tomllib.loads(f"a = {one_of(rng, VALUES)}")["a"]
    return "".join(_entry(name, value) for name, value in sorted(study.items(), key=_is_table))


def _is_table(item: tuple[str, Any]) -> bool:
    value = item[1]
    return isinstance(value, dict) or (isinstance(value, list) and any(isinstance(v, dict) for v in value))


def _entry(name: str, value: Any) -> str:
    key = json.dumps(name, ensure_ascii=False)
    if isinstance(value, dict):
        return f"[{key}]\n" + "".join(f"{json.dumps(n)} = {_value(v)}\n" for n, v in value.items()) + "\n"
    if isinstance(value, list) and value and all(isinstance(v, dict) for v in value):
        return "".join(f"[{_entry(name, v).replace(']', ']]', 1)}" for v in value)
    return f"{key} = {_value(value)}\n"


def _value(value: Any) -> str:
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{json.dumps(n)} = {_value(v)}" for n, v in value.items()) + " }"
    if isinstance(value, list):
        return f"[{', '.join(map(_value, value))}]"
    if isinstance(value, bool):
        return str(value).lower()
    return json.dumps(value) if isinstance(value, str) else str(value)
