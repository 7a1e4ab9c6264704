"""Draw driven rigs with known causes hidden, diagnose them, and count."""

from __future__ import annotations

import math
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from types import ModuleType
from typing import Annotated, Any

import typer
from going_on import results_of

from driven_rigs import arm as arms
from driven_rigs import laboratory as laboratories
from driven_rigs import stimulated as ankles
from driven_rigs import swing_up as pendulums
from driven_rigs.draw import CAUSES, OUTSIDE, PAIRS, Drawn, draw
from fes_pin.data.study import read_study
from fes_pin.diagnosis.diagnosis import diagnose_joint
from fes_pin.diagnosis.result import Diagnosis
from fes_pin.infer.levels import CONFIDENCE_95

UNKNOWN = (*OUTSIDE, *ankles.OUTSIDE)
"""What no library has, of any generator."""

Drawing = Callable[[tuple[str, ...], int, Path], Drawn]
"""Draws a rig with such causes from such a seed into a folder."""


def items(count: int, drawn: ModuleType | None = None, play: bool = False) -> Iterator[tuple[str, ...]]:
    """What is hidden in each of so many studies: nothing, every cause in turn, pairs, and something else.

    Parameters
    ----------
    drawn
        Another generator's own causes and pairs.
    play
        Nothing, a play, and every other cause beside one.
    """
    rows: list[tuple[str, ...]] = [(), *((c,) for c in CAUSES[:5]), (), *((c,) for c in CAUSES[5:])]
    rows += [*PAIRS[:2], (), OUTSIDE, *PAIRS[2:]]
    if drawn is not None:
        rows = [(), *((c,) for c in drawn.CAUSES), (), drawn.CAUSES[:1], *drawn.PAIRS]
        rows += [(c,) for c in getattr(drawn, "OUTSIDE", ())]
    if play:
        rows = [(), ("backlash",), *((c, "backlash") for c in CAUSES if c != "backlash")]
    for k in range(count):
        yield rows[k % len(rows)]


def judged(causes: tuple[str, ...], seed: int, drawing: Drawing) -> dict[str, Any]:
    """Make a study, diagnose it, and say how the answer compares with the truth."""
    with tempfile.TemporaryDirectory(prefix="driven") as folder:
        drawn = drawing(causes, seed, Path(folder))
        began = time.perf_counter()
        try:
            found = diagnose_joint(read_study(drawn.study))
        except Exception as error:
            return {"seed": seed, "causes": causes, "error": f"{type(error).__name__}: {error}"}
        seconds = time.perf_counter() - began
    beside = set(drawn.beside) - set(causes)
    named = [(c.name, *c.equivalents) for c in found.causes if not beside & {c.name, *c.equivalents}]
    return {
        "seed": seed,
        "rig": drawn.base,
        "causes": causes,
        "verdict": found.verdict,
        "named": named,
        "left": found.remainder.unexplained,
        "share": [r.share for r in found.random],
        "deviations": deviations(found, drawn.truth),
        "off": {
            n: found.extended.values[n] / v - 1.0 for n, v in drawn.truth.items() if v and n in found.extended.values
        },
        "seconds": round(seconds, 1),
    }


def deviations(found: Diagnosis, truth: dict[str, float]) -> dict[str, float]:
    """Of inertia and damping, in standard deviations, where the model is as the truth is."""
    fitted = found.extended
    return {
        n: (fitted.values[n] - truth[n]) / fitted.std(n)
        for n in ("inertia_scale", "damping", "inertia_kgm2", "damping_nms")
        if n in truth and n in fitted.free and math.isfinite(fitted.std(n)) and fitted.std(n) > 0.0
    }


