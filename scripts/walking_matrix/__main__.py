"""Hide causes in walks made without the engine, diagnose each, print how often the hidden one is named."""

import argparse
import json
import tempfile
import time
from collections import defaultdict
from pathlib import Path

from fes_pin.body.measured_walk import data_folder
from fes_pin.data.study import read_study
from fes_pin.walk.diagnosis import WalkDiagnosis, diagnose_walk
from walking_matrix.plan import KINDS, drawn
from walking_matrix.synthetic import Wrong, gait_of, make

TRUTH = {"plate_gain": "share", "clock_offset": "late_s", "base_tilt": "rad", "marker_noise": "markers_m"}


def judged(wrong: Wrong, found: WalkDiagnosis) -> dict:
    """What became of a hidden cause."""
    sets = [(c.name, *c.equivalents) for c in found.causes]
    alone = [c for c in found.causes if c.name == wrong.cause]
    record = {"cause": wrong.cause, "size": wrong.size, "verdict": found.verdict, "sets": sets}
    record["ok"] = not sets if wrong.cause == "none" else bool(sets) and wrong.cause in sets[0]
    record["named"] = bool(sets) and sets[0][0] == wrong.cause
    record["extra"] = len(sets) - 1 if record["ok"] and sets else len(sets)
    known = TRUTH.get(wrong.cause)
    for cause in alone[:1]:
        for name, (value, std, _) in cause.parameters.items():
            if known and name.endswith(known) and len(cause.parameters) == 1:
                record["z"] = (value - wrong.size * _sign(wrong, name)) / std
    return record


def _sign(wrong: Wrong, name: str) -> float:
    return 1.0 if wrong.cause != "base_tilt" or name.startswith(("forward", "left")) else float("nan")


def table(records: list[dict]) -> str:
    """Rows by cause: how many, in the first set, named first, further causes, within 1.96 standard deviations."""
    groups = defaultdict(list)
    for record in records:
        groups[record["cause"]].append(record)
    lines = [f"{'hidden':18s} studies  in first set  named first  further causes  |z| < 1.96"]
    for cause in ("none", *KINDS):
        if mine := groups.get(cause):
            z = [abs(r["z"]) < 1.96 for r in mine if "z" in r]
            covered = f"{sum(z)} of {len(z)}" if z else "-"
            parts = (
                len(mine),
                sum(r["ok"] for r in mine),
                sum(r["named"] for r in mine),
                sum(r["extra"] for r in mine),
            )
            lines.append(f"{cause:18s} {parts[0]:7d}  {parts[1]:12d}  {parts[2]:11d}  {parts[3]:14d}  {covered:>10s}")
    return "\n".join(lines)


def main() -> None:
    """Run the studies that are asked for; with --out they are kept, and not run again."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--hidden", type=int, default=45, help="studies that hide a cause")
    parser.add_argument("--nulls", type=int, default=20, help="studies that hide none")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, help="file of records, one line each")
    options = parser.parse_args()
    gait, done = gait_of(data_folder()), {}
    if options.out and options.out.exists():
        done = {r["key"]: r for r in map(json.loads, options.out.read_text().splitlines())}
    plan = [(KINDS[k % len(KINDS)], options.seed + k) for k in range(options.hidden)]
    plan += [("none", options.seed + 10000 + k) for k in range(options.nulls)]
    records = []
    for kind, seed in plan:
        key = f"{kind} {seed}"
        if key not in done:
            wrong = drawn(kind, seed)
            with tempfile.TemporaryDirectory() as folder:
                make(gait, Path(folder), wrong, seed)
                began = time.process_time()
                done[key] = {"key": key, **judged(wrong, diagnose_walk(read_study(folder)))}
                done[key]["cpu_s"] = round(time.process_time() - began, 2)
            if options.out:
                with options.out.open("a") as file:
                    file.write(json.dumps(done[key]) + "\n")
        records.append(done[key])
    print(table(records))
    print(f"processor time of a diagnosis: at most {max(r['cpu_s'] for r in records):.1f} s")


if __name__ == "__main__":
    main()
