"""Inverse dynamics as a second estimator of a joint whose effort was recorded.

It searches, and the likelihood fits its set, the sets one cause away, and its own best first causes. Where the two name
different sets, that which predicts better answers: in the low-passed effort, and in motion over the horizon.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fes_pin.data.errors import InputError
from fes_pin.data.trial import Trial
from fes_pin.diagnosis.held_out import Again
from fes_pin.diagnosis.likelihood_models import Found, LikelihoodModels
from fes_pin.diagnosis.verdict import EFFORT, RigState, RigVerdict
from fes_pin.effort.search import NOT_CARRIED, has_efforts, searched
from fes_pin.identify.likelihood_fit import LikelihoodFit, at_values
from fes_pin.infer.estimators import AnyState, Compared, Estimator, compared
from fes_pin.infer.scatter import as_wide_as
from fes_pin.infer.search import BEAM, FITTED, Policy
from fes_pin.infer.text import percent
from fes_pin.infer.verdict import State
from fes_pin.models.rigs.joint import Joint


def begun_by_effort(models: LikelihoodModels, trials: Sequence[Trial], thorough: bool = False) -> Policy:
    """Search by inverse dynamics where it applies, and return the options of a search that begins there.

    Of sets of one cause those of largest score are fitted then. A thorough search begins with none, and fits all.
    """
    rig = models.model.rig
    if models.model.effects or not isinstance(rig, Joint) or not has_efforts(rig, trials):
        return Policy()
    try:
        found = searched(rig, trials, models.seed)
        models.refusal = "" if found.is_carried else NOT_CARRIED
    except (InputError, ArithmeticError, np.linalg.LinAlgError) as problem:
        models.refusal = str(problem)
    if models.refusal:
        return Policy()
    models.by_effort = found
    if thorough:
        return Policy()
    models.proposed = models.by_effort.model()
    return Policy(fitted=BEAM, fitted_first=FITTED)


class VerdictByEffort(RigVerdict):
    """The verdict on a set that inverse dynamics found: what its efforts do not distinguish is equivalent too."""

    def alike(self, found: Found, name: str) -> tuple[str, ...]:
        """Return a cause and its equivalents."""
        by_effort, known = self.models.by_effort, super().alike(found, name)
        rest, near = {*found.best.names} - {name}, [f.names for f in by_effort.alike] if by_effort else []
        more = {n for names in near if rest < {*names} for n in {*names} - rest}
        return name, *sorted({*known, *more} - {name})


class InverseDynamics(Estimator):
    """Least squares of the low-passed effort, for a joint whose effort was recorded."""

    prefers_smaller = True

    def words(self, state: AnyState) -> str:
        """Return how it found a set, in words."""
        by_effort = state.search.models.by_effort
        return by_effort.models.estimator if by_effort else ""

    def state(self, first: RigState) -> RigState | None:
        """Return the state of its set, fitted by the likelihood; None where the first state has the same.

        Of the sets that efforts do not distinguish it is the likeliest.
        """
        models, search = first.search.models, first.search
        by_effort = models.by_effort
        if by_effort is None or search.was_stopped or any({*f.names} == first.names for f in by_effort.alike):
            return None
        for one in by_effort.alike:
            if one.names not in models.fits:
                models.fit_model(by_effort.model(one))
        possible = [f for one in by_effort.alike if models.is_possible(f := models.fits[one.names])]
        if not possible:
            return None
        assert isinstance(first.verdict, RigVerdict)
        names, verdict = min(possible, key=lambda f: f.criterion).names, VerdictByEffort(search, first.verdict.test)
        found = search.result(names)
        return State(verdict, found, verdict.weigh(found), {}, frozenset(names), replaced=first)


class ValuesByEffort(RigVerdict):
    """The verdict on a set with the values of inverse dynamics, of all trials or of those that are not held out."""

    def __init__(self, first: RigVerdict) -> None:
        super().__init__(first.search, first.test)
        self._begun: dict[int, tuple[LikelihoodFit, LikelihoodFit]] = {}

        def refitted(fitted: LikelihoodFit, trials: Sequence[Trial]) -> LikelihoodFit:
            _, begun = self._begun.get(id(fitted), (fitted, fitted))
            return self.at_efforts(*first.refitted([(begun, trials)]))

        self.refitted = Again(refitted)

    def at_efforts(self, fitted: LikelihoodFit) -> LikelihoodFit:
        """Return a fit at the values of inverse dynamics of its trials.

        A set with a cause that inverse dynamics does not know keeps its values.
        """
        by_effort = self.models.by_effort
        other = fitted
        if by_effort is not None and by_effort.knows(fitted.names):
            other = at_values(fitted, by_effort.values_in(fitted, [t.name for t in fitted.trials]))
        self._begun[id(other)] = other, fitted
        return other

    def with_intervals(self, fitted: LikelihoodFit) -> LikelihoodFit:
        """See `RigVerdict.with_intervals`; as wide as those of inverse dynamics at least."""
        by_effort, honest = self.models.by_effort, super().with_intervals(fitted)
        if by_effort is None or not by_effort.knows(fitted.names):
            return honest
        return as_wide_as(honest, by_effort.final(by_effort.models.fitted_set(fitted.names)))


def with_better_values(state: RigState) -> tuple[RigState, list[str]]:
    """Return a state with a warning, and with other values of its set where these predict the effort better.

    They are those of inverse dynamics. They answer where the effort tells them apart as two estimators are, and where
    they predict motion no worse, or the effort is predicted worse than by the beliefs.
    """
    models, found, first = state.search.models, state.found, state.verdict
    by_effort, best = models.by_effort, state.found.best
    if by_effort is None or state.search.was_stopped or not by_effort.knows(best.names):
        return state, []
    assert isinstance(first, RigVerdict)
    verdict = ValuesByEffort(first)
    after = verdict.at_efforts(best)
    now, then, believed = map(by_effort.errors_at, (best.model, after.model, models.model))
    effort = Compared.of(EFFORT, now, then, models.seed)
    if not (effort.is_better and effort.is_felt):
        return state, []
    without = {n: verdict.at_efforts(f) for n, f in found.without.items()}
    again = replace(found, best=after, nominal=verdict.at_efforts(found.nominal), without=without)
    other = replace(state, verdict=verdict, found=again, weighed=verdict.weigh(again))
    refuted = now.error_percent() > believed.error_percent()
    if not refuted and any(c.is_worse for c in compared(state, other, verdict.ahead, models.seed)):
        return state, []
    errors = (percent(one.error_percent()) for one in (now, believed, then))
    words = "the likelihood's values predict the effort with E {}, the believed ones {}; those of least squares of the "
    return other, [(words + "effort are given: {}").format(*errors)]


def named_by_one(first: RigState, answer: RigState) -> list[str]:
    """Return a line for each cause that only one of two estimators names, where both know it, or why one is silent.

    Parameters
    ----------
    first
        The state of the likelihood, of which inverse dynamics is the other estimator.
    answer
        The state that answers.
    """
    models = first.search.models
    if (by_effort := models.by_effort) is None:
        return [f"efforts name no cause: {models.refusal}"] * bool(models.refusal)
    verdict = answer.verdict
    assert isinstance(verdict, RigVerdict)
    alike = {n: {*verdict.alike(answer.found, n)} for n in answer.names}
    by_motion, by_efforts = {*first.names}, {n for one in by_effort.alike for n in one.names}
    words = []
    for name in sorted({*first.names, *by_effort.names, *answer.names} & {*by_effort.models.library}):
        near = {name} | {m for n, many in alike.items() if name in many for m in many}
        if not (near & by_motion and near & by_efforts) and (name in alike or near == {name}):
            one, other = ("motion", "effort") if near & by_motion else ("effort", "motion")
            left = "" if name in alike else "; it is not in the answer"
            words.append(f"{name} is named by {one}, not by {other}{left}")
    return words
