"""Parts of a diagnosis in words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from fes_pin.data.trial import Trial
from fes_pin.diagnosis.errors_ahead import Ahead, AheadErrors, RandomPart


def ahead_notes(ahead: AheadErrors | None, random: Sequence[RandomPart], unit: str) -> list[str]:
    """What is said of a rig that a recorded effort drives: errors ahead, and what acts at random.

    `unit` is that of the effort.
    """
    if ahead is None:
        return []
    pairs = [("fitted", ahead.nominal, ahead.extended)]
    if ahead.nominal_held_out and ahead.extended_held_out:
        pairs.append(("held out", ahead.nominal_held_out, ahead.extended_held_out))
    lines = [
        f"error E {ahead.horizon_s:g} s ahead {b.horizon:.2g} -> {a.horizon:.2g} %{_of_noise(a)}, "
        f"one sample ahead {b.one_step:.2g} -> {a.one_step:.2g} % {where}"
        for where, b, a in pairs
    ]
    if ahead.extended.free is None:
        lines.append("the rig falls by itself: a free simulation of it says nothing of the model")
    lines += [
        f"a random {r.name} of {r.std:.3g} {unit} acts, {100.0 * r.share:.2g} % of what drives the rig, "
        f"changing within {r.time_constant_s:.2g} s"
        for r in random
    ]
    return lines


def _of_noise(ahead: Ahead) -> str:
    return "" if ahead.noise is None else f" (noise alone {ahead.noise:.2g} %)"


def left_out_text(left_out: Mapping[str, Mapping[str, Sequence[int]]], trials: Sequence[Trial]) -> str:
    """How many samples of which column were taken for spikes, and in which trials if they are few."""
    lengths = {t.name: len(t) for t in trials}
    found: dict[str, dict[str, int]] = {}
    for trial, columns in left_out.items():
        for name, samples in columns.items():
            found.setdefault(name, {})[trial] = len(samples)
    return ", ".join(
        f"{sum(counts.values())} of {sum(lengths[t] for t in counts)} samples of {name} in "
        + (" and ".join(counts) if len(counts) < 3 else f"{len(counts)} trials")
        for name, counts in found.items()
    )
