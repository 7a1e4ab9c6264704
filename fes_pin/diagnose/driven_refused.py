"""Causes of driven rigs that held-out trials do not speak for, and what that leaves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from fes_pin.diagnose.decide.claims import FORM_SHARE
from fes_pin.diagnose.decide.held_out import Evidence, Gain, speaks_for
from fes_pin.diagnose.errors_ahead import RandomPart
from fes_pin.diagnose.remainder.open_set import Remainder
from fes_pin.diagnose.search.likelihood_search import Found
from fes_pin.identify.levels import CERTAIN_LEVEL, NOTHING_PERCENT, SMALL_SHARE


@dataclass(frozen=True)
class Refused:
    """A cause that held-out trials did not bear out, or that most folds do not choose.

    Attributes
    ----------
    stage, p_value
        Where it acts, and how certain it was.
    share
        Of what all causes explained.
    percent
        What it gains over the horizon.
    """

    stage: str
    p_value: float
    share: float
    percent: float


def unsupported(evidence: dict[str, Evidence], gains: dict[str, Gain], left: Remainder) -> list[str]:
    """Causes that trials which took no part do not speak for.

    Where none could be held out, a cause beside others must still gain something over the horizon.
    """
    if not evidence:
        return [n for n, gain in gains.items() if len(gains) > 1 and not gain.is_material]
    known = {n: None if left.unexplained else e for n, e in evidence.items()}
    return [n for n, e in known.items() if not speaks_for(e, gains[n], alone=len(known) == 1)]


def refused_from(found: Found, name: str, percent: float) -> Refused:
    """What is kept of a cause of a set that is refused; `percent` is what it gains over the horizon."""
    stage = next(str(e.stage) for e in found.best.model.effects if e.name == name)
    return Refused(stage, found.p_values[name], share_in(found, name), percent)


def share_in(found: Found, name: str) -> float:
    """Share of a cause in what all that were found add to the log-likelihood."""
    whole = found.nominal.sse - found.best.sse
    return (found.without[name].sse - found.best.sse) / max(whole, 1e-9)


def with_refused_causes(left: Remainder, random: Sequence[RandomPart], refused: dict[str, Refused]) -> Remainder:
    """What is left: by the features, or a random effort that is too large, or a cause that was refused.

    A cause that explains less than another's error of form leaves to whatever comes near stands for that error; one
    that gains nothing over the horizon stands for noise that is not white, as that of an encoder's counts.
    """
    if left.unexplained:
        return left
    large = [r for r in random if r.share > SMALL_SHARE]
    if large:
        return replace(left, unexplained=True, where="effort")
    certain = [r for r in refused.values() if r.p_value < CERTAIN_LEVEL and r.share >= FORM_SHARE]
    certain = [r for r in certain if r.percent > NOTHING_PERCENT]
    if certain:
        surest = min(certain, key=lambda r: r.p_value)
        return replace(left, unexplained=True, p_value=surest.p_value, where=surest.stage)
    return left
