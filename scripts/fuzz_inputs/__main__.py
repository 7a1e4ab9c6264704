"""Command line of the fuzz; see `scripts/fuzz`."""

from __future__ import annotations

import argparse
import os
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

from fuzz_inputs.cases import KINDS, READING_KINDS


def main() -> None:
    """Run the cases asked for, print each that broke a rule, and how many there were."""
    parser = argparse.ArgumentParser(prog="scripts/fuzz", description=__doc__)
    parser.add_argument("--count", type=int, default=5000, help="cases")
    parser.add_argument("--first", type=int, default=0, help="number of the first case")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", type=int, action="append", metavar="CASE", help="one case by its number, shown whole")
    parser.add_argument("--kind", choices=sorted({*KINDS, *READING_KINDS}), help="cases of one kind only")
    parser.add_argument("--reading", action="store_true", help="ask only what reads: new-study, check and predict")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    given = parser.parse_args()
    os.environ["FES_PIN_THREADS"] = "1"
    numbers = given.only or list(range(given.first, given.first + given.count))
    kinds = READING_KINDS if given.reading else KINDS
    numbers = [n for n in numbers if given.only or given.kind in (None, kinds[n % len(kinds)])]
    workers = 1 if given.only else given.workers
    began, bad, codes, slowest = time.monotonic(), 0, {0: 0, 2: 0}, 0.0
    jobs = [(numbers[k::workers], given.seed, given.reading, bool(given.only)) for k in range(workers)]
    with ProcessPoolExecutor(workers) as pool:
        for code_counts, faults, slow in pool.map(_run, jobs):
            bad += faults
            slowest = max(slowest, slow)
            for code, count in code_counts.items():
                codes[code] = codes.get(code, 0) + count
    print(
        f"{len(numbers)} cases of seed {given.seed}: {codes[0]} answered, {codes[2]} rejected in one line, {bad} broke "
        f"a rule; slowest {slowest:.0f} s; {time.monotonic() - began:.0f} s in all"
    )
    raise SystemExit(bool(bad))


def _run(job: tuple[list[int], int, bool, bool]) -> tuple[dict[int, int], int, float]:
    import fes_pin.diagnosis.diagnosis  # noqa: PLC0415
    import fes_pin.view.report  # noqa: F401, PLC0415
    from fuzz_inputs.cases import run_case  # noqa: PLC0415
    from fuzz_inputs.check import warm_up  # noqa: PLC0415

    numbers, seed, reading, whole = job
    codes: dict[int, int] = {}
    bad, slowest = 0, 0.0
    cache = Path(os.environ.setdefault("FES_PIN_CACHE", str(Path(tempfile.gettempdir()) / f"fuzz-cache-{os.getuid()}")))
    with tempfile.TemporaryDirectory(prefix="fuzz") as folder:
        warm_up(Path(folder))
        for number in numbers:
            result = run_case(number, seed, Path(folder) / "case", cache, reading)
            codes[result.answer.code] = codes.get(result.answer.code, 0) + 1
            slowest = max(slowest, result.answer.seconds)
            if result.faults:
                bad += 1
                print(result, flush=True)
            if whole:
                print(result.name, result.answer.code, result.answer.out, result.answer.err, sep="\n", flush=True)
    return codes, bad, slowest


if __name__ == "__main__":
    main()
