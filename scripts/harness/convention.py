"""Joints whose columns are in another convention than is stated: `scripts/recorded conventions`.

Every study is drawn once, and read as it is and in each wrong convention. What `check` says of it is counted.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

import fes_pin as fp
from fes_pin.models.conventions import with_meant_columns
from fes_pin.models.nominal import nominal_model
from harness.generators import generator_of

TURN, COUNTS = 2.0 * np.pi, 16384
"""A whole turn, rad, and in counts of an encoder."""
Change = Callable[[dict[str, np.ndarray]], dict[str, np.ndarray]]


def scaled(column: str, factor: float) -> Change:
    """What multiplies a column, and the velocity with the position."""
    also = ("position", "velocity") if column == "position" else (column,)
    return lambda columns: {n: v * factor if n in also else v for n, v in columns.items()}


def _wrapped(columns: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The position within the turn whose end the motion passes most often."""
    q = columns["position"]
    low = float(np.median(q))
    return {**columns, "position": np.mod(q - low, TURN) + low}


def _counted(columns: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    return {**columns, "position": np.rint(columns["position"] * COUNTS / TURN)}


KINDS: dict[str, tuple[Change, tuple[str, ...]]] = {
    "effort with the other sign": (
        scaled("effort", -1.0),
        ("effort has the other", "effort or position has the other"),
    ),
    "position with the other sign": (
        scaled("position", -1.0),
        ("position has the other", "effort or position has the other"),
    ),
    "position in degrees": (scaled("position", 360.0 / TURN), ("position is in degrees",)),
    "effort in mN m": (scaled("effort", 1e3), ("effort is in mN m",)),
    "effort in N cm": (scaled("effort", 1e2), ("effort is in N cm",)),
    "position in counts": (_counted, ("position is in counts",)),
    "position that wraps": (_wrapped, ("position jumps by 360 deg",)),
}
"""What is done to the columns of a joint that turns, and how the sentence begins that names it."""
SLIDES: dict[str, tuple[Change, tuple[str, ...]]] = {
    "position in degrees": (scaled("position", 1e3), ("position is in mm",)),
    "effort in mN m": (scaled("effort", 1e3), ("effort is in mN,",)),
}
"""The same of one that slides."""


def said_of(study: fp.Study) -> list[str]:
    """The sentences of `check` about conventions."""
    read = [r for t in study.trials for r in t.remarks if r.startswith("position jumps")]
    return [*with_meant_columns(study.trials, nominal_model(study).rig)[1], *read]


def spoiled(study: fp.Study, kind: str) -> tuple[fp.Study, tuple[str, ...]] | None:
    """A study in a wrong convention, and how a sentence about it begins; None where its rig has none of the kind."""
    slides = study.urdf is not None and 'type="prismatic"' in study.urdf.read_text()
    if slides and kind in ("position that wraps", "position in counts", "effort in N cm"):
        return None
    change, words = (SLIDES if slides and kind in SLIDES else KINDS)[kind]
    trials = [replace(t, columns=change(dict(t.columns)), as_read=None) for t in study.trials]
    return replace(study, trials=tuple(trials)), words


def drawn(generator: str, count: int, seed: int, folder: Path) -> Iterator[fp.Study]:
    """Studies of driven joints of a generator."""
    made = generator_of(generator)
    for item in islice((i for i in made.plan(seed) if generator != "large" or i.key.startswith("driven")), count):
        place = folder / item.key
        place.mkdir()
        yield made.make(item, place)[0]


def main(
    generators: Annotated[list[str], typer.Argument(help="Of driven joints.")] = ["driven", "swing-up", "large"],  # noqa: B006
    count: Annotated[int, typer.Option(help="Studies of each generator.")] = 10,
    seed: Annotated[int, typer.Option(help="Of the first.")] = 500,
) -> None:
    """Count the conventions that are named, and those of right studies that are doubted."""
    named, asked, alarms, right = dict.fromkeys(KINDS, 0), dict.fromkeys(KINDS, 0), 0, 0
    for generator in generators:
        with tempfile.TemporaryDirectory() as folder:
            for study in drawn(generator, count, seed, Path(folder)):
                right += 1
                if found := said_of(study):
                    alarms += 1
                    print(f"false alarm: {generator} {study.name}: {found}", flush=True)
                for kind in KINDS:
                    if (one := spoiled(study, kind)) is None:
                        continue
                    found = said_of(one[0])
                    is_named = any(words.startswith(one[1]) for words in found)
                    named[kind], asked[kind] = named[kind] + is_named, asked[kind] + 1
                    if not is_named or len({one.split(" at ")[0] for one in found}) > 1:
                        print(f"{kind}: {generator} {study.name}: {found}", flush=True)
        print(
            generator, {kind: f"{named[kind]}/{asked[kind]}" for kind in KINDS}, f"alarms {alarms}/{right}", flush=True
        )


if __name__ == "__main__":
    typer.run(main)
