"""Noise, ranges and log of a saved model: the tables `random`, `range` and `log` of a `model.toml`.

Noise of each output column, autoregressive where it is coloured, and first-order random processes. Models that older
versions saved of rigs that are simulated freely have autoregressive noise by output column, `noise`.
"""

import warnings
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from fes_pin.data.log import Log
from fes_pin.data.schema import NumberKey
from fes_pin.data.toml import Document, read_toml
from fes_pin.identify.likelihood_fit import LikelihoodFit
from fes_pin.infer.noise import Noise, NoiseModel
from fes_pin.models.predictor import StateSpaceNoise

KEY = "random"
LOG_KEY = "log"
RANGE_KEY = "range"
_PARTS = ("white", "std", "time")
_LAG = ("correlation_s", "lasts_s")
"""Key of the correlation time of measurement noise, and its name in models that version 0.1 saved."""
_LOG = {
    "effort_late_s": NumberKey("s", required=False),
    "effort_over_s": NumberKey("s", lower=0.0, required=False),
    "effort_noise": NumberKey("N m or N", lower=0.0, required=False),
    "low_pass_hz": NumberKey("Hz", lower=0.0, required=False),
}
"""Keys of a `Log` in a file."""
_NOISE = {"std": NumberKey(""), "innovation_std": NumberKey(""), "step_s": NumberKey("s")}


def stored_tables(fitted: LikelihoodFit, log: Log) -> dict[str, dict[str, Any]]:
    """Return the tables of a fit's noise, of the range of each column of its trials, and of its log."""
    names = dict.fromkeys(n for t in fitted.trials for n in t.columns)
    ends = {n: [(np.nanmin(t[n]), np.nanmax(t[n])) for t in fitted.trials if n in t] for n in names}
    ranges = {n: [float(np.min(v)), float(np.max(v))] for n, v in ends.items()}
    tables = {KEY: _random_table(fitted.noise), RANGE_KEY: ranges}
    return {**tables, **({LOG_KEY: log_table(log)} if log != Log() else {})}


def log_table(log: Log) -> dict[str, float]:
    """Return the faults of a log, by name."""
    return {n: float(v) for n, v in asdict(log).items() if v}


def load_log(path: str | Path) -> Log:
    """Read the faults of a rig's log, as `diagnose` found them.

    Raises
    ------
    InputError
        For a table that is not as `stored_tables` writes it: names the row and the key.
    """
    document = read_toml(path)
    return Log(**document.numbers(LOG_KEY, document.table(LOG_KEY), _LOG))


def load_range(path: str | Path) -> dict[str, tuple[float, float]]:
    """Read the range of each column of the trials that a model was fitted to; none of a model saved without it.

    Raises
    ------
    InputError
        For a table that is not as `stored_tables` writes it: names the row and the key.
    """
    document, ranges = read_toml(path), dict[str, tuple[float, float]]()
    for name, ends in document.table(RANGE_KEY).items():
        both = _coefficients(document, f"{RANGE_KEY}.{name}", ends)
        if len(both) != 2:
            raise document.error(f"{RANGE_KEY}.{name}", "expected [lowest, highest]")
        ranges[name] = (both[0], both[1])
    return ranges


def _random_table(noise: StateSpaceNoise) -> dict[str, Any]:
    parts = {part: {n: float(v) for n, v in getattr(noise, part).items()} for part in _PARTS}
    ar = {n: [float(a) for a in own] for n, own in noise.ar.items() if own}
    lag = float(noise.correlation_s)
    return {**({"correlation_s": lag} if lag else {}), **parts, **({"ar": ar} if ar else {})}


def load_random(path: str | Path) -> NoiseModel | None:
    """Read the noise of a rig, as `diagnose` estimated it; None of a model that was saved without it.

    Raises
    ------
    InputError
        For a table that is not as `stored_tables` writes it: names the row and the key.
    """
    document = read_toml(path)
    if KEY not in document.data:
        return None
    table = document.table(KEY)
    if "noise" not in table:
        parts = {part: _numbers(document, table, part) for part in _PARTS}
        own = document.table(f"{KEY}.ar", table) if "ar" in table else {}
        ar = {n: _coefficients(document, f"{KEY}.ar.{n}", one) for n, one in own.items()}
        others = {n: v for n, v in table.items() if n not in (*_PARTS, "ar")}
        lag = document.numbers(KEY, others, dict.fromkeys(_LAG, NumberKey("s", required=False)))
        if "lasts_s" in lag:
            said = f"{path}: lasts_s of [{KEY}] is correlation_s now; it ends with version 0.3"
            warnings.warn(said, DeprecationWarning, stacklevel=2)
        return StateSpaceNoise(parts["white"], parts["std"], parts["time"], next(iter(lag.values()), 0.0), ar)
    channels = document.table(f"{KEY}.noise", table)
    return {name: _noise(document, name, channels) for name in channels}


def _numbers(document: Document, table: dict[str, Any], part: str) -> dict[str, float]:
    values = document.table(f"{KEY}.{part}", table)
    return document.numbers(f"{KEY}.{part}", values, dict.fromkeys(values, NumberKey("")))


def _noise(document: Document, name: str, channels: dict[str, Any]) -> Noise:
    key = f"{KEY}.noise.{name}"
    one = dict(document.table(key, channels))
    ar = _coefficients(document, f"{key}.ar", one.pop("ar", None))
    numbers = document.numbers(key, one, _NOISE)
    return Noise(numbers["innovation_std"], ar, numbers["std"], numbers["step_s"])


def _coefficients(document: Document, key: str, given: object) -> tuple[float, ...]:
    if not isinstance(given, list) or not all(isinstance(a, int | float) and not isinstance(a, bool) for a in given):
        raise document.error(key, "expected a list of numbers")
    return tuple(float(a) for a in given)
