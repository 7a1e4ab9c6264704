"""Causes of driven rigs that are refused: held-out trials do not speak for them, or no recorded input moves the rig."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from fes_pin.diagnosis.errors_ahead import RandomPart, are_large, free_errors, random_parts
from fes_pin.identify.fit import Fit, rough_noise
from fes_pin.identify.likelihood import LikelihoodProblem
from fes_pin.identify.likelihood_fit import LikelihoodFit
from fes_pin.infer.levels import CERTAIN_LEVEL, FORM_SHARE, NOTHING_PERCENT, SMALL_PERCENT, SMALL_SHARE
from fes_pin.infer.optimize import WORTH
from fes_pin.infer.result import Remainder
from fes_pin.infer.verdict import Rejected

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


def with_rejected_causes(
    left: Remainder, random: Sequence[RandomPart], rejected: Mapping[str, Rejected], stages: Mapping[str, str]
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
    certain = [n for n, r in rejected.items() if r.p_value < CERTAIN_LEVEL and r.share >= FORM_SHARE]
    certain = [n for n in certain if rejected[n].gain.percent > NOTHING_PERCENT]
    if certain:
        surest = min(certain, key=lambda n: rejected[n].p_value)
        return replace(left, unexplained=True, p_value=rejected[surest].p_value, where=stages[surest])
    return left


def no_noise(fitted: LikelihoodFit) -> str | None:
    """Why the error of a simulation is no noise of a reading; None where it may be, or where there is process noise.

    An autoregression takes any slow error for noise; a missing input would then be noise, too. First-order
    autoregressive noise is 3.8 times its part from sample to sample at a coefficient of 0.9, 5.5 at 0.95, 12 at 0.99;
    270 studies without a cause, of three rigs in three kinds of noise, have 8.3 at most:
    `scripts/benchmarks/adequate.py --count 30`.
    """
    problem = LikelihoodProblem(fitted.model, fitted.trials, fitted.noise)
    if not problem.is_simulated:
        return None
    ratio = slowness(fitted)
    percent = free_errors(fitted.model, fitted.trials, rough_noise(fitted.model, fitted.trials)).error_percent()
    if SMALL_SHARE * ratio <= 1.0 or percent <= SMALL_PERCENT:
        return None
    return f"an error of {percent:.3g} %, {ratio:.3g} times the scatter from sample to sample, is no noise of a reading"


def slowness(fitted: Fit) -> float:
    """Largest ratio of a channel's residual in free simulation to the noise from sample to sample of its reading."""
    rough = rough_noise(fitted.model, fitted.trials)
    errors = {n: free_errors(fitted.model, [t for t in fitted.trials if n in t], {n: m}) for n, m in rough.items()}
    return max((math.sqrt(e.squares.sum() / e.noise.sum()) for e in errors.values()), default=0.0)
