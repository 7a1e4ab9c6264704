"""Whether an answer depends on how a study is recorded: `scripts/recorded invariance GENERATOR...`.

Every study is drawn once and written in twelve ways that mean the same: other units, signs, names, orders of columns,
times, files, an angle that wraps. The trials that are read must be the same, and with `--diagnose` the verdicts too.
"""

from __future__ import annotations

import tempfile
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import tomli_w
import typer

import fes_pin as fp
from fes_pin.data.table import format_csv
from fes_pin.data.urdf import is_revolute
from harness.generators import generator_of

SAME = 1e-9
"""Share of a column's largest value by which it may differ: twelve digits are written of degrees and counts of time."""
LATER_S = 1000.0
"""By how much times are shifted, s."""
SMALL = {"effort": "m", "force_n": "m", "torque_nm": "m"}
"""Columns that are written in thousandths of their unit."""
ANGLES = {"position": "deg", "angle_rad": "deg", "velocity": "deg/s"}


@dataclass
class Written:
    """How the trials of a study are written.

    Attributes
    ----------
    files
        Columns by the name of a file, the time first.
    trials
        Keys of each `[[trial]]` that say where it is.
    tables
        Further tables of the study.toml.
    text
        How a file is made of its columns.
    """

    files: dict[str, dict[str, np.ndarray]] = field(default_factory=dict)
    trials: list[dict[str, Any]] = field(default_factory=list)
    tables: dict[str, Any] = field(default_factory=dict)
    text: Callable[[Mapping[str, np.ndarray]], str] = format_csv


def _each(study: fp.Study, change: Callable[[dict[str, np.ndarray]], dict[str, np.ndarray]], **more: Any) -> Written:
    """Every trial in a file of its own, with its columns changed."""
    made = Written(**more)
    for place, trial in enumerate(study.trials):
        made.files[f"{place}.csv"] = change({"time_s": trial.time, **trial.columns})
        made.trials.append({"file": f"{place}.csv"})
    return made


def _stated(study: fp.Study, factors: Mapping[str, float], said: Mapping[str, Any]) -> Written:
    """Columns times a factor, with what `[columns]` says of them."""
    names = ["time_s", *dict.fromkeys(n for t in study.trials for n in t.columns)]
    table = {n: said.get(n, {"name": n}) for n in names}
    return _each(study, lambda c: {n: v * factors.get(n, 1.0) for n, v in c.items()}, tables={"columns": table})


def reordered(study: fp.Study) -> Written:
    """The columns the other way round."""
    return _each(study, lambda c: {"time_s": c["time_s"], **dict(reversed([*c.items()][1:]))})


