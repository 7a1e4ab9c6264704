"""Make rigs follow a motion with known causes hidden, diagnose them, and count."""

from __future__ import annotations

import tempfile
import time
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from going_on import results_of

from fes_pin.diagnosis.diagnosis import diagnose_joint
from imposed_rigs import ankle, joint, muscle

RIGS = {"joint": joint, "muscle": muscle, "ankle": ankle}
BESIDE = {"series_elasticity": {"series_elasticity", "force_velocity"}}
"""What is hidden with a cause that shows nothing alone; see `muscle.study`."""


def items(count: int, rig: str) -> list[tuple[str, str]]:
    """Rig and cause of each of so many studies: every cause in turn, nothing ("") in every fourth."""
    rows: list[tuple[str, str]] = []
    for name in RIGS if rig == "all" else (rig,):
        for k, cause in enumerate(RIGS[name].CAUSES):
            rows += [(name, cause)] + ([(name, "")] if k % 3 == 2 else [])
    return [rows[k % len(rows)] for k in range(count)]


def judged(rig: str, cause: str, size: float, seed: int) -> dict[str, Any]:
    """Make a study, diagnose it, and say how the answer compares with the truth."""
    began = time.process_time()
    with tempfile.TemporaryDirectory() as folder:
        made = RIGS[rig].study((cause,) if cause else (), size, np.random.default_rng(seed), Path(folder) / "study")
        found = diagnose_joint(made)
    named = [[c.name, *c.equivalents] for c in found.causes]
    row = {"rig": rig, "cause": cause, "seed": seed, "verdict": found.verdict, "named": named}
    row["gain"] = {c.name: [c.gain_held_out.percent, c.gain_held_out.low, c.gain_held_out.high] for c in found.causes}
    return {**row, "left": found.remainder.unexplained, "seconds": round(time.process_time() - began, 1)}


def _true(row: dict[str, Any]) -> set[str]:
    return BESIDE.get(row["cause"], {row["cause"]})


def table(rows: list[dict[str, Any]]) -> list[str]:
    """Counts in words, and every study that was not answered rightly."""
    nulls, others = ([r for r in rows if bool(r["cause"]) is full] for full in (False, True))
    first = [r for r in others if r["named"] and _true(r) & set(r["named"][0])]
    anywhere = [r for r in others if any(r["cause"] in names for names in r["named"])]
    alarms = [r for r in nulls if r["verdict"] != "adequate"]
    alone = [r for r in first if all(_true(r) & set(names) for names in r["named"])]
    lines = [
        f"hidden cause in the first set: {len(first)} of {len(others)}; in any: {len(anywhere)} of {len(others)}; "
        f"no further name: {len(alone)} of {len(others)}",
        f"alarms where nothing is hidden: {len(alarms)} of {len(nulls)}",
    ]
    wrong = [r for r in others if r not in alone] + alarms
    return lines + [
        f"  {r['rig']} {r['cause'] or 'nothing'} (seed {r['seed']}): {r['verdict']} {r['named']}" for r in wrong
    ]


def main(
    count: Annotated[int, typer.Option(help="How many studies.")] = 100,
    rig: Annotated[str, typer.Option(help="joint, muscle, ankle or all.")] = "all",
    size: Annotated[float, typer.Option(help="Of what is hidden, as a share of the effort.")] = 0.3,
    seed: Annotated[int, typer.Option(help="Of the first; each next one has the next seed.")] = 0,
    results: Annotated[
        Path | None, typer.Option(help="A file of one line a study, with which a run can go on.")
    ] = None,
) -> None:
    """Hide known causes in rigs that follow a motion, and count what the diagnosis makes of them."""
    rows = results_of(items(count, rig), seed, lambda piece, k: judged(*piece, size, k), results)
    typer.echo("\n".join(table(rows)))


if __name__ == "__main__":
    typer.run(main)