def table(rows: Sequence[dict[str, Any]]) -> list[str]:
    """The counts."""
    good = [r for r in rows if "error" not in r]
    lines = [f"{len(rows)} studies, {len(rows) - len(good)} ended in an error"]
    nulls = [r for r in good if not r["causes"]]
    if nulls:
        adequate, alarms = (sum(f(r) for r in nulls) for f in (_adequate, lambda r: bool(r["named"])))
        lines.append(f"nothing hidden: {adequate} of {len(nulls)} adequate, {alarms} with a name")
    for count in (1, 2):
        many = [r for r in good if len(r["causes"]) == count and r["causes"][0] not in UNKNOWN]
        if many:
            first = sum(_all_named(r) for r in many)
            alone = sum(sorted(n[0] for n in r["named"]) == sorted(r["causes"]) for r in many)
            lines.append(f"{count} hidden: all in their sets {first} of {len(many)}, named exactly {alone}")
            lines += [
                f"    missed: {r['seed']} {r['rig']} {r['causes']} -> {r['verdict']} {r['named']}"
                for r in many
                if not _all_named(r)
            ]
    outside = [r for r in good if r["causes"] and r["causes"][0] in UNKNOWN]
    if outside:
        lines.append(f"outside the library: {sum(r['left'] for r in outside)} of {len(outside)} with a remainder")
    exact = [r for r in good if sorted(n[0] for n in r["named"]) == sorted(r["causes"])]
    off = [abs(d) for r in exact for d in r["deviations"].values()]
    if off:
        covered = 100.0 * sum(d < CONFIDENCE_95 for d in off) / len(off)
        lines.append(f"95 % intervals of inertia and damping cover {covered:.1f} % of {len(off)}")
    for name in ("inertia_scale", "damping", "coulomb_friction.torque_nm"):
        if shares := sorted(100.0 * abs(r["off"][name]) for r in good if name in r["off"]):
            lines.append(f"{name} is off by {shares[len(shares) // 2]:.1f} % in the median, {shares[-1]:.1f} at most")
    seconds = sorted(r["seconds"] for r in good)
    lines.append(f"a diagnosis takes {seconds[len(seconds) // 2]:.1f} s in the median, {seconds[-1]:.1f} at most")
    return lines


def _adequate(row: dict[str, Any]) -> bool:
    return row["verdict"] == "adequate"


def _all_named(row: dict[str, Any]) -> bool:
    return all(any(c in names for names in row["named"]) for c in row["causes"])


def main(
    count: Annotated[int, typer.Option(help="How many studies.")] = 40,
    size: Annotated[float, typer.Option(help="Torque of what is hidden, as a share of the effort.")] = 0.3,
    seed: Annotated[int, typer.Option(help="Of the first; each next one has the next seed.")] = 0,
    nulls: Annotated[bool, typer.Option(help="Hide nothing in any.")] = False,
    recorded: Annotated[bool, typer.Option(help="Friction of bristles, effort read with noise.")] = False,
    low_pass: Annotated[
        float | None, typer.Option(help="Hz at which effort and reading were low-passed, without delay, when stored.")
    ] = None,
    every: Annotated[int, typer.Option(help="Samples of the controller from one row of the log to the next.")] = 1,
    laboratory: Annotated[
        bool, typer.Option("--laboratory", help="Of another generator: other controllers, motions, encoders, rates.")
    ] = False,
    play: Annotated[bool, typer.Option("--play", help="Every cause beside a play.")] = False,
    swing_up: Annotated[bool, typer.Option("--swing-up", help="Pendulums that are swung up and held.")] = False,
    arm: Annotated[bool, typer.Option("--arm", help="Joints of industrial arms, behind an elastic drive.")] = False,
    stimulated: Annotated[
        bool, typer.Option("--stimulated", help="Ankles under position control, by their stimulus.")
    ] = False,
    results: Annotated[
        Path | None, typer.Option(help="A file of one line a study, with which a run can go on.")
    ] = None,
) -> None:
    """Hide known causes in rigs that a controller drives, and count what the diagnosis makes of them."""

    def drawn(causes: tuple[str, ...], k: int, folder: Path) -> Drawn:
        if stimulated:
            return ankles.draw_stimulated(causes, k, folder)
        if swing_up:
            return pendulums.draw_swing_up(causes, k, folder)
        if arm:
            return arms.draw_arm(causes, k, folder)
        if laboratory:
            return laboratories.draw_laboratory(causes, k, folder)
        return draw(causes, size, k, folder, recorded, low_pass, every)

    def one(causes: tuple[str, ...], k: int) -> dict[str, Any]:
        return judged(() if nulls else causes, k, drawn)

    other = ankles if stimulated else pendulums if swing_up else arms if arm else laboratories if laboratory else None
    rows = results_of(items(count, other, play), seed, one, results)
    typer.echo("\n".join(table(rows)))


if __name__ == "__main__":
    typer.run(main)
