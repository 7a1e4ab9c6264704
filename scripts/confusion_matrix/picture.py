"""The picture of the confusion matrix: true causes against what was named."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import matplotlib as mpl
import numpy as np

mpl.use("Agg")
from matplotlib import pyplot as plt
from matplotlib.axes import Axes

from confusion_matrix.table import SINGLE_BANDS, Record, exact, first, in_band, wilson
from fes_pin.models.effects import EFFECTS

NOTHING, MORE = "(nothing)", "(two or more)"
INK, FAINT, GOOD = "#1b2a3a", "#b9c4cf", "#1f6f8b"


def draw(records: Iterable[Record], path: Path) -> None:
    """Write the picture of results to a file."""
    good = [r for r in records if "error" not in r]
    fig, (left, right) = plt.subplots(1, 2, figsize=(14, 8.2), width_ratios=(2.6, 1), layout="constrained")
    _matrix(left, [r for r in good if r["kind"] == "single" and r["d"][0] >= 25])
    _shares(right, good)
    fig.suptitle(f"What is hidden, and what is named: {len(good)} studies, made without the engine", color=INK)
    path.parent.mkdir(parents=True, exist_ok=True)
    fig.savefig(path, dpi=110)
    plt.close(fig)


def _matrix(axes: Axes, singles: list[Record]) -> None:
    names = [e.name for e in EFFECTS]
    columns = [*names, MORE, NOTHING]
    counts = np.zeros((len(names), len(columns)))
    for r in singles:
        if not r["sets"]:
            named = {NOTHING: 1.0}
        elif len(r["sets"]) > 1:
            named = {MORE: 1.0}
        else:
            named = {c: 1.0 / len(r["sets"][0]) for c in r["sets"][0]}
        for name, share in named.items():
            counts[names.index(r["causes"][0]), columns.index(name)] += share
    total = counts.sum(axis=1, keepdims=True)
    shares = np.divide(counts, total, out=np.full_like(counts, np.nan), where=total > 0)
    right = np.eye(*shares.shape, dtype=bool)
    for where, colours in ((right, "GnBu"), (~right, "Oranges")):
        axes.imshow(np.where(where & (shares > 0), shares, np.nan), cmap=colours, vmin=0.0, vmax=1.3, aspect="auto")
    for i, k in zip(*np.nonzero(np.nan_to_num(shares)), strict=True):
        dark = shares[i, k] > 0.9
        axes.text(k, i, f"{100 * shares[i, k]:.0f}", ha="center", va="center", fontsize=6.5, color="w" if dark else INK)
    labels = [f"{n}  ({int(t)})" for n, t in zip(names, total[:, 0], strict=True)]
    axes.set_yticks(range(len(names)), labels, fontsize=7.5)
    axes.set_xticks(range(len(columns)), columns, rotation=90, fontsize=7.5)
    axes.set_xticks(np.arange(len(columns) + 1) - 0.5, minor=True)
    axes.set_yticks(np.arange(len(names) + 1) - 0.5, minor=True)
    axes.grid(which="minor", color="#eef1f4", linewidth=0.6)
    axes.tick_params(which="both", length=0)
    axes.spines[:].set_visible(False)
    axes.set_title("named, % of the studies with d of 25 and more (a set shares its study)", fontsize=9, color=INK)
    axes.set_ylabel("hidden (studies)", color=INK)


def _shares(axes: Axes, good: list[Record]) -> None:
    tests = (
        ("true cause in the first set", first, None, INK),
        ("named exactly, the engine's form", exact, True, GOOD),
        ("named exactly, another form", exact, False, "#d1793a"),
    )
    for k, (label, test, same, colour) in enumerate(tests):
        for d in SINGLE_BANDS:
            hits = [test(r) for r in good if in_band(r, d) and same in (None, r["form"] == "same")]
            if not hits:
                continue
            share, (low, high) = 100 * np.mean(hits), wilson(sum(hits), len(hits))
            x = list(SINGLE_BANDS).index(d) + 0.14 * (k - 1)
            axes.plot([x, x], [100 * low, 100 * high], color=colour, linewidth=1.4)
            axes.plot(x, share, "o", color=colour, markersize=6, label=label if d == 40 else None)
    axes.set_xticks(range(len(SINGLE_BANDS)), [f"d = {d}" for d in SINGLE_BANDS])
    axes.set_ylim(0, 102)
    axes.set_ylabel("% of studies, 95 % intervals", color=INK)
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(axis="y", color="#eef1f4")
    axes.legend(frameon=False, fontsize=8, loc="lower right")
    axes.set_title("by the size of the cause", fontsize=9, color=INK)
