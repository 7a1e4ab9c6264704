"""Two codes on the same studies."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from statistics import median

from scipy.stats import binomtest

from harness.row import KINDS, Row
from harness.table import counts, notes, one_line, table

HEAD = ("hidden", "studies", "both right", "only now", "only before", "neither", "p (McNemar)")
LEAST_S = 0.1
"""Processor times below that are taken for it."""


def compared(now: Sequence[Row], before: Mapping[str, Row]) -> list[str]:
    """What two runs make of the same studies.

    Returns
    -------
    list of str
        The table of who is right, with the exact test of McNemar (Psychometrika 12, 1947) of each kind; the ratio of
        processor times; intervals and errors of both; then every study of which other sets are named, or of which one
        run alone is right.
    """
    same = [(row, before[row.key]) for row in now if row.key in before and before[row.key].study == row.study]
    pairs = [(a, b) for a, b in same if a.error is None and b.error is None]
    lines = [
        f"{len(same)} of {len(now)} studies were answered by both from the same files, {len(same) - len(pairs)} of "
        "them with an error"
    ]
    kinds = [("all", pairs), *((kind, [p for p in pairs if p[0].kind == kind]) for kind in KINDS)]
    lines.append(table(HEAD, [_line(kind, some) for kind, some in kinds if some]))
    if pairs:
        ratios = [max(a.cpu_s, LEAST_S) / max(b.cpu_s, LEAST_S) for a, b in pairs]
        lines.append(f"processor time now, as a share of before, median: {median(ratios):.2f}")
    for words, rows in (("now", [a for a, _ in pairs]), ("before", [b for _, b in pairs])):
        lines += [f"{words}: {line}" for line in notes(counts(rows))]
    for a, b in pairs:
        if a.right != b.right or [set(s) for s in a.sets] != [set(s) for s in b.sets]:
            lines += [f"  before {one_line(b)}", f"  now    {one_line(a)}"]
    return lines


def _line(kind: str, pairs: Sequence[tuple[Row, Row]]) -> list[str | int]:
    right = [(a.right, b.right) for a, b in pairs]
    both, now, before, neither = (right.count(c) for c in ((True, True), (True, False), (False, True), (False, False)))
    p_value = binomtest(now, now + before).pvalue if now + before else 1.0
    return [kind, len(pairs), both, now, before, neither, f"{p_value:.3g}"]
