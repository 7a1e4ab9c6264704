"""The likelihood's maximum of measured trials: a fit by `infer.maximise`, with its noise."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from fes_pin.data.trial import Trial
from fes_pin.identify.fit import Fit, fit_of
from fes_pin.identify.likelihood import LikelihoodProblem
from fes_pin.infer.maximise import ROUNDS, alternate, together
from fes_pin.infer.problem import Unknowns
from fes_pin.models.predictor import Doubt


def maximise(
    problem: LikelihoodProblem,
    start: Mapping[str, float],
    unknowns: Unknowns | None = None,
    rounds: int = ROUNDS,
    near: bool = False,
) -> Fit:
    """The likelihood's maximum, what is random there its `doubt`; see `alternate`, or `together` if it is near."""
    if near and not problem.is_final:
        return replace(fit_of(problem, together(problem, start, unknowns)), doubt=problem.doubt)
    return replace(fit_of(problem, alternate(problem, start, unknowns, rounds)), doubt=problem.doubt)


def maximum_from(fitted: Fit, trials: Sequence[Trial], doubt: Doubt | None = None) -> Fit:
    """The likelihood's maximum of a fit's model on trials much like its own, from where it ended.

    Parameters
    ----------
    doubt
        What is taken for random at first; by default what was random in the fit.
    """
    begun = doubt or fitted.doubt
    assert begun is not None
    problem = LikelihoodProblem(fitted.model, trials, begun)
    return maximise(problem, fitted.values, fitted.unknowns, near=fitted.together)
