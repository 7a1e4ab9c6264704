"""Lack of fit of the model of all groups in some of them."""

from dataclasses import replace

import numpy as np

from fes_pin.contrasts.grouped import Grouped
from fes_pin.contrasts.models import ContrastModels
from fes_pin.diagnosis.remainder.lack_of_fit import lack_of_fit
from fes_pin.infer.levels import CLAIM_LEVEL
from fes_pin.infer.result import Remainder
from fes_pin.workers import in_parallel


def left_in_groups(models: ContrastModels, best: Grouped) -> tuple[Remainder, list[str]]:
    """Return the lack of fit in some groups alone, and warnings; one of all groups is an error of the model."""
    parts = in_parallel(lambda g: models.maxima.part(best, g), list(models.trials))
    each = dict(zip(models.trials, in_parallel(lack_of_fit, parts), strict=True))
    each = {g: _in_single_trials(models, best, g, r) if r.unexplained else r for g, r in each.items()}
    least = min(each.values(), key=lambda r: r.p_value)
    open_ = [g for g, r in each.items() if r.unexplained]
    p = min(1.0, len(each) * least.p_value)
    if len(open_) == len(each):
        words = "the model leaves something unexplained in every group; `diagnose` says what"
        return Remainder(False, p, least.where), [words]
    if not open_ or not p < CLAIM_LEVEL:
        return Remainder(False, p, None), []
    return Remainder(True, p, least.where), [f"lack of fit in the group {g}" for g in open_]


def _in_single_trials(models: ContrastModels, best: Grouped, group: str, left: Remainder) -> Remainder:
    """Return the lack of fit of a group, if half of its trials have one with nominal values of their own.

    Trials that differ in strength or friction, within a group too, have a lack of fit with shared values.
    """
    alone = in_parallel(lambda k: models.maxima.part(best, group, k), range(len(models.trials[group])))
    p = min(1.0, 2.0 * float(np.median([lack_of_fit(one).p_value for one in alone])))
    return replace(left, unexplained=p < CLAIM_LEVEL, p_value=max(left.p_value, p))
