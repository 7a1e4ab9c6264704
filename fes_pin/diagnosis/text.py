"""Parts of a diagnosis in words."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from fes_pin.data.trial import Trial
from fes_pin.diagnosis.cause import Cause, ParameterEstimate
from fes_pin.diagnosis.errors_ahead import Ahead, AheadErrors, RandomPart

LEAST_P, LEAST_PERCENT = 1e-12, 1e-3
"""Below these a p-value and a percentage are no longer told apart from zero when they are printed."""


def probability(value: float) -> str:
    """A p-value as printed; never zero."""
    if math.isnan(value):
        return "not tested"
    return f"p < {LEAST_P:g}" if value < LEAST_P else f"p = {value:.2g}"


def percent(value: float | None) -> str:
    """A percentage as printed, "-" for none."""
    if value is None or not math.isfinite(value):
        return "-"
    if 0.0 <= value < LEAST_PERCENT:
        return f"below {LEAST_PERCENT:g} %"
    return f"{value:.3g} %" if value >= 1.0 else f"{value:.2g} %"


def quantity(value: float, std: float, unit: str) -> str:
    """A value with its standard deviation, rounded to what it means."""
    if not math.isfinite(std):
        return f"{value:.3g} {unit} (not identified)".replace("  ", " ")
    if std <= 0.0:
        return f"{value:.4g} {unit} (held)".replace("  ", " ")
    digits = max(0, 1 - math.floor(math.log10(std)))
    if digits > 6 or abs(value) >= 1e5:
        return f"{value:.3g} +- {std:.2g} {unit}".strip()
    return f"{value:.{digits}f} +- {std:.{digits}f} {unit}".strip()


def estimate_text(one: ParameterEstimate) -> str:
    """A value with its standard deviation; at a bound with the other end of its one-sided 95 % interval."""
    if not one.at_bound:
        return quantity(one.value, one.std, one.unit)
    return f"{one.value:.4g} {one.unit} (at its bound, {one_sided(one)})".replace("  ", " ")


def one_sided(one: ParameterEstimate) -> str:
    """The end of the interval of a value at its bound that is not the bound."""
    low, high = one.interval
    word, end = ("most", high) if high - one.value >= one.value - low else ("least", low)
    return f"at {word} {end:.3g}" if math.isfinite(end) else "not identified"


def cause_columns(gain: str) -> tuple[str, str, str, str, str]:
    """Names of what `cause_row` gives; `gain` is that of its gain."""
    return "cause", "stage", "parameters", gain, "cannot be told from"


def cause_row(cause: Cause) -> tuple[str, str, str, str, str]:
    """Cause, stage, parameters, gain, what it cannot be told from."""
    values = "\n".join(f"{n} {estimate_text(p)}" for n, p in cause.parameters.items())
    if cause.trial is not None:
        values = f"trial {cause.trial}: {values}"
    return cause.name, cause.stage, values, str(cause.gain_held_out), ", ".join(cause.equivalents) or "-"


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
