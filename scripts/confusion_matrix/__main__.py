"""Command line of the confusion matrix; see `scripts/confusion`."""

from __future__ import annotations

import argparse
import os
from pathlib import Path


def main() -> None:
    """Run the studies asked for and print the table."""
    parser = argparse.ArgumentParser(prog="scripts/confusion", description=__doc__)
    parser.add_argument("--quick", type=int, metavar="N", help="a stratified slice of N studies; without it 1000")
    parser.add_argument("--seed", type=int, default=0, help="of the slice")
    parser.add_argument("--only", action="append", metavar="ID", help="one study by its name; may be repeated")
    parser.add_argument("--results", type=Path, default=Path("confusion.jsonl"), help="one line for each study done")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1, help="processes")
    parser.add_argument("--table", type=Path, help="write the table here as well")
    parser.add_argument("--figure", type=Path, help="write the picture here")
    parser.add_argument("--read-only", action="store_true", help="run nothing: table of what the results hold")
    parser.add_argument("--check", action="store_true", help="80 studies; exit code 1 if they are worse than the table")
    parser.add_argument("--oracle", type=Path, metavar="FILE", help="what an oracle tells of the singles, beside these")
    given = parser.parse_args()
    os.environ["FES_PIN_THREADS"] = "1"

    from confusion_matrix import oracle, runner  # noqa: PLC0415
    from confusion_matrix.check import complaints, slice_of  # noqa: PLC0415
    from confusion_matrix.picture import draw  # noqa: PLC0415
    from confusion_matrix.plan import Item  # noqa: PLC0415
    from confusion_matrix.table import beside, one_line, table  # noqa: PLC0415

    if given.only:
        for record in runner.run([[Item.parse(name)] for name in given.only], None, given.workers):
            print(one_line(record))
        return
    if given.check:
        found = complaints(runner.run(slice_of(given.seed), None, given.workers))
        print("\n".join(found) or "as good as the table that is committed")
        raise SystemExit(bool(found))
    if given.oracle:
        singles = oracle.asked(runner.plan(given.quick or 1000, given.seed))
        told = runner.run(singles, given.oracle, given.workers, oracle.oracle)
        print(beside(told, runner.read(given.results)))
        return
    if given.read_only:
        records = list(runner.read(given.results).values())
    else:
        records = runner.run(runner.plan(given.quick or 1000, given.seed), given.results, given.workers)
    text = table(records)
    print(text)
    if given.table:
        given.table.write_text(text + "\n", encoding="utf-8")
    if given.figure:
        draw(records, given.figure)


if __name__ == "__main__":
    main()
