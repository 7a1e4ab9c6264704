"""Parts of a diagnosis as plain values, as they stand in `diagnosis.json`, and in words."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from fes_pin.data.trial import Trial
from fes_pin.diagnosis.errors_ahead import AheadErrors, RandomPart
from fes_pin.identify.fit import Fit
from fes_pin.infer.held_out import FOLDS
from fes_pin.infer.result import ParameterEstimate, shown
from fes_pin.models.catalogue import Catalogue


def left_out_record(left_out: Mapping[str, Mapping[str, Sequence[int]]]) -> dict[str, Any]:
    """Return the samples left out as spikes by trial and column; no key where there are none."""
    found = {t: {n: len(k) for n, k in columns.items()} for t, columns in left_out.items()}
    return {"left_out_samples": found} if found else {}


def library_record(catalogue: Catalogue) -> dict[str, Any]:
    """Return causes and rigs of users' own by the file or module that defines them; no key where there are none."""
    found = {Path(where).name: names for where, names in catalogue.origins().items()}
    return {"library": found} if found else {}


def parameters_record(fitted: Fit) -> dict[str, Any]:
    """Return fitted parameters with their standard deviations, by name."""
    return {n: ParameterEstimate.of(fitted, n, "").record() for n in fitted.free}


def errors_record(
    free: tuple[float | None, float | None], ahead: AheadErrors | None, which: str
) -> dict[str, float | None]:
    """Return E of one of the two models, by the names of `identify.error_measures`."""
    out = {"fit": shown(free[0]), "held_out": shown(free[1])}
    if ahead is not None:
        errors = getattr(ahead, f"{which}_held_out") or getattr(ahead, which)
        out.update({n: shown(getattr(errors, n)) for n in ("one_step", "horizon", "free")})
    return out


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
