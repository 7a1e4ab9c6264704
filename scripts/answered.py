"""Diagnose studies whose answers are known, and count."""

from __future__ import annotations

import json
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import typer
from driven_rigs.__main__ import deviations
from going_on import results_of

import fes_pin as fp
from fes_pin.diagnosis.misread import NAME as MISREAD
from fes_pin.infer.levels import CONFIDENCE_95
from fes_pin.models.catalogue import shipped


def judged(study: Path, number: int) -> dict[str, Any]:
    """Diagnose a study, and say how the answer compares with the truth."""
    answer = json.loads((study.parent / "answers" / study.name / "answer.json").read_text())
    truth = answer["causes"]
    began = time.process_time()
    found = fp.diagnose(fp.read_study(study))
    seconds = time.process_time() - began
    return {
        "seed": number,
        "study": study.name,
        "causes": truth,
        "verdict": found.verdict,
        "named": [[c.name, *c.equivalents] for c in found.causes],
        "gain": {c.name: [c.gain_held_out.percent, c.gain_held_out.low, c.gain_held_out.high] for c in found.causes},
        "left": found.remainder.unexplained,
        "deviations": deviations(found, numbers_of(answer)),
        "seconds": round(seconds, 1),
    }


def numbers_of(answer: dict[str, Any]) -> dict[str, float]:
    """Inertia and damping of a driven rig, as a model has them; nothing where the answer does not say."""
    if "true_inertia_scale" not in answer:
        return {}
    return {"inertia_scale": answer["true_inertia_scale"], "damping": answer["parameters"]["b"]}


def table(rows: Sequence[dict[str, Any]]) -> list[str]:
    """Counts in words, and every study that was not answered exactly."""
    known = {e.name for e in shipped().effects} | {MISREAD}
    nulls = [r for r in rows if not r["causes"]]
    outside = [r for r in rows if set(r["causes"]) - known]
    hidden = [r for r in rows if r["causes"] and r not in outside]
    lines = [f"{sum(r['verdict'] == 'adequate' for r in nulls)} of {len(nulls)} with nothing hidden are adequate"]
    for count in sorted({len(r["causes"]) for r in hidden}):
        many = [r for r in hidden if len(r["causes"]) == count]
        right, alone = (sum(f(r) for r in many) for f in (_in_sets, _exact))
        lines.append(f"{count} hidden: all in their sets {right} of {len(many)}, no further name {alone}")
    if outside:
        left = sum(r["left"] for r in outside)
        lines.append(f"outside the library: {left} of {len(outside)} with a remainder")
    off = [abs(d) for r in rows if _exact(r) for d in r["deviations"].values()]
    if off:
        covered = 100.0 * sum(d < CONFIDENCE_95 for d in off) / len(off)
        lines.append(f"95 % intervals of inertia and damping cover {covered:.1f} % of {len(off)}")
    seconds = sorted(r["seconds"] for r in rows)
    lines.append(f"processor time: {seconds[len(seconds) // 2]:.1f} s in the median, {seconds[-1]:.1f} s at most")
    return lines + [
        f"    {r['study']}: hidden {r['causes']} -> {r['verdict']} {r['named']}" + " and something left" * r["left"]
        for r in rows
        if not _exact(r) or r["verdict"] == "unexplained"
    ]


def _in_sets(row: dict[str, Any]) -> bool:
    return all(any(c in names for names in row["named"]) for c in row["causes"])


def _exact(row: dict[str, Any]) -> bool:
    return _in_sets(row) and len(row["named"]) == len(row["causes"])


def main(
    folder: Annotated[Path, typer.Argument(help="Studies, with answers/STUDY/answer.json among them.")],
    first: Annotated[int, typer.Option(help="The first that is diagnosed.")] = 0,
    every: Annotated[int, typer.Option(help="Then every so many: for runs side by side.")] = 1,
    results: Annotated[
        Path | None, typer.Option(help="A file of one line a study, with which a run can go on.")
    ] = None,
) -> None:
    """Diagnose a folder of studies whose answers lie beside them, and count what is right."""
    studies = [folder / a.parent.name for a in sorted((folder / "answers").glob("*/answer.json"))]
    if not studies:
        raise typer.BadParameter(f"{folder}: expected answers/STUDY/answer.json")
    typer.echo("\n".join(table(results_of(studies[first::every], 0, judged, results))))


if __name__ == "__main__":
    typer.run(main)
