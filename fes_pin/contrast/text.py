"""A contrast in words: what a person reads in the terminal."""

from __future__ import annotations

from fes_pin.contrast.contrast import Change, Contrast
from fes_pin.diagnose.text import probability, quantity


def headline(found: Contrast) -> str:
    """The answer in one sentence."""
    between = " and ".join(found.groups)
    if found.verdict == "unexplained":
        return f"something differs between {between}, and nothing in the library explains it."
    if not found.changes:
        return f"nothing changed between {between} that these data show."
    many = "one thing" if len(found.changes) == 1 else f"{len(found.changes)} things"
    return f"{many} changed between {between}."


def change_row(change: Change) -> tuple[str, str, str, str, str]:
    """Name, what happened, values by group, p, what it cannot be told from."""
    lines = []
    for name, by_group in change.parameters.items():
        values = ", ".join(f"{g} {quantity(p.value, p.std, p.unit) if p.std else 'none'}" for g, p in by_group.items())
        lines.append(f"{name}: {values}")
    shown = probability(change.p_value)
    return change.name, change.words, "\n".join(lines), shown, ", ".join(change.equivalents) or "-"


def notes(found: Contrast) -> list[str]:
    """What stands beneath the changes."""
    lines = []
    if found.common:
        lines.append(f"in all groups alike, so no change: {', '.join(found.common)}")
    if found.unchanged:
        sizes = ", ".join(f"{n} by {100.0 * v:.2g} %" for n, v in found.unchanged.items())
        lines.append(f"did not change; would have been seen in 95 of 100: {sizes}")
    if found.excluded:
        sizes = ", ".join(f"{n} {p.value:.2g} {p.unit}".strip() for n, p in found.excluded.items())
        lines.append(f"did not come; would have been seen in 95 of 100: {sizes}")
    if found.untestable:
        lines.append(f"could have changed unseen: {', '.join(found.untestable)}")
    left = found.remainder
    state = "something is" if left.unexplained else "nothing"
    lines.append(f"{state} left unexplained in one group alone ({probability(left.p_value)})")
    return [*lines, *(f"warning: {words}" for words in found.warnings)]


def contrast_text(found: Contrast) -> str:
    """The whole answer as plain text."""
    lines = [f"{found.study.name}: {headline(found)}"]
    for change in found.changes:
        name, words, values, shown, others = change_row(change)
        lines.append(f" {name}: {words}; {shown}; cannot be told from {others}")
        lines += [f"   {value}" for value in values.split("\n")]
    return "\n".join(lines + [f" {note}" for note in notes(found)])
