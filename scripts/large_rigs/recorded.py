"""Integration with a held input, and what a laboratory stores of a reading: noise, counts, units, decimals."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from imposed_rigs.motion import wandering
from scipy.integrate import solve_ivp

from fes_pin.data.study import Study, read_study

HOLD = 6
"""Samples that an input is held for at least: every second and every third sample have all of its changes."""
LEVELS = (1e-4, 1e-2)
"""Deviation of a reading's noise, as a share of its range."""
COUNTS = (1e-4, 3e-3)
"""An encoder's or converter's count, in the same."""
SILENT, COLOURED, COUNTED = 0.3, 0.4, 0.25
"""Shares of studies without noise, of coloured noise among the others, and of readings in counts."""
UNITS = {"position": ("rad", "deg"), "angle_rad": ("rad", "deg"), "force_n": ("N", "mN")}
FACTORS = {"rad": 1.0, "deg": 180.0 / np.pi, "N": 1.0, "mN": 1000.0}
PASSIVE = ("f0_n", "f1_per_rad", "theta_r_rad")

Rates = Callable[[float, np.ndarray, float], Sequence[float]]


@dataclass(frozen=True)
class Take:
    """One trial before it is recorded.

    Attributes
    ----------
    inputs
        Columns that drive it, shape (n,) each.
    output, values
        The column that is read, and what it would read without noise, shape (n,).
    """

    dt: float
    output: str
    values: np.ndarray
    inputs: Mapping[str, np.ndarray] = field(default_factory=dict)
    kind: str = "motion"
    conditions: Mapping[str, float] = field(default_factory=dict)
    group: str | None = None


@dataclass(frozen=True)
class Drawn:
    """A rig, what is believed of it, its trials, and one more that nobody is shown.

    Attributes
    ----------
    truth
        Values of the model that has what is hidden, by their names in an answer.
    size
        Range of the reading, which noise is a share of; of a joint that turns round one turn at most.
    """

    rig: str
    known: Mapping[str, float]
    start: Mapping[str, float]
    truth: Mapping[str, float]
    takes: Sequence[Take]
    unseen: Take | None
    size: float
    urdf: str | None = None


@dataclass(frozen=True)
class Recording:
    """How a reading is stored; noise and counts are shares of its range, of correlation time 0 it is white."""

    noise: float
    correlation_s: float
    count: float
    decimals: int
    other_unit: bool

    def read(self, take: Take, size: float, rng: np.random.Generator) -> Take:
        """The trial with its reading as the file's digits have it, in SI."""
        n, std = len(take.values), self.noise * size
        white = self.correlation_s == 0.0
        noise = std * rng.standard_normal(n) if white else wandering(n, take.dt, std, self.correlation_s, rng)
        y, count, factor = take.values + noise, self.count * size, FACTORS[self.unit(take)]
        y = np.round(y / count) * count if count else y
        return replace(take, values=np.round(y * factor, self.decimals) / factor)

    def unit(self, take: Take) -> str:
        """The unit that the file has the reading in."""
        return UNITS[take.output][self.other_unit]


def recording_of(rng: np.random.Generator) -> Recording:
    """Draw how a study is recorded."""
    silent, coloured, counted = rng.random() < SILENT, rng.random() < COLOURED, rng.random() < COUNTED
    level, correlation_s, count = log_uniform(rng, *LEVELS), log_uniform(rng, 0.003, 0.05), log_uniform(rng, *COUNTS)
    decimals, other = int(rng.integers(4, 9)), bool(rng.random() < 0.5)
    return Recording(
        0.0 if silent else level, correlation_s if coloured else 0.0, count if counted else 0.0, decimals, other
    )


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """Draw a number whose logarithm is spread evenly."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def simulated(
    rates: Rates, state: Sequence[float], time: np.ndarray, breaks: np.ndarray, values: np.ndarray
) -> np.ndarray:
    """States at the samples, shape (n, states), by LSODA between the changes of the input.

    Parameters
    ----------
    rates
        Of time, state and input.
    breaks, values
        The input is `values[k]` from `breaks[k]` on; `breaks[0]` is the first sample's time.
    """
    out, now = np.empty((len(time), len(state))), np.asarray(state, dtype=float)
    inside = breaks < time[-1]
    ends = np.append(breaks[inside], time[-1])
    for a, b, value in zip(ends[:-1], ends[1:], values[inside], strict=True):
        low, high = np.searchsorted(time, a, "left"), np.searchsorted(time, b, "right")
        at = np.unique(np.append(time[low:high], b))
        run = solve_ivp(rates, (a, b), now, "LSODA", at, args=(float(value),), rtol=1e-9, atol=1e-11)
        out[low:high], now = run.y.T[: high - low], run.y[:, -1]
    return out


def held(levels: np.ndarray, samples: int, count: int) -> np.ndarray:
    """Each level for so many samples, shape (count,)."""
    return np.repeat(levels, samples)[:count]


def changes(column: np.ndarray, time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """When a held input changes, and what to: see `simulated`."""
    at = np.append(0, np.flatnonzero(np.diff(column)) + 1)
    return time[at], column[at]


def recorded(drawn: Drawn, how: Recording, rng: np.random.Generator, folder: Path) -> Study:
    """Write a study as a laboratory has it, and read it."""
    passive = {n: v for n, v in drawn.known.items() if n in PASSIVE}
    tables = {"rig": {n: v for n, v in drawn.known.items() if n not in PASSIVE}, "start": drawn.start}
    tables |= {"rig.passive": passive} if passive else {}
    lines = ["[study]", f'name = "{folder.name}"', f'rig = "{drawn.rig}"']
    for name, numbers in tables.items():
        lines += [f"[{name}]", *(f"{n} = {v:.12g}" for n, v in numbers.items())]
        lines += ['urdf = "rig.urdf"'] if drawn.urdf and name == "rig" else []
    if drawn.urdf:
        (folder / "rig.urdf").write_text(drawn.urdf, encoding="utf-8")
    takes = [how.read(take, drawn.size, rng) for take in drawn.takes]
    lines += _columns(takes[0], how)
    for k, take in enumerate(takes):
        unit = how.unit(take)
        columns = {
            "t": (np.arange(len(take.values)) * take.dt, "%.6f"),
            **{n: (v, "%.9g") for n, v in take.inputs.items()},
            "read": (take.values * FACTORS[unit], f"%.{how.decimals}f"),
        }
        table = np.column_stack([v for v, _ in columns.values()])
        formats = [f for _, f in columns.values()]
        np.savetxt(folder / f"{k:02d}.csv", table, formats, ",", header=",".join(columns), comments="")
        lines += ["[[trial]]", f'file = "{k:02d}.csv"', f'kind = "{take.kind}"']
        lines += [f"{n} = {v:.12g}" for n, v in take.conditions.items()]
        lines += [f'group = "{take.group}"'] if take.group else []
    (folder / "study.toml").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return read_study(folder)


def _columns(take: Take, how: Recording) -> list[str]:
    """The table that says what the file's columns are."""
    reading = f'{take.output} = {{ name = "read", unit = "{how.unit(take)}" }}'
    return [
        "[columns]",
        'time_s = { name = "t", unit = "s" }',
        reading,
        *(f'{n} = {{ name = "{n}" }}' for n in take.inputs),
    ]
