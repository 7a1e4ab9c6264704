"""Hide causes in walks made without the engine, diagnose each, print how often the hidden one is named."""

import argparse
import tempfile
import time
from collections import defaultdict
from dataclasses import replace
from pathlib import Path

import numpy as np
from going_on import keep, rows_of

from fes_pin.body.measured_walk import data_folder
from fes_pin.data.study import read_study
from fes_pin.walk.banks import Banks
from fes_pin.walk.diagnosis import diagnose_walk, white_noise
from fes_pin.walk.fits import WalkFits
from fes_pin.walk.recording import recordings_of
from fes_pin.walk.result import WalkDiagnosis
from walking_matrix.plan import KINDS, drawn
from walking_matrix.synthetic import Gait, Wrong, gait_of, make

AXIS = {(1, 0, 0): "forward", (0, 1, 0): "left", (0, 0, 1): "up"}
CLEAR = 40.0
"""The least d at which a hidden cause that is missed counts."""


def hidden_form(wrong: Wrong) -> tuple[str, float]:
    """The site of the form that is hidden, and the size of its parameter."""
    axis = AXIS.get(tuple(wrong.extra.get("axis", ())), "")
    site = {"left_thigh,right_thigh": "both thighs", "both": "both plates", "": "both plates"}.get(
        wrong.site, wrong.site
    )
    if wrong.cause.startswith("plate") and site in ("left", "right"):
        site = f"{site} plate"
    if wrong.cause == "plate_offset":
        return f"{site}, {axis} force, while loaded", wrong.size
    if wrong.cause in ("segment_com", "external_force"):
        return f"{site}, {axis}", wrong.size
    named = {"base_tilt": axis, "marker_noise": "white"}
    return named.get(wrong.cause, site.replace("_", " ")), wrong.size


def strength(gait: Gait, wrong: Wrong, seed: int, found: WalkDiagnosis) -> float:
    """Twice the expected log-likelihood ratio of the truth against nothing.

    What the cause changes in the mean stride is the difference of two walks of the same errors, with and without it; it
    is weighed by the noise and the nuisance of the walk without it. Of marker noise the deviance that it saves.
    """
    if wrong.cause == "marker_noise":
        return float((white_noise(found.search.banks) or (0.0, 0.0, 0.0))[2])
    with tempfile.TemporaryDirectory() as folder:
        make(gait, Path(folder), replace(wrong, cause="none"), seed)
        twin = Banks(recordings_of(read_study(folder), cutoff_hz=found.cutoff_hz)[1], found.cutoff_hz)
    waves = min(len(twin.strides.harmonics), len(found.search.banks.strides.harmonics))
    y = [b.as_read.y[:, :, :waves] for b in (found.search.banks, twin)]
    noise, variance = twin.noise, WalkFits(twin).fit(()).fitted.variance[:, :, :waves]
    means = twin.strides.harmonics[:waves] == 0
    change = np.where(means, y[0] - y[1], np.einsum("ij,njk->nik", noise.turn, y[0] - y[1])).ravel()
    nuisance = noise.nuisance[:, :, :waves].reshape(change.size, -1)
    covariance = np.diag(variance.ravel()) + nuisance @ nuisance.T
    return float(change @ np.linalg.solve(covariance, change))


def judged(wrong: Wrong, found: WalkDiagnosis) -> dict:
    """What became of a hidden cause."""
    sets = [(c.name, *c.equivalents) for c in found.causes]
    record = {"cause": wrong.cause, "size": wrong.size, "verdict": found.verdict, "sets": sets}
    record["ok"] = not sets if wrong.cause == "none" else bool(sets) and wrong.cause in sets[0]
    record["named"] = bool(sets) and sets[0][0] == wrong.cause
    record["extra"] = len(sets) - 1 if record["ok"] and sets else len(sets)
    site, size = hidden_form(wrong)
    for cause in found.causes:
        if (cause.name, cause.site) == (wrong.cause, site):
            ((value, std, _),) = cause.parameters.values()
            record["z"] = (value - size) / std
    return record


def table(records: list[dict]) -> str:
    """Rows by cause: how many, in the first set, named first, further causes, within 1.96 standard deviations."""
    groups = defaultdict(list)
    for record in records:
        groups[record["cause"]].append(record)
    lines = [f"{'hidden':18s} studies  in first set  named first  further causes  |z| < 1.96"]
    groups["all hidden"] = [r for r in records if r["cause"] != "none"]
    for cause in ("none", *KINDS, "all hidden"):
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
    parser.add_argument("--kind", choices=KINDS, help="hide this cause in all")
    parser.add_argument("--out", type=Path, help="file of records, one line each")
    options = parser.parse_args()
    gait, done = gait_of(data_folder()), {r["key"]: r for r in rows_of(options.out)}
    kinds = (options.kind,) if options.kind else KINDS
    hidden = [(kinds[k % len(kinds)], options.seed + k) for k in range(options.hidden)]
    nulls = [("none", options.seed + 10000 + k) for k in range(options.nulls)]
    spread = [(k / max(len(part), 1), one) for part in (hidden, nulls) for k, one in enumerate(part)]
    plan = [one for _, one in sorted(spread)]  # a run that is broken off has some of each
    records = []
    for kind, seed in plan:
        key = f"{kind} {seed}"
        if key not in done:
            wrong = drawn(kind, seed)
            with tempfile.TemporaryDirectory() as folder:
                make(gait, Path(folder), wrong, seed)
                began = time.process_time()
                found = diagnose_walk(read_study(folder))
                done[key] = {"key": key, **judged(wrong, found)}
                done[key]["cpu_s"] = round(time.process_time() - began, 2)
                if kind != "none":
                    done[key]["d"] = round(strength(gait, wrong, seed, found), 1)
            done[key] = keep(done[key], options.out)
        records.append(done[key])
    print(table(records))
    clear = [r for r in records if r.get("d", 0.0) >= CLEAR]
    print(f"\nof these at d >= {CLEAR:g}:\n{table(clear)}")
    print(f"processor time of a diagnosis: at most {max(r['cpu_s'] for r in records):.1f} s")


if __name__ == "__main__":
    main()
