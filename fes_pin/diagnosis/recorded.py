"""Parts of a diagnosis as plain values, as they stand in `diagnosis.json`, and in words."""

from collections.abc import Mapping, Sequence
from typing import Any

from fes_pin.data.trial import Trial
from fes_pin.diagnosis.errors_ahead import AheadErrors, RandomPart
from fes_pin.infer.held_out import FOLDS
from fes_pin.infer.result import shown


def ahead_record(ahead: AheadErrors | None, driven: bool, random: Sequence[RandomPart]) -> dict[str, Any]:
    """Return the horizon and the process noise of a driven rig; no key without errors over a horizon."""
    if ahead is None:
        return {}
    horizon = {"horizon_s": shown(ahead.horizon_s)}
    if not driven:
        return horizon
    parts = {
        r.name: {
            "std": shown(r.std),
            "time_constant_s": shown(r.time_constant_s),
            "share_percent": shown(100.0 * r.share),
        }
        for r in random
    }
    errors = ahead.extended_held_out or ahead.extended
    return {**horizon, "horizon_ceiling_percent": shown(errors.noise), "random": parts}


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


def few_trials(count: int) -> list[str]:
    """Return a warning that the names rest on few trials; none if there are many."""
    few = f"the names rest on {count} trial{'s' if count > 1 else ''}, fewer than {FOLDS}: more may change them"
    return [few] * (count < FOLDS)
