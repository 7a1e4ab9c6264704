"""Counts of rows, and one table of them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from statistics import median
from typing import Any

from scipy.stats import binomtest, fisher_exact, norm

from harness.row import ADEQUATE, KINDS, STOPPED, Row

COLUMNS = ("studies", "right", "first", "alone", "further", "left")
HEAD = ("hidden", "right", "named first", "alone", "further names", "something left")
CONFIDENCE_95 = norm.ppf(0.975)
WORSE = 0.01
"""Level at which counts are worse than those of another run."""
WORSE_ERROR = 1.02
"""An error of prediction is worse than another that is so many times smaller."""
NO_MODEL_PERCENT = 50.0
"""An error E of a motion from which the mean of the trial is hardly worse, percent."""
LEAST_PERCENT = 1e-3
"""Errors E below that are alike, percent: what remains is rounding."""

Counts = Mapping[str, Any]
"""What a run of a generator amounts to, as plain values for JSON; see `counts`."""


def counts(rows: Iterable[Row]) -> dict[str, Any]:
    """Counts of rows.

    Returns
    -------
    dict
        `rows`: of each kind, and of its parts, how many studies there are and of how many what `COLUMNS` say holds;
        `intervals`: how many of so many 95 % intervals hold the truth, where the model has the causes that are hidden;
        `off`: by parameter how far it is off in percent, in the median, of the nominal model and of the extended one;
        `errors`: by kind the median error of both; `cpu_s`: median; `unanswered`; `no_form`: of studies whose hidden
        mechanism the library has no form of, and of their nulls, what holds of how many of how many; see `_no_form`.
    """
    rows = list(rows)
    good = [row for row in rows if row.error is None]
    lines = {}
    for kind in KINDS:
        own = [row for row in good if row.kind == kind]
        parts = sorted({row.part for row in own if row.part}, key=lambda part: (len(part), part))
        divided = [(f"{kind}: {p}", [r for r in own if r.part == p]) for p in parts]
        for name, some in [(kind, own), *(divided if len(parts) > 1 else [])]:
            if some:
                lines[name] = [len(some), *(sum(getattr(row, column) for row in some) for column in COLUMNS[1:])]
    held = [abs(x - true) < CONFIDENCE_95 * std for r in good if r.exact for _, true, _, x, std in r.estimates]
    return {
        "unanswered": len(rows) - len(good),
        "rows": lines,
        "intervals": [int(sum(held)), len(held)],
        "off": _off(good),
        "errors": _errors(good),
        "cpu_s": round(median([row.cpu_s for row in good] or [0.0]), 1),
        **_no_form([row for row in good if row.nearest is not None]),
    }


def _no_form(good: Sequence[Row]) -> dict[str, dict[str, list[int]]]:
    """Counts of studies of no form: without a wrong name; one of the nearest named, where there is one; adequate."""
    near = [row.near for row in good if row.nearest]
    nulls = [row.verdict == ADEQUATE for row in good if not row.hidden]
    faults = [row.verdict == ADEQUATE for row in good if row.hidden and not row.nearest]
    shares = {
        "no wrong name": [not row.misnamed for row in good],
        "one of the nearest causes is named": near,
        "adequate where nothing is hidden": nulls,
        "adequate where nothing is near": faults,
    }
    return {"no_form": {words: [sum(some), len(some)] for words, some in shares.items() if some}} if good else {}


def _off(good: Sequence[Row]) -> dict[str, list[float]]:
    """Of parameters that the nominal model has and that are true of at least half of the studies."""
    every: dict[str, list[tuple[float, float]]] = {}
    for row in good:
        for name, true, before, after, _ in row.estimates:
            if before is not None and true:
                every.setdefault(name, []).append((before / true - 1.0, after / true - 1.0))
    return {
        name: [float(f"{100.0 * median(abs(x) for x in off):.2g}") for off in zip(*pairs, strict=True)]
        for name, pairs in sorted(every.items())
    }


def _errors(good: Sequence[Row]) -> dict[str, list[float]]:
    kinds = sorted({kind for row in good for kind in row.errors})
    pairs = {kind: [row.errors[kind] for row in good if row.hidden and kind in row.errors] for kind in kinds}
    return {kind: [float(f"{median(e):.2g}") for e in zip(*some, strict=True)] for kind, some in pairs.items() if some}


def interval(hits: int, count: int) -> str:
    """A share with its 95 % interval, after Wilson, J. Am. Stat. Assoc. 22 (1927)."""
    low, high = binomtest(hits, count).proportion_ci(method="wilson")
    return f"{hits} of {count}: {100 * hits / count:.1f} % ({100 * low:.1f} to {100 * high:.1f})"


def table(head: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    """A table in Markdown."""
    lines = [[str(cell) for cell in row] for row in rows]
    return "\n".join("| " + " | ".join(row) + " |" for row in [list(head), ["---"] * len(head), *lines])


def lines_of(found: Counts) -> list[list[Any]]:
    """Rows of the table, below `HEAD`."""
    out = []
    for name, (count, right, *others) in found["rows"].items():
        kind, _, part = name.partition(": ")
        first, alone, further, left = others
        told = [first, alone] if kind in ("one", "two") else ["", ""]
        out.append([f"{kind}, {part}" if part else kind, interval(right, count), *told, further, left])
    return out


def notes(found: Counts) -> list[str]:
    """What is counted beside the table, a line each."""
    held, count = found["intervals"]
    lines = [f"95 % intervals that hold the truth: {interval(held, count)}"] if count else []
    lines += [f"{words}: {interval(*share)}" for words, share in found.get("no_form", {}).items()]
    for kind, (before, after) in found["errors"].items():
        words = "over the horizon" if kind == "horizon" else "held out"
        lines.append(f"error E {words}, where something is hidden, median: {before:g} % nominal, {after:g} % extended")
    for name, (before, after) in found["off"].items():
        lines.append(f"{name} off by, median: {before:g} % nominal, {after:g} % extended")
    return [*lines, f"processor time of an answer, median: {found['cpu_s']:g} s"]


def wrong(rows: Iterable[Row]) -> list[str]:
    """Every study without the right answer, or with a further name, a line each."""
    return [f"  {one_line(row)}" for row in rows if row.error or not row.right or row.further]


def one_line(row: Row) -> str:
    """One answer in words."""
    if row.error:
        return f"{row.key}: no answer: {row.error}"
    named = " and ".join("|".join(names) for names in row.sets) or "nothing"
    hidden = " and ".join(row.hidden) or "nothing"
    return f"{row.key}: {hidden} -> {row.verdict}: {named}" + " and something left" * row.left


def worse(now: Counts, before: Counts) -> list[str]:
    """Kinds of studies of which significantly fewer are right than before, after Fisher; a line each."""
    out = []
    for name in now["rows"].keys() & before["rows"].keys():
        (count, right, *_), (many, good, *_) = now["rows"][name], before["rows"][name]
        if fisher_exact([[right, count - right], [good, many - good]], "less").pvalue < WORSE:
            out.append(f"{name}: {interval(right, count)}, before {interval(good, many)}")
    return sorted(out)


def totals(rows: Sequence[Row]) -> list[str]:
    """What a run amounts to in a few lines: see `family`."""
    words = ("first set right", "exactly right", "nulls named", "ended in an error", "stopped")
    return [f"{word}: {share}" for word, share in zip(words, family(rows)[1:], strict=True) if share]


def families(rows: Sequence[Row]) -> str:
    """Table of `totals` of each part of the rows."""
    parts = sorted({row.part for row in rows})
    head = ("family", "studies", "first set right", "exactly right", "nulls named", "error", "stopped")
    return table(head, [[part, *family([row for row in rows if row.part == part])] for part in parts])


def family(rows: Sequence[Row]) -> list[str | int]:
    """Counts of some rows, as text.

    Returns
    -------
    list
        Studies; of those that hide something, in how many the first set is right, and in how many the hidden causes
        are named and no other; of answered ones that hide nothing, in how many something is named; of all, how many
        ended in an error or were stopped. An answer that is missing is not right.
    """
    hides, nulls = [r for r in rows if r.hidden], [r for r in rows if not r.hidden and r.error is None]
    good = [r for r in hides if r.error is None and r.right]
    counted = (
        (len(good), len(hides)),
        (sum(r.exact for r in good), len(hides)),
        (sum(bool(r.sets) for r in nulls), len(nulls)),
        (sum(r.error is not None for r in rows), len(rows)),
        (sum(r.verdict == STOPPED for r in rows), len(rows)),
    )
    return [len(rows), *(f"{k} of {n}: {100 * k / n:.0f} %" if n else "" for k, n in counted)]


def against(ours: Sequence[Row], others: Sequence[Row]) -> list[str]:
    """Errors of our models on the trials that nobody was shown beside those of others, lines of text.

    Errors below `LEAST_PERCENT` are taken for it. A study without our answer counts as worse.
    """
    theirs = {row.key: row.unseen for row in others if row.unseen is not None}
    pairs = [(row, _percent(row.unseen), max(theirs[row.key], LEAST_PERCENT)) for row in ours if row.key in theirs]
    if not pairs:
        return ["no trial that nobody was shown"]
    odd = [(row, a, b) for row, a, b in pairs if a > WORSE_ERROR * b]
    lines = [
        f"E on a trial that nobody was shown, ours over that of ten lines, of {len(pairs)} studies: median "
        f"{median(a / b for _, a, b in pairs):.3g}, smallest {min(a / b for _, a, b in pairs):.2g}, largest "
        f"{max(a / b for _, a, b in pairs):.2g}",
        f"ours is worse by more than 2 %: {interval(len(odd), len(pairs))}; without our answer: "
        f"{sum(row.error is not None for row, _, _ in odd)} of these",
    ]
    return [*lines, *(f"  {one_line(row)}: E {a:.3g} %, ten lines {b:.3g} %" for row, a, b in odd)]


def ratios_of(errors: Mapping[str, Sequence[float]]) -> dict[tuple[str, str], float]:
    """Errors of a model over those of the believed model and of the regression, by measure and the name of the other.

    Errors below `LEAST_PERCENT` are taken for it. A measure is passed over where each of the models leaves more than
    `NO_MODEL_PERCENT`: there is nothing to choose.
    """
    out = {}
    for measure, (ours, *others) in errors.items():
        if min(ours, *others) > NO_MODEL_PERCENT:
            continue
        for name, theirs in zip(("believed", "regression"), others, strict=True):
            out[measure, name] = _percent(ours) / _percent(theirs) if ours < float("inf") else ours
    return out


def is_worse(errors: Mapping[str, Sequence[float]]) -> bool:
    """Whether a model is worse than the believed one or the regression in one of its errors."""
    return max(ratios_of(errors).values(), default=0.0) > WORSE_ERROR


def never_worse(rows: Sequence[Row]) -> list[str]:
    """Errors of our models over those of the believed model and of the regression, by measure, lines of text.

    A study without an answer counts as worse. What is worse is printed with the largest ratio of the true model, which
    may be worse than a regression too: free motion adds up a random effort, and an offset may happen to cancel that.
    """
    ratios: dict[str, list[tuple[float, Row]]] = {}
    worst: dict[str, float] = {}
    for row in rows:
        if row.error is not None:
            worst[row.key] = float("inf")
        for (measure, name), ratio in ratios_of(row.against).items():
            ratios.setdefault(f"{measure}, ours over {name}", []).append((ratio, row))
            worst[row.key] = max(worst.get(row.key, 0.0), ratio)
    lines = []
    for name, some in sorted(ratios.items()):
        most, where = max(some, key=lambda one: one[0])
        good = sum(ratio <= WORSE_ERROR for ratio, _ in some)
        middle = median(ratio for ratio, _ in some)
        share = f"at most {WORSE_ERROR} in {interval(good, len(some))}"
        lines.append(f"{name}: median {middle:.3g}, {share}; largest {most:.3g} ({where.key})")
    odd = [row for row in rows if worst.get(row.key, 0.0) > WORSE_ERROR]
    if worst:
        good, as_true = len(worst) - len(odd), sum(not row.error and not _beaten(row) for row in odd)
        lines.append(
            f"every error at most {WORSE_ERROR} times: {interval(good, len(worst))}; largest {max(worst.values()):.3g}"
        )
        lines.append(
            f"the same, or at most {WORSE_ERROR} times that of the true model: {interval(good + as_true, len(worst))}"
        )
    return [*lines, *(_of_truth(row, worst[row.key]) for row in odd)]


def _beaten(row: Row) -> bool:
    """Whether an error of a model is larger than another's and than the true model's, where that is known."""
    larger = {n[0] for n, ratio in ratios_of(row.against).items() if ratio > WORSE_ERROR}
    return any(n not in row.true or _percent(row.against[n][0]) > WORSE_ERROR * _percent(row.true[n]) for n in larger)


def _of_truth(row: Row, worst: float) -> str:
    """A study whose answer is worse than another, with what the true model is in the same measures."""
    line = f"  {one_line(row)}: {worst:.3g}"
    if row.true:
        theirs = ratios_of({n: (row.true[n], *errors[1:]) for n, errors in row.against.items() if n in row.true})
        own = {n: ratio for n, ratio in ratios_of(row.against).items() if ratio > WORSE_ERROR}
        line += "; the true model " + ", ".join(f"{theirs[n]:.3g} in {n[0]}" for n in own if n in theirs)
    return line


def _percent(unseen: float | None) -> float:
    return float("inf") if unseen is None else max(unseen, LEAST_PERCENT)
