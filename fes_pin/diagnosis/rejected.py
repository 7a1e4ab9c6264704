"""Rejected causes: held-out trials do not support them, or the recorded input does not move the rig."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from fes_pin.diagnosis.errors_ahead import RandomPart, are_large, random_parts
from fes_pin.identify.fit import Fit, noise_of, rough_noise
from fes_pin.identify.likelihood import LikelihoodProblem, is_simulated
from fes_pin.identify.likelihood_fit import LikelihoodFit
from fes_pin.infer.levels import CERTAIN_LEVEL, FORM_GAIN, NOTHING_PERCENT, SEPARABLE, SMALL_PERCENT, SMALL_SHARE
from fes_pin.infer.result import Remainder
from fes_pin.infer.text import WHOLE
from fes_pin.infer.verdict import CLAIMS, Rejected

UNMOVED = CLAIMS["drop_unmoved"]
"""Why no cause is named where `is_moved_by_what_is_recorded` is False."""


def is_moved_by_what_is_recorded(fitted: LikelihoodFit) -> bool:
    """Return False where process noise is large and the motion is as likely without the recorded input.

    Such an input may be the column of another joint or of another trial. A spring or a friction would then be mistaken
    for the controller that did drive the rig. The answer is True for a rig without recorded inputs.
    """
    inputs = {id(t): [n for n in fitted.model.driven_by(t) if n in t] for t in fitted.trials}
    if not any(inputs.values()) or not are_large(random_parts(fitted)):
        return True
    still = [t.with_columns(**{n: np.zeros(len(t)) for n in inputs[id(t)]}) for t in fitted.trials]
    (without,) = LikelihoodProblem(fitted.model, still, fitted.noise).costs([(fitted.values, fitted.unknowns)])
    return without > fitted.sse + SEPARABLE


def with_rejected_causes(
    left: Remainder, random: Sequence[RandomPart], rejected: Mapping[str, Rejected], stages: Mapping[str, str]
) -> Remainder:
    """Return the lack of fit: by its tests, by process noise that is too large, or by a cause that was rejected.

    A rejected cause is no lack of fit if it explains less than an error in the form of another cause may, or if it
    gains nothing over the horizon: it is then mistaken for noise that is not white, as that of an encoder's counts.

    Parameters
    ----------
    left
        The result of the tests of lack of fit.
    random
        Process noise of the fit.
    rejected
        Rejected causes by name.
    stages
        Where each cause acts.
    """
    if left.unexplained:
        return left
    if are_large(random):
        share = max(WHOLE * r.share for r in random)
        return replace(left, unexplained=True, where="effort", reason=f"a random effort of {share:.2g} % is needed")
    certain = [n for n, r in rejected.items() if r.p_value < CERTAIN_LEVEL and r.share >= FORM_GAIN]
    certain = [n for n in certain if rejected[n].gain.percent > NOTHING_PERCENT]
    if certain:
        surest = min(certain, key=lambda n: rejected[n].p_value)
        return replace(left, unexplained=True, p_value=rejected[surest].p_value, where=stages[surest])
    return left


def no_noise(fitted: LikelihoodFit) -> str | None:
    """Return why the error of a simulation cannot be measurement noise; None where it may be, or with process noise.

    An autoregression takes any slow error for noise, even that of a missing input. The limit is a ratio of the error to
    its scatter from sample to sample. First-order autoregressive noise has a ratio of 3.8 at a coefficient of 0.9, 5.5
    at 0.95 and 12 at 0.99. 270 studies without a cause, of three rigs in three kinds of noise, have 8.3 at most
    (`scripts/benchmarks/adequate.py --count 30`).
    """
    if not is_simulated(fitted.noise, fitted.trials):
        return None
    ratio, name = max((ratio, name) for name, ratio in slowness(fitted).items())
    around = np.concatenate([t[name] - np.nanmean(t[name]) for t in fitted.trials if name in t])
    percent = WHOLE * noise_of(fitted, 0)[name].std ** 2 / float(np.nanmean(around**2))
    if SMALL_SHARE * ratio <= 1.0 or percent <= SMALL_PERCENT:
        return None
    return f"an error of {percent:.3g} %, {ratio:.3g} times the scatter from sample to sample, is no measurement noise"


def slowness(fitted: Fit) -> dict[str, float]:
    """Return the ratio of the residual of each channel in free simulation to its scatter from sample to sample."""
    rough = rough_noise(fitted.model, fitted.trials)
    return {n: one.std / rough[n].std for n, one in noise_of(fitted, 0).items()}
