"""Command line of the fuzz; see `scripts/fuzz`."""

from __future__ import annotations

import argparse
import gc
import os
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

from fuzz_inputs.cases import KINDS, READING_KINDS, Result
from fuzz_inputs.check import Ask


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
    began, bad, slowest = time.monotonic(), 0, 0.0
    codes: dict[str, list[int]] = {}
    jobs = [(numbers[k::workers], given.seed, given.reading, bool(given.only)) for k in range(workers)]
    with ProcessPoolExecutor(workers) as pool:
        for found, faults, slow in pool.map(_run, jobs):
            bad += faults
            slowest = max(slowest, slow)
            for kind, ended in found.items():
                codes.setdefault(kind, []).extend(ended)
    for kind, ended in codes.items():
        print(f"  {kind}: {ended.count(0)} answered, {ended.count(2)} rejected in one line")
    answered, rejected = (sum(ended.count(code) for ended in codes.values()) for code in (0, 2))
    print(
        f"{len(numbers)} cases of seed {given.seed}: {answered} answered, {rejected} rejected in one line, {bad} broke "
        f"a rule; slowest {slowest:.0f} s; {time.monotonic() - began:.0f} s in all"
    )
    raise SystemExit(bool(bad))


def _run(job: tuple[list[int], int, bool, bool]) -> tuple[dict[str, list[int]], int, float]:
    """Codes by kind, cases that broke a rule, and the longest call, s."""
    import fes_pin.diagnosis.diagnosis  # noqa: PLC0415
    import fes_pin.view.report  # noqa: F401, PLC0415
    from fuzz_inputs.batch import in_batches  # noqa: PLC0415
    from fuzz_inputs.cases import run_case  # noqa: PLC0415
    from fuzz_inputs.check import call, warm_up  # noqa: PLC0415

    numbers, seed, reading, whole = job
    codes: dict[str, list[int]] = {}
    bad, slowest = 0, 0.0
    cache = Path(os.environ.setdefault("FES_PIN_CACHE", str(Path(tempfile.gettempdir()) / f"fuzz-cache-{os.getuid()}")))
    memory = "/dev/shm" if os.access("/dev/shm", os.W_OK) else None
    with tempfile.TemporaryDirectory(prefix="fuzz", dir=memory) as folder:
        warm_up(Path(folder))

        def run(number: int, ask: Ask) -> Result:
            place = Path(folder) / ("alone" if ask is call else "case")  # both may run at once
            return run_case(number, seed, place, cache, reading, ask)

        gc.freeze()  # what forks share stays shared
        for result in (run(n, call) for n in numbers) if whole or not reading else in_batches(numbers, run):
            codes.setdefault(result.name.split()[1], []).append(result.answer.code)
            slowest = max(slowest, result.answer.seconds)
            if result.faults:
                bad += 1
                print(result, flush=True)
            if whole:
                print(result.name, result.answer.code, result.answer.out, result.answer.err, sep="\n", flush=True)
    return codes, bad, slowest


if __name__ == "__main__":
    main()
