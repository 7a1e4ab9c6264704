"""Causes of driven rigs that are refused: held-out trials do not speak for them, or no recorded input moves the rig."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from fes_pin.diagnosis.decide.claims import FORM_SHARE
from fes_pin.diagnosis.errors_ahead import RandomPart, are_large, random_parts
from fes_pin.identify.likelihood import LikelihoodProblem
from fes_pin.identify.likelihood_fit import LikelihoodFit
from fes_pin.infer.levels import CERTAIN_LEVEL, NOTHING_PERCENT
from fes_pin.infer.optimize import WORTH
from fes_pin.infer.result import Remainder
from fes_pin.infer.verdict import Refused

UNMOVED = "the motion is as likely without the recorded input, so something else moves the rig"
"""Why no cause is named where `is_moved_by_what_is_recorded` is False."""


def is_moved_by_what_is_recorded(fitted: LikelihoodFit) -> bool:
    """False where most of what moves a rig acts at random, and the motion is as likely without what was recorded.

    A column of another joint, or of another trial, is not what drove the rig; a spring or a friction beside it would
    stand for the controller that did. A rig without recorded inputs is moved by what it is.
    """
    inputs = {id(t): [n for n in fitted.model.driven_by(t) if n in t] for t in fitted.trials}
    if not any(inputs.values()) or not are_large(random_parts(fitted)):
        return True
    still = [t.with_columns(**{n: np.zeros(len(t)) for n in inputs[id(t)]}) for t in fitted.trials]
    (without,) = LikelihoodProblem(fitted.model, still, fitted.noise).costs([(fitted.values, fitted.unknowns)])
    return without > fitted.sse + WORTH


def with_refused_causes(
    left: Remainder, random: Sequence[RandomPart], refused: Mapping[str, Refused], stages: Mapping[str, str]
) -> Remainder:
    """What is left: by the features, or a random effort that is too large, or a cause that was refused.

    `stages` says where each cause acts.

    A cause that explains less than another's error of form leaves to whatever comes near stands for that error; one
    that gains nothing over the horizon stands for noise that is not white, as that of an encoder's counts.
    """
    if left.unexplained:
        return left
    if are_large(random):
        return replace(left, unexplained=True, where="effort")
    certain = [n for n, r in refused.items() if r.p_value < CERTAIN_LEVEL and r.share >= FORM_SHARE]
    certain = [n for n in certain if refused[n].gain.percent > NOTHING_PERCENT]
    if certain:
        surest = min(certain, key=lambda n: refused[n].p_value)
        return replace(left, unexplained=True, p_value=refused[surest].p_value, where=stages[surest])
    return left
