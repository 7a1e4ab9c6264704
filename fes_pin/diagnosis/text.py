"""Parts of a diagnosis in words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from fes_pin.data.trial import Trial
from fes_pin.diagnosis.errors_ahead import RandomPart


def in_words(random: RandomPart, unit: str) -> str:
    """Return process noise in words; `unit` is that of the effort."""
    share = f"{100.0 * random.share:.2g} % of what drives the rig"
    return f"{random.std:.3g} {unit}, {share}, changing within {random.time_constant_s:.2g} s"


def left_out_text(left_out: Mapping[str, Mapping[str, Sequence[int]]], trials: Sequence[Trial]) -> str:
    """Return in words how many samples of each column were taken for spikes, and in which trials if they are few."""
    lengths = {t.name: len(t) for t in trials}
    found: dict[str, dict[str, int]] = {}
    for trial, columns in left_out.items():
        for name, samples in columns.items():
            found.setdefault(name, {})[trial] = len(samples)
    return ", ".join(
        f"{sum(counts.values())} of {sum(lengths[t] for t in counts)} samples of {name} in "
        + (" and ".join(counts) if len(counts) <= 2 else f"{len(counts)} trials")
        for name, counts in found.items()
    )