def renamed(study: fp.Study) -> Written:
    """Other names, and a column that is none of the rig's."""
    names = ["time_s", *dict.fromkeys(n for t in study.trials for n in t.columns)]
    called = {n: f"channel {k}" for k, n in enumerate(names)}
    table = {**{n: {"name": called[n]} for n in names}, "ignored": ["temperature"]}

    def change(columns: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        return {"temperature": np.full(len(columns["time_s"]), 21.5), **{called[n]: v for n, v in columns.items()}}

    return _each(study, change, tables={"columns": table})


def shifted(study: fp.Study) -> Written:
    """Times of a clock that began earlier."""
    return _each(study, lambda c: {**c, "time_s": c["time_s"] + LATER_S})


def in_milliseconds(study: fp.Study) -> Written:
    """Times in ms."""
    return _stated(study, {"time_s": 1e3}, {"time_s": {"name": "time_s", "unit": "ms"}})


def in_half_seconds(study: fp.Study) -> Written:
    """A clock that runs twice as fast."""
    return _stated(study, {"time_s": 2.0}, {"time_s": {"name": "time_s", "scale": 0.5}})


def in_degrees(study: fp.Study) -> Written:
    """Angles in degrees."""
    turns = is_revolute(study.urdf) is not False
    units = {n: u for n, u in ANGLES.items() if turns or n == "angle_rad"}
    return _stated(study, dict.fromkeys(units, 180.0 / np.pi), {n: {"name": n, "unit": u} for n, u in units.items()})


def in_thousandths(study: fp.Study) -> Written:
    """Forces and torques in mN or mN m."""
    force = "mN" if is_revolute(study.urdf) is False else "mN m"
    units = {"effort": force, "force_n": "mN", "torque_nm": "mN m"}
    return _stated(study, dict.fromkeys(units, 1e3), {n: {"name": n, "unit": u} for n, u in units.items()})


def turned_round(study: fp.Study) -> Written:
    """Readings and efforts that count the other way, as is said."""
    signed = ("position", "velocity", "effort", "force_n", "torque_nm", "angle_rad")
    return _stated(study, dict.fromkeys(signed, -1.0), {n: {"name": n, "scale": -1.0} for n in signed})


def wrapped(study: fp.Study) -> Written:
    """An angle that returns by a whole turn at half a turn from where it is most, without a word about it."""
    if is_revolute(study.urdf) is not True or "position" not in study.trials[0]:
        return _each(study, dict)
    return _each(study, lambda c: {**c, "position": np.mod(c["position"] + np.pi, 2.0 * np.pi) - np.pi})


def with_commas(study: fp.Study) -> Written:
    """Semicolons and decimal commas."""

    def text(columns: Mapping[str, np.ndarray]) -> str:
        return format_csv(columns).replace(",", ";").replace(".", ",")

    return _each(study, dict, tables={"columns": {"file": {"delimiter": ";", "decimal": ","}}}, text=text)


def in_one_file(study: fp.Study) -> Written:
    """All trials with the same columns in one file, as stretches of it."""
    made, begin = Written(), {}
    for trial in study.trials:
        name = f"{'_'.join(trial.columns)}.csv"
        earlier = made.files.setdefault(name, {n: np.zeros(0) for n in ("time_s", *trial.columns)})
        later = begin.get(name, 0.0) - trial.time[0]
        own = {"time_s": trial.time + later, **trial.columns}
        made.files[name] = {n: np.concatenate([earlier[n], own[n]]) for n in earlier}
        begin[name] = float(own["time_s"][-1]) + 10.0
        half = 0.5 * trial.dt
        made.trials.append({"file": name, "from": own["time_s"][0] - half, "to": own["time_s"][-1] + half})
    return made


def in_two_files(study: fp.Study) -> Written:
    """Each column in a file of its own, by the first of which the time is."""
    made = Written()
    names = [*dict.fromkeys(n for t in study.trials for n in t.columns)]
    made.tables["sources"] = {n: {"time_s": {"name": "time_s"}, n: {"name": n}} for n in names}
    for place, trial in enumerate(study.trials):
        files = {n: f"{n}_{place}.csv" for n in trial.columns}
        made.files |= {files[n]: {"time_s": trial.time, n: v} for n, v in trial.columns.items()}
        made.trials.append({"sources": files, "name": f"{place}"})
    return made


WAYS: dict[str, Callable[[fp.Study], Written]] = {
    way.__name__.replace("_", " "): way
    for way in (
        *(reordered, renamed, shifted, in_milliseconds, in_half_seconds, in_degrees, in_thousandths, turned_round),
        *(wrapped, with_commas, in_one_file, in_two_files),
    )
}
"""Twelve ways to record the same."""


def recorded_as(study: fp.Study, way: str, folder: Path) -> fp.Study:
    """A study as it is read after it was recorded in another way."""
    fp.write_study(study, folder)
    place = folder / "study.toml"
    document = tomllib.loads(place.read_text("utf-8"))
    made = WAYS[way](study)
    kept = [{k: v for k, v in t.items() if k not in ("file", "name")} for t in document.pop("trial")]
    trials = [{"name": t.name, **one, **rest} for t, one, rest in zip(study.trials, made.trials, kept, strict=True)]
    place.write_text(tomli_w.dumps({**document, **made.tables, "trial": trials}), "utf-8")
    for name, columns in made.files.items():
        (folder / name).write_text(made.text(columns), "utf-8")
    return fp.read_study(folder)


def difference(study: fp.Study, other: fp.Study) -> float:
    """The largest difference of two studies' trials, as a share of each column's largest value; turns count as none."""
    worst = 0.0
    for one, two in zip(study.trials, other.trials, strict=True):
        if one.kind != two.kind or set(one.columns) != set(two.columns) or len(one) != len(two):
            return np.inf
        pairs = [(one.time - one.time[0], two.time - two.time[0]), *((one[n], two[n]) for n in one.columns)]
        for a, b in pairs:
            missed = b - a
            if np.abs(missed).max() > 1.0:
                missed = missed - 2.0 * np.pi * np.round(np.median(missed) / (2.0 * np.pi))
            worst = max(worst, float(np.abs(missed).max()) / max(float(np.abs(a).max()), 1e-12))
    return worst


def alike(study: fp.Study, other: fp.Study) -> bool:
    """Whether a diagnosis begins from the same numbers to the last bit, and so ends in the same verdict."""
    pairs = zip(study.trials, other.trials, strict=True)
    stated = all(one.conditions == two.conditions and one.time[0] == two.time[0] for one, two in pairs)
    return stated and difference(study, other) == 0.0


def verdict(study: fp.Study) -> tuple[Any, ...]:
    """What a diagnosis says of a study, without numbers."""
    found = fp.diagnose(study)
    return found.verdict, *((c.name, c.equivalents) for c in found.causes)


def main(
    generators: Annotated[list[str], typer.Argument(help="Of rigs.")],
    count: Annotated[int, typer.Option(help="Studies of each generator.")] = 20,
    seed: Annotated[int, typer.Option(help="Of the first.")] = 0,
    diagnose: Annotated[bool, typer.Option("--diagnose", help="Compare the verdicts as well.")] = False,
) -> None:
    """Count the studies that are read the same in each way, and print those that are not."""
    for generator in generators:
        made, same, asked, kept = generator_of(generator), 0, 0, 0
        with tempfile.TemporaryDirectory() as name:
            for item in islice(made.plan(seed), count):
                folder = Path(name) / item.key
                folder.mkdir()
                study = made.make(item, folder)[0]
                said = verdict(study) if diagnose else ()
                for way in WAYS:
                    place = Path(name) / f"{item.key} {way}"
                    other = recorded_as(study, way, place)
                    off = difference(study, other)
                    is_kept = not diagnose or alike(study, other) or verdict(other) == said
                    same, asked, kept = same + (off <= SAME), asked + 1, kept + is_kept
                    if off > SAME or not is_kept:
                        print(f"{generator} {item.key} {way}: differs by {off:.3g}, verdict kept {is_kept}", flush=True)
        more = f", {kept} of {asked} with the same verdict" if diagnose else ""
        print(f"{generator}: {same} of {asked} read the same{more}", flush=True)


if __name__ == "__main__":
    typer.run(main)
