"""What a set of results amounts to, beside what is asked for."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from confusion_matrix.noise import FAMILIES

Record = dict[str, Any]
SINGLE_BANDS = {15: (0.0, 25.0), 40: (25.0, 80.0), 150: (80.0, math.inf)}
"""d of a study as it came out, by the target whose row it counts in."""
FELT = ((12, 25), (25, 80))
"""d of a single cause against the noise as it is: about 15, and about 40. Coloured noise leaves some 5 of a d of 15."""

TWINS = {
    "muscle": ({"second_order_activation", "sensor_lag"},),
    "joint": ({"base_tilt", "sensor_offset"},),
}
"""Causes that are the same in all that a rig shows: no data tell them apart. Asserted in tests/models/test_twins.py."""
LATE_CLOCK, DELAY, STIMULATED = "time_shift", "electromechanical_delay", ("ankle", "muscle")
"""The form of `sensor_lag` that is a delay where nothing but the stimulus tells the time. Asserted there, too."""


def wilson(hits: int, count: int) -> tuple[float, float]:
    """95 % interval of a share, after Wilson, J. Am. Stat. Assoc. 22 (1927)."""
    if not count:
        return 0.0, 1.0
    z, p = 1.959964, hits / count
    middle = p + z * z / (2 * count)
    half = z * math.sqrt(p * (1 - p) / count + z * z / (4 * count * count))
    return max(0.0, (middle - half) / (1 + z * z / count)), min(1.0, (middle + half) / (1 + z * z / count))


def claims(r: Record) -> bool:
    return r["verdict"] != "adequate"


def first(r: Record) -> bool:
    """The true cause is in the first set."""
    return bool(r["sets"]) and r["causes"][0] in r["sets"][0]


def exact(r: Record) -> bool:
    """One claim, a set of one, the right one."""
    return r["sets"] == [list(r["causes"])]


def twin(r: Record) -> set[str]:
    """The hidden cause, and what is the same on this rig."""
    (cause,) = r["causes"]
    if r["form"] == LATE_CLOCK and r["rig"] in STIMULATED:
        return {cause, DELAY}
    return next((twins for twins in TWINS.get(r["rig"], ()) if cause in twins), {cause})


def first_but_twins(r: Record) -> bool:
    """The true cause, or what is the same on this rig, is in the first set."""
    return bool(r["sets"]) and bool(twin(r) & set(r["sets"][0]))


def exact_but_twins(r: Record) -> bool:
    """One claim, of nothing but the right cause and what is the same on this rig."""
    return len(r["sets"]) == 1 and set(r["sets"][0]) <= twin(r)


def both(r: Record) -> bool:
    """Each of two causes is in a set, in sets of their own."""
    a, b = r["causes"]
    holding = [{k for k, s in enumerate(r["sets"]) if c in s} for c in (a, b)]
    return bool(holding[0] and holding[1]) and len(holding[0] | holding[1]) > 1


def in_band(r: Record, target: int) -> bool:
    low, high = SINGLE_BANDS[target]
    return r["kind"] == "single" and low <= r["d"][0] < high


def table(records: Iterable[Record]) -> str:
    """The whole table as text."""
    all_ = sorted(records, key=lambda r: r["id"])
    good = [r for r in all_ if "error" not in r]
    kinds = ", ".join(f"{n} {kind}" for kind, n in sorted(Counter(r["kind"] for r in all_).items()))
    lines = [f"{len(all_)} studies ({kinds}); {len(all_) - len(good)} of them without an answer", ""]
    lines += [f"{'':66s} {'target':>9s}  {'measured':>8s}  95 % interval      n"]
    rows = [_blank_rows, _power_rows, _name_rows, _set_rows, _pair_rows, _interval_rows, _gain_rows, _outside_rows]
    for make in rows:
        lines += make(good)
    lines += ["", *_times(good), "", *_confusions(good), "", *_by_cause(good), "", *failures(good)]
    lines += ["", *[f"no answer: {r['id']}: {r['error']}" for r in all_ if "error" in r]]
    return "\n".join(line.rstrip() for line in lines).rstrip()


def beside(told: Sequence[Record], diagnosed: Mapping[str, Record]) -> str:
    """What an oracle tells of studies, and what the diagnosis told of them, as text."""
    both_told = [r for r in told if "error" not in r and "error" not in diagnosed.get(r["id"], {"error": ""})]
    lines = []
    for label, test in (("something claimed", claims), ("true cause in the first set", first), ("exactly", exact)):
        for form, same in (("", None), (", the engine's form", True), (", another form", False)):
            part = [r for r in both_told if same in (None, r["form"] == "same")]
            lines.append(_row(f"{label}{form}: an oracle", "", [test(r) for r in part]))
            lines.append(_row(f"{label}{form}: the diagnosis", "", [test(diagnosed[r["id"]]) for r in part]))
    unlike = [r for r in both_told if r["sets"] != diagnosed[r["id"]]["sets"]]
    lines += [f"  {r['id']}: {r['sets']}; the diagnosis {diagnosed[r['id']]['sets']}" for r in unlike]
    return "\n".join(lines)


def _row(label: str, target: str, hits: Sequence[bool]) -> str:
    if not hits:
        return f"{label:66s} {target:>9s}  {'-':>8s}  {'-':>13s} {0:6d}"
    low, high = wilson(sum(hits), len(hits))
    between = f"{100 * low:5.1f} - {100 * high:5.1f}"
    return f"{label:66s} {target:>9s}  {100 * sum(hits) / len(hits):6.1f} %  {between:>13s} {len(hits):6d}"


def _blank_rows(good: list[Record]) -> list[str]:
    out = []
    for kind in ("null", "decoy"):
        for family in FAMILIES:
            hits = [claims(r) for r in good if r["kind"] == kind and r["noise"] == family]
            out.append(_row(f"false alarms, {kind}s, {family} noise", "<= 5 %", hits))
    return out


def _power_rows(good: list[Record]) -> list[str]:
    wanted = {15: ">= 90 %", 40: ">= 99 %", 150: ">= 99 %"}
    out = []
    for d, target in wanted.items():
        out.append(_row(f"something claimed, d = {d}", target, [claims(r) for r in good if in_band(r, d)]))
    out += [_row(f"something claimed, {_words(felt)}", "", [claims(r) for r in _felt(good, felt)]) for felt in FELT]
    return out


def _felt(good: list[Record], band: tuple[int, int]) -> list[Record]:
    """Singles by d against the noise as it is, where that can be given: coloured noise leaves less of d."""
    return [r for r in good if r["kind"] == "single" and band[0] <= (r.get("felt") or 0) < band[1]]


def _words(band: tuple[int, int]) -> str:
    return f"d of {band[0]} to {band[1]} against the noise as it is"


def _name_rows(good: list[Record]) -> list[str]:
    def rows(label: str, targets: dict[int, str], test: Callable[[Record], bool], same: bool | None) -> list[str]:
        out = []
        for d, t in targets.items():
            part = [r for r in good if in_band(r, d) and same in (None, r["form"] == "same")]
            out.append(_row(f"{label}, d = {d}", t, [test(r) for r in part]))
        return out

    return [
        *rows("true cause in the first set", {15: "", 40: ">= 97 %", 150: ">= 99 %"}, first, None),
        *rows("  the same, twins counted as one", {40: "", 150: ""}, first_but_twins, None),
        *rows("named exactly, the engine's form", {15: "", 40: ">= 90 %", 150: ">= 97 %"}, exact, True),
        *rows("  the same, twins counted as one", {40: "", 150: ""}, exact_but_twins, True),
        *rows("named exactly, another form", {15: "", 40: ">= 80 %", 150: ">= 90 %"}, exact, False),
        *rows("  the same, twins counted as one", {40: "", 150: ""}, exact_but_twins, False),
        *_felt_rows(good),
    ]


def _felt_rows(good: list[Record]) -> list[str]:
    small, form = _felt(good, FELT[0]), {True: "the engine's form", False: "another form"}
    rows = [_row(f"in the first set, {_words(FELT[0])}", "", [first(r) for r in small])]
    for same, label in form.items():
        hits = [exact(r) for r in small if (r["form"] == "same") == same]
        rows.append(_row(f"exactly, {label}, {_words(FELT[0])}", "", hits))
    return rows


def _set_rows(good: list[Record]) -> list[str]:
    out = []
    for d in SINGLE_BANDS:
        sizes = [len(r["sets"][0]) for r in good if in_band(r, d) and r["sets"]]
        extra = [len(r["sets"]) > 1 for r in good if in_band(r, d)]
        mean = f"{np.mean(sizes):8.2f}" if sizes else f"{'-':>8s}"
        out.append(f"{f'mean size of the first set, d = {d}':66s} {'<= 1.3':>9s}  {mean}  {'':13s} {len(sizes):6d}")
        out.append(_row(f"more than one cause claimed, d = {d}", "", extra))
    return out


def _pair_rows(good: list[Record]) -> list[str]:
    return [_row("both of two causes found, d = 100 each", ">= 90 %", [both(r) for r in good if r["kind"] == "pair"])]


def _interval_rows(good: list[Record]) -> list[str]:
    out = []
    for label, wanted in (("all parameters", None), ("of the cause", True), ("nominal", False)):
        for family in (*FAMILIES, None):
            hits = [
                abs(value - truth) <= 1.959964 * std
                for r in good
                if r["kind"] == "single" and family in (None, r["noise"])
                for name, truth, value, std in r["parameters"]
                if wanted in (None, "." in name)
            ]
            if family is None or wanted is None:
                out.append(_row(f"95 % intervals cover, {label}, {family or 'any'} noise", "93-97 %", hits))
    return out


def _gain_rows(good: list[Record]) -> list[str]:
    out = []
    for d, target in ((40, ">= 90 %"), (150, ">= 96 %")):
        shares = [r["share"] for r in good if in_band(r, d) and r["share"] is not None]
        label = f"share of the fresh trials' excess removed, median (mean), d = {d}"
        if shares:
            capped = np.maximum(shares, -1.0)
            text = f"{100 * np.median(shares):6.1f} %  ({100 * np.mean(capped):.1f} %)"
            out.append(f"{label:66s} {target:>9s}  {text:24s} {len(shares):5d}")
            out.append(_row(f"  at least that, d = {d}", "", [s >= float(target.strip(">=% ")) / 100 for s in shares]))
        out.append(_row(f"  below 0, d = {d}", "<= 2 %", [s < 0 for s in shares]))
    return out


def _outside_rows(good: list[Record]) -> list[str]:
    part = [r for r in good if r["kind"] == "outside"]
    far = [r for r in part if (r["orthogonal"] or 0) >= 15]
    return [
        _row(
            "outside the library, 15 beside its nearest cause: unexplained", ">= 85 %", [r["unexplained"] for r in far]
        ),
        _row(
            "outside the library, nearer than that: unexplained", "", [r["unexplained"] for r in part if r not in far]
        ),
    ]


def _times(good: list[Record]) -> list[str]:
    out = []
    for key, label in (("wall_s", "wall time of one diagnosis, one thread"), ("cpu_s", "processor time of it")):
        values = [r[key] for r in good if key in r]
        if values:
            spread = f"median {np.median(values):.1f} s, 95 % below {np.quantile(values, 0.95):.1f} s"
            out.append(f"{label}: {spread}, worst {max(values):.1f} s, {len(values)} studies")
    return out


def _confusions(good: list[Record]) -> list[str]:
    """What is taken for what, singles at d of 25 and above."""
    wrong: Counter[tuple[str, str]] = Counter()
    for r in good:
        if r["kind"] == "single" and r["d"][0] >= 25 and not exact(r):
            answer = " and ".join("|".join(s) for s in r["sets"]) or r["verdict"]
            wrong[f"{r['causes'][0]} ({r['form']})", answer] += 1
    lines = [f"  {true:48s} -> {answer}  x{n}" for (true, answer), n in sorted(wrong.items())]
    return ["not named exactly, singles with d >= 25 (| separates the members of a set):", *(lines or ["  none"])]


def _by_cause(good: list[Record]) -> list[str]:
    out = ["by cause and form, singles with d >= 25: named exactly / in the first set / studies"]
    cells: dict[tuple[str, str], list[Record]] = {}
    for r in good:
        if r["kind"] == "single" and r["d"][0] >= 25:
            cells.setdefault((r["causes"][0], r["form"]), []).append(r)
    for (cause, form), part in sorted(cells.items()):
        out.append(f"  {cause:26s} {form:18s} {sum(map(exact, part)):3d} {sum(map(first, part)):3d} {len(part):3d}")
    return out


def _trouble(r: Record) -> str | None:
    """What is wrong with an answer, in two words; None if nothing is."""
    if r["kind"] == "single":
        return _single_trouble(r)
    right = {
        "outside": lambda: r["unexplained"],
        "pair": lambda: both(r),
    }.get(r["kind"], lambda: not claims(r))()
    words = {"outside": "outside the library, not unexplained", "pair": "not both of two causes"}
    return None if right else words.get(r["kind"], f"false alarm, {r['noise']} noise")


def _single_trouble(r: Record) -> str | None:
    if exact(r):
        return None
    if not r["sets"]:
        return "missed"
    if len(r["sets"]) > 1:
        return "extra claims"
    return "set too large" if first(r) else "wrong name"


def failures(good: list[Record]) -> list[str]:
    """Every study that was not answered as it should be, by kind of failure."""
    kinds: dict[str, list[Record]] = {}
    for r in good:
        if trouble := _trouble(r):
            kinds.setdefault(trouble, []).append(r)
    out = ["not as it should be; each runs again by scripts/confusion --only ID:"]
    for trouble, part in sorted(kinds.items()):
        out += [f" {trouble} ({len(part)})", *(f"  {one_line(r)}" for r in part)]
    return out


def one_line(r: Record) -> str:
    """One result in words."""
    if "error" in r:
        return f"{r['id']}: no answer: {r['error']}"
    answer = " and ".join("|".join(s) for s in r["sets"]) or "-"
    ds = ", ".join(f"{d:g}" for d in r["d"]) or "0"
    left = f", remainder in {r['where']}" if r["unexplained"] else ""
    beside = f" ({r['orthogonal']:g} beside the nearest cause)" if r.get("orthogonal") else ""
    felt = f", {r['felt']:g} in its noise" if r.get("felt") else ""
    return f"{r['id']}: d = {ds}{felt}{beside}; {r['verdict']}: {answer}{left}; share {r['share']}"
