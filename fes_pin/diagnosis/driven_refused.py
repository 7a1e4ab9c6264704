"""Causes of driven rigs that are refused: held-out trials do not speak for them, or no recorded input moves the rig."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from fes_pin.diagnosis.decide.claims import FORM_SHARE
from fes_pin.diagnosis.errors_ahead import RandomPart, are_large, random_parts
from fes_pin.diagnosis.remainder.open_set import Remainder
from fes_pin.diagnosis.search.likelihood_models import Found
from fes_pin.identify.fit import Fit
from fes_pin.identify.likelihood import LikelihoodProblem
from fes_pin.infer.held_out import Evidence, Gain, speaks_for
from fes_pin.infer.levels import CERTAIN_LEVEL, NOTHING_PERCENT
from fes_pin.infer.optimize import WORTH

UNMOVED = "the motion is as likely without the recorded input, so something else moves the rig"
"""Why no cause is named where `is_moved_by_what_is_recorded` is False."""


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


def unsupported(
    evidence: dict[str, Evidence], gains: dict[str, Gain], left: Remainder, random: Sequence[RandomPart]
) -> list[str]:
    """Causes that trials which took no part do not speak for.

    Where none could be held out, a cause beside others must still gain something over the horizon. Where something
    acts that no cause explains, one that explains no more than an error of form does may be of that.
    """
    if are_large(random) and (formal := [n for n, gain in gains.items() if gain.low < 100.0 * FORM_SHARE]):
        return formal
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


def is_moved_by_what_is_recorded(fitted: Fit) -> bool:
    """False where most of what moves a rig acts at random, and the motion is as likely without what was recorded.

    A column of another joint, or of another trial, is not what drove the rig; a spring or a friction beside it would
    stand for the controller that did. A rig without recorded inputs is moved by what it is.
    """
    inputs = {id(t): [n for n in fitted.model.driven_by(t) if n in t] for t in fitted.trials}
    if not any(inputs.values()) or not are_large(random_parts(fitted)):
        return True
    assert fitted.doubt is not None
    still = [t.with_columns(**{n: np.zeros(len(t)) for n in inputs[id(t)]}) for t in fitted.trials]
    (without,) = LikelihoodProblem(fitted.model, still, fitted.doubt).costs([(fitted.values, fitted.unknowns)])
    return without > fitted.sse + WORTH


def with_refused_causes(left: Remainder, random: Sequence[RandomPart], refused: dict[str, Refused]) -> Remainder:
    """What is left: by the features, or a random effort that is too large, or a cause that was refused.

    A cause that explains less than another's error of form leaves to whatever comes near stands for that error; one
    that gains nothing over the horizon stands for noise that is not white, as that of an encoder's counts.
    """
    if left.unexplained:
        return left
    if are_large(random):
        return replace(left, unexplained=True, where="effort")
    certain = [r for r in refused.values() if r.p_value < CERTAIN_LEVEL and r.share >= FORM_SHARE]
    certain = [r for r in certain if r.percent > NOTHING_PERCENT]
    if certain:
        surest = min(certain, key=lambda r: r.p_value)
        return replace(left, unexplained=True, p_value=surest.p_value, where=surest.stage)
    return left
