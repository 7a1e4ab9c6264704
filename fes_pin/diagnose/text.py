"""A diagnosis in words: what a person reads in the terminal."""

from __future__ import annotations

import math
from pathlib import Path

from fes_pin.diagnose.diagnosis import Cause, Diagnosis

HEADLINES = {
    "adequate": "the model is adequate: these data justify no extension of it.",
    "unexplained": "the model misses something, and nothing in the library explains it.",
}

EACH_TRIAL = (
    "size and phase are each trial's own; in a held-out trial its other parts tell them, and a prediction from inputs "
    "alone leaves the effect out"
)
"""What is said of effects whose amplitudes are each trial's own."""


def headline(diagnosis: Diagnosis) -> str:
    """The verdict in one sentence, with how much is explained and how much is not."""
    count = len(diagnosis.causes)
    if not count:
        return HEADLINES[diagnosis.verdict].removesuffix(".") + (f": {diagnosis.reason}." if diagnosis.reason else ".")
    share = diagnosis.explained_percent()
    named = "one cause explains" if count == 1 else f"{count} causes explain"
    rest = ", and something is left" if diagnosis.remainder.unexplained else ""
    return f"{named} {share:.0f} % of what the model gets wrong, {100.0 - share:.0f} % stays{rest}."


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


def cause_row(cause: Cause) -> tuple[str, str, str, str, str]:
    """Cause, stage, parameters, held-out gain, what it cannot be told from."""
    values = "\n".join(f"{n} {quantity(p.value, p.std, p.unit)}" for n, p in cause.parameters.items())
    held = cause.gain_held_out
    gain = f"{held.percent:.0f} % [{held.low:.0f}, {held.high:.0f}]"
    return cause.name, cause.stage, values, gain, ", ".join(cause.equivalents) or "-"


def footnotes(diagnosis: Diagnosis) -> list[str]:
    """What stands beneath the table."""
    before, after = diagnosis.nominal_error, diagnosis.extended_error
    shown = [
        f"{b:.2f} -> {a:.2f} % {where}"
        for b, a, where in zip(before, after, ("fitted", "held out"), strict=True)
        if a is not None and b is not None
    ]
    lines = [f"error E {', '.join(shown)}; noise floor {diagnosis.ceiling_percent:.2g} %"] if shown else []
    lines += driven_notes(diagnosis)
    left = diagnosis.remainder
    where = f", most on {left.where}" if left.where else ""
    if diagnosis.reason is None:
        state = "something is" if left.unexplained else "nothing"
        lines.append(f"{state} left unexplained (p = {left.p_value:.2g}{where})")
    elif diagnosis.causes:
        lines.append(f"something is left unexplained: {diagnosis.reason}")
    if diagnosis.left_out:
        lines.append(f"left out as spikes: {left_out_text(diagnosis)}")
    own = [e.name for e in diagnosis.model.effects if e.each_trial]
    if own:
        lines.append(f"{', '.join(own)}: {EACH_TRIAL}")
    for where, names in diagnosis.catalogue.origins().items():
        lines.append(f"looked for as well: {', '.join(names)}, code of {Path(where).name}")
    if diagnosis.absorbed:
        lines.append(f"not testable here: {', '.join(diagnosis.absorbed)}")
    if diagnosis.next_experiment:
        lines.append(f"next experiment: {diagnosis.next_experiment.why}")
    return [*lines, *(f"warning: {words}" for words in diagnosis.warnings)]


def driven_notes(diagnosis: Diagnosis) -> list[str]:
    """What is said of a rig that a recorded effort drives: errors ahead, and what acts at random."""
    if diagnosis.ahead is None:
        return []
    ahead = diagnosis.ahead
    pairs = [("fitted", ahead.nominal, ahead.extended)]
    if ahead.nominal_held_out and ahead.extended_held_out:
        pairs.append(("held out", ahead.nominal_held_out, ahead.extended_held_out))
    unit = diagnosis.model.rig.units()["effort"]
    lines = [
        f"error E {ahead.horizon_s:g} s ahead {b.horizon:.2g} -> {a.horizon:.2g} %, "
        f"one sample ahead {b.one_step:.2g} -> {a.one_step:.2g} % {where}"
        for where, b, a in pairs
    ]
    if ahead.extended.free is None:
        lines.append("the rig falls by itself: a free simulation of it says nothing of the model")
    lines += [
        f"a random {r.name} of {r.std:.3g} {unit} acts, {100.0 * r.share:.2g} % of what drives the rig, "
        f"changing within {r.time_constant_s:.2g} s"
        for r in diagnosis.random
    ]
    return lines


def left_out_text(diagnosis: Diagnosis) -> str:
    """How many samples of which column were taken for spikes, and in which trials if they are few."""
    lengths = {t.name: len(t) for t in diagnosis.study.trials}
    found: dict[str, dict[str, int]] = {}
    for trial, columns in diagnosis.left_out.items():
        for name, samples in columns.items():
            found.setdefault(name, {})[trial] = len(samples)
    return ", ".join(
        f"{sum(counts.values())} of {sum(lengths[t] for t in counts)} samples of {name} in "
        + (" and ".join(counts) if len(counts) < 3 else f"{len(counts)} trials")
        for name, counts in found.items()
    )


def verdict_text(diagnosis: Diagnosis) -> str:
    """The verdict as plain text."""
    lines = [f"{diagnosis.study.name}: {headline(diagnosis)}"]
    if diagnosis.causes:
        rows = [("cause", "stage", "parameters", "held-out gain", "cannot be told from")]
        for cause in diagnosis.causes:
            name, stage, values, gain, others = cause_row(cause)
            for k, value in enumerate(values.split("\n")):
                rows.append((name, stage, value, gain, others) if k == 0 else ("", "", value, "", ""))
        widths = [max(len(r[k]) for r in rows) for k in range(5)]
        lines += [" " + "  ".join(c.ljust(w) for c, w in zip(r, widths, strict=True)).rstrip() for r in rows]
    return "\n".join(lines + [f" {note}" for note in footnotes(diagnosis)])
