"""Inverse dynamics as a second estimator of a joint whose effort was recorded.

It searches, and the likelihood fits its set, the sets one cause away, and its own best first causes. Where the two name
different sets, that which predicts better answers: in the low-passed effort, and in motion over the horizon.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fes_pin.data.errors import InputError
from fes_pin.data.trial import Trial
from fes_pin.diagnosis.errors_ahead import squared_errors
from fes_pin.diagnosis.held_out import Again
from fes_pin.diagnosis.likelihood_models import Found, LikelihoodModels, LikelihoodSearch
from fes_pin.diagnosis.verdict import RigState, RigVerdict
from fes_pin.effort.search import NOT_CARRIED, has_efforts, searched
from fes_pin.identify.likelihood_fit import LikelihoodFit, at_values
from fes_pin.infer.estimators import AnyState, Estimator
from fes_pin.infer.scatter import as_wide_as
from fes_pin.infer.search import BEAM, FITTED, Policy
from fes_pin.infer.verdict import State
from fes_pin.models.rigs.joint import Joint


def begun_by_effort(models: LikelihoodModels, trials: Sequence[Trial], thorough: bool = False) -> Policy:
    """Search by inverse dynamics where it applies, and return the options of a search that begins there.

    Of sets of one cause those of largest score are fitted then. So they are where another set is proposed already. A
    thorough search begins with none, and fits all.
    """
    rig, few = models.model.rig, Policy(fitted=BEAM, fitted_first=FITTED)
    if models.proposed is not None:
        return few
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
    return few


class VerdictByEffort(RigVerdict):
    """The verdict on a set that inverse dynamics found: what its efforts do not distinguish is equivalent too."""

    def alike(self, state: RigState, name: str) -> tuple[str, ...]:
        """Return a cause and its equivalents."""
        by_effort, known = self.models.by_effort, super().alike(state, name)
        rest, near = state.names - {name}, [f.names for f in by_effort.alike] if by_effort else []
        more = {n for names in near if rest < {*names} for n in {*names} - rest}
        return name, *sorted({*known, *more} - {name})


class InverseDynamics(Estimator):
    """Least squares of the low-passed effort, for a joint whose effort was recorded."""

    prefers_smaller = is_independent = True

    def words(self, state: AnyState) -> str:
        """Return how it found a set, in words."""
        by_effort = state.search.models.by_effort
        return by_effort.models.estimator if by_effort else ""

    def state(self, first: RigState) -> RigState | None:
        """Return the state of its set, fitted by the likelihood; None where the first state has the same.

        Causes of both sets begin in the forms of the first. Of the sets that efforts do not distinguish it is the
        likeliest, without causes that are not significant in it.
        """
        models, search = first.search.models, first.search
        by_effort = models.by_effort
        if by_effort is None or search.was_stopped or any({*f.names} == first.names for f in by_effort.alike):
            return None
        for one in by_effort.alike:
            if one.names not in models.fits:
                models.fit_model(by_effort.model(one))
        again = models.in_other_forms(first.found.best, [one.names for one in by_effort.alike])
        models.begin_at(first.found.best, again)
        models.converge_these(again)
        possible = [f for one in by_effort.alike if models.is_possible(f := models.fits[one.names])]
        if not possible:
            return None
        assert isinstance(first.verdict, RigVerdict)
        names, verdict = min(possible, key=lambda f: f.criterion).names, VerdictByEffort(search, first.verdict.test)
        found = search.result(search.backward(names))
        state = State(verdict, found, verdict.weigh(found), {}, frozenset(found.without), replaced=first)
        while (fewer := verdict.drop_unrepeated(state)) is not None:
            state = fewer
        return None if state.names == first.names else state


class ValuesByEffort(VerdictByEffort):
    """The verdict on a set with the values of inverse dynamics, of all trials or of those that are not held out.

    Sets are compared at their maxima of the likelihood.
    """

    def __init__(self, search: LikelihoodSearch, test: Sequence[Trial]) -> None:
        super().__init__(search, test)
        by_motion, self._by_names = self.refitted, dict[frozenset[str], Found]()
        self.refitted = Again(lambda fitted, trials: self.at_efforts(*by_motion([(fitted, trials)])))

    @property
    def estimator(self) -> str:
        """See `Verdict.estimator`."""
        by_effort = self.models.by_effort
        return f"{super().estimator}, values by {by_effort.models.estimator}" if by_effort else super().estimator

    def of_search(self, search: LikelihoodSearch) -> RigVerdict:
        """See `RigVerdict.of_search`; with the values of the likelihood."""
        return VerdictByEffort(search, self.test)

    def _likeliest(self, state: RigState) -> RigState:
        """Return a state with the maximum of the likelihood of its set."""
        if state.names not in self._by_names:
            self._by_names[state.names] = self.search.result(tuple(sorted(state.names)))
        return replace(state, found=self._by_names[state.names])

    def alike(self, state: RigState, name: str) -> tuple[str, ...]:
        """Return a cause and its equivalents."""
        return super().alike(self._likeliest(state), name)

    def chosen(self, state: RigState) -> list[LikelihoodFit]:
        """See `RigVerdict.chosen`."""
        return super().chosen(self._likeliest(state))

    def at_efforts(self, fitted: LikelihoodFit) -> LikelihoodFit:
        """Return a fit at the values of inverse dynamics of its trials.

        A set with a cause that inverse dynamics does not know keeps its values.
        """
        by_effort = self.models.by_effort
        if by_effort is None or not by_effort.knows(fitted.names):
            return fitted
        known = by_effort.values_in(fitted, [t.name for t in fitted.trials])
        return at_values(fitted, known)

    def in_place_of(self, found: Found) -> Found:
        """Return a set, its nominal model and those without each cause at the values of inverse dynamics."""
        without = {n: self.at_efforts(f) for n, f in found.without.items()}
        return replace(found, best=self.at_efforts(found.best), nominal=self.at_efforts(found.nominal), without=without)

    def with_intervals(self, fitted: LikelihoodFit) -> LikelihoodFit:
        """See `RigVerdict.with_intervals`; as wide as those of inverse dynamics at least."""
        by_effort, honest = self.models.by_effort, super().with_intervals(fitted)
        if by_effort is None or not by_effort.knows(fitted.names):
            return honest
        return as_wide_as(honest, by_effort.final(by_effort.models.fitted_set(fitted.names)))


OF_SIZES = ("drop_unrepeated", "drop_of_no_model", "drop_impossible", "drop_uncertain")
"""Claims that ask nothing of a likelihood: they object to values of inverse dynamics too."""


class ValuesOfInverseDynamics(InverseDynamics):
    """The same with its own values: where a likelihood tells little, as of few samples, efforts know more.

    It adds causes to those of the likelihood and replaces none, where it predicts better in each currency.
    """

    def state(self, first: RigState) -> RigState | None:
        """Return the state of its set at its own values.

        None where the set does not hold all causes of the first, or where the likelihood of held-out data refutes it.
        """
        search, by_effort = first.search, first.search.models.by_effort
        if by_effort is None or search.was_stopped or not first.names < {*(names := by_effort.names)}:
            return None
        if names not in search.models.fits or not search.models.is_possible(search.models.fits[names]):
            return None
        return _at_own_values(first, search.result(names))


class ValuesOfTheSameSet(InverseDynamics):
    """The set of the likelihood with the values of inverse dynamics.

    Friction that a model describes roughly near rest is process noise to a filter, which then tells other values from
    little of the data. Inverse dynamics weighs the rows near rest less.
    """

    def state(self, first: RigState) -> RigState | None:
        """Return the state; None where a cause of the set has no column, or as `_at_own_values` says."""
        by_effort = first.search.models.by_effort
        if by_effort is None or first.search.was_stopped or not by_effort.knows(first.found.best.names):
            return None
        return _at_own_values(first, first.found)


def _at_own_values(first: RigState, found: Found) -> RigState | None:
    """Return the state of a set at the values of inverse dynamics.

    None where these do not predict the fitted trials better over the horizon than the first state, where the likelihood
    of held-out data refutes a cause, or where a size is uncertain or impossible.
    """
    assert isinstance(first.verdict, RigVerdict)
    models, best = first.search.models, first.found.best
    verdict = ValuesByEffort(first.search, first.verdict.test)
    found = verdict.in_place_of(found)
    then, now = (squared_errors([(f, best, models.trials)], models.judged_s) for f in (found.best, best))
    if not then.error_percent() < now.error_percent():
        return None
    names = found.best.names
    rejected = {n: one for n, one in first.rejected.items() if n not in names}
    own = State(verdict, found, verdict.weigh(found), rejected, frozenset(names), replaced=first, tied=first.tied)
    if any(getattr(verdict, claim)(own) for claim in OF_SIZES):
        return None
    return None if any(e.high < 0.0 for e in own.weighed.evidence.values()) else own


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
    alike = {n: {*verdict.alike(answer, n)} for n in answer.names}
    by_motion, by_efforts = {*first.names}, {n for one in by_effort.alike for n in one.names}
    words = []
    for name in sorted({*first.names, *by_effort.names, *answer.names} & {*by_effort.models.library}):
        near = {name} | {m for n, many in alike.items() if name in many for m in many}
        if not (near & by_motion and near & by_efforts) and (name in alike or near == {name}):
            one, other = ("motion", "effort") if near & by_motion else ("effort", "motion")
            left = "" if name in alike else "; it is not in the answer"
            words.append(f"{name} is named by {one}, not by {other}{left}")
    return words
